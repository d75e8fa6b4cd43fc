//! A sphere that moves.

use core::ops::ControlFlow;

use firsthit_geometry::frustum::Containment;
use firsthit_geometry::slab::Slabs;
use firsthit_geometry::sweep::sphere_to_triangle;
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

struct Cast<'a> {
    ray: &'a Ray<f64>,
    slabs: Slabs<f64>,
    radius: f64,
    best: Option<SphereHit>,
}

impl Cast<'_> {
    /// When the center enters and leaves a box that is grown by the radius, and by more than anything is rounded.
    fn interval(&self, bounds: &Aabb<f64>) -> (f64, f64) {
        let far = (bounds.min - self.ray.origin).abs().max((bounds.max - self.ray.origin).abs()).max_element();
        let grown =
            DVec3::splat(self.radius + (far + self.radius + self.ray.origin.abs().max_element()) * 2f64.powi(-40));
        let grown = Aabb::new(bounds.min - grown, bounds.max + grown);
        self.slabs.padded(&grown, self.ray.t_min, self.best.map_or(self.ray.t_max, |h| h.t))
    }
}

impl Visitor for Cast<'_> {
    fn bounds(&mut self, bounds: &Aabb<f64>) -> Containment {
        let (enter, leave) = self.interval(bounds);
        if enter <= leave { Containment::Intersecting } else { Containment::Outside }
    }
    fn triangle(&mut self, triangle: &VisitedTriangle) -> ControlFlow<()> {
        if let Some(touch) = sphere_to_triangle(self.ray, self.radius, triangle.corners)
            && self.best.is_none_or(|best| (touch.t, triangle.id) < (best.t, best.id))
        {
            let center = self.ray.at(touch.t);
            self.best = Some(SphereHit { id: triangle.id, t: touch.t, point: touch.point, center });
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
        if !(ray.is_valid() && ray.t_min.is_finite() && radius.is_finite() && radius >= 0.0) {
            return None;
        }
        let mut cast = Cast { ray, slabs: Slabs::new(ray.origin, ray.direction), radius, best: None };
        // It never breaks.
        let _ = self.visit(&mut cast);
        cast.best
    }
}
