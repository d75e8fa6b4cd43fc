//! Many rays on many threads.

use firsthit_geometry::Ray;
use rayon::prelude::*;

use crate::{Hit, Scene};

/// Rays that one task takes.
pub(super) const CHUNK: usize = 1024;

impl Scene {
    /// As [`Scene::closest_hits`], on the threads of the rayon pool it is called from. The same bits for any number.
    pub fn par_closest_hits(&self, rays: &[Ray<f64>], hits: &mut [Option<Hit>]) {
        rays.par_chunks(CHUNK).zip(hits.par_chunks_mut(CHUNK)).for_each(|(r, h)| self.closest_hits(r, h));
    }

    /// As [`Scene::any_hits`], on the threads of the rayon pool it is called from.
    pub fn par_any_hits(&self, rays: &[Ray<f64>], hits: &mut [bool]) {
        rays.par_chunks(CHUNK).zip(hits.par_chunks_mut(CHUNK)).for_each(|(r, h)| self.any_hits(r, h));
    }
}
