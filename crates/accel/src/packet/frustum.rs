//! All rays of a packet against eight boxes.

use super::group::Group;
use crate::layout::wide8::Node;
use crate::simd::{Lanes, Row};

/// Ends of what the rays of a packet do among boxes. They go into one octant, so that they enter through the same planes:
/// no ray of the packet meets a box that this misses.
///
/// For rays down an axis (of positive direction), a plane is entered at `(plane - origin) * inverse`: not before the
/// largest origin would enter it by the smaller or the larger reciprocal, whichever is sooner. It is the test of a ray
/// ([`Boxes`](crate::wide::Boxes)) for two at the ends, rounded no more often, so what boxes are widened by covers this
/// test too.
#[derive(Clone, Copy)]
pub(super) struct Frustum<L> {
    axes: [Ends<L>; 3],
    start: L,
}

#[derive(Clone, Copy)]
struct Ends<L> {
    /// The planes where the rays enter, and where they leave.
    entry: Row,
    exit: Row,
    /// The smallest and the largest reciprocal.
    inverse: [L; 2],
    /// The origin that enters first and that which leaves last, times either.
    near: [L; 2],
    far: [L; 2],
}

impl<L: Lanes> Ends<L> {
    #[inline(always)]
    fn new(groups: &[Group], axis: usize, negative: bool) -> Self {
        let (infinite, zero) = (L::splat(f32::INFINITY), L::splat(0.0));
        let (mut least, mut most) = (infinite, zero.sub(infinite));
        // Turned round where the rays go down, so that the largest counts.
        let turn = if negative { L::splat(-0.0) } else { zero };
        let (mut near, mut far) = (zero.sub(infinite), infinite);
        for group in groups {
            let inverse = L::load(&group.inverse[axis]);
            let (origin, out) = (L::load(&group.origin32[axis]).turned_by(turn), L::load(&group.delta));
            least = least.min(inverse.choose(group.awake, least));
            most = most.max(inverse.choose(group.awake, most));
            near = near.max(origin.add(out).choose(group.awake, near));
            far = far.min(origin.sub(out).choose(group.awake, far));
        }
        let inverse = [L::splat(least.smallest()), L::splat(most.largest())];
        let (near, far) = (L::splat(near.largest()).turned_by(turn), L::splat(far.smallest()).turned_by(turn));
        let side = usize::from(negative);
        Self {
            entry: Row::new(Node::row(axis, side)),
            exit: Row::new(Node::row(axis, 1 - side)),
            inverse,
            near: [near.mul(inverse[0]), near.mul(inverse[1])],
            far: [far.mul(inverse[0]), far.mul(inverse[1])],
        }
    }

    #[inline(always)]
    fn enter(&self, node: &Node) -> L {
        let plane = L::load_row(&node.planes, self.entry);
        plane.mul_sub(self.inverse[0], self.near[0]).min(plane.mul_sub(self.inverse[1], self.near[1]))
    }

    #[inline(always)]
    fn leave(&self, node: &Node) -> L {
        let plane = L::load_row(&node.planes, self.exit);
        plane.mul_sub(self.inverse[0], self.far[0]).max(plane.mul_sub(self.inverse[1], self.far[1]))
    }
}

impl<L: Lanes> Frustum<L> {
    /// Around the rays that are awake, at least one.
    #[inline(always)]
    pub(super) fn new(groups: &[Group], negative: [bool; 3]) -> Self {
        let mut start = L::splat(f32::INFINITY);
        for group in groups {
            start = start.min(L::load(&group.start).choose(group.awake, start));
        }
        let [x, y, z] = negative;
        let axes = [Ends::new(groups, 0, x), Ends::new(groups, 1, y), Ends::new(groups, 2, z)];
        Self { axes, start: L::splat(start.smallest()) }
    }

    /// Which children some ray may meet before `end`, and where none enters sooner.
    #[inline(always)]
    pub(super) fn test(&self, node: &Node, end: L) -> (u32, L) {
        let [x, y, z] = &self.axes;
        let enter = x.enter(node).max(y.enter(node)).max(z.enter(node).max(self.start));
        let leave = x.leave(node).min(y.leave(node)).min(z.leave(node).min(end));
        (enter.le(leave), enter)
    }
}

/// The latest end of the boxes' intervals.
#[inline(always)]
pub(super) fn latest<L: Lanes>(groups: &[Group]) -> f32 {
    let mut end = L::splat(f32::NEG_INFINITY);
    for group in groups {
        end = end.max(L::load(&group.end));
    }
    end.largest()
}

impl Group {
    /// Which rays meet one of eight boxes. Those asleep do not.
    #[inline(always)]
    pub(super) fn meet<L: Lanes>(&self, node: &Node, child: usize, negative: [bool; 3]) -> u32 {
        let mut enter = L::load(&self.start);
        let mut leave = L::load(&self.end);
        for (axis, negative) in negative.into_iter().enumerate() {
            let side = usize::from(negative);
            let (entry, exit) =
                (node.planes[Node::row(axis, side)][child], node.planes[Node::row(axis, 1 - side)][child]);
            let inverse = L::load(&self.inverse[axis]);
            enter = L::splat(entry).mul_sub(inverse, L::load(&self.near[axis])).max(enter);
            leave = L::splat(exit).mul_sub(inverse, L::load(&self.far[axis])).min(leave);
        }
        enter.le(leave)
    }
}
