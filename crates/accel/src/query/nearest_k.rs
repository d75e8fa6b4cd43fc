//! The nearest triangles and shapes.

use std::collections::BinaryHeap;

use glam::DVec3;

use super::closest_point::within;
use crate::nearest::{Keep, Near};
use crate::{ClosestPoint, Scene};

/// By distance, then id.
struct Ordered(Near);

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        let key = |n: &Near| (n.instance, n.number);
        self.0.squared.total_cmp(&other.0.squared).then(key(&self.0).cmp(&key(&other.0)))
    }
}
impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Ordered {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Ordered {}

/// Keeps so many, the farthest on top.
struct Few {
    count: usize,
    limit: f64,
    heap: BinaryHeap<Ordered>,
}

impl Keep for Few {
    fn limit(&self) -> f64 {
        self.limit
    }
    fn offer(&mut self, near: Near) {
        self.heap.push(Ordered(near));
        if self.heap.len() > self.count {
            self.heap.pop();
        }
        if self.heap.len() == self.count
            && let Some(farthest) = self.heap.peek()
        {
            self.limit = farthest.0.squared;
        }
    }
}

impl Scene {
    /// The `count` triangles, shapes and primitives of the user's own that are nearest to `point` and not farther than
    /// `radius`, each with its nearest point: by distance, then by id. See [`Scene::closest_point`].
    ///
    /// ```
    /// # use firsthit_accel::{Geometry, SceneBuilder};
    /// # use glam::{DAffine3, DVec3, Vec3};
    /// # let mut builder = SceneBuilder::default();
    /// let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, -Vec3::X];
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2], [0, 2, 3]] }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let near = builder.build()?.nearest_k(DVec3::new(-0.25, 0.25, 1.0), 2, 9.0);
    /// assert_eq!(near.iter().map(|n| n.id.primitive).collect::<Vec<_>>(), [1, 0]);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn nearest_k(&self, point: DVec3, count: usize, radius: f64) -> Vec<ClosestPoint> {
        if count == 0 || !(point.is_finite() && radius >= 0.0) {
            return Vec::new();
        }
        let mut keep = Few { count, limit: within(radius), heap: BinaryHeap::new() };
        self.inner().near(point, &mut keep);
        let near = keep.heap.into_sorted_vec();
        let inside = near.iter().filter(|near| near.0.squared.sqrt() <= radius);
        inside.filter_map(|near| self.closest(point, &near.0)).collect()
    }
}
