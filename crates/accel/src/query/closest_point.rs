//! The surface's nearest point, and how far it is.

use firsthit_geometry::distance::Feature;
use glam::DVec3;
use rayon::prelude::*;

use super::batch::CHUNK;
use crate::model::Surface;
use crate::nearest::{Keep, Near, Seen};
use crate::scene::Inner;
use crate::{HitId, Scene};

/// A point of a surface, as seen from the point that is asked about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// On which triangle, shape or primitive of the user's own it lies. Of several that are equally near, the smallest.
    pub id: HitId,
    /// The point in the world.
    pub point: DVec3,
    /// Distance from the point that is asked about, in world units.
    pub distance: f64,
    /// Weight of the triangle's second vertex; a shape's own first parameter.
    pub u: f32,
    /// Weight of the triangle's third vertex; a shape's own second parameter.
    pub v: f32,
    /// What of the triangle the point lies on; of shapes always [`Feature::Face`].
    pub feature: Feature,
    /// The geometric normal there in the world, of a triangle by its winding, of any length: see [`ClosestPoint::normal`]. Zero
    /// where there is none (the apex of a cone).
    pub normal_direction: DVec3,
}

impl ClosestPoint {
    /// Weights of the triangle's three vertices; they add up to 1. (The parameters of a shape are not weights.) See [`Hit::interpolate`](crate::Hit::interpolate).
    #[inline]
    #[must_use]
    pub fn weights(&self) -> [f32; 3] {
        [1.0 - self.u - self.v, self.u, self.v]
    }

    /// Unit geometric normal in the world, of a triangle by its winding.
    #[inline]
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal_direction.normalize_or_zero()
    }
}

/// Keeps the nearest.
struct Nearest {
    limit: f64,
    best: Option<Near>,
    shapes: bool,
}

impl Keep for Nearest {
    fn limit(&self) -> f64 {
        self.limit
    }
    fn offer(&mut self, near: Near) {
        if self.best.is_none_or(|best| near.comes_before(&best)) {
            self.limit = near.squared;
            self.best = Some(near);
        }
    }
    fn shapes(&self) -> bool {
        self.shapes
    }
}

/// The square of a radius, not too small; what is found within has still to be compared by its distance.
pub(super) fn within(radius: f64) -> f64 {
    radius * radius * (1.0 + 4.0 * f64::EPSILON)
}

/// Instance and number of what is nearest to the last point: the next point's may not be far from it.
type Last = Option<(u32, u32)>;

/// What is nearest to a point.
impl Scene {
    /// The point of the surface that is nearest to `point`: of triangles, analytic shapes and primitives of the user's own;
    /// of several, that with the smallest id. `None` if there is no surface, or the point is not finite.
    ///
    /// At every tier it is found in `f64`, relative to the point: its error is some units in the last place of the largest
    /// of the distance and the coordinates of the triangle or shape as seen from the point. (Squares of distances must be
    /// numbers: those of more than 1e150 are all alike, and so are those of less than 1e-150.)
    ///
    /// Not part of the surface are triangles of which two corners coincide, and what has no nearest points: shapes as told at
    /// [`Shape::closest_point`](firsthit_geometry::Shape::closest_point), and primitives of the user's own without
    /// [`UserPrimitives::closest_point`](crate::UserPrimitives::closest_point). Spheres, ellipsoids, planes, disks, polygons
    /// and boxes have them in every instance; cylinders, cones and primitives of the user's own only where the instance's
    /// transform keeps angles. Closed shapes are surfaces too: from inside it is their boundary that is near.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use firsthit_geometry::distance::Feature;
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles {
    ///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
    ///     triangles: vec![[0, 1, 2]],
    /// }]);
    /// builder.add_instance(mesh, DAffine3::from_translation(DVec3::new(0.0, 0.0, -5.0)));
    /// let scene = builder.build()?;
    ///
    /// let nearest = scene.closest_point(DVec3::new(0.5, -3.0, -1.0)).unwrap();
    /// assert_eq!(nearest.point, DVec3::new(0.5, 0.0, -5.0));
    /// assert_eq!((nearest.distance, nearest.feature), (5.0, Feature::Edge(0)));
    /// assert!(scene.closest_point_within(DVec3::ZERO, 4.0).is_none());
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn closest_point(&self, point: DVec3) -> Option<ClosestPoint> {
        self.closest_point_within(point, f64::INFINITY)
    }

    /// The same, if it is not farther than `radius`, in world units.
    #[must_use]
    pub fn closest_point_within(&self, point: DVec3, radius: f64) -> Option<ClosestPoint> {
        self.nearest(point, radius, &mut None)
    }

    /// [`Scene::closest_point_within`] for each point, into the slot of the same index. The shorter slice decides how
    /// many. The same bits; points that follow each other and are near each other are answered sooner.
    pub fn closest_points(&self, points: &[DVec3], radius: f64, found: &mut [Option<ClosestPoint>]) {
        let mut last = None;
        for (point, found) in points.iter().zip(found) {
            *found = self.nearest(*point, radius, &mut last);
        }
    }

    /// As [`Scene::closest_points`], on the threads of the rayon pool it is called from. The same bits for any number.
    pub fn par_closest_points(&self, points: &[DVec3], radius: f64, found: &mut [Option<ClosestPoint>]) {
        let chunks = points.par_chunks(CHUNK).zip(found.par_chunks_mut(CHUNK));
        chunks.for_each(|(points, found)| self.closest_points(points, radius, found));
    }

    /// Distance of the nearest point of the surface, in world units; infinite if there is none, NaN for a point that is
    /// not finite. See [`Scene::closest_point`].
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        self.distance_after(point, true, &mut None)
    }

