//! The flattened tree of the `bvh` crate. It yields every shape whose box the ray meets; the triangle test is its
//! `Ray::intersects_triangle`.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::flat_bvh::FlatBvh as Tree;
use bvh::ray::Ray;
use firsthit_measure::mesh::Mesh;
use glam::Vec3;
use nalgebra::{Point3, Vector3};

use super::{Peer, Ray32};

struct Triangle {
    corners: [Point3<f32>; 3],
    node: usize,
}

impl Bounded<f32, 3> for Triangle {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.corners.iter().fold(Aabb::empty(), |b, p| b.grow(p))
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

impl FlatBvh {
    /// Builds the tree.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let corner = |i: u32| {
            let Vec3 { x, y, z } = mesh.positions[i as usize];
            Point3::new(x, y, z)
        };
        let mut triangles: Vec<Triangle> =
            mesh.triangles.iter().map(|t| Triangle { corners: t.map(corner), node: 0 }).collect();
        Self { tree: Tree::build(&mut triangles), triangles }
    }
}

impl Peer for FlatBvh {
    fn closest(&self, r: &Ray32) -> Option<f32> {
        let (o, d) = (r.origin, r.direction);
        // It normalises the direction, so that t is a length in the world. It culls back faces too: both windings.
        let ray = Ray::new(Point3::new(o.x, o.y, o.z), Vector3::new(d.x, d.y, d.z));
        let mut nearest = f32::INFINITY;
        for triangle in self.tree.traverse(&ray, &self.triangles) {
            let [a, b, c] = &triangle.corners;
            let front = ray.intersects_triangle(a, b, c).distance;
            nearest = nearest.min(front.min(ray.intersects_triangle(a, c, b).distance));
        }
        nearest.is_finite().then(|| nearest / d.length())
    }
}
