//! Bodies that move.

use core::ops::ControlFlow;

use firsthit_geometry::frustum::Containment;
use firsthit_geometry::slab::Slabs;
use firsthit_geometry::sweep::{ConvexBody, convex_to_triangle, sphere_to_triangle};
use firsthit_geometry::{Aabb, Ray};
use glam::DVec3;

use super::{VisitedTriangle, Visitor};
use crate::{HitId, Scene};

/// Where a moving sphere first touches a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereHit {
    /// What it touches. Of several at the same `t`, the smallest.
    pub id: HitId,
    /// Ray parameter, in lengths of the ray's direction.
    pub t: f64,
    /// The point of the surface that is touched.
    pub point: DVec3,
    /// The middle of the sphere then.
    pub center: DVec3,
}

impl SphereHit {
    /// From the touched point to the middle of the sphere, unit; zero where that is the same point.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        (self.center - self.point).normalize_or_zero()
    }
}

/// Where a moving convex body first touches a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyHit {
    /// What it touches. Of several at the same `t`, the smallest.
    pub id: HitId,
    /// Ray parameter, in lengths of the ray's direction.
    pub t: f64,
    /// A point of the surface that is touched: the middle of the points of contact, if there are many.
    pub point: DVec3,
    /// From the surface to the body, unit: what keeps them apart before. Zero where they are not at the start.
    pub normal: DVec3,
}

/// What moves.
trait Body {
    type Hit: Copy;
    /// Its box about the point that moves along the ray.
    fn reach(&self) -> Aabb<f64>;
    fn touch(&self, ray: &Ray<f64>, triangle: &VisitedTriangle) -> Option<Self::Hit>;
    fn order(hit: &Self::Hit) -> (f64, HitId);
}

struct Ball(f64);

impl Body for Ball {
    type Hit = SphereHit;

    fn reach(&self) -> Aabb<f64> {
        Aabb::new(DVec3::splat(-self.0), DVec3::splat(self.0))
    }
    fn touch(&self, ray: &Ray<f64>, triangle: &VisitedTriangle) -> Option<SphereHit> {
        let touch = sphere_to_triangle(ray, self.0, triangle.corners)?;
        Some(SphereHit { id: triangle.id, t: touch.t, point: touch.point, center: ray.at(touch.t) })
    }
    fn order(hit: &SphereHit) -> (f64, HitId) {
        (hit.t, hit.id)
    }
}

impl Body for ConvexBody {
    type Hit = BodyHit;

    fn reach(&self) -> Aabb<f64> {
        self.bounds()
    }
    fn touch(&self, ray: &Ray<f64>, triangle: &VisitedTriangle) -> Option<BodyHit> {
        let (touch, normal) = convex_to_triangle(ray, self, triangle.corners)?;
        Some(BodyHit { id: triangle.id, t: touch.t, point: touch.point, normal })
    }
    fn order(hit: &BodyHit) -> (f64, HitId) {
        (hit.t, hit.id)
    }
}

struct Cast<'a, B: Body> {
    ray: &'a Ray<f64>,
    slabs: Slabs<f64>,
    body: &'a B,
    reach: Aabb<f64>,
    best: Option<B::Hit>,
}

impl<'a, B: Body> Cast<'a, B> {
    fn first(scene: &Scene, ray: &'a Ray<f64>, body: &'a B) -> Option<B::Hit> {
        if !(ray.is_valid() && ray.t_min.is_finite()) {
            return None;
        }
        let slabs = Slabs::new(ray.origin, ray.direction);
        let mut cast = Self { ray, slabs, body, reach: body.reach(), best: None };
        // It never breaks.
        let _ = scene.visit(&mut cast);
        cast.best
    }

