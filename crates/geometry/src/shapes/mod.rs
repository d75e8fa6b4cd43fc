//! Analytic primitives, one file a shape.
//!
//! | shape | kind in scene files | surface parameters (u, v) |
//! |---|---|---|
//! | [`Sphere`] | `sphere` | longitude and latitude, 0..1 |
//! | [`Plane`] | `plane` | coordinates in the plane, world units |
//! | [`Disk`] | `disk` | angle and distance from the inner rim, 0..1 |
//! | [`Polygon`] | `polygon` | the two kept coordinates across its bounds, 0..1 |
//! | [`Cuboid`] | `box` | the other two coordinates across the face, 0..1 |
//! | [`Quadric`], open | `quadric`, `cylinder`, `cone`, ... | longitude, 0..1; height |
//! | [`Solid`], closed | as the quadric it closes | as the quadric; on a cap as the box |
//!
//! To add one: a file here, a variant of [`Shape`], its cases in `tests/corpus`; the property suite picks it up.

use core::ops::ControlFlow;

use crate::{Aabb, Ray, Real, exact::Root};

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

impl<R: Real> SurfaceHit<R> {
    /// A hit; surface parameters that are no numbers, because the hit point is out of range, become 0.
    fn new(t: R, u: R, v: R, normal: Option<R::Vec3>) -> Self {
        let number = |x: R| if x.is_finite() { x } else { R::ZERO };
        Self { t, u: number(u), v: number(v), normal }
    }
}

/// Where a ray meets a surface, decided exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactSurfaceHit<R: Real> {
    /// The hit. Its `t` is correctly rounded; the rest comes from that `t`.
    pub hit: SurfaceHit<R>,
    /// Whether the ray passes to the other side, rather than touching the surface: tangent to a sphere, at the edge of a
    /// box, through the apex of a cone. The boundary of a solid is crossed an even number of times by every line.
    pub crosses: bool,
}

