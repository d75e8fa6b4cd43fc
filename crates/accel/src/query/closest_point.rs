//! The surface's nearest point, and how far it is.

use firsthit_geometry::distance::Feature;
use glam::DVec3;
use rayon::prelude::*;

use super::batch::CHUNK;
use crate::nearest::{Keep, Near, Seen};
use crate::scene::Inner;
use crate::{HitId, Scene};

/// A point of a surface, as seen from the point that is asked about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// On which triangle it lies. Of several that are equally near, the smallest.
    pub id: HitId,
    /// The point in the world.
    pub point: DVec3,
    /// Distance from the point that is asked about, in world units.
    pub distance: f64,
    /// Weight of the triangle's second vertex.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
    /// What of the triangle the point lies on.
    pub feature: Feature,
    /// The geometric normal of the triangle in the world, by its winding, of any length: see [`ClosestPoint::normal`].
    pub normal_direction: DVec3,
}

impl ClosestPoint {
    /// Weights of the triangle's three vertices; they add up to 1. See [`Hit::interpolate`](crate::Hit::interpolate).
    #[inline]
    #[must_use]
    pub fn weights(&self) -> [f32; 3] {
        [1.0 - self.u - self.v, self.u, self.v]
    }

    /// Unit geometric normal of the triangle in the world, by its winding.
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
}

/// The square of a radius, not too small; what is found within has still to be compared by its distance.
pub(super) fn within(radius: f64) -> f64 {
    radius * radius * (1.0 + 4.0 * f64::EPSILON)
}

/// Instance and number of the triangle that is nearest to the last point: the next point's may not be far from it.
type Last = Option<(u32, u32)>;

/// What is nearest to a point.
impl Scene {
    /// The point of the triangles that is nearest to `point`; of several, that on the triangle with the smallest id.
    /// `None` if there is no triangle, or the point is not finite.
    ///
    /// At every tier it is found in `f64`, relative to the point: its error is some units in the last place of the largest
    /// of the distance and the coordinates of the triangle as seen from the point. (Squares of distances must be numbers:
    /// those of more than 1e150 are all alike, and so are those of less than 1e-150.) Triangles of which two corners
    /// coincide are not part of the surface; nor are analytic shapes, which have no such query yet.
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

    /// Distance of the nearest point of the triangles, in world units; infinite if there is none, NaN for a point that is
    /// not finite. See [`Scene::closest_point`].
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        self.distance_after(point, &mut None)
    }

    /// [`Scene::distance`] for each point, into the slot of the same index. The shorter slice decides how many.
    pub fn distances(&self, points: &[DVec3], distances: &mut [f64]) {
        let mut last = None;
        for (point, distance) in points.iter().zip(distances) {
            *distance = self.distance_after(*point, &mut last);
        }
    }

    /// As [`Scene::distances`], on the threads of the rayon pool it is called from. The same bits for any number.
    pub fn par_distances(&self, points: &[DVec3], distances: &mut [f64]) {
        let chunks = points.par_chunks(CHUNK).zip(distances.par_chunks_mut(CHUNK));
        chunks.for_each(|(points, distances)| self.distances(points, distances));
    }

    fn distance_after(&self, point: DVec3, last: &mut Last) -> f64 {
        if !point.is_finite() {
            return f64::NAN;
        }
        self.nearest_of(point, f64::INFINITY, last).map_or(f64::INFINITY, |near| near.at.point.length())
    }

    fn nearest(&self, point: DVec3, radius: f64, last: &mut Last) -> Option<ClosestPoint> {
        self.nearest_of(point, radius, last).and_then(|near| self.closest(point, &near))
    }

    fn nearest_of(&self, point: DVec3, radius: f64, last: &mut Last) -> Option<Near> {
        if !(point.is_finite() && radius >= 0.0) {
            return None;
        }
        let mut keep = Nearest { limit: within(radius), best: None };
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
        let [a, b, c] = model.corners(part)?;
        let [_, u, v] = near.at.weights;
        Some(ClosestPoint {
            id: HitId { instance: near.instance, geometry: part.geometry, primitive: part.primitive },
            point: point + near.at.point,
            distance: near.at.point.length(),
            u: u as f32,
            v: v as f32,
            feature: near.at.feature(),
            normal_direction: instance.transform.normal_direction((b - a).cross(c - a)),
        })
    }
}

impl Inner {
    /// Offers one triangle, if it lies within the limit.
    fn measure(&self, point: DVec3, instance: u32, number: u32, keep: &mut dyn Keep) {
        let placed = &self.instances[instance as usize];
        let model = &self.models[placed.model as usize];
        if let Some(corners) = model.of_number(number).and_then(|part| model.corners(part)) {
            Seen::new(model, instance, &placed.transform, point).triangle(number, &corners, keep);
        }
    }

    /// Offers what lies within the limit of what keeps it.
    pub(crate) fn near(&self, point: DVec3, keep: &mut dyn Keep) {
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
