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

/// One axis of a ray.
struct Axis {
    inverse: f32,
    near: f32,
    far: f32,
}

impl Axis {
    #[inline(always)]
    fn new(origin: f32, direction: f32, delta: f32) -> Self {
        let direction = if direction.abs() < SMALLEST { SMALLEST.copysign(direction) } else { direction };
        let inverse = 1.0 / direction;
        let out = delta.copysign(direction);
        Self { inverse, near: (origin + out) * inverse, far: (origin - out) * inverse }
    }
}

impl<L: Lanes> Boxes<L> {
    /// For boxes that are to be met as if larger by `delta` in each axis, and by the roundings of the test.
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, direction: Vec3, delta: Vec3, padded: bool) -> Self {
        let [x, y, z] = [
            Axis::new(origin.x, direction.x, delta.x),
            Axis::new(origin.y, direction.y, delta.y),
            Axis::new(origin.z, direction.z, delta.z),
        ];
        Self {
            inverse: [L::splat(x.inverse), L::splat(y.inverse), L::splat(z.inverse)],
            near: [L::splat(x.near), L::splat(y.near), L::splat(z.near)],
            far: [L::splat(x.far), L::splat(y.far), L::splat(z.far)],
            negative: [x.inverse < 0.0, y.inverse < 0.0, z.inverse < 0.0],
            // 4 roundings of an end (two here, two to spare), twice: on either side.
            pad: L::splat(if padded { 8.0 * f32::EPSILON / 2.0 } else { 0.0 }),
        }
    }

    /// Where the ray passes the nearer planes of one axis, and the farther ones.
    #[inline(always)]
    fn ends(&self, node: &Node, k: usize) -> (L, L) {
        let [lower, upper] = &node.planes[k];
        let (near, far) = if self.negative[k] { (upper, lower) } else { (lower, upper) };
        (L::load(near).mul_sub(self.inverse[k], self.near[k]), L::load(far).mul_sub(self.inverse[k], self.far[k]))
    }

    /// Which children the ray meets within `[t_min, t_max]`, and where it enters them.
    #[inline(always)]
    pub(crate) fn test(&self, node: &Node, t_min: L, t_max: L) -> (u32, L) {
        let (near0, far0) = self.ends(node, 0);
        let (near1, far1) = self.ends(node, 1);
        let (near2, far2) = self.ends(node, 2);
        let enter = near0.max(near1).max(near2.max(t_min));
        let leave = far0.min(far1).min(far2);
        // Of a missing child the far end is -infinity, and padded NaN: as the second operand it stays, and is no hit.
        let leave = t_max.min(leave.add(leave.abs().mul(self.pad)));
        (enter.le(leave), enter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Available, Level, Work, run};
    use firsthit_geometry::Aabb;
    use proptest::prelude::*;

    struct Test<'a> {
        node: &'a Node,
        origin: Vec3,
        direction: Vec3,
        padded: bool,
    }

    impl Work for Test<'_> {
        type Output = u32;
        #[inline(always)]
        fn run<L: Lanes>(self) -> u32 {
            let delta = if self.padded { self.origin.abs() * 3e-7 + 1e-12 } else { Vec3::ZERO };
            let boxes = Boxes::<L>::new(self.origin, self.direction, delta, self.padded);
            boxes.test(self.node, L::splat(0.0), L::splat(f32::INFINITY)).0
        }
    }

    fn node(boxes: &[Aabb<f32>]) -> Node {
        let mut node = Node { planes: [[[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]]; 3], children: [u32::MAX; 8] };
        for (k, b) in boxes.iter().enumerate() {
            for axis in 0..3 {
                node.planes[axis][0][k] = b.min[axis];
                node.planes[axis][1][k] = b.max[axis];
            }
        }
        node
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// A box that the ray meets exactly is never missed when padded; a child that is missing is never met; a ray
        /// may run along the axes and in the planes of the boxes.
        #[test]
        fn boxes_that_are_met_are_found(
            corner in prop::array::uniform3(-4i32..=4), size in prop::array::uniform3(0i32..=3),
            target in prop::array::uniform3(0i32..=4), o in prop::array::uniform3(-40i32..=40), scale in -8i32..8, used in 0usize..=8,
        ) {
            let v = |a: [i32; 3]| Vec3::new(a[0] as f32, a[1] as f32, a[2] as f32);
            let b = Aabb::new(v(corner), v(corner) + v(size));
            // On quarters of integers the target is exact.
            let p = b.min + v(size) * v(target) / 4.0;
            let origin = v(o);
            prop_assume!(p != origin);
            // Another length rounds the direction; powers of two don't.
            let direction = (p - origin) * 2f32.powi(scale);
            let node = node(&vec![b; used]);
            let all = (1u32 << used) - 1;
            for level in Level::ALL {
                for padded in [true, false] {
                    let hits = run(Available::up_to(level), Test { node: &node, origin, direction, padded });
                    prop_assert_eq!(hits & !all, 0, "{} missing children are met", level);
                    prop_assert!(!padded || hits == all, "{} {:b}", level, hits);
                }
            }
        }
    }
}
