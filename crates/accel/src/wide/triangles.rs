//! Eight triangles at once: which of them the tier's own test must look at.
//!
//! A filter may let too many pass, never too few: the decision is the scalar kernel's, and so are its bits.
//!
//! No closures and no `map` here: what is not inlined into the function compiled for the level is slow.

use core::hint::black_box;
use core::marker::PhantomData;

use glam::Vec3;

use crate::Guards;
use crate::guards::GuardSet;
use crate::simd::Lanes;
use crate::wide::Leaf;

/// Eight vectors.
type Vectors<L> = [L; 3];

/// What a filter knows of its ray stays in memory, and is read from there: the registers are for the test of boxes. Left to
/// itself the compiler keeps all of it in registers, and moves it to memory and back at every leaf.
#[inline(always)]
fn in_memory<const MANY: bool, const N: usize>(ray: &[f32; N]) -> &[f32; N] {
    // For one leaf there is nothing to be gained, and a way through memory to be lost.
    if MANY { black_box(ray) } else { ray }
}

#[inline(always)]
fn vertex<L: Lanes>(leaf: &impl Leaf, vertex: usize) -> Vectors<L> {
    [leaf.load(vertex, 0), leaf.load(vertex, 1), leaf.load(vertex, 2)]
}

/// What a filter knows of the triangles: edge functions, or `t`, `u` and `v`.
pub(crate) type Known<L> = [L; 3];

/// A filter of leaves for one ray.
pub(crate) trait Filter<L: Lanes>: Copy {
    /// The ray's interval, prepared.
    type Interval: Copy;
    /// The boxes' interval, which has room for rounding.
    fn interval(&self, t_min: f32, t_max: f32) -> Self::Interval;
    /// One bit for each lane of the leaf that may be hit in the interval.
    fn candidates(&self, leaf: &impl Leaf, interval: &Self::Interval) -> (u32, Known<L>);
}

/// The operations of the watertight test in `f32`, as [`Shear::weights`] does them: the same decision, but for edge
/// functions that are 0, which pass. It serves `MANY` leaves, or one.
#[derive(Clone, Copy)]
pub(crate) struct Sheared<L, const MANY: bool = true> {
    /// In the order of `axes`, and the slopes.
    ray: [f32; 5],
    /// The axes of the sheared plane and the one that the ray follows most.
    axes: [usize; 3],
    /// How far a sheared coordinate may be off the true ray's, where the decision is to be made for that.
    off: f32,
    /// The direction's component along the last axis, and how far a vertex may be off along it.
    depth: L,
    slack: L,
}

/// Edge functions, the larger coordinate of all corners, and the range of depths.
struct Projected<L> {
    edges: [L; 3],
    size: L,
    nearest: L,
    farthest: L,
}

impl<L: Lanes, const MANY: bool> Sheared<L, MANY> {
    /// For a ray (in the first three lanes).
    #[inline(always)]
    pub(crate) fn new(origin: L, direction: L, off: f32, slack: f32) -> Self {
        // Of all axes the last that is as long as any, as `Shear::new` chooses. No branches: directions of many rays are
        // not to be predicted.
        let length = direction.abs();
        let most =
            length.max(length.reordered(&[1, 2, 0, 3, 3, 3, 3, 3]).max(length.reordered(&[2, 0, 1, 3, 3, 3, 3, 3])));
        let longest = most.le(length) & 7;
        // Looked up in memory: the three that follow each other, by the mask of the longest.
        static ORDERS: [[u32; 8]; 8] = {
            let (x, y, z) = ([1, 2, 0, 0, 0, 0, 0, 0], [2, 0, 1, 0, 0, 0, 0, 0], [0, 1, 2, 0, 0, 0, 0, 0]);
            [x, x, y, y, z, z, z, z]
        };
        let order = &ORDERS[longest as usize];
        let (origin, direction) = (origin.reordered(order), direction.reordered(order));
        let depth = direction.reordered(&[2; 8]);
        let (o, slopes) = (origin.store(), direction.div(depth).store());
        Self {
            ray: [o[0], o[1], o[2], slopes[0], slopes[1]],
            axes: [order[0] as usize & 3, order[1] as usize & 3, order[2] as usize & 3],
            off,
            depth,
            slack: L::splat(slack),
        }
    }

    /// The same for origin and slopes that are known already, in the order of the axes.
    #[inline(always)]
    pub(crate) fn known(origin: [f32; 3], axes: [usize; 3], slopes: [f32; 2], depth: f32, slack: f32) -> Self {
        let [x, y, z] = origin;
        let (depth, slack) = (L::splat(depth), L::splat(slack));
        Self { ray: [x, y, z, slopes[0], slopes[1]], axes, off: 0.0, depth, slack }
    }

