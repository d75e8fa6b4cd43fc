//! How many hits there are.

use core::ops::ControlFlow;

use firsthit_geometry::Ray;
use rayon::prelude::*;

use super::{Collect, Crossings, Take, batch::CHUNK};
use crate::{Hit, HitId, Scene};

/// Counts the hits.
pub(super) struct Count(pub(super) u32);

impl Take for Count {
    #[inline(always)]
    fn take(&mut self, _: Hit, _: &mut f64) -> ControlFlow<(), bool> {
        self.0 += 1;
        ControlFlow::Continue(false)
    }
}

impl Scene {
    /// How many hits the ray has in its closed interval: the length of [`Scene::all_hits`], without the list.
    ///
    /// With [`Crossings::Surfaces`] the count tells inside from outside: a ray without end that starts inside a closed
    /// mesh counts an odd number, one from outside an even number, whichever way it goes, through edges and vertices
    /// too (at the tiers but `Fast`).
    #[must_use]
    pub fn count_hits(&self, ray: &Ray<f64>, crossings: Crossings) -> u32 {
        let mut count = 0;
        if !self.inner().tally(core::slice::from_ref(ray), crossings, core::slice::from_mut(&mut count)) {
            count = self.count_hits_filtered(ray, crossings, None, |_| true);
        }
        count
    }

    /// As [`Scene::count_hits`], of the hits that `accept` accepts, other than on the flat primitive `source`. `accept`
    /// is asked about each hit once, in any order.
    #[must_use]
    pub fn count_hits_filtered(
        &self,
        ray: &Ray<f64>,
        crossings: Crossings,
        source: Option<HitId>,
        mut accept: impl FnMut(&Hit) -> bool,
    ) -> u32 {
        let accept = |hit: &Hit| accept(&self.finished(*hit));
        let mut count = Collect::new(ray, self.flat(source), accept, Count(0));
        // It never breaks.
        let _ = self.collect(ray, crossings, &mut count);
        count.take.0
    }

    /// [`Scene::count_hits`] for each ray, into the slot of the same index. The shorter slice decides how many.
    pub fn count_hits_each(&self, rays: &[Ray<f64>], crossings: Crossings, counts: &mut [u32]) {
        if !self.inner().tally(rays, crossings, counts) {
            for (ray, count) in rays.iter().zip(counts) {
                *count = self.count_hits_filtered(ray, crossings, None, |_| true);
            }
        }
    }

    /// As [`Scene::count_hits_each`], on the threads of the rayon pool it is called from.
    pub fn par_count_hits(&self, rays: &[Ray<f64>], crossings: Crossings, counts: &mut [u32]) {
        rays.par_chunks(CHUNK)
            .zip(counts.par_chunks_mut(CHUNK))
            .for_each(|(r, c)| self.count_hits_each(r, crossings, c));
    }
}
