//! A ray caster that shares no code with the library: plain, slow, and honest about what it cannot tell.

use glam::{DAffine3, DVec3};

use crate::mesh::Mesh;

/// A scene flattened into world-space triangles, each with the ids it must be reported by.
#[derive(Clone, Debug, Default)]
pub struct FlatScene {
    /// Instance, geometry, primitive; and the corners in the world.
    pub triangles: Vec<([u32; 3], [DVec3; 3])>,
}

/// What a flat scene answers.
#[derive(Clone, Copy, Debug)]
pub struct FlatHit {
    /// Instance, geometry, primitive.
    pub id: [u32; 3],
    /// Ray parameter.
    pub t: f64,
    /// Weights of the second and third vertex.
    pub uv: (f64, f64),
    /// Unit normal by the winding in the world.
    pub normal: DVec3,
    /// |n.d| / |d|: 1 head-on, 0 grazing.
    pub cosine: f64,
}

impl FlatScene {
    /// Adds one geometry of an instance.
    pub fn add(&mut self, instance: u32, geometry: u32, mesh: &Mesh, transform: DAffine3) {
        for k in 0..mesh.triangles.len() {
            let v = mesh.corners(k).map(|p| transform.transform_point3(p));
            self.triangles.push(([instance, geometry, k as u32], v));
        }
    }

    /// The nearest hit at `t >= 0` by Cramer's rule in double precision. The second answer is false when it is not
    /// clear, within `margin`, whether or which triangle comes first.
    #[must_use]
    pub fn closest_hit(&self, o: DVec3, d: DVec3, margin: f64) -> (Option<FlatHit>, bool) {
        let det = |x: DVec3, y: DVec3, z: DVec3| x.dot(y.cross(z));
        let mut best: Option<FlatHit> = None;
        let mut doubts = Vec::new();
        for &(id, [a, b, c]) in &self.triangles {
            let (e1, e2, s) = (b - a, c - a, o - a);
            let m = det(-d, e1, e2);
            if m == 0.0 {
                continue;
            }
            let (t, u, v) = (det(s, e1, e2) / m, det(-d, s, e2) / m, det(-d, e1, s) / m);
            let least = u.min(v).min(1.0 - u - v);
            // Thin or grazing triangles make the weights uncertain.
            let cosine = m.abs() / (e1.cross(e2).length() * d.length());
            if least.abs() < margin / cosine || (t.abs() < margin && least > -margin) {
                doubts.push(t);
            }
            if least >= 0.0 && t >= 0.0 {
                if best.is_some_and(|h| (h.t - t).abs() < margin) {
                    doubts.push(t.min(best.map_or(t, |h| h.t)));
                }
                if best.is_none_or(|h| t < h.t) {
                    let normal = e1.cross(e2).normalize();
                    best = Some(FlatHit { id, t, uv: (u, v), normal, cosine });
                }
            }
        }
        let end = best.map_or(f64::INFINITY, |h| h.t);
        let clear = !doubts.iter().any(|&t| t > -margin && t <= end + margin);
        (best, clear)
    }
}
