//! parry3d's triangle mesh.

use firsthit_measure::mesh::Mesh;
use parry3d::math::Vector;
use parry3d::query::details::local_ray_intersection_with_triangle;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::{CompositeShapeRef, TriMesh};

use super::{Answer, Peer, Ray32};

/// A mesh of parry3d.
pub struct Parry(TriMesh);

impl Parry {
    /// Builds the tree; `None` for a mesh that parry3d refuses.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Option<Self> {
        let vertices = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        TriMesh::new(vertices, mesh.triangles.clone()).ok().map(Self)
    }
}

fn ray(r: &Ray32) -> Ray {
    let (o, d) = (r.origin, r.direction);
    Ray::new(Vector::new(o.x, o.y, o.z), Vector::new(d.x, d.y, d.z))
}

impl Peer for Parry {
    fn closest(&self, r: &Ray32) -> Option<Answer> {
        let ray = ray(r);
        let (triangle, t) = CompositeShapeRef(&self.0).cast_local_ray(&ray, r.t_max.min(f32::MAX), false)?;
        let corners = self.0.triangle(triangle);
        let weights = local_ray_intersection_with_triangle(corners.a, corners.b, corners.c, &ray);
        let (u, v) = weights.map_or((0.0, 0.0), |(_, w)| (w.y, w.z));
        Some(Answer { t: f64::from(t), triangle, u, v })
    }

    fn any(&self, r: &Ray32) -> bool {
        self.0.intersects_local_ray(&ray(r), r.t_max.min(f32::MAX))
    }
}
