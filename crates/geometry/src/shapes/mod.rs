//! Analytic primitives, one file a shape.
//!
//! To add one: a file here, a variant of [`Shape`], its cases in `tests/corpus`; the property suite picks it up.

use crate::{Aabb, Ray, Real};

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit<R: Real> {
    /// Ray parameter, in lengths of the ray's direction.
    pub t: R,
    /// First surface parameter; each shape says what it is.
    pub u: R,
    /// Second surface parameter.
    pub v: R,
    /// Unit geometric normal, never flipped towards the ray. `None` where the surface has none (the apex of a cone).
    pub normal: Option<R::Vec3>,
}

/// What every primitive answers, in the arithmetic of `R`.
pub trait Primitive<R: Real> {
    /// A box that holds the primitive (infinite for unbounded ones). Conservative: no point of the surface, nor a
    /// computed hit point within its stated error, need lie outside.
    fn bounds(&self) -> Aabb<R>;

    /// The nearest hit in the closed interval of the ray, in stable arithmetic.
    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>>;

    /// The nearest hit by the shortest formulas (tier `Fast`).
    fn closest_hit_fast(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.closest_hit(ray)
    }

    /// Whether anything is hit in the closed interval: the same decision as [`Primitive::closest_hit`].
    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.closest_hit(ray).is_some()
    }
}

/// Why a shape cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// A number that must be finite is not.
    #[error("{what} must be finite, but is {value}")]
    NotFinite {
        /// Which parameter.
        what: &'static str,
        /// What was given.
        value: f64,
    },
    /// A number is out of the allowed range.
    #[error("{what} must be {expected}, but is {value}")]
    OutOfRange {
        /// Which parameter.
        what: &'static str,
        /// The allowed range in words.
        expected: &'static str,
        /// What was given.
        value: f64,
    },
    /// The parameters describe no surface.
    #[error("degenerate shape: {0}")]
    Degenerate(&'static str),
}

mod sphere;
pub use sphere::Sphere;

/// Any of the analytic shapes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shape<R: Real> {
    /// A sphere.
    Sphere(Sphere<R>),
}

impl<R: Real> Shape<R> {
    /// The shape as a primitive.
    fn primitive(&self) -> &dyn Primitive<R> {
        match self {
            Self::Sphere(s) => s,
        }
    }

    /// The name of the shape's kind, as scene files spell it.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Sphere(_) => "sphere",
        }
    }
}

impl<R: Real> Primitive<R> for Shape<R> {
    fn bounds(&self) -> Aabb<R> {
        self.primitive().bounds()
    }
    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.primitive().closest_hit(ray)
    }
    fn closest_hit_fast(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.primitive().closest_hit_fast(ray)
    }
    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.primitive().any_hit(ray)
    }
}