    #[inline(always)]
    fn corner(&self, r: &[f32; 5], leaf: &impl Leaf, vertex: usize) -> [L; 3] {
        let x = leaf.load::<L>(vertex, self.axes[0]).sub(L::splat(r[0]));
        let y = leaf.load::<L>(vertex, self.axes[1]).sub(L::splat(r[1]));
        let z = leaf.load::<L>(vertex, self.axes[2]).sub(L::splat(r[2]));
        [x.sub(L::splat(r[3]).mul(z)), y.sub(L::splat(r[4]).mul(z)), z]
    }

    #[inline(always)]
    fn project(&self, leaf: &impl Leaf) -> Projected<L> {
        let r = in_memory::<MANY, _>(&self.ray);
        let [a, b, c] = [self.corner(r, leaf, 0), self.corner(r, leaf, 1), self.corner(r, leaf, 2)];
        Projected {
            edges: [edge(c, b), edge(a, c), edge(b, a)],
            size: size(a).max(size(b)).max(size(c)),
            nearest: a[2].min(b[2]).min(c[2]),
            farthest: a[2].max(b[2]).max(c[2]),
        }
    }

    /// Depths in the interval.
    #[inline(always)]
    fn depths(&self, t_min: f32, t_max: f32) -> [L; 2] {
        let (first, last) = (L::splat(t_min).mul(self.depth), L::splat(t_max).mul(self.depth));
        [first.min(last).sub(self.slack), first.max(last).add(self.slack)]
    }
}

impl<L: Lanes> Projected<L> {
    /// Lanes whose triangles reach into the interval: their depths tell, whatever the weights.
    #[inline(always)]
    fn within(&self, [low, high]: &[L; 2]) -> u32 {
        self.nearest.le(*high) & low.le(self.farthest)
    }
}

#[inline(always)]
fn edge<L: Lanes>(p: [L; 3], q: [L; 3]) -> L {
    p[0].mul(q[1]).sub(p[1].mul(q[0]))
}

/// The larger sheared coordinate.
#[inline(always)]
fn size<L: Lanes>(p: [L; 3]) -> L {
    p[0].abs().max(p[1].abs())
}

impl<L: Lanes, const MANY: bool> Filter<L> for Sheared<L, MANY> {
    type Interval = [L; 2];

    #[inline(always)]
    fn interval(&self, t_min: f32, t_max: f32) -> [L; 2] {
        self.depths(t_min, t_max)
    }

    #[inline(always)]
    fn candidates(&self, leaf: &impl Leaf, depths: &[L; 2]) -> (u32, Known<L>) {
        let p = self.project(leaf);
        let [e0, e1, e2] = p.edges;
        let zero = L::splat(0.0);
        let hit = zero.le(e0.min(e1).min(e2)) | e0.max(e1).max(e2).le(zero);
        (hit & p.within(depths) & leaf.lanes(), p.edges)
    }
}

/// The same with a margin: everything passes that the unrounded ray may meet.
#[derive(Clone, Copy)]
pub(crate) struct Margin<L>(pub(crate) Sheared<L>);

impl<L: Lanes> Filter<L> for Margin<L> {
    type Interval = [L; 2];

    #[inline(always)]
    fn interval(&self, t_min: f32, t_max: f32) -> [L; 2] {
        self.0.depths(t_min, t_max)
    }

    #[inline(always)]
    fn candidates(&self, leaf: &impl Leaf, depths: &[L; 2]) -> (u32, Known<L>) {
        let p = self.0.project(leaf);
        let ([e0, e1, e2], m) = (p.edges, p.size);
        // Coordinates up to m (plus x), each off by x: a product is off by 2mx + x^2, and rounded; two of them.
        let x = L::splat(self.0.off);
        let bound = m.mul(x).mul(L::splat(4.5)).add(x.mul(x).mul(L::splat(3.0))).add(m.mul(m).mul(L::splat(4e-7)));
        let least = L::splat(0.0).sub(bound);
        let hit = least.le(e0.min(e1).min(e2)) | e0.max(e1).max(e2).le(bound);
        (hit & p.within(depths) & leaf.lanes(), p.edges)
    }
}

/// The operations of Moeller and Trumbore's test, as `triangle::moeller_trumbore` does them: the same decision.
#[derive(Clone, Copy)]
pub(crate) struct Plain<L, const MANY: bool = true> {
    /// Origin and direction.
    ray: [f32; 6],
    lanes: PhantomData<L>,
}

