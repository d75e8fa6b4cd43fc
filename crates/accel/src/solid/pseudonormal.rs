//! The side of the nearest feature.

use firsthit_geometry::distance::Feature;
use glam::DVec3;

use crate::Scene;
use crate::model::Model;
use crate::nearest::{Keep, Near};

/// Keeps what may be nearest: what shares the nearest edge or vertex is as near, but for rounding.
struct Ties {
    nearest: Option<Near>,
    all: Vec<Near>,
    /// By how much the distances may be off. What is kept too much does no harm: it does not share the vertices.
    room: f64,
}

impl Keep for Ties {
    fn limit(&self) -> f64 {
        let Some(near) = self.nearest else { return f64::INFINITY };
        let distance = near.squared.sqrt() * (1.0 + 1e-9) + self.room;
        distance * distance
    }
    fn offer(&mut self, near: Near) {
        if self.nearest.is_none_or(|nearest| near.comes_before(&nearest)) {
            self.nearest = Some(near);
            let limit = self.limit();
            if self.all.last().is_some_and(|last| last.squared > limit) {
                self.all.retain(|other| other.squared <= limit);
            }
        }
        self.all.push(near);
    }
    fn shapes(&self) -> bool {
        false
    }
}

/// Whether a point is behind what is nearest to it.
pub(super) fn is_inside(scene: &Scene, point: DVec3) -> bool {
    // Beside the surface distances are no sharper than places, as seen from the point; within needles less than that.
    let bounds = scene.bounds();
    let farthest = (point - bounds.min).abs().max((point - bounds.max).abs()).max_element();
    let mut ties = Ties { nearest: None, all: Vec::new(), room: farthest * 2f64.powi(-40) };
    scene.inner().near(point, &mut ties);
    // From beyond all numbers everything is equally far.
    let Some(nearest) = ties.nearest.filter(|near| near.squared.is_finite()) else { return false };
    let Some(normal) = normal(scene, &nearest, ties.all) else { return false };
    // From the surface to the point.
    normal.dot(-nearest.at.point) < 0.0
}

/// The sum of the normals of all triangles that share the nearest feature, weighted by their angles there.
fn normal(scene: &Scene, nearest: &Near, mut all: Vec<Near>) -> Option<DVec3> {
    let instance = scene.instances().get(nearest.instance as usize)?;
    let model: &Model = scene.models().get(instance.model as usize)?;
    let corners = |near: &Near| model.corners(model.of_number(near.number)?);
    let first = corners(nearest)?;
    // By place: files split vertices where other things than their positions differ.
    let shared: Vec<DVec3> = match nearest.at.feature() {
        Feature::Face => first.to_vec(),
        Feature::Edge(k) => vec![first[usize::from(k)], first[(usize::from(k) + 1) % 3]],
        Feature::Vertex(k) => vec![first[usize::from(k)]],
    };
    // In an order that does not depend on the tree.
    all.sort_by_key(|near| near.number);
    let mut sum = DVec3::ZERO;
    for near in all.iter().filter(|near| near.instance == nearest.instance) {
        let corners = corners(near)?;
        let has_it = shared.iter().all(|p| corners.contains(p));
        if !has_it || shared.len() == 3 && near.number != nearest.number {
            continue;
        }
        let [a, b, c] = corners;
        let angle = if let [vertex] = shared[..] {
            let k = corners.iter().position(|p| *p == vertex)?;
            let along = |i: usize| instance.transform.vector(corners[(k + i) % 3] - vertex);
            along(1).angle_between(along(2))
        } else {
            // The same for both triangles of an edge.
            1.0
        };
        sum += instance.transform.normal((b - a).cross(c - a)) * angle;
    }
    Some(sum)
}
