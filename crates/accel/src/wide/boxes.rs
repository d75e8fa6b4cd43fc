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
    near: [Ends<L>; 3],
    far: [Ends<L>; 3],
    /// Added to the far ends, relative to them, for lines that begin before 0; others have it in `far`.
    line: Option<L>,
}

/// Planes of one axis and one side.
#[derive(Clone, Copy)]
struct Ends<L> {
    /// Lower (0) or upper (1).
    side: usize,
    inverse: L,
    /// The origin times the reciprocal.
    origin: L,
}

impl<L: Lanes> Ends<L> {
    #[inline(always)]
    fn new(side: usize, inverse: f32, origin: f32) -> Self {
        Self { side, inverse: L::splat(inverse), origin: L::splat(origin * inverse) }
    }

    #[inline(always)]
    fn at(&self, planes: &[[f32; 8]; 2]) -> L {
        L::load(&planes[self.side & 1]).mul_sub(self.inverse, self.origin)
    }
}

/// 4 roundings of an end (two here, two to spare), twice: on either side.
const PAD: f32 = 8.0 * f32::EPSILON / 2.0;

impl<L: Lanes> Boxes<L> {
    /// For boxes that are to be met as if larger by `delta` in each axis, and by the roundings of the test.
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, direction: Vec3, delta: Vec3, padded: bool, t_min: f32) -> Self {
        let pad = if padded { PAD } else { 0.0 };
        // A longer reciprocal moves positive ends outward, and costs nothing.
        let line = t_min < 0.0;
        let far = if line { 1.0 } else { 1.0 + pad };
        let (x0, x1) = axis(origin.x, direction.x, delta.x, far);
        let (y0, y1) = axis(origin.y, direction.y, delta.y, far);
        let (z0, z1) = axis(origin.z, direction.z, delta.z, far);
        Self { near: [x0, y0, z0], far: [x1, y1, z1], line: line.then(|| L::splat(pad)) }
    }

    /// Which children the ray meets within `[t_min, t_max]`, and where it enters them.
    #[inline(always)]
    pub(crate) fn test(&self, node: &Node, t_min: L, t_max: L) -> (u32, L) {
        let [x, y, z] = &node.planes;
        let enter = self.near[0].at(x).max(self.near[1].at(y)).max(self.near[2].at(z).max(t_min));
        let mut leave = self.far[0].at(x).min(self.far[1].at(y)).min(self.far[2].at(z));
        if let Some(pad) = self.line {
            // Of a missing child the far end is -infinity, and padded NaN: as the second operand below it stays, and is
            // no hit.
            leave = leave.add(leave.abs().mul(pad));
        }
        (enter.le(t_max.min(leave)), enter)
    }
}

/// The nearer and the farther planes of one axis.
#[inline(always)]
fn axis<L: Lanes>(origin: f32, direction: f32, delta: f32, far: f32) -> (Ends<L>, Ends<L>) {
    let direction = if direction.abs() < SMALLEST { SMALLEST.copysign(direction) } else { direction };
    let inverse = 1.0 / direction;
    let out = delta.copysign(direction);
    // Going down, the ray enters through the upper planes.
    let side = (direction.to_bits() >> 31) as usize;
    (Ends::new(side, inverse, origin + out), Ends::new(1 - side, inverse * far, origin - out))
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
        t_min: f32,
    }

    impl Work for Test<'_> {
        type Output = u32;
        #[inline(always)]
        fn run<L: Lanes>(self) -> u32 {
            let delta = if self.padded { self.origin.abs() * 3e-7 + 1e-12 } else { Vec3::ZERO };
            let boxes = Boxes::<L>::new(self.origin, self.direction, delta, self.padded, self.t_min);
            boxes.test(self.node, L::splat(self.t_min), L::splat(f32::INFINITY)).0
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
                for (padded, t_min) in [(true, 0.0), (true, f32::NEG_INFINITY), (false, 0.0), (false, -1.0)] {
                    let test = Test { node: &node, origin, direction, padded, t_min };
                    let hits = run(Available::up_to(level), test);
                    prop_assert_eq!(hits & !all, 0, "{} missing children are met", level);
                    prop_assert!(!padded || hits == all, "{} {:b}", level, hits);
                }
            }
        }
    }
}