impl<L: Lanes, const MANY: bool> Plain<L, MANY> {
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, direction: Vec3) -> Self {
        let (o, d) = (origin, direction);
        Self { ray: [o.x, o.y, o.z, d.x, d.y, d.z], lanes: PhantomData }
    }

    /// For a ray in the first three lanes.
    #[inline(always)]
    pub(crate) fn in_lanes(origin: L, direction: L) -> Self {
        let (o, d) = (origin.store(), direction.store());
        Self { ray: [o[0], o[1], o[2], d[0], d[1], d[2]], lanes: PhantomData }
    }
}

impl<L: Lanes, const MANY: bool> Filter<L> for Plain<L, MANY> {
    type Interval = [L; 2];

    #[inline(always)]
    fn interval(&self, t_min: f32, t_max: f32) -> [L; 2] {
        [L::splat(t_min), L::splat(t_max)]
    }

    #[inline(always)]
    fn candidates(&self, leaf: &impl Leaf, [t_min, t_max]: &[L; 2]) -> (u32, Known<L>) {
        let r = in_memory::<MANY, _>(&self.ray);
        let origin: Vectors<L> = [L::splat(r[0]), L::splat(r[1]), L::splat(r[2])];
        let direction: Vectors<L> = [L::splat(r[3]), L::splat(r[4]), L::splat(r[5])];
        let [v0, v1, v2] = [vertex::<L>(leaf, 0), vertex(leaf, 1), vertex(leaf, 2)];
        let (e1, e2) = (minus(v1, v0), minus(v2, v0));
        let p = cross(direction, e2);
        let det = dot(e1, p);
        let s = minus(origin, v0);
        let q = cross(s, e1);
        let (u, v) = (dot(s, p), dot(direction, q));
        let (a, b, zero) = (u.turned_by(det), v.turned_by(det), L::splat(0.0));
        let inside = zero.le(a) & zero.le(b) & a.add(b).le(det.abs()) & leaf.lanes();
        if inside == 0 {
            return (0, [zero; 3]);
        }
        let inverse = L::splat(1.0).div(det);
        let t = dot(e2, q).mul(inverse);
        (inside & t_min.le(t) & t.le(*t_max), [t, u.mul(inverse), v.mul(inverse)])
    }
}

#[inline(always)]
fn minus<L: Lanes>(a: Vectors<L>, b: Vectors<L>) -> Vectors<L> {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}
#[inline(always)]
fn cross<L: Lanes>(a: Vectors<L>, b: Vectors<L>) -> Vectors<L> {
    [a[1].mul(b[2]).sub(b[1].mul(a[2])), a[2].mul(b[0]).sub(b[2].mul(a[0])), a[0].mul(b[1]).sub(b[0].mul(a[1]))]
}
#[inline(always)]
fn dot<L: Lanes>(a: Vectors<L>, b: Vectors<L>) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// One or the other, by [`Guards::WATERTIGHT`]; what is known when compiling costs nothing.
#[derive(Clone, Copy)]
pub(crate) struct Either<L, G> {
    pub(crate) guards: G,
    pub(crate) plain: Plain<L>,
    pub(crate) sheared: Sheared<L>,
}

impl<L: Lanes, G: GuardSet> Filter<L> for Either<L, G> {
    type Interval = [L; 2];

    #[inline(always)]
    fn interval(&self, t_min: f32, t_max: f32) -> [L; 2] {
        if self.guards.has(Guards::WATERTIGHT) {
            self.sheared.interval(t_min, t_max)
        } else if self.guards.has(Guards::PLANE_T) || self.guards.has(Guards::PADDING) {
            // The hit gets another `t` than the filter knows.
            self.plain.interval(f32::NEG_INFINITY, f32::INFINITY)
        } else {
            self.plain.interval(t_min, t_max)
        }
    }

    #[inline(always)]
    fn candidates(&self, leaf: &impl Leaf, interval: &[L; 2]) -> (u32, Known<L>) {
        if self.guards.has(Guards::WATERTIGHT) {
            self.sheared.candidates(leaf, interval)
        } else {
            self.plain.candidates(leaf, interval)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::compact8::{Compact8, fits};
    use crate::layout::wide8::{Block, Reference, Wide8};
    use crate::simd::{Available, Level, Work, run};
    use crate::wide::{WideTree, in_lanes};
    use firsthit_geometry::triangle::{self, Shear};
    use proptest::prelude::*;

    struct Candidates<'a, T> {
        leaf: &'a T,
        origin: Vec3,
        direction: Vec3,
        off: f32,
        interval: [f32; 2],
    }

    impl<T: Leaf> Work for Candidates<'_, T> {
        type Output = [u32; 3];
        #[inline(always)]
        fn run<L: Lanes>(self) -> [u32; 3] {
            let (origin, direction) = (in_lanes(self.origin), in_lanes(self.direction));
            let sheared = Sheared::<L>::new(origin, direction, self.off, 1e-5);
            let ([low, high], plain) = (self.interval, Plain::<L>::new(self.origin, self.direction));
            [
                plain.candidates(self.leaf, &plain.interval(low, high)).0,
                sheared.candidates(self.leaf, &sheared.interval(low, high)).0,
                Margin(sheared).candidates(self.leaf, &Margin(sheared).interval(low, high)).0,
            ]
        }
    }

