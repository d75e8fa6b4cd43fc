//! Boxes, along the axes or turned.

use glam::{DMat3, DVec3};

use super::Region;
use crate::Aabb;
use crate::frustum::Containment;

/// A box that may be turned: the points `center + axes * p` with `|p| <= half` in each component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// The middle.
    pub center: DVec3,
    /// Half the length of each edge.
    pub half: DVec3,
    /// Directions of the edges: perpendicular and of length 1.
    pub axes: DMat3,
}

impl Region for Aabb<f64> {
    fn is_valid(&self) -> bool {
        self.is_finite() && !self.is_empty()
    }
    fn size(&self) -> f64 {
        self.min.abs().max(self.max.abs()).max_element()
    }
    fn classify_box(&self, bounds: &Aabb<f64>) -> Containment {
        if self.intersection(*bounds).is_empty() {
            Containment::Outside
        } else if self.contains(bounds.min) && self.contains(bounds.max) {
            Containment::Inside
        } else {
            Containment::Intersecting
        }
    }
    /// By separating axes (Akenine-Moller, *Journal of Graphics Tools* 6(1), 2001).
    fn meets_triangle(&self, corners: [DVec3; 3]) -> bool {
        let center = self.center();
        let half = (self.max - center).max(center - self.min);
        self.classify_box(&Aabb::from_points(corners)) != Containment::Outside
            && meets_centred(half, corners.map(|p| p - center), Region::size(self))
    }
}

impl OrientedBox {
    /// Its eight corners.
    pub fn corners(&self) -> impl Iterator<Item = DVec3> {
        let to_world = move |p| self.center + self.axes * p;
        Aabb::<f64>::new(-self.half, self.half).corners().into_iter().map(to_world)
    }
}

impl Region for OrientedBox {
    fn is_valid(&self) -> bool {
        let turned = self.axes.transpose() * self.axes - DMat3::IDENTITY;
        self.center.is_finite() && self.half.is_finite() && self.half.min_element() >= 0.0 && {
            let off = turned.to_cols_array().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            turned.is_finite() && off < 1e-6
        }
    }
    fn size(&self) -> f64 {
        (self.center.abs() + DVec3::splat(self.half.length())).max_element()
    }
    fn classify_box(&self, bounds: &Aabb<f64>) -> Containment {
        // The faces of either; an edge against an edge is left to the triangles.
        let within = |p: DVec3| (self.axes.transpose() * (p - self.center)).abs().cmple(self.half).all();
        if bounds.corners().into_iter().all(within) {
            return Containment::Inside;
        }
        if Aabb::<f64>::from_points(self.corners()).intersection(*bounds).is_empty() {
            return Containment::Outside;
        }
        let apart = self.axes.transpose() * (bounds.center() - self.center);
        let reach = self.half + self.axes.transpose().abs() * (bounds.extent() * 0.5);
        if apart.abs().cmpgt(reach).any() { Containment::Outside } else { Containment::Intersecting }
    }
    fn meets_triangle(&self, corners: [DVec3; 3]) -> bool {
        meets_centred(self.half, corners.map(|p| self.axes.transpose() * (p - self.center)), self.size())
    }
}

/// Whether a triangle meets the box about the origin. `size` is that of what was subtracted before.
fn meets_centred(half: DVec3, corners: [DVec3; 3], size: f64) -> bool {
    let [a, b, c] = corners;
    let edges = [b - a, c - b, a - c];
    let size = corners.iter().fold(size, |m, p| m.max(p.abs().max_element())) + half.max_element();
    let separates = |axis: DVec3| {
        let [x, y, z] = corners.map(|p| axis.dot(p));
        let reach = half.dot(axis.abs());
        let room = 32.0 * f64::EPSILON * size * axis.abs().element_sum();
        x.min(y).min(z) > reach + room || x.max(y).max(z) < -reach - room
    };
    let crossed = edges.iter().flat_map(|e| DVec3::AXES.map(|axis| axis.cross(*e)));
    !(DVec3::AXES.into_iter().chain([edges[0].cross(edges[1])]).chain(crossed).any(separates))
}
