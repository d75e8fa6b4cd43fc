//! Primitives of the user's own, and whatever else rays meet that is no triangle.

use core::fmt;
use core::ops::ControlFlow;
use std::sync::Arc;

use firsthit_geometry::exact::Root;
use firsthit_geometry::shapes::{ClosestOnSurface, ExactVisitor};
use firsthit_geometry::transform::similarity;
use firsthit_geometry::{Aabb, ExactSurfaceHit, Primitive, Ray, Shape, SurfaceHit};
use glam::{DAffine3, DVec3};

/// Primitives that the user tests: voxels, curves, height fields, distance functions, anything with a box that a ray can be
/// tested against. They are in the same trees as triangles, and instances place and scale them.
///
/// All numbers are in the mesh's own space and in `f64` (`u` and `v` of a [`Hit`](crate::Hit) are rounded to `f32`). Queries call
/// from several threads. Number and boxes must not change while a scene is built and lives. A panic in here ends the query that
/// asked.
///
/// Every query about rays meets them (at the tier `Exact` what is reported is taken for exact). Those about nearest points do
/// where [`UserPrimitives::closest_point`] is there. Queries about triangles in regions do not; those about parts tell them
/// by their boxes.
///
/// ```
/// use std::sync::Arc;
/// use firsthit_accel::{Geometry, SceneBuilder, UserPrimitives};
/// use firsthit_geometry::{Aabb, Ray, SurfaceHit};
/// use glam::{DAffine3, DVec3};
///
/// /// Square tiles in the plane z = 0.
/// #[derive(Debug)]
/// struct Tiles(Vec<[f64; 2]>);
///
/// impl UserPrimitives for Tiles {
///     fn count(&self) -> u32 {
///         self.0.len() as u32
///     }
///     fn bounds(&self, tile: u32) -> Aabb<f64> {
///         let [x, y] = self.0[tile as usize];
///         Aabb::new(DVec3::new(x, y, 0.0), DVec3::new(x + 1.0, y + 1.0, 0.0))
///     }
///     fn closest_hit(&self, tile: u32, ray: &Ray<f64>) -> Option<SurfaceHit<f64>> {
///         let t = -ray.origin.z / ray.direction.z;
///         let [u, v] = [ray.at(t).x - self.0[tile as usize][0], ray.at(t).y - self.0[tile as usize][1]];
///         let inside = (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v);
///         (inside && ray.contains(t)).then_some(SurfaceHit { t, u, v, normal: Some(DVec3::Z) })
///     }
/// }
///
/// let mut builder = SceneBuilder::default();
/// let mesh = builder.add_mesh(vec![Geometry::User(Arc::new(Tiles(vec![[0.0, 0.0], [4.0, 4.0]])))]);
/// builder.add_instance(mesh, DAffine3::from_scale(DVec3::splat(2.0)));
/// let hit = builder.build()?.closest_hit(&Ray::new(DVec3::new(9.0, 9.5, 3.0), DVec3::NEG_Z)).unwrap();
/// assert_eq!((hit.id.primitive, hit.t, hit.u, hit.v), (1, 3.0, 0.5, 0.75));
/// # Ok::<(), firsthit_accel::BuildError>(())
/// ```
pub trait UserPrimitives: fmt::Debug + Send + Sync {
    /// How many there are; they are told by numbers from 0 on, which are the `primitive` of their hits.
    fn count(&self) -> u32;

    /// A box that holds the primitive, every hit that is reported of it included. It may be infinite: then all rays are tested
    /// against the primitive.
    fn bounds(&self, primitive: u32) -> Aabb<f64>;

    /// The first hit in the closed interval of the ray, whose direction may have any length. A query that goes on behind a hit
    /// asks again with a `t_min` just beyond, so a surface that a ray starts on should not be found there again and again (`refine`
    /// moves starts away from it). Hits outside the interval, and those that are no finite numbers, are not taken.
    fn closest_hit(&self, primitive: u32, ray: &Ray<f64>) -> Option<SurfaceHit<f64>>;

    /// A hit point brought onto the surface, and how far off it may still be along the normal, the rounding of the next
    /// test from there included: see [`Primitive::refine`]. As it stands, the point itself and 64 roundings of its largest
    /// coordinate, which is enough where hits are as exact as that.
    fn refine(&self, _primitive: u32, point: DVec3, _normal: Option<DVec3>) -> (DVec3, f64) {
        (point, point.abs().max_element() * (64.0 * f64::EPSILON))
    }

