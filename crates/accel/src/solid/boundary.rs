//! Where a mesh ends.

use std::collections::HashMap;

use firsthit_geometry::transform::Transform;
use glam::{DVec3, Vec3};

use crate::model::Model;

/// The edges at which a mesh ends.
#[derive(Clone, Debug)]
pub(super) struct Boundary {
    /// Whether each edge has an even number of triangles.
    pub(super) closed: bool,
    /// Both ends, normalised, in the direction in which more triangles run through it than in the other, and how many more.
    pub(super) edges: Vec<([Vec3; 2], u32)>,
}

/// Of nothing.
impl Default for Boundary {
    fn default() -> Self {
        Self { closed: true, edges: Vec::new() }
    }
}

impl Boundary {
    /// Vertices are one where their positions are.
    pub(super) fn new(model: &Model) -> Self {
        let mut ids = HashMap::new();
        let mut points: Vec<Vec3> = Vec::new();
        let mut edges: Vec<([u32; 2], bool)> = Vec::new();
        model.each_triangle(|_, corners| {
            let [a, b, c] = corners.map(|p| {
                // -0 is 0.
                *ids.entry(p.to_array().map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                    points.push(p);
                    points.len() as u32 - 1
                })
            });
            edges.extend([(a, b), (b, c), (c, a)].map(|(u, v)| ([u.min(v), u.max(v)], u < v)));
        });
        edges.sort_unstable();
        let mut boundary = Self::default();
        for same in edges.chunk_by(|x, y| x.0 == y.0) {
            let ([low, high], _) = same[0];
            let upward = same.iter().filter(|(_, up)| *up).count();
            let downward = same.len() - upward;
            boundary.closed &= same.len() % 2 == 0;
            let ends = [points[low as usize], points[high as usize]];
            if upward > downward {
                boundary.edges.push((ends, (upward - downward) as u32));
            } else if downward > upward {
                boundary.edges.push(([ends[1], ends[0]], (downward - upward) as u32));
            }
        }
        boundary
    }

    /// What the cone from the boundary to infinity, in a direction, takes from the solid angle around a point: the sum over its edges
    /// of the spherical triangles with that direction (van Oosterom and Strackee 1983), signed.
    ///
    /// `None` if the ray that goes the other way passes so close to an edge, given what is rounded in a scene of some `size`,
    /// that it is not certain on which side: there the sum jumps by 4 pi, as does the number of crossings.
    pub(super) fn solid_angle(&self, transform: &Transform, point: DVec3, apex: DVec3, size: f64) -> Option<f64> {
        let (linear, offset) = (transform.linear(), transform.translation() - point);
        let apex = apex.normalize_or_zero();
        let mut sum = 0.0;
        for (ends, times) in &self.edges {
            let [a, b] = ends.map(|p| linear * p.as_dvec3() + offset);
            let (la, lb) = (a.length(), b.length());
            let volume = a.cross(b).dot(apex);
            let around = la * lb + a.dot(b) + b.dot(apex) * la + apex.dot(a) * lb;
            // Single precision, many times over; the distance is that of the two lines.
            let close = (size + la + lb) * 2f64.powi(-18);
            if around <= la * lb * 1e-4 && volume.abs() <= (b - a).cross(apex).length() * close {
                return None;
            }
            sum += 2.0 * volume.atan2(around) * f64::from(*times);
        }
        // A mirrored mesh keeps its outside.
        Some(if transform.mirrors() { -sum } else { sum })
    }
}