    /// [`Scene::distance`] for each point, into the slot of the same index. The shorter slice decides how many.
    pub fn distances(&self, points: &[DVec3], distances: &mut [f64]) {
        let mut last = None;
        for (point, distance) in points.iter().zip(distances) {
            *distance = self.distance_after(*point, true, &mut last);
        }
    }

    /// As [`Scene::distances`], on the threads of the rayon pool it is called from. The same bits for any number.
    pub fn par_distances(&self, points: &[DVec3], distances: &mut [f64]) {
        let chunks = points.par_chunks(CHUNK).zip(distances.par_chunks_mut(CHUNK));
        chunks.for_each(|(points, distances)| self.distances(points, distances));
    }

    /// [`Scene::distances`] of the triangles alone.
    pub(crate) fn distances_of_triangles(&self, points: &[DVec3], distances: &mut [f64]) {
        let mut last = None;
        for (point, distance) in points.iter().zip(distances) {
            *distance = self.distance_after(*point, false, &mut last);
        }
    }

    fn distance_after(&self, point: DVec3, shapes: bool, last: &mut Last) -> f64 {
        if !point.is_finite() {
            return f64::NAN;
        }
        self.nearest_of(point, f64::INFINITY, shapes, last).map_or(f64::INFINITY, |near| near.at.point.length())
    }

    fn nearest(&self, point: DVec3, radius: f64, last: &mut Last) -> Option<ClosestPoint> {
        self.nearest_of(point, radius, true, last).and_then(|near| self.closest(point, &near))
    }

    fn nearest_of(&self, point: DVec3, radius: f64, shapes: bool, last: &mut Last) -> Option<Near> {
        if !(point.is_finite() && radius >= 0.0) {
            return None;
        }
        let mut keep = Nearest { limit: within(radius), best: None, shapes };
        if let Some((instance, number)) = *last {
            self.inner().measure(point, instance, number, &mut keep);
        }
        self.inner().near(point, &mut keep);
        if let Some(best) = &keep.best {
            *last = Some((best.instance, best.number));
        }
        keep.best.filter(|near| near.squared.sqrt() <= radius)
    }

    /// What users get of it.
    pub(crate) fn closest(&self, point: DVec3, near: &Near) -> Option<ClosestPoint> {
        let instance = self.instances().get(near.instance as usize)?;
        let model = self.models().get(instance.model as usize)?;
        let part = model.of_number(near.number)?;
        let transform = &instance.transform;
        let (u, v, normal) = match model.surface(part)? {
            Surface::Triangle([a, b, c]) => {
                let [_, u, v] = near.at.weights;
                (u, v, (b - a).cross(c - a))
            }
            Surface::Shape(shape) => {
                let on = shape.closest_to_origin(transform.linear(), transform.translation() - point)?;
                (on.u, on.v, on.normal.unwrap_or(DVec3::ZERO))
            }
        };
        Some(ClosestPoint {
            id: HitId { instance: near.instance, geometry: part.geometry, primitive: part.primitive },
            point: point + near.at.point,
            distance: near.at.point.length(),
            u: u as f32,
            v: v as f32,
            feature: near.at.feature(),
            normal_direction: transform.normal_direction(normal),
        })
    }
}

impl Inner {
    /// Offers one triangle or shape, if it lies within the limit.
    fn measure(&self, point: DVec3, instance: u32, number: u32, keep: &mut dyn Keep) {
        let (placed, model) = self.placed(instance);
        let seen = Seen::new(model, instance, &placed.transform, point);
        match model.of_number(number).and_then(|part| model.surface(part)) {
            Some(Surface::Triangle(corners)) => seen.triangle(number, &corners, keep),
            Some(Surface::Shape(shape)) => seen.shape(number, shape, keep),
            None => {}
        }
    }

    /// Offers what lies within the limit of what keeps it.
    pub(crate) fn near(&self, point: DVec3, keep: &mut dyn Keep) {
        if self.has_unbounded() && keep.shapes() {
            for &i in self.unbounded() {
                let (instance, model) = self.placed(i);
                Seen::new(model, i, &instance.transform, point).search_unbounded(keep);
            }
        }
        self.above().nearest(point, keep.limit(), &mut |run| {
            for &k in run {
                let i = self.bounded(k);
                let instance = &self.instances[i as usize];
                Seen::new(&self.models[instance.model as usize], i, &instance.transform, point).search(keep);
            }
            keep.limit()
        });
    }
}
