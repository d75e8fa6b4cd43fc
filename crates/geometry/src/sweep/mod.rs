//! Bodies that move along a ray: when they first touch.

mod convex;
mod sphere;

pub use convex::{ConvexBody, ConvexBodyError, convex_to_triangle};
pub use sphere::sphere_to_triangle;

use glam::DVec3;

/// Where a moving body first touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The parameter of the ray when it does.
    pub t: f64,
    /// The point of the triangle that is touched.
    pub point: DVec3,
}
