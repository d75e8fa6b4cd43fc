//! What lies within a distance: of a point, or of a segment.

use glam::DVec3;

use super::Region;
use crate::distance::{closest_on_box, closest_on_triangle, segment_to_triangle};
use crate::frustum::Containment;
use crate::{Aabb, Ray, clip};

/// What is not farther from `center` than `radius`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// The middle.
    pub center: DVec3,
    /// Not negative; 0 for a point.
    pub radius: f64,
}

/// What is not farther from a segment than `radius`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// One end of the segment.
    pub a: DVec3,
    /// The other; may be the same.
    pub b: DVec3,
    /// Not negative; 0 for the segment itself.
    pub radius: f64,
}

fn is_radius(radius: f64) -> bool {
    radius.is_finite() && radius >= 0.0
}

/// The room in distances: some roundings of the numbers they come from.
fn room(size: f64) -> f64 {
    32.0 * f64::EPSILON * size
}

impl Region for Sphere {
    fn is_valid(&self) -> bool {
        self.center.is_finite() && is_radius(self.radius)
    }
    fn size(&self) -> f64 {
        self.center.abs().max_element() + self.radius
    }
    fn classify_box(&self, bounds: &Aabb<f64>) -> Containment {
        let farthest = (bounds.min - self.center).abs().max((bounds.max - self.center).abs());
        if (closest_on_box(bounds, self.center) - self.center).length() > self.radius {
            Containment::Outside
        } else if farthest.length() <= self.radius {
            Containment::Inside
        } else {
            Containment::Intersecting
        }
    }
    fn meets_triangle(&self, corners: [DVec3; 3]) -> bool {
        let relative = corners.map(|p| p - self.center);
        let nearest = closest_on_triangle::<f64>(relative, DVec3::ZERO);
        nearest.point.length() <= self.radius + room(self.size())
    }
}

impl Region for Capsule {
    fn is_valid(&self) -> bool {
        self.a.is_finite() && self.b.is_finite() && is_radius(self.radius)
    }
    fn size(&self) -> f64 {
        self.a.abs().max(self.b.abs()).max_element() + self.radius
    }
    fn classify_box(&self, bounds: &Aabb<f64>) -> Containment {
        let grown = Aabb::<f64>::new(bounds.min - self.radius, bounds.max + self.radius);
        let near = |p: DVec3| {
            let nearest = crate::distance::closest_on_segment::<f64>(self.a, self.b, p).point;
            nearest.distance(p) <= self.radius
        };
        let passes = grown.contains(self.a)
            || grown.contains(self.b)
            || clip::liang_barsky(&grown, &Ray::segment(self.a, self.b)).is_some();
        if !passes {
            Containment::Outside
        } else if bounds.corners().into_iter().all(near) {
            Containment::Inside
        } else {
            Containment::Intersecting
        }
    }
    fn meets_triangle(&self, corners: [DVec3; 3]) -> bool {
        let (b, relative) = (self.b - self.a, corners.map(|p| p - self.a));
        segment_to_triangle([DVec3::ZERO, b], relative).distance() <= self.radius + room(self.size())
    }
}
