//! How far a build has come, and whether it is to go on.

use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::{BuildError, Geometry};

/// Is told which part of the work is done, from 0 to 1, by any thread; breaking cancels the build.
pub(crate) type Watch<'a> = Option<&'a (dyn Fn(f64) -> ControlFlow<()> + Sync)>;

/// The work of building some meshes.
pub(crate) struct Progress<'a> {
    watch: Watch<'a>,
    total: u64,
    done: AtomicU64,
    cancelled: AtomicBool,
}

/// A mesh's work is told in so many steps.
const STEPS: u64 = 8;

impl<'a> Progress<'a> {
    pub(crate) fn of(meshes: &[Vec<Geometry>], watch: Watch<'a>) -> Self {
        let total = meshes.iter().map(|mesh| size(mesh)).sum::<u64>() * STEPS;
        Self { watch, total, done: AtomicU64::new(0), cancelled: AtomicBool::new(false) }
    }

    /// That nobody looks at.
    pub(crate) fn unwatched() -> Self {
        Self::of(&[], None)
    }

    /// So many of the steps of a mesh are done.
    pub(crate) fn advance(&self, mesh: &[Geometry], steps: u64) -> Result<(), BuildError> {
        let Some(watch) = self.watch else { return Ok(()) };
        let new = size(mesh) * steps;
        let done = self.done.fetch_add(new, Ordering::Relaxed) + new;
        let goes_on = !self.cancelled.load(Ordering::Relaxed)
            && watch((done as f64 / self.total.max(1) as f64).min(1.0)).is_continue();
        if goes_on {
            return Ok(());
        }
        self.cancelled.store(true, Ordering::Relaxed);
        Err(BuildError::Cancelled)
    }
}

/// Of no mesh is it nothing.
fn size(mesh: &[Geometry]) -> u64 {
    1 + mesh.iter().map(Geometry::count).sum::<u64>()
}
