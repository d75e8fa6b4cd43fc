//! Watching a render from outside.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::Sums;

/// Told how far a render is, and asked whether it shall go on. Called from the rendering threads: be quick.
pub trait Monitor: Sync {
    /// `done` of `total` pixel blocks are finished, by `rays` rays so far.
    fn progress(&self, done: u64, total: u64, rays: u64) {
        let _ = (done, total, rays);
    }

    /// Whether [`Monitor::checkpoint`] is to be called now: it is, once each thread has finished the row of pixels that it is
    /// at. Asked before each row, and between batches of light paths: those of the sample at hand are not in the sums.
    fn wants_checkpoint(&self) -> bool {
        false
    }

    /// All that has been summed so far. The render waits.
    fn checkpoint(&self, sums: &Sums<'_>) {
        let _ = sums;
    }

    /// True: finish nothing more; the picture so far is returned.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Watches nothing.
impl Monitor for () {}

/// Cancels when the flag is set (as by a signal handler).
impl Monitor for AtomicBool {
    fn cancelled(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}
