//! The first few hits.

use core::cmp::Ordering;
use core::ops::ControlFlow;

use firsthit_geometry::Ray;

use super::{Collect, Crossings, Take};
use crate::{Hit, HitId, Scene};

/// Keeps so many of the first, and up to as many more until they are looked through.
struct First<'a, O> {
    count: usize,
    order: O,
    hits: &'a mut Vec<Hit>,
}

impl<O: Fn(&Hit, &Hit) -> Ordering> First<'_, O> {
    /// Forgets all but the first; the last of them is at the end of the list.
    fn look_through(&mut self) {
        if self.hits.len() > self.count {
            self.hits.select_nth_unstable_by(self.count - 1, &self.order);
            self.hits.truncate(self.count);
        }
    }
}

impl<O: Fn(&Hit, &Hit) -> Ordering> Take for First<'_, O> {
    fn take(&mut self, hit: Hit, t_max: &mut f64) -> ControlFlow<(), bool> {
        self.hits.push(hit);
        if self.hits.len() >= self.count.saturating_mul(2) {
            self.look_through();
            if let Some(last) = self.hits.last() {
                // A little later: at `Exact` the interval is compared with what is not rounded yet.
                *t_max = t_max.min(last.t.next_up());
            }
        }
        // Of a shape the next root is wanted too.
        ControlFlow::Continue(false)
    }
}

impl Scene {
    /// The first `count` of [`Scene::all_hits`], found without most of the others: what lies far behind the last of them
    /// is not looked at.
    ///
    /// ```
    /// use firsthit_accel::{Crossings, Geometry, SceneBuilder};
    /// use firsthit_geometry::Ray;
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: vec![[0, 1, 2]] }]);
    /// for depth in 0..100 {
    ///     builder.add_instance(mesh, DAffine3::from_translation(DVec3::NEG_Z * f64::from(depth)));
    /// }
    /// let ray = Ray::new(DVec3::new(0.2, 0.2, 1.0), DVec3::NEG_Z);
    /// let hits = builder.build()?.first_k_hits(&ray, 3, Crossings::Surfaces);
    /// assert_eq!(hits.iter().map(|h| h.t).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn first_k_hits(&self, ray: &Ray<f64>, count: usize, crossings: Crossings) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.first_k_hits_filtered_into(ray, count, crossings, None, |_| true, &mut hits);
        hits
    }

    /// As [`Scene::first_k_hits`], of the hits that `accept` accepts, other than on the flat primitive `source`, into a list that
    /// is emptied first and may be used again. `accept` is asked about hits in any order.
    pub fn first_k_hits_filtered_into(
        &self,
        ray: &Ray<f64>,
        count: usize,
        crossings: Crossings,
        source: Option<HitId>,
        mut accept: impl FnMut(&Hit) -> bool,
        hits: &mut Vec<Hit>,
    ) {
        hits.clear();
        if count == 0 {
            return;
        }
        let order = |a: &Hit, b: &Hit| self.order(ray, a, b);
        let accept = |hit: &Hit| accept(&self.finished(*hit));
        let mut first = Collect::new(ray, self.flat(source), accept, First { count, order, hits: &mut *hits });
        // It never breaks.
        let _ = self.collect(ray, crossings, &mut first);
        first.take.look_through();
        hits.sort_by(|a, b| self.order(ray, a, b));
        for hit in hits {
            *hit = self.finished(*hit);
        }
    }
}
