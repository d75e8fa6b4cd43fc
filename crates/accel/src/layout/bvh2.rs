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
    /// Planes by axis, side (lower, upper) and child.
    planes: [[[R; 2]; 2]; 3],
    children: [Child; 2],
}

const _: () = assert!(size_of::<Node<f32>>() == 64);

impl<R: Real> Bvh2<R> {
    /// Boxes are joined upwards from those of the primitives.
    pub(crate) fn new(topology: &Topology, boxes: &[Aabb<R>]) -> Self {
        let empty = Node { planes: [[[R::INFINITY; 2], [-R::INFINITY; 2]]; 3], children: [Child::default(); 2] };
        let mut nodes = vec![empty; topology.nodes.len()];
        for i in (0..nodes.len()).rev() {
            let children = topology.nodes[i];
            let below = children.map(|c| {
                if c.is_leaf() {
                    topology.order[c.range()].iter().fold(Aabb::empty(), |b, &p| b.union(boxes[p as usize]))
                } else {
                    let node = &nodes[c.first as usize];
                    node.child_box(0).union(node.child_box(1))
                }
            });
            nodes[i].children = children;
            for axis in 0..3 {
                nodes[i].planes[axis] =
                    [below.map(|b: Aabb<R>| b.min.axis(axis)), below.map(|b: Aabb<R>| b.max.axis(axis))];
            }
        }
        Self { root: topology.root, nodes }
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

    /// Memory of the nodes.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }
}

impl<R: Real> Node<R> {
    fn child_box(&self, child: usize) -> Aabb<R> {
        let corner = |side: usize| {
            R::Vec3::new(self.planes[0][side][child], self.planes[1][side][child], self.planes[2][side][child])
        };
        Aabb::new(corner(0), corner(1))
    }
}

impl<R: Real> Tree<R> for Bvh2<R> {
    #[inline(always)]
    fn root(&self) -> Option<Child> {
        self.root
    }

    #[inline(always)]
    fn all_children(&self, index: u32) -> [Child; 2] {
        self.nodes[index as usize].children
    }

    #[inline(always)]
    fn children(&self, index: u32, ray: &Slabs<R>, t_min: R, t_max: R) -> [Option<(Child, R)>; 2] {
        let node = &self.nodes[index as usize];
        let (mut enter, mut leave) = ([t_min; 2], [t_max; 2]);
        for axis in 0..3 {
            let side = usize::from(ray.negative[axis]);
            let (near, far) = (node.planes[axis][side], node.planes[axis][1 - side]);
            let (near_origin, far_origin) = (ray.near_origin.axis(axis), ray.far_origin.axis(axis));
            let inverse = ray.inverse.axis(axis);
            for k in 0..2 {
                let n = (near[k] - near_origin) * inverse;
                let f = (far[k] - far_origin) * inverse;
                // In this form one instruction each, and NaN is dropped.
                enter[k] = if n > enter[k] { n } else { enter[k] };
                leave[k] = if f < leave[k] { f } else { leave[k] };
            }
        }
        let pad = R::TWO * R::gamma(4);
        let meets = [0, 1].map(|k| enter[k] <= leave[k] + leave[k].abs() * pad);
        match meets {
            [false, false] => [None, None],
            [true, false] => [Some((node.children[0], enter[0])), None],
            [false, true] => [Some((node.children[1], enter[1])), None],
            [true, true] => {
                let (a, b) = ((node.children[0], enter[0]), (node.children[1], enter[1]));
                if b.1 < a.1 { [Some(b), Some(a)] } else { [Some(a), Some(b)] }
            }
        }
    }
}
