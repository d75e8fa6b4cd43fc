//! The binary tree: each node holds the boxes of both its children, 64 bytes in `f32`.

use firsthit_geometry::{Aabb, Real, Vector3, slab::Slabs};

use super::Tree;
use crate::build::{Child, Topology};

/// A binary tree.
#[derive(Clone, Debug)]
pub(crate) struct Bvh2<R> {
    root: Option<Child>,
    nodes: Vec<Node<R>>,
}

/// Two children. One cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node<R> {
    /// By axis: the lower planes of both children, then the upper planes negated. So the larger of two values is the
    /// tighter one for all four, and one instruction of four lanes serves.
    planes: [[[R; 2]; 2]; 3],
    children: [Child; 2],
}

const _: () = assert!(size_of::<Node<f32>>() == 64);

impl<R: Real> Bvh2<R> {
    /// Boxes are joined upwards from those of the primitives.
    pub(crate) fn new(topology: &Topology, boxes: &[Aabb<R>]) -> Self {
        let planes = [[[R::INFINITY; 2]; 2]; 3];
        let nodes = topology.nodes.iter().map(|&children| Node { planes, children }).collect();
        let mut tree = Self { root: topology.root, nodes };
        tree.set_boxes(&topology.order, boxes);
        tree
    }

    /// The children of all nodes.
    pub(crate) fn children_of_all(&self) -> Vec<[Child; 2]> {
        self.nodes.iter().map(|n| n.children).collect()
    }

    /// A tree of the same shape over boxes in this order of the leaves; `u32::MAX` stands for a place with nothing.
    pub(crate) fn refit(&self, order: &[u32], boxes: &[Aabb<R>]) -> Self {
        let mut tree = self.clone();
        tree.set_boxes(order, boxes);
        tree
    }

    fn set_boxes(&mut self, order: &[u32], boxes: &[Aabb<R>]) {
        for i in (0..self.nodes.len()).rev() {
            let [l, r] = self.nodes[i].children.map(|c| {
                if c.is_leaf() {
                    order[c.range()]
                        .iter()
                        .filter_map(|&p| boxes.get(p as usize))
                        .fold(Aabb::empty(), |a, b| a.union(*b))
                } else {
                    let node = &self.nodes[c.first as usize];
                    node.child_box(0).union(node.child_box(1))
                }
            });
            self.nodes[i].planes =
                [0, 1, 2].map(|k| [[l.min.axis(k), r.min.axis(k)], [-l.max.axis(k), -r.max.axis(k)]]);
        }
    }

    /// Surface-area cost: the expected number of nodes and primitives that a random line through the root's box is
    /// tested against. 0 for an empty tree.
    pub(crate) fn sah_cost(&self) -> f64 {
        let Some(root) = self.root else { return 0.0 };
        if root.is_leaf() {
            return f64::from(root.count);
        }
        let Some(top) = self.nodes.first() else { return 0.0 };
        let whole = top.child_box(0).union(top.child_box(1)).to_f64().area();
        let below: f64 = self
            .nodes
            .iter()
            .flat_map(|n| [(n.child_box(0), n.children[0]), (n.child_box(1), n.children[1])])
            .map(|(b, c)| b.to_f64().area() * f64::from(c.count.max(1)))
            .sum();
        if whole > 0.0 { 1.0 + below / whole } else { 1.0 }
    }

    /// Where to begin; `None` when there is nothing.
    pub(crate) fn first(&self) -> Option<Child> {
        self.root
    }

    /// What is below a node, with its boxes.
    pub(crate) fn below(&self, index: u32) -> [(Child, Aabb<R>); 2] {
        let node = &self.nodes[index as usize];
        [(node.children[0], node.child_box(0)), (node.children[1], node.child_box(1))]
    }

    /// How many nodes there are.
    pub(crate) fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Bytes of the nodes over so many primitives at most.
    pub(crate) fn bytes_of(primitives: u64) -> u64 {
        primitives * size_of::<Node<R>>() as u64
    }

    /// Memory of the nodes.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }
}

impl<R: Real> Node<R> {
    fn child_box(&self, child: usize) -> Aabb<R> {
        let [x, y, z] = self.planes.map(|p| p.map(|side| side[child]));
        Aabb::new(R::Vec3::new(x[0], y[0], z[0]), R::Vec3::new(-x[1], -y[1], -z[1]))
    }
}

#[cfg(test)]
impl<R: Real> Bvh2<R> {
    /// A box that no longer holds what is below, for tests.
    pub(crate) fn shrink_a_box(&mut self) {
        self.nodes[0].planes[0][1][0] = -self.nodes[0].planes[0][0][0];
    }
}

impl<R: Real> Tree<R> for Bvh2<R> {
    #[inline(always)]
    fn root(&self) -> Option<Child> {
        self.root
    }

    #[inline(always)]
    fn children<const PADDED: bool>(
        &self,
        index: u32,
        ray: &Slabs<R>,
        t_min: R,
        t_max: R,
    ) -> ([Child; 2], [bool; 2], [R; 2]) {
        let node = &self.nodes[index as usize];
        // Where the ray enters both boxes, and minus where it leaves them.
        let mut ends = [t_min, t_min, -t_max, -t_max];
        for axis in 0..3 {
            let (near, far) = (ray.near_origin.axis(axis), ray.far_origin.axis(axis));
            let inverse = ray.inverse.axis(axis).abs();
            // Going down, the ray enters through the upper planes. Chosen by index: there is no branch to mispredict.
            let side = usize::from(ray.negative[axis]);
            let ([p0, p1], [p2, p3]) = (node.planes[axis][side], node.planes[axis][1 - side]);
            let p = [p0, p1, p2, p3];
            let origin = if ray.negative[axis] { [-near, -near, far, far] } else { [near, near, -far, -far] };
            for k in 0..4 {
                let t = (p[k] - origin[k]) * inverse;
                // In this form one instruction, and NaN is dropped.
                ends[k] = if t > ends[k] { t } else { ends[k] };
            }
        }
        let [enter0, enter1, leave0, leave1] = ends;
        let meets = if PADDED {
            let pad = R::TWO * R::gamma(4);
            [enter0 <= leave0.abs() * pad - leave0, enter1 <= leave1.abs() * pad - leave1]
        } else {
            [enter0 <= -leave0, enter1 <= -leave1]
        };
        (node.children, meets, [enter0, enter1])
    }
}
