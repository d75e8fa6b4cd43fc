//! Eight boxes at once.

use glam::Vec3;

use crate::layout::wide8::Node;
use crate::simd::Lanes;

/// Reciprocals are kept finite, so that no product is NaN: a direction component smaller than this bends the ray by
/// less than the slack in the boxes' padding.
const SMALLEST: f32 = 1e-18;

/// A ray for the test of eight boxes: `plane * inverse - origin * inverse`, which is one instruction.
///
/// Its error, against the exact reciprocal: the product with the origin is rounded (`u |o|` in the plane's place, which
/// whoever widens the origins must cover), and two more roundings are relative to the result.
#[derive(Clone, Copy)]
pub(crate) struct Boxes<L> {
    inverse: [L; 3],
    /// Origins times the reciprocals: for the planes where the ray enters, and where it leaves.
    near: [L; 3],
    far: [L; 3],
    negative: [bool; 3],
    pad: L,
}

impl<L: Lanes> Boxes<L> {
    /// For boxes that are to be met as if larger by `delta` in each axis, and by the roundings of the test.
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, direction: Vec3, delta: Vec3, padded: bool) -> Self {
        let d = direction.to_array().map(|d| if d.abs() < SMALLEST { SMALLEST.copysign(d) } else { d });
        let inverse = d.map(|d| 1.0 / d);
        let negative = d.map(f32::is_sign_negative);
        let axis = |k: usize, side: f32| {
            let out = if negative[k] { -delta[k] } else { delta[k] };
            (origin[k] + side * out) * inverse[k]
        };
        Self {
            inverse: inverse.map(L::splat),
            near: [axis(0, 1.0), axis(1, 1.0), axis(2, 1.0)].map(L::splat),
            far: [axis(0, -1.0), axis(1, -1.0), axis(2, -1.0)].map(L::splat),
            negative,
            // 4 roundings of an end (two here, two to spare), twice: on either side.
            pad: L::splat(if padded { 8.0 * f32::EPSILON / 2.0 } else { 0.0 }),
        }
    }

    /// Which children the ray meets within `[t_min, t_max]`, and where it enters them.
    #[inline(always)]
    pub(crate) fn test(&self, node: &Node, t_min: L, t_max: L) -> (u32, L) {
        let near = |k: usize| {
            let planes = &node.planes[k][usize::from(self.negative[k])];
            L::load(planes).mul_sub(self.inverse[k], self.near[k])
        };
        let far = |k: usize| {
            let planes = &node.planes[k][usize::from(!self.negative[k])];
            L::load(planes).mul_sub(self.inverse[k], self.far[k])
        };
        let enter = near(0).max(near(1)).max(near(2).max(t_min));
        let leave = far(0).min(far(1)).min(far(2));
        // Of a missing child the far end is -infinity: there infinity - infinity is NaN, and no hit.
        let leave = leave.add(leave.abs().mul(self.pad)).min(t_max);
        (enter.le(leave), enter)
    }
}
