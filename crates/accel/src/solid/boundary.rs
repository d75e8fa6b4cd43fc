//! Where a mesh ends.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;

use super::loops::Loops;
use crate::model::Model;

/// The edges at which a mesh ends.
#[derive(Clone, Debug)]
pub(super) struct Boundary {
    /// Whether each edge has an even number of triangles.
    pub(super) closed: bool,
    /// How many edges have more triangles that run through them in one direction than in the other.
    pub(super) edges: usize,
    /// Those edges in that direction, as often as there are more.
    pub(super) loops: Arc<Loops>,
}

/// Of nothing.
impl Default for Boundary {
    fn default() -> Self {
        Self { closed: true, edges: 0, loops: Arc::default() }
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
        let mut open: Vec<[u32; 2]> = Vec::new();
        for same in edges.chunk_by(|x, y| x.0 == y.0) {
            let ([low, high], _) = same[0];
            let upward = same.iter().filter(|(_, up)| *up).count();
            let downward = same.len() - upward;
            boundary.closed &= same.len() % 2 == 0;
            if upward != downward {
                let edge = if upward > downward { [low, high] } else { [high, low] };
                boundary.edges += 1;
                open.extend(core::iter::repeat_n(edge, upward.abs_diff(downward)));
            }
        }
        boundary.loops = Arc::new(Loops::new(&points, &open));
        boundary
    }
}