    fn vector(x: &[f32]) -> Vec3 {
        Vec3::new(x[0], x[1], x[2])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// What the scalar tests accept passes the filters, at every level alike; unused lanes do not.
        #[test]
        fn filters_pass_what_the_tests_accept(
            x in prop::collection::vec(prop_oneof![-1.0f32..1.0, (-2i8..=2).prop_map(f32::from)], 78), used in 0usize..=8,
            (low, high) in prop_oneof![Just((f32::NEG_INFINITY, f32::INFINITY)), Just((0.0, 1.0)), (-3.0f32..0.5, 0.5f32..3.0)],
        ) {
            let (origin, direction) = (vector(&x[72..]), vector(&x[75..]));
            prop_assume!(direction != Vec3::ZERO);
            let corners: Vec<[Vec3; 3]> =
                x[..9 * used].chunks(9).map(|t| [0, 3, 6].map(|k| vector(&t[k..]))).collect();
            let mut wide = Wide8::default();
            wide.blocks.resize(3, Block::EMPTY);
            for (lane, t) in corners.iter().enumerate() {
                wide.blocks[lane / 4].set_triangle(lane % 4, *t);
            }
            let interval = [low, high];
            fn of<T: Leaf>(leaf: &T, (origin, direction): (Vec3, Vec3), interval: [f32; 2], level: Level) -> [u32; 3] {
                run(Available::up_to(level), Candidates { leaf, origin, direction, off: 1e-5, interval })
            }
            let masks = of(&wide.leaf(Reference::leaf(0, 8)), (origin, direction), interval, Level::Scalar);
            for level in Level::ALL {
                let leaf = wide.leaf(Reference::leaf(0, 8));
                prop_assert_eq!(of(&leaf, (origin, direction), interval, level), masks, "{}", level);
                // A compact leaf of those that have few enough vertices.
                let some = (1..=used).rev().find(|&n| fits(corners[..n].iter().copied())).unwrap_or(0);
                if some > 0 {
                    wide.root = Reference::leaf(0, some);
                    let compact = Compact8::new(&wide, &[0, 1, 2, 3, 4, 5, 6, 7]);
                    let found = of(&compact.leaf(compact.root()), (origin, direction), interval, level);
                    prop_assert_eq!(found, masks.map(|m| m & ((1 << some) - 1)), "compact {}", level);
                    for (k, place) in compact.places().enumerate() {
                        prop_assert_eq!(compact.number(place), Some(k as u32));
                        prop_assert_eq!(WideTree::triangle(&compact, place), corners[k]);
                    }
                }
            }
            let shear = Shear::<f32>::new(direction);
            let exact = Shear::<f64>::new(direction.as_dvec3());
            for lane in 0..8 {
                let passes = masks.map(|m| m >> lane & 1 == 1);
                let Some(&t) = corners.get(lane) else {
                    prop_assert_eq!(passes, [false; 3]);
                    continue;
                };
                let inside = |t: f64| f64::from(low) <= t && t <= f64::from(high);
                let plane = triangle::plane_parameter(t.map(|p| p.as_dvec3()), origin.as_dvec3(), direction.as_dvec3());
                // The plane of a sliver tells little: there only triangles with some area are compared.
                let fat = (t[1] - t[0]).cross(t[2] - t[0]).length() > 1e-2;
                let meets = fat && plane.is_some_and(inside);
                let plain = triangle::moeller_trumbore::<f32>(t, origin, direction).is_some_and(|h| inside(h.t.into()));
                let sheared = meets && shear.weights(t.map(|p| p - origin)).is_some();
                let double = meets && exact.weights(t.map(|p| p.as_dvec3() - origin.as_dvec3())).is_some();
                prop_assert!(plain <= passes[0] && sheared <= passes[1] && sheared <= passes[2] && double <= passes[2]);
            }
        }
    }
}
