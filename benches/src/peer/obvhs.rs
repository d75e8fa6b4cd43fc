//! obvhs's own traversals of its own trees, with its own triangles, in the order of the leaves.

use std::time::Duration;

use firsthit_measure::mesh::Mesh;
use glam::Vec3;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh as Wide, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::{BvhBuildParams, triangle::Triangle};

use super::{Answer, Peer, Ray32};

/// The triangles of a mesh as obvhs takes them.
#[must_use]
pub fn triangles(mesh: &Mesh) -> Vec<Triangle> {
    let corner = |i: u32| Vec3::into(mesh.positions[i as usize]);
    mesh.triangles.iter().map(|&[a, b, c]| Triangle { v0: corner(a), v1: corner(b), v2: corner(c) }).collect()
}

fn ray(ray: &Ray32) -> Ray {
    Ray::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

/// As its traversals want them: no indirection at a leaf.
fn reordered(triangles: &[Triangle], order: &[u32]) -> Vec<RtTriangle> {
    order.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect()
}

/// Its traversals yield a place in the order of the leaves; weights are computed for the hit alone.
fn answer(hit: &RayHit, ray: &Ray, triangles: &[RtTriangle], order: &[u32]) -> Option<Answer> {
    let at = hit.primitive_id as usize;
    let weights = triangles.get(at)?.compute_barycentric(ray);
    Some(Answer { t: f64::from(hit.t), triangle: order[at], u: weights.x, v: weights.y })
}

macro_rules! peer {
    ($tree:ty, $name:ident, $build:ident) => {
        impl $name {
            /// Builds the tree.
            #[must_use]
            pub fn new(mesh: &Mesh) -> Self {
                let triangles = triangles(mesh);
                let tree: $tree = $build(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
                let triangles = reordered(&triangles, &tree.primitive_indices);
                Self { tree, triangles }
            }

            #[inline(always)]
            fn test(&self, ray: &Ray, at: usize) -> f32 {
                // SAFETY: a leaf's places are less than the tree's number of primitives, and there is a triangle for each.
                unsafe { self.triangles.get_unchecked(at) }.intersect(ray)
            }
        }

        impl Peer for $name {
            #[inline(always)]
            fn closest(&self, r: &Ray32) -> Option<Answer> {
                let (ray, mut hit) = (ray(r), RayHit::none());
                self.tree.ray_traverse(ray, &mut hit, |ray, at| self.test(ray, at));
                answer(&hit, &ray, &self.triangles, &self.tree.primitive_indices)
            }

            #[inline(always)]
            fn any(&self, r: &Ray32) -> bool {
                !self.tree.ray_traverse_miss(ray(r), |ray, at| self.test(ray, at))
            }
        }
    };
}

/// The binary tree, medium preset.
pub struct ObvhsBvh2 {
    tree: Bvh2,
    triangles: Vec<RtTriangle>,
}
peer!(Bvh2, ObvhsBvh2, build_bvh2_from_tris);

/// The compressed tree of eight children, medium preset.
pub struct CwBvh {
    tree: Wide,
    triangles: Vec<RtTriangle>,
}
peer!(Wide, CwBvh, build_cwbvh_from_tris);
