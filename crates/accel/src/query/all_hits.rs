//! Every hit.

use core::ops::ControlFlow;

use firsthit_geometry::Ray;
use rayon::prelude::*;

use super::{Collect, Crossings, Take, batch::CHUNK};
use crate::{Hit, HitId, Scene};

/// Keeps every hit.
pub(crate) struct All<'a>(pub(crate) &'a mut Vec<Hit>);

impl Take for All<'_> {
    #[inline(always)]
    fn take(&mut self, hit: Hit, _: &mut f64) -> ControlFlow<(), bool> {
        self.0.push(hit);
        // Never "taken": of a shape the next root is wanted too.
        ControlFlow::Continue(false)
    }
}

/// The hits of many rays, one list after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HitLists {
    hits: Vec<Hit>,
    /// End of each ray's hits.
    ends: Vec<usize>,
}

impl HitLists {
    /// The hits of ray `index`, as [`Scene::all_hits`] gives them; `None` if there was no such ray.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&[Hit]> {
        let end = *self.ends.get(index)?;
        let start = if index > 0 { self.ends[index - 1] } else { 0 };
        self.hits.get(start..end)
    }

    /// The lists in the order of the rays.
    pub fn iter(&self) -> impl Iterator<Item = &[Hit]> {
        (0..self.len()).filter_map(|i| self.get(i))
    }

    /// All hits of all rays.
    #[must_use]
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }

    /// Number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there was no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    fn push(&mut self, hits: &[Hit]) {
        self.hits.extend_from_slice(hits);
        self.ends.push(self.hits.len());
    }

    fn append(&mut self, other: &Self) {
        let start = self.hits.len();
        self.hits.extend_from_slice(&other.hits);
        self.ends.extend(other.ends.iter().map(|e| e + start));
    }
}

impl Scene {
    /// Every hit in the ray's closed interval, sorted by `t`, then by id (at `Exact` first by the exact order, where
    /// triangles of one instance have the same rounded `t`); none for an invalid ray. Of a shape, every
    /// root.
    ///
    /// What counts where the ray passes through an edge is up to `crossings`. With [`Crossings::Triangles`] the first is
    /// [`Scene::closest_hit`], and a ray that starts at a hit's `t` finds it and its equals again (at `Exact`, where
    /// the interval is compared with the exact `t` before that is rounded, one that starts at `t.next_down()`).
    ///
    /// ```
    /// use firsthit_accel::{Crossings, Geometry, SceneBuilder};
    /// use firsthit_geometry::Ray;
    /// use glam::{DAffine3, DVec3, Vec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let square = builder.add_mesh(vec![Geometry::Triangles {
    ///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
    ///     triangles: vec![[0, 1, 2], [0, 2, 3]],
    /// }]);
    /// builder.add_instance(square, DAffine3::IDENTITY);
    /// let scene = builder.build()?;
    /// // Through the diagonal: two triangles have the point, one surface is crossed.
    /// let ray = Ray::new(DVec3::new(0.5, 0.5, 1.0), DVec3::NEG_Z);
    /// assert_eq!(scene.all_hits(&ray, Crossings::Triangles).len(), 2);
    /// assert_eq!(scene.all_hits(&ray, Crossings::Surfaces).len(), 1);
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[must_use]
    pub fn all_hits(&self, ray: &Ray<f64>, crossings: Crossings) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.all_hits_into(ray, crossings, &mut hits);
        hits
    }

    /// As [`Scene::all_hits`], into a list that is emptied first and may be used again.
    pub fn all_hits_into(&self, ray: &Ray<f64>, crossings: Crossings, hits: &mut Vec<Hit>) {
        self.all_hits_filtered_into(ray, crossings, None, |_| true, hits);
    }

    /// As [`Scene::all_hits_into`], of the hits that `accept` accepts, other than on the flat primitive `source`.
    /// `accept` is asked about each hit once, in any order.
    pub fn all_hits_filtered_into(
        &self,
        ray: &Ray<f64>,
        crossings: Crossings,
        source: Option<HitId>,
        mut accept: impl FnMut(&Hit) -> bool,
        hits: &mut Vec<Hit>,
    ) {
        hits.clear();
        let accept = |hit: &Hit| accept(&self.finished(*hit));
        let mut all = Collect::new(ray, self.flat(source), accept, All(hits));
        // It never breaks.
        let _ = self.collect(ray, crossings, &mut all);
        let hits = all.take.0;
        hits.sort_by(|a, b| self.order(ray, a, b));
        for hit in hits {
            *hit = self.finished(*hit);
        }
    }

    /// [`Scene::all_hits`] for each ray.
    #[must_use]
    pub fn all_hits_each(&self, rays: &[Ray<f64>], crossings: Crossings) -> HitLists {
        let mut lists = HitLists::default();
        let mut hits = Vec::new();
        for ray in rays {
            self.all_hits_into(ray, crossings, &mut hits);
            lists.push(&hits);
        }
        lists
    }

    /// As [`Scene::all_hits_each`], on the threads of the rayon pool it is called from. The same bits for any number.
    #[must_use]
    pub fn par_all_hits(&self, rays: &[Ray<f64>], crossings: Crossings) -> HitLists {
        let chunks: Vec<HitLists> = rays.par_chunks(CHUNK).map(|r| self.all_hits_each(r, crossings)).collect();
        let mut lists = HitLists::default();
        chunks.iter().for_each(|c| lists.append(c));
        lists
    }
}
