//! What is right, in double precision and apart from every engine: obvhs's binary tree only sorts out what is far away,
//! with boxes tested in f64 and generously; triangles are tested by signed volumes in f64.

use std::time::Duration;

use firsthit_geometry::Ray;
use firsthit_measure::mesh::Mesh;
use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};

use crate::peer::{Ray32, obvhs_triangles};

/// Boxes are taken for larger by this share of the distance to them: far beyond the rounding of f64.
const MARGIN: f64 = 1e-9;

/// A hit in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Ray parameter.
    pub t: f64,
    /// The triangle.
    pub triangle: u32,
    /// The least of the three barycentric coordinates: how far inside the triangle.
    pub inside: f64,
}

/// A mesh to be asked in double precision.
pub struct Reference<'a> {
    mesh: &'a Mesh,
    tree: Bvh2,
}

impl<'a> Reference<'a> {
    /// Builds the tree.
    #[must_use]
    pub fn new(mesh: &'a Mesh) -> Self {
        let medium = BvhBuildParams::medium_build();
        Self { mesh, tree: build_bvh2_from_tris(&obvhs_triangles(mesh), medium, &mut Duration::default()) }
    }

    /// The nearest hit; of several at the same `t` the smallest triangle.
    #[must_use]
    pub fn closest(&self, ray: &Ray32) -> Option<Truth> {
        let mut best: Option<Truth> = None;
        self.walk(ray, f64::from(ray.t_max), |hit, end| {
            let nearer = best.is_none_or(|b| hit.t < b.t || (hit.t == b.t && hit.triangle < b.triangle));
            if nearer {
                best = Some(hit);
                *end = hit.t;
            }
            true
        });
        best
    }

    /// Some hit.
    #[must_use]
    pub fn any(&self, ray: &Ray32) -> Option<Truth> {
        let mut found = None;
        self.walk(ray, f64::from(ray.t_max), |hit, _| {
            found = Some(hit);
            false
        });
        found
    }

    /// Every hit.
    #[must_use]
    pub fn all(&self, ray: &Ray32) -> Vec<Truth> {
        let mut all = Vec::new();
        self.walk(ray, f64::from(ray.t_max), |hit, _| {
            all.push(hit);
            true
        });
        all
    }

    /// Triangles whose boxes, widened by `pad`, the ray's line meets.
    #[must_use]
    pub fn near(&self, ray: &Ray32, pad: f64) -> Vec<u32> {
        let mut near = Vec::new();
        self.visit(ray, pad, f64::INFINITY, |triangle, _| {
            near.push(triangle);
            true
        });
        near
    }

    /// Offers hits, nearer boxes first; `take` may bring the end nearer, or stop by false.
    fn walk(&self, ray: &Ray32, end: f64, mut take: impl FnMut(Truth, &mut f64) -> bool) {
        self.visit(ray, 0.0, end, |triangle, end| match self.test(ray, triangle) {
            Some(hit) if hit.t >= f64::from(ray.t_min) && hit.t <= *end => take(hit, end),
            _ => true,
        });
    }

    fn visit(&self, ray: &Ray32, pad: f64, mut end: f64, mut take: impl FnMut(u32, &mut f64) -> bool) {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let entry =
            |i: u32, end: f64| enter(self.tree.nodes[i as usize].aabb(), o, d, pad, (f64::from(ray.t_min), end));
        let mut stack: Vec<(f64, u32)> = vec![(f64::NEG_INFINITY, 0)];
        while let Some((from, index)) = stack.pop() {
            if from > end + MARGIN * (1.0 + end.abs()) {
                continue;
            }
            let node = &self.tree.nodes[index as usize];
            if !node.is_leaf() {
                let (a, b) = (node.first_index, node.first_index + 1);
                let of = |i: u32| entry(i, end).map(|t| (t, i));
                let (near, far) = match (of(a), of(b)) {
                    (Some(a), Some(b)) if b.0 < a.0 => (Some(b), Some(a)),
                    other => other,
                };
                stack.extend(far);
                stack.extend(near);
                continue;
            }
            for k in node.first_index..node.first_index + node.prim_count {
                if !take(self.tree.primitive_indices[k as usize], &mut end) {
                    return;
                }
            }
        }
    }

    /// The ray's line against a triangle. The volume at an edge has the same magnitude in both its triangles, so no line
    /// passes between them.
    fn test(&self, ray: &Ray32, triangle: u32) -> Option<Truth> {
        let d = ray.direction.as_dvec3();
        let [a, b, c] = self.mesh.corners(triangle as usize).map(|p| p - ray.origin.as_dvec3());
        let volumes = [d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a))];
        if volumes.iter().any(|&v| v < 0.0) && volumes.iter().any(|&v| v > 0.0) {
            return None;
        }
        let normal = (b - a).cross(c - a);
        let slope = normal.dot(d);
        let sum: f64 = volumes.iter().sum::<f64>().abs();
        let least = volumes.iter().fold(f64::INFINITY, |m, v| m.min(v.abs()));
        (slope != 0.0).then(|| Truth {
            t: normal.dot(a) / slope,
            triangle,
            inside: if sum > 0.0 { least / sum } else { 0.0 },
        })
    }
}

/// Where a ray enters a node's box widened by `pad`.
fn enter(bounds: &Aabb, o: DVec3, d: DVec3, pad: f64, (t_min, t_max): (f64, f64)) -> Option<f64> {
    let corner = |v: Vec3A, pad: f64| v.as_dvec3() + pad;
    let (low, high) = (corner(bounds.min, -pad), corner(bounds.max, pad));
    let (mut from, mut to) = (t_min, t_max);
    for k in 0..3 {
        if d[k] == 0.0 {
            if o[k] < low[k] || o[k] > high[k] {
                return None;
            }
            continue;
        }
        let (a, b) = ((low[k] - o[k]) / d[k], (high[k] - o[k]) / d[k]);
        from = from.max(a.min(b));
        to = to.min(a.max(b));
    }
    (from <= to + MARGIN * (1.0 + to.abs())).then_some(from)
}

/// A ray in double precision, for decisions about margins.
#[must_use]
pub fn double(ray: &Ray32) -> Ray<f64> {
    Ray {
        origin: ray.origin.as_dvec3(),
        direction: ray.direction.as_dvec3(),
        t_min: f64::from(ray.t_min),
        t_max: f64::from(ray.t_max),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firsthit_measure::mesh::soup;
    use firsthit_measure::random::Rng;

    /// The tree only leaves out what is not hit.
    #[test]
    fn the_tree_changes_nothing() {
        let mut rng = Rng(5);
        let mesh = soup(&mut rng, 3_000);
        let reference = Reference::new(&mesh);
        let mut hits = 0;
        for _ in 0..500 {
            let ray = Ray32::new((rng.in_cube() * 2.0).as_vec3(), rng.direction().as_vec3());
            let each = (0..3_000).filter_map(|k| reference.test(&ray, k)).filter(|h| h.t >= 0.0);
            let mut all: Vec<Truth> = each.collect();
            all.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
            assert_eq!(reference.closest(&ray), all.first().copied());
            assert_eq!(reference.any(&ray).is_some(), !all.is_empty());
            assert_eq!(reference.all(&ray).len(), all.len());
            hits += all.len();
        }
        assert!(hits > 1_000, "{hits}");
    }
}
