//! obvhs's own traversals of its own trees, with its own triangles.

use std::time::Duration;

use firsthit_measure::mesh::Mesh;
use glam::Vec3;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh as Wide, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::{BvhBuildParams, triangle::Triangle};

use super::{Peer, Ray32};

fn triangles(mesh: &Mesh) -> Vec<Triangle> {
    let corner = |i: u32| Vec3::into(mesh.positions[i as usize]);
    mesh.triangles.iter().map(|&[a, b, c]| Triangle { v0: corner(a), v1: corner(b), v2: corner(c) }).collect()
}

fn ray(ray: &Ray32) -> Ray {
    Ray::new_inf(ray.origin.into(), ray.direction.into())
}

/// The binary tree, medium preset.
pub struct ObvhsBvh2 {
    tree: Bvh2,
    triangles: Vec<Triangle>,
}

impl ObvhsBvh2 {
    /// Builds the tree.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let triangles = triangles(mesh);
        let tree = build_bvh2_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&i| triangles[i as usize]).collect();
        Self { tree, triangles }
    }
}

impl Peer for ObvhsBvh2 {
    fn closest(&self, r: &Ray32) -> Option<f32> {
        let mut hit = RayHit::none();
        self.tree.ray_traverse(ray(r), &mut hit, |ray, id| self.triangles[id].intersect(ray));
        (hit.t < f32::MAX).then_some(hit.t)
    }
}

/// The compressed tree of eight children, medium preset.
pub struct CwBvh {
    tree: Wide,
    triangles: Vec<Triangle>,
}

impl CwBvh {
    /// Builds the tree.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let triangles = triangles(mesh);
        let tree = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&i| triangles[i as usize]).collect();
        Self { tree, triangles }
    }
}

impl Peer for CwBvh {
    fn closest(&self, r: &Ray32) -> Option<f32> {
        let mut hit = RayHit::none();
        self.tree.ray_traverse(ray(r), &mut hit, |ray, id| self.triangles[id].intersect(ray));
        (hit.t < f32::MAX).then_some(hit.t)
    }
}
