//! The flattened tree of the `bvh` crate. Its own iterator yields every shape whose box the ray meets, however far, and
//! its triangle test culls back faces; so its public nodes are walked here with an end that comes nearer, and triangles are
//! tested from both sides (Moeller and Trumbore's test).

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, rayon_executor};
use bvh::flat_bvh::FlatBvh as Tree;
use firsthit_measure::mesh::Mesh;
use glam::Vec3;
use nalgebra::Point3;

use super::{Answer, Peer, Ray32};

/// A triangle in a tree of the `bvh` crate.
pub(crate) struct Triangle {
    pub(crate) corners: [Vec3; 3],
    /// The tree says which it is in.
    pub(crate) node: usize,
}

impl Bounded<f32, 3> for Triangle {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.corners.iter().fold(Aabb::empty(), |b, p| b.grow(&Point3::new(p.x, p.y, p.z)))
    }
}

impl BHShape<f32, 3> for Triangle {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }
    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// A tree of the `bvh` crate.
pub struct FlatBvh {
    tree: Tree<f32, 3>,
    triangles: Vec<Triangle>,
}

/// What the crate writes where a node of the flat list has no entry: a leaf.
const LEAF: u32 = u32::MAX;

impl FlatBvh {
    /// Builds the tree, on the threads of the rayon pool it is called from.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let corner = |i: u32| mesh.positions[i as usize];
        let mut triangles: Vec<Triangle> =
            mesh.triangles.iter().map(|t| Triangle { corners: t.map(corner), node: 0 }).collect();
        let tree = Bvh::build_with_executor(&mut triangles, rayon_executor);
        Self { tree: tree.flatten(), triangles }
    }

    #[inline(always)]
    fn walk(&self, ray: &Ray32, any: bool) -> Option<Answer> {
        let inverse = ray.direction.recip();
        let mut end = ray.t_max;
        let mut best = None;
        let mut at = 0;
        while let Some(node) = self.tree.get(at as usize) {
            if node.entry_index == LEAF {
                let hit = test(&self.triangles[node.shape_index as usize].corners, ray, end);
                if let Some((t, u, v)) = hit {
                    end = t;
                    best = Some(Answer { t: f64::from(t), triangle: node.shape_index, u, v });
                    if any {
                        break;
                    }
                }
                at = node.exit_index;
            } else {
                let (mut from, mut to) = (ray.t_min, end);
                for k in 0..3 {
                    let a = (node.aabb.min[k] - ray.origin[k]) * inverse[k];
                    let b = (node.aabb.max[k] - ray.origin[k]) * inverse[k];
                    from = from.max(a.min(b));
                    to = to.min(a.max(b));
                }
                at = if from <= to { node.entry_index } else { node.exit_index };
            }
        }
        best
    }
}

#[inline(always)]
fn test([a, b, c]: &[Vec3; 3], ray: &Ray32, end: f32) -> Option<(f32, f32, f32)> {
    let (p, q, o) = (b - a, c - a, ray.origin - a);
    let across = ray.direction.cross(q);
    let scale = 1.0 / p.dot(across);
    let u = o.dot(across) * scale;
    let along = o.cross(p);
    let v = ray.direction.dot(along) * scale;
    let t = q.dot(along) * scale;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= ray.t_min && t <= end).then_some((t, u, v))
}

impl Peer for FlatBvh {
    fn closest(&self, ray: &Ray32) -> Option<Answer> {
        self.walk(ray, false)
    }

    fn any(&self, ray: &Ray32) -> bool {
        self.walk(ray, true).is_some()
    }
}
