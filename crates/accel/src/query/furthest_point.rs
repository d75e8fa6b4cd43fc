//! The surface's furthest point.

use core::ops::ControlFlow;

use firsthit_geometry::Aabb;
use firsthit_geometry::distance::Feature;
use firsthit_geometry::frustum::Containment;
use glam::DVec3;
use rayon::prelude::*;

use super::batch::CHUNK;
use crate::model::Surface;
use crate::{ClosestPoint, HitId, Scene, VisitedTriangle, Visitor};

/// A corner of a triangle, as seen from a point.
#[derive(Clone, Copy, Debug)]
struct Far {
    squared: f64,
    id: HitId,
    vertex: u8,
    /// Relative to the point.
    corner: DVec3,
}

impl Far {
    /// The furthest of a triangle's corners, of several the first.
    fn of(id: HitId, corners: [DVec3; 3]) -> Self {
        let far = |vertex: u8| {
            let corner = corners[usize::from(vertex)];
            Self { squared: corner.length_squared(), id, vertex, corner }
        };
        [far(1), far(2)].into_iter().fold(far(0), |best, other| if other.squared > best.squared { other } else { best })
    }

    /// Those farther away come first, of those that are equally far the one with the smaller id.
    fn comes_before(&self, other: &Self) -> bool {
        self.squared > other.squared || self.squared == other.squared && self.id < other.id
    }
}

/// Looks for the furthest triangle, in the farthest boxes first.
struct Furthest<'a> {
    scene: &'a Scene,
    point: DVec3,
    best: Option<Far>,
}

/// Of boxes and corners the distances are rounded otherwise.
const ROOM: f64 = 1.0 + 1e-12;

impl Furthest<'_> {
    /// Nothing in a box is farther away, squared.
    fn most(&self, bounds: &Aabb<f64>) -> f64 {
        (self.point - bounds.min).abs().max((bounds.max - self.point).abs()).length_squared() * ROOM
    }

    fn measure(&mut self, id: HitId) {
        let Some(corners) = self.scene.seen_from(self.point, &id) else { return };
        let far = Far::of(id, corners);
        if !far.squared.is_nan() && self.best.is_none_or(|best| far.comes_before(&best)) {
            self.best = Some(far);
        }
    }
}

impl Visitor for Furthest<'_> {
    fn bounds(&mut self, bounds: &Aabb<f64>) -> Containment {
        // What is no number may be anywhere.
        let beaten = self.best.is_some_and(|best| self.most(bounds) < best.squared);
        if beaten { Containment::Outside } else { Containment::Intersecting }
    }

    fn triangle(&mut self, triangle: &VisitedTriangle) -> ControlFlow<()> {
        self.measure(triangle.id);
        ControlFlow::Continue(())
    }

    fn order(&self, bounds: &Aabb<f64>) -> f64 {
        -self.most(bounds)
    }
}

/// What is furthest from a point.
impl Scene {
    /// The point of the triangles that is furthest from `point`, a vertex ([`Feature::Vertex`]); of several, that of the
    /// triangle with the smallest id. `None` if there is no triangle, or the point is not finite.
    ///
    /// As [`Scene::closest_point`] at every tier in `f64`, relative to the point, and of the same triangles; so are errors and
    /// ranges. The distance bounds those of all points of the surface: a ball of that radius holds the scene.
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
    /// builder.add_instance(mesh, DAffine3::from_translation(DVec3::new(0.0, 0.0, -4.0)));
    /// let scene = builder.build()?;
    ///
    /// let furthest = scene.furthest_point(DVec3::new(-2.0, 0.0, 0.0)).unwrap();
    /// assert_eq!(furthest.point, DVec3::new(1.0, 0.0, -4.0));
    /// assert_eq!((furthest.distance, furthest.feature), (5.0, Feature::Vertex(1)));
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn furthest_point(&self, point: DVec3) -> Option<ClosestPoint> {
        self.furthest_after(point, &mut None)
    }

    /// [`Scene::furthest_point`] for each point, into the slot of the same index. The shorter slice decides how many. The
    /// same bits; points that follow each other and have the same furthest triangle are answered sooner.
    pub fn furthest_points(&self, points: &[DVec3], found: &mut [Option<ClosestPoint>]) {
        let mut last = None;
        for (point, found) in points.iter().zip(found) {
            *found = self.furthest_after(*point, &mut last);
        }
    }

    /// As [`Scene::furthest_points`], on the threads of the rayon pool it is called from. The same bits for any number.
    pub fn par_furthest_points(&self, points: &[DVec3], found: &mut [Option<ClosestPoint>]) {
        let chunks = points.par_chunks(CHUNK).zip(found.par_chunks_mut(CHUNK));
        chunks.for_each(|(points, found)| self.furthest_points(points, found));
    }

    fn furthest_after(&self, point: DVec3, last: &mut Option<HitId>) -> Option<ClosestPoint> {
        if !point.is_finite() {
            return None;
        }
        let mut furthest = Furthest { scene: self, point, best: None };
        if let Some(last) = *last {
            furthest.measure(last);
        }
        // It never breaks.
        let _ = self.visit(&mut furthest);
        let best = furthest.best?;
        *last = Some(best.id);
        let (instance, surface) = self.surface(&best.id)?;
        let Surface::Triangle([a, b, c]) = surface else { return None };
        Some(ClosestPoint {
            id: best.id,
            point: point + best.corner,
            distance: best.corner.length(),
            u: if best.vertex == 1 { 1.0 } else { 0.0 },
            v: if best.vertex == 2 { 1.0 } else { 0.0 },
            feature: Feature::Vertex(best.vertex),
            normal_direction: instance.transform.normal_direction((b - a).cross(c - a)),
        })
    }

    /// The corners of a triangle relative to a point of the world.
    fn seen_from(&self, point: DVec3, id: &HitId) -> Option<[DVec3; 3]> {
        let (instance, surface) = self.surface(id)?;
        let Surface::Triangle(corners) = surface else { return None };
        let (linear, offset) = (instance.transform.linear(), instance.transform.translation() - point);
        Some(corners.map(|p| linear * p + offset))
    }
}
