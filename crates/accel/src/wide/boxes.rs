//! Eight boxes at once.

use glam::Vec3;

use crate::layout::wide8::Node;
use crate::simd::{Lanes, Row};
use crate::wide::BoxNode;

/// Reciprocals are kept finite, so that no product is NaN: a direction component smaller than this bends the ray by
/// less than the slack in the boxes' padding.
pub(crate) const SMALLEST: f32 = 1e-18;

/// Origins are kept so near, and boxes no larger than by so much, that their products with reciprocals are finite. What is
/// farther (in units of a normalised object) has no digit left that says where it is.
pub(crate) const FARTHEST: f32 = 1e20;

/// A number for the test of boxes: within [`FARTHEST`], also where it was infinite or none.
#[inline(always)]
pub(crate) fn kept_near<L: Lanes>(x: L) -> L {
    x.max(L::splat(-FARTHEST)).min(L::splat(FARTHEST))
}

/// A ray for the test of eight boxes: `plane * inverse - origin * inverse`, which is one instruction.
///
/// Its error, against the exact reciprocal: the product with the origin is rounded (`u |o|` in the plane's place), and
/// two more roundings are relative to the result (`2u |plane - o|`). Whoever widens the boxes must cover them.
#[derive(Clone, Copy)]
pub(crate) struct Boxes<L> {
    axes: [Axis<L>; 3],
}

/// The ray along one axis.
#[derive(Clone, Copy)]
pub(crate) struct Axis<L> {
    /// The planes where the ray enters, and where it leaves.
    pub(crate) entry: Row,
    pub(crate) exit: Row,
    pub(crate) inverse: L,
    /// The origin times the reciprocal, for either.
    pub(crate) near: L,
    pub(crate) far: L,
}

/// For each octant of directions (a bit is set where the ray goes down, and so enters through the upper planes), the rows
/// where the ray enters and where it leaves, by axis.
static ROWS: [[[Row; 2]; 3]; 8] = {
    let mut rows = [[[Row::new(0); 2]; 3]; 8];
    let mut octant = 0;
    while octant < 8 {
        let mut k = 0;
        while k < 3 {
            let side = octant >> k & 1;
            rows[octant][k] = [Row::new(Node::row(k, side)), Row::new(Node::row(k, 1 - side))];
            k += 1;
        }
        octant += 1;
    }
    rows
};

impl<L: Lanes> Axis<L> {
    #[inline(always)]
    fn new([entry, exit]: [Row; 2], inverse: L, near: L, far: L) -> Self {
        Self { entry, exit, inverse, near, far }
    }
}

/// In the first three lanes.
#[inline(always)]
pub(crate) fn in_lanes<L: Lanes>(v: Vec3) -> L {
    L::load(&[v.x, v.y, v.z, 0.0, 0.0, 0.0, 0.0, 0.0])
}

impl<L: Lanes> Boxes<L> {
    /// For a ray (in the first three lanes), and boxes that are to be met as if larger by `delta` in each axis.
    #[inline(always)]
    pub(crate) fn new(origin: L, direction: L, delta: f32) -> Self {
        let inverse = L::splat(1.0).div(direction.abs().max(L::splat(SMALLEST)).turned_by(direction));
        Self::inverted(kept_near(origin), direction, inverse, kept_near(L::splat(delta)))
    }

    /// The same for numbers that are within [`FARTHEST`], with the reciprocals of the direction, which are finite.
    #[inline(always)]
    pub(crate) fn inverted(origin: L, direction: L, inverse: L, delta: L) -> Self {
        // All axes at once; the other lanes are of no use.
        let out = delta.turned_by(direction);
        let (near, far) = (origin.add(out).mul(inverse), origin.sub(out).mul(inverse));
        let [x, y, z] = ROWS[direction.negative() as usize & 7];
        Self {
            axes: [
                Axis::new(x, inverse.reordered(&[0; 8]), near.reordered(&[0; 8]), far.reordered(&[0; 8])),
                Axis::new(y, inverse.reordered(&[1; 8]), near.reordered(&[1; 8]), far.reordered(&[1; 8])),
                Axis::new(z, inverse.reordered(&[2; 8]), near.reordered(&[2; 8]), far.reordered(&[2; 8])),
            ],
        }
    }

    /// The same for a ray's origin and direction.
    #[inline(always)]
    pub(crate) fn of(origin: Vec3, direction: Vec3, delta: f32) -> Self {
        Self::new(in_lanes(origin), in_lanes(direction), delta)
    }

    /// Of each axis the reciprocal, the origin times that for near and far planes, and whether (1) the ray goes down.
    #[inline(always)]
    pub(crate) fn known(axes: [(f32, [f32; 2], u32); 3]) -> Self {
        let [(ix, [nx, fx], sx), (iy, [ny, fy], sy), (iz, [nz, fz], sz)] = axes;
        let [x, y, z] = ROWS[(sx & 1 | (sy & 1) << 1 | (sz & 1) << 2) as usize];
        Self {
            axes: [
                Axis::new(x, L::splat(ix), L::splat(nx), L::splat(fx)),
                Axis::new(y, L::splat(iy), L::splat(ny), L::splat(fy)),
                Axis::new(z, L::splat(iz), L::splat(nz), L::splat(fz)),
            ],
        }
    }

    /// Which children the ray meets within `[t_min, t_max]`, and where it enters them.
    #[inline(always)]
    pub(crate) fn test(&self, node: &impl BoxNode, t_min: L, t_max: L) -> (u32, L) {
        let [x, y, z] = [node.slabs(0, &self.axes[0]), node.slabs(1, &self.axes[1]), node.slabs(2, &self.axes[2])];
        let enter = x.0.max(y.0).max(z.0.max(t_min));
        let leave = x.1.min(y.1).min(z.1.min(t_max));
        (node.there(enter.le(leave)), enter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::compact8;
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
            // 4u|o|, and 4u of the farthest that a plane may be.
            let delta = if self.padded { (self.origin.abs().max_element() + 50.0) * 2.4e-7 } else { 0.0 };
            let boxes = Boxes::<L>::of(self.origin, self.direction, delta);
            let (t_min, t_max) = (L::splat(self.t_min), L::splat(f32::INFINITY));
            let compact = boxes.test(&compact8::Node::new(self.node), t_min, t_max).0;
            let wide = boxes.test(self.node, t_min, t_max).0;
            // Those of the grid are never smaller (where nothing is rounded: powers of two are multiples of steps).
            assert!(!self.padded || wide & !compact == 0);
            wide | compact << 8
        }
    }

    fn node(boxes: &[Aabb<f32>]) -> Node {
        let mut node = Node::EMPTY;
        for (k, b) in boxes.iter().enumerate() {
            node.set_box(k, b);
            node.children[k] = k as u32;
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
                    let all = all | all << 8;
                    prop_assert_eq!(hits & !all, 0, "{} missing children are met", level);
                    prop_assert!(!padded || hits == all, "{} {:b}", level, hits);
                }
            }
        }
    }
}