    /// When the body may touch what is in a box: its point enters and leaves the box grown by the body, and by more than anything
    /// is rounded.
    fn interval(&self, bounds: &Aabb<f64>) -> (f64, f64) {
        let reach = self.reach.min.abs().max(self.reach.max.abs()).max_element();
        let far = (bounds.min - self.ray.origin).abs().max((bounds.max - self.ray.origin).abs()).max_element();
        let room = DVec3::splat((far + reach + self.ray.origin.abs().max_element()) * 2f64.powi(-40));
        let grown = Aabb::new(bounds.min - self.reach.max - room, bounds.max - self.reach.min + room);
        self.slabs.padded(&grown, self.ray.t_min, self.best.map_or(self.ray.t_max, |h| B::order(&h).0))
    }
}

impl<B: Body> Visitor for Cast<'_, B> {
    fn bounds(&mut self, bounds: &Aabb<f64>) -> Containment {
        let (enter, leave) = self.interval(bounds);
        if enter <= leave { Containment::Intersecting } else { Containment::Outside }
    }
    fn triangle(&mut self, triangle: &VisitedTriangle) -> ControlFlow<()> {
        if let Some(hit) = self.body.touch(self.ray, triangle)
            && self.best.is_none_or(|best| B::order(&hit) < B::order(&best))
        {
            self.best = Some(hit);
        }
        ControlFlow::Continue(())
    }
    fn order(&self, bounds: &Aabb<f64>) -> f64 {
        self.interval(bounds).0
    }
}

impl Scene {
    /// Where a sphere whose center moves along the ray first touches a triangle: at the start of the interval if it does so
    /// there. The ray's `t_min` must be finite; a sphere of radius 0 is a point.
    ///
    /// In `f64` in the world at any tier: see [`sphere_to_triangle`]. `None` also for a ray that is not valid and a radius
    /// that is no finite number from 0 on. Analytic shapes have no such query yet.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use firsthit_geometry::Ray;
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles {
    ///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
    ///     triangles: vec![[0, 1, 2]],
    /// }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let scene = builder.build()?;
    ///
    /// // It passes beside the triangle's corner, nearer than its radius.
    /// let ray = Ray::new(DVec3::new(-3.0, 0.0, 5.0), DVec3::NEG_Z);
    /// let hit = scene.cast_sphere(&ray, 5.0).unwrap();
    /// assert_eq!((hit.t, hit.point, hit.center), (1.0, DVec3::ZERO, DVec3::new(-3.0, 0.0, 4.0)));
    /// assert!(scene.cast_sphere(&ray, 2.9).is_none());
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn cast_sphere(&self, ray: &Ray<f64>, radius: f64) -> Option<SphereHit> {
        if !(radius.is_finite() && radius >= 0.0) {
            return None;
        }
        Cast::first(self, ray, &Ball(radius))
    }

    /// Where a convex body first touches a triangle while its origin moves along the ray, without turning: at the start of the
    /// interval if it does so there. The ray's `t_min` must be finite.
    ///
    /// In `f64` in the world at any tier: see [`convex_to_triangle`]. `None` also for a ray that is not valid. Analytic shapes
    /// have no such query yet.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use firsthit_geometry::{Aabb, Ray, sweep::ConvexBody};
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles {
    ///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
    ///     triangles: vec![[0, 1, 2]],
    /// }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let scene = builder.build()?;
    ///
    /// let body = ConvexBody::new(&Aabb::<f64>::new(DVec3::splat(-0.5), DVec3::splat(0.5)).corners())?;
    /// let hit = scene.cast_convex(&Ray::new(DVec3::new(-0.25, 0.0, 5.0), DVec3::NEG_Z), &body).unwrap();
    /// assert_eq!((hit.t, hit.normal), (4.5, DVec3::Z));
    /// assert!(scene.cast_convex(&Ray::new(DVec3::new(-0.75, 0.0, 5.0), DVec3::NEG_Z), &body).is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn cast_convex(&self, ray: &Ray<f64>, body: &ConvexBody) -> Option<BodyHit> {
        Cast::first(self, ray, body)
    }
}
