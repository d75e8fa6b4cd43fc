//! Which triangles and boxes have a point in common with a region of space.
//!
//! Regions are closed: what touches one meets it. Boxes are decided by separating axes, spheres and capsules by
//! distances, convex regions by clipping; all in `f64`, and what is nearer than some roundings meets (a false hit is better
//! here than a false miss). A triangle without area is the segment or point that it is.

mod boxes;
mod convex;
mod round;

pub use boxes::OrientedBox;
pub use convex::Convex;
pub use round::{Capsule, Sphere};

use glam::DVec3;

use crate::Aabb;
use crate::frustum::{Containment, Frustum};

/// A part of space that queries ask about.
///
/// ```
/// use firsthit_geometry::overlap::{Region, Sphere};
/// use glam::DVec3;
/// let ball = Sphere { center: DVec3::new(0.2, 0.2, 1.0), radius: 1.0 };
/// assert!(ball.meets_triangle([DVec3::ZERO, DVec3::X, DVec3::Y]));
/// assert!(!ball.meets_triangle([DVec3::ZERO, DVec3::X, -DVec3::Y]));
/// ```
pub trait Region: Sync {
    /// Whether there is any point in it, and all its numbers are finite. Nothing meets a region that is not valid.
    fn is_valid(&self) -> bool;
    /// A number that no coordinate which decides exceeds: roundings are relative to it.
    fn size(&self) -> f64;
    /// How a box lies to it. `Intersecting` is always allowed; a box that is larger must not be `Outside` where a smaller one
    /// in it is not, nor `Inside` where the smaller one is not.
    fn classify_box(&self, bounds: &Aabb<f64>) -> Containment;
    /// Whether a triangle has a point in it.
    fn meets_triangle(&self, corners: [DVec3; 3]) -> bool;
}

impl Region for Frustum {
    fn is_valid(&self) -> bool {
        true
    }
    fn size(&self) -> f64 {
        self.corners().iter().fold(0.0, |m, c| m.max(c.abs().max_element()))
    }
    fn classify_box(&self, bounds: &Aabb<f64>) -> Containment {
        Frustum::classify_box(self, bounds)
    }
    fn meets_triangle(&self, corners: [DVec3; 3]) -> bool {
        self.classify_triangle(corners) != Containment::Outside
    }
}

#[cfg(test)]
mod tests;