/// What is asked about each exact hit; it may stop the search.
/// The second argument computes the exact parameter, which costs more than the hit.
pub type ExactVisitor<'a, R> = dyn FnMut(ExactSurfaceHit<R>, &dyn Fn() -> Root) -> ControlFlow<()> + 'a;

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

    /// Visits every hit in the closed interval, in ascending order, until the visitor breaks (tier `Exact`).
    ///
    /// The surface is the one that the parameters describe as they are stored, the ray is what its numbers are, and for
    /// these the decisions are exact: hit or miss, which roots are in the interval and within bounds and rims. `t` is
    /// the root rounded to nearest, ties to even; a root beyond the largest number of `R` is no hit.
    ///
    /// Returns whether `f64`, and twice its digits, could not decide, and exact numbers were needed.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use firsthit_geometry::{Primitive, Ray, shapes::Sphere};
    /// use glam::DVec3;
    /// let sphere = Sphere::new(DVec3::ZERO, 1.0)?;
    /// let mut hits = Vec::new();
    /// let visit = &mut |h: firsthit_geometry::ExactSurfaceHit<f64>, _: &dyn Fn() -> _| {
    ///     hits.push((h.hit.t, h.crosses));
    ///     ControlFlow::Continue(())
    /// };
    /// // Tangent: touched once, at the point itself. One unit in the last place further out: missed.
    /// sphere.visit_exact(&Ray::new(DVec3::new(1.0, 0.0, 5.0), DVec3::NEG_Z), visit);
    /// sphere.visit_exact(&Ray::new(DVec3::new(1.0_f64.next_up(), 0.0, 5.0), DVec3::NEG_Z), visit);
    /// assert_eq!(hits, [(5.0, false)]);
    /// # Ok::<(), firsthit_geometry::ShapeError>(())
    /// ```
    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool;

    /// The first hit of [`Primitive::visit_exact`].
    fn closest_hit_exact(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        let mut first = None;
        self.visit_exact(ray, &mut |found, _| {
            first = Some(found.hit);
            ControlFlow::Break(())
        });
        first
    }

    /// The exact parameter of the first hit of [`Primitive::visit_exact`] whose rounded one is `t`: it orders hits on
    /// different surfaces.
    fn exact_root(&self, ray: &Ray<R>, t: R) -> Option<Root> {
        let mut exact = None;
        self.visit_exact(ray, &mut |found, root| {
            if found.hit.t == t {
                exact = Some(root());
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        exact
    }

    /// Whether anything is hit in the closed interval: the same decision as [`Primitive::closest_hit`].
    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.closest_hit(ray).is_some()
    }

    /// A computed hit point brought back onto the surface, and a bound of the distance that is left.
    ///
    /// `normal` is the normal of the hit; it tells which face of a box or cap of a solid was hit. The point must lie
    /// near the surface, as `ray.at(hit.t)` does.
    ///
    /// The bound covers the rounding of the point itself *and* that of the next intersection test from there: a ray
    /// that starts at `point + normal * error` and leaves to that side does not hit the same piece of surface again.
    fn refine(&self, point: R::Vec3, normal: Option<R::Vec3>) -> (R::Vec3, R);

    /// Whether a straight line meets the primitive at most once, so that a ray that starts on it need not be tested
    /// against it.
    fn is_flat(&self) -> bool {
        false
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
    /// The vertices of a polygon do not lie in one plane.
    #[error("polygon is not flat: a vertex lies {distance} off its plane, {tolerance} is allowed")]
    NotPlanar {
        /// Distance of the worst vertex from the plane, in world units.
        distance: f64,
        /// The largest distance allowed.
        tolerance: f64,
    },
    /// The parameters describe no surface.
    #[error("degenerate shape: {0}")]
    Degenerate(&'static str),
}

mod closest;
mod common;
mod cuboid;
mod disk;
mod ellipsoid;
mod exact;
mod plane;
mod polygon;
mod quadric;
mod quadric_bounds;
mod solid;
mod sphere;

pub use closest::ClosestOnSurface;
pub use cuboid::Cuboid;
pub use disk::Disk;
pub use plane::Plane;
pub use polygon::Polygon;
pub use quadric::{Quadric, QuadricKind};
pub use solid::Solid;
pub use sphere::Sphere;

/// Any of the analytic shapes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shape<R: Real> {
    /// A sphere.
    Sphere(Sphere<R>),
    /// An infinite plane.
    Plane(Plane<R>),
    /// A disk or annulus.
    Disk(Disk<R>),
    /// A flat polygon with holes.
    Polygon(Polygon<R>),
    /// An axis-aligned box.
    Cuboid(Cuboid<R>),
    /// An open quadric surface.
    Quadric(Quadric<R>),
    /// A quadric closed by the faces of its clip box.
    Solid(Solid<R>),
}

impl<R: Real> Shape<R> {
    /// The shape as a primitive.
    fn primitive(&self) -> &dyn Primitive<R> {
        match self {
            Self::Sphere(s) => s,
            Self::Plane(s) => s,
            Self::Disk(s) => s,
            Self::Polygon(s) => s,
            Self::Cuboid(s) => s,
            Self::Quadric(s) => s,
            Self::Solid(s) => s,
        }
    }

    /// The name of the shape's kind, as scene files spell it.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Sphere(_) => "sphere",
            Self::Plane(_) => "plane",
            Self::Disk(_) => "disk",
            Self::Polygon(_) => "polygon",
            Self::Cuboid(_) => "box",
            Self::Quadric(q) => q.kind().name(),
            Self::Solid(s) => s.surface().kind().name(),
        }
    }

    /// The same shape in another arithmetic, its parameters rounded to nearest.
    ///
    /// # Errors
    /// When rounding leaves no shape, e.g. a radius too small for f32.
    pub fn cast<S: Real>(&self) -> Result<Shape<S>, ShapeError> {
        Ok(match self {
            Self::Sphere(s) => Shape::Sphere(s.cast()?),
            Self::Plane(s) => Shape::Plane(s.cast()?),
            Self::Disk(s) => Shape::Disk(s.cast()?),
            Self::Polygon(s) => Shape::Polygon(s.cast()?),
            Self::Cuboid(s) => Shape::Cuboid(s.cast()?),
            Self::Quadric(s) => Shape::Quadric(s.cast()?),
            Self::Solid(s) => Shape::Solid(s.cast()?),
        })
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
    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool {
        self.primitive().visit_exact(ray, visit)
    }
    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.primitive().any_hit(ray)
    }
    fn refine(&self, point: R::Vec3, normal: Option<R::Vec3>) -> (R::Vec3, R) {
        self.primitive().refine(point, normal)
    }
    fn is_flat(&self) -> bool {
        self.primitive().is_flat()
    }
}

macro_rules! shape_from {
    ($($shape:ident),*) => {
        $(impl<R: Real> From<$shape<R>> for Shape<R> {
            fn from(shape: $shape<R>) -> Self {
                Self::$shape(shape)
            }
        })*
    };
}
shape_from!(Sphere, Plane, Disk, Polygon, Cuboid, Quadric, Solid);
