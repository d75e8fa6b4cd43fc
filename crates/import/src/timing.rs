//! Where the time of a load goes.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::Limits;
use crate::image::{Encoded, decode_all};

/// A stage of reading a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Bytes from the disk, decompressed.
    Read,
    /// Text to statements or JSON to a document.
    Parse,
    /// Meshes: accessors read, skins applied, polygons cut, normals and tangents computed.
    Meshes,
    /// Images decoded, from the first to the last of them.
    Images,
    /// The same, summed over threads.
    ImagesInAll,
}

/// Stopwatches of a load, for [`Options::stages`](crate::Options::stages). Clones are the same.
///
/// Stages overlap, so that their sum may be more than the whole.
#[derive(Clone, Debug, Default)]
pub struct Stages(Arc<Watches>);

#[derive(Debug, Default)]
struct Watches {
    nanoseconds: [AtomicU64; 5],
    /// The images that were decoded, as they were.
    encoded: Mutex<Vec<Vec<u8>>>,
}

impl Stages {
    /// How long a stage took so far.
    #[must_use]
    pub fn get(&self, stage: Stage) -> Duration {
        Duration::from_nanos(self.0.nanoseconds[stage as usize].load(Relaxed))
    }

    /// How many images were decoded.
    #[must_use]
    pub fn images(&self) -> usize {
        self.0.encoded.lock().map_or(0, |all| all.len())
    }

    /// Decodes the images once more, and nothing else: how long that takes.
    #[must_use]
    pub fn decode_again(&self) -> Duration {
        let Ok(encoded) = self.0.encoded.lock() else { return Duration::ZERO };
        let sources: Vec<_> = encoded.iter().map(|bytes| Encoded { name: "", bytes }).collect();
        let started = Instant::now();
        let images = decode_all(&sources, &Limits::default());
        let taken = started.elapsed();
        drop(images);
        taken
    }

    pub(crate) fn add(&self, stage: Stage, taken: Duration) {
        let nanoseconds = u64::try_from(taken.as_nanos()).unwrap_or(u64::MAX);
        self.0.nanoseconds[stage as usize].fetch_add(nanoseconds, Relaxed);
    }

    pub(crate) fn keep(&self, sources: &[Encoded<'_>]) {
        if let Ok(mut encoded) = self.0.encoded.lock() {
            encoded.extend(sources.iter().map(|s| s.bytes.to_vec()));
        }
    }
}

/// Does something that belongs to a stage.
pub(crate) fn timed<T>(stages: Option<&Stages>, stage: Stage, work: impl FnOnce() -> T) -> T {
    let Some(stages) = stages else { return work() };
    let started = Instant::now();
    let result = work();
    stages.add(stage, started.elapsed());
    result
}
