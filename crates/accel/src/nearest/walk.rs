//! Trees from the nearest box on.

use core::ops::Range;

use firsthit_geometry::distance::closest_on_box;
use firsthit_geometry::{Aabb, Real};
use glam::{DVec3, Vec3};

use super::bounds::Point;
use super::{Keep, Seen};
use crate::kernel::double;
use crate::layout::Bvh2;
use crate::layout::wide8::Reference;
use crate::simd::{Lanes, Stack, Work};
use crate::wide::{BoxNode, Leaf, WideTree};

/// What lies in the leaves. A trait and not a closure, which could not be told to be inlined.
pub(crate) trait Boxed<L: Lanes> {
    type Node: BoxNode;
    fn root(&self) -> Reference;
    fn node(&self, at: Reference) -> &Self::Node;
    /// Looks at what is in a leaf that is nearer than the limit; answers with the new limit. Must be
    /// `#[inline(always)]`.
    fn leaf(&mut self, at: Reference, point: Point<L>, limit: f32) -> f32;
}

/// Visits the leaves whose boxes are not farther than the limit (squared), the nearest first.
#[inline(always)]
pub(crate) fn walk<L: Lanes>(of: &mut impl Boxed<L>, point: Vec3, mut limit: f32) {
    let point = Point::<L>::new(point);
    let mut stack = Stack::<u64>::new();
    let mut current = of.root();
    if current == Reference::NOTHING {
        return;
    }
    loop {
        if current.is_leaf() {
            limit = of.leaf(current, point, limit);
        } else {
            let node = of.node(current);
            let (low, high) = node.corners::<L>();
            let near = point.to_boxes(low, high);
            // Children that are missing are infinitely far.
            let hits = node.there(near.le(L::splat(limit)));
            if hits != 0 {
                let keys = near.pack(node.children(), hits);
                current = Reference(stack.top().push_sorted(keys, hits.count_ones() as usize) as u32);
                continue;
            }
        }
        loop {
            let Some(key) = stack.top().pop() else { return };
            if f32::from_bits((key >> 32) as u32) <= limit {
                current = Reference(key as u32);
                break;
            }
        }
    }
}

/// The triangles of a mesh.
pub(super) struct Triangles<'a, 'k, T> {
    pub(super) seen: &'a Seen<'a>,
    pub(super) tree: &'a T,
    pub(super) keep: &'a mut (dyn Keep + 'k),
}

impl<L: Lanes, T: WideTree> Boxed<L> for Triangles<'_, '_, T> {
    type Node = T::Node;

    #[inline(always)]
    fn root(&self) -> Reference {
        self.tree.root()
    }

    #[inline(always)]
    fn node(&self, at: Reference) -> &T::Node {
        self.tree.node(at)
    }

    #[inline(always)]
    fn leaf(&mut self, at: Reference, point: Point<L>, mut limit: f32) -> f32 {
        let leaf = self.tree.leaf(at);
        let bounds = point.to_triangles(&leaf);
        // What is not a number is not beyond.
        let mut rest = leaf.lanes() & !L::splat(limit.next_up()).le(bounds);
        if rest == 0 {
            return limit;
        }
        let bounds = bounds.store();
        while rest != 0 {
            // The nearest first: few are left then.
            let mut lane = rest.trailing_zeros() as usize & 7;
            let mut others = rest & (rest - 1);
            while others != 0 {
                let other = others.trailing_zeros() as usize & 7;
                if !(bounds[lane] <= bounds[other]) {
                    lane = other;
                }
                others &= others - 1;
            }
            rest &= !(1 << lane);
            if bounds[lane] > limit {
                continue;
            }
            let place = leaf.place(lane);
            if let Some(number) = self.seen.model.number(place).filter(|&n| n != u32::MAX) {
                self.seen.triangle(number, &double(&self.tree.triangle(place)), self.keep);
                limit = self.seen.limit(self.keep.limit());
            }
        }
        limit
    }
}

/// [`walk`] over a mesh's triangles.
pub(super) struct Search<'a, 'k, T>(pub(super) Triangles<'a, 'k, T>);

impl<T: WideTree> Work for Search<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let limit = self.0.seen.limit(self.0.keep.limit());
        let point = self.0.seen.point;
        walk::<L>(&mut self.0, point, limit);
    }
}

/// The same for a binary tree, by `f64` and one box after the other. `leaf` answers with the new limit.
pub(crate) fn walk_binary<R: Real>(
    tree: &Bvh2<R>,
    distance: impl Fn(&Aabb<f64>) -> f64,
    mut limit: f64,
    mut leaf: impl FnMut(Range<usize>) -> f64,
) {
    let Some(root) = tree.first() else { return };
    let mut stack = vec![(root, 0.0)];
    while let Some((current, near)) = stack.pop() {
        if near > limit {
            continue;
        }
        if current.is_leaf() {
            limit = leaf(current.range());
            continue;
        }
        let [a, b] = tree.below(current.first).map(|(child, bounds)| (child, distance(&bounds.to_f64())));
        // The nearer on top.
        stack.extend(if a.1 <= b.1 { [b, a] } else { [a, b] });
    }
}

/// Squared distance of a point from a box, 0 inside.
pub(crate) fn squared_distance(bounds: &Aabb<f64>, point: DVec3) -> f64 {
    (closest_on_box(bounds, point) - point).length_squared()
}