    /// The point of the primitive that is nearest to `point`, for [`Scene::closest_point`](crate::Scene::closest_point) and its
    /// kin. `None`, as it stands: for these queries it is not there. The point must lie in the primitive's box; one that is not
    /// finite is not taken. Parameters and normal are as of a hit there.
    ///
    /// Nearest here is nearest in the world only where an instance's transform keeps angles, so it is asked about in such
    /// instances alone.
    fn closest_point(&self, _primitive: u32, _point: DVec3) -> Option<ClosestOnSurface> {
        None
    }

    /// Whether each of them is met by a straight line once at most, so that a ray that starts on one need not be tested against it.
    fn is_flat(&self) -> bool {
        false
    }
}

/// A primitive that is no triangle.
#[derive(Clone, Debug)]
pub(crate) enum OtherSurface {
    /// Boxed: there may be many of the others, which are small.
    Shape(Box<Shape<f64>>),
    User(Arc<dyn UserPrimitives>, u32),
}

impl OtherSurface {
    /// The point nearest to the origin of the primitive as placed by a map.
    pub(crate) fn closest_to_origin(&self, placed: &DAffine3) -> Option<ClosestOnSurface> {
        match self {
            Self::Shape(shape) => shape.closest_to_origin(placed),
            Self::User(user, primitive) => {
                let scale = similarity(&placed.matrix3)?;
                // The inverse of a turn is its transpose.
                let origin = placed.matrix3.transpose() * (-placed.translation / scale) / scale;
                let nearest = user.closest_point(*primitive, origin)?;
                let point = placed.transform_point3(nearest.point);
                point.is_finite().then_some(ClosestOnSurface { point, ..nearest })
            }
        }
    }

    /// So many times at most a ray is asked to go on.
    pub(crate) fn most_hits(&self) -> usize {
        match self {
            // No ray meets one of the shapes more often than this.
            Self::Shape(_) => 16,
            Self::User(..) if self.is_flat() => 1,
            Self::User(..) => 1 << 16,
        }
    }
}

impl Primitive<f64> for OtherSurface {
    fn bounds(&self) -> Aabb<f64> {
        match self {
            Self::Shape(shape) => shape.bounds(),
            Self::User(user, primitive) => user.bounds(*primitive),
        }
    }

    fn closest_hit(&self, ray: &Ray<f64>) -> Option<SurfaceHit<f64>> {
        match self {
            Self::Shape(shape) => shape.closest_hit(ray),
            // Behind the last hit of an interval there is nothing to ask about.
            Self::User(user, primitive) if ray.t_min <= ray.t_max => {
                user.closest_hit(*primitive, ray).filter(|hit| hit.t.is_finite() && ray.contains(hit.t))
            }
            Self::User(..) => None,
        }
    }

    fn closest_hit_fast(&self, ray: &Ray<f64>) -> Option<SurfaceHit<f64>> {
        match self {
            Self::Shape(shape) => shape.closest_hit_fast(ray),
            Self::User(..) => self.closest_hit(ray),
        }
    }

    fn visit_exact(&self, ray: &Ray<f64>, visit: &mut ExactVisitor<'_, f64>) -> bool {
        if let Self::Shape(shape) = self {
            return shape.visit_exact(ray, visit);
        }
        let mut rest = *ray;
        for _ in 0..self.most_hits() {
            let Some(hit) = self.closest_hit(&rest) else { break };
            let t = hit.t;
            if visit(ExactSurfaceHit { hit, crosses: true }, &|| Root::from(t)) == ControlFlow::Break(()) {
                break;
            }
            rest.t_min = t.next_up();
        }
        false
    }

    fn exact_root(&self, ray: &Ray<f64>, t: f64) -> Option<Root> {
        match self {
            Self::Shape(shape) => shape.exact_root(ray, t),
            // What was reported is what it is.
            Self::User(..) => Some(Root::from(t)),
        }
    }

    fn refine(&self, point: DVec3, normal: Option<DVec3>) -> (DVec3, f64) {
        match self {
            Self::Shape(shape) => shape.refine(point, normal),
            Self::User(user, primitive) => user.refine(*primitive, point, normal),
        }
    }

    fn is_flat(&self) -> bool {
        match self {
            Self::Shape(shape) => shape.is_flat(),
            Self::User(user, _) => user.is_flat(),
        }
    }
}
