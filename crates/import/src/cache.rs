//! Images that are decoded once for several readings of one file.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::scene::ImageDesc;

/// Decoded images of files that are read again and again, as for the frames of an animation. Clones share them.
///
/// Whoever changes a file or its images meanwhile sees the old images.
#[derive(Clone, Debug, Default)]
pub struct ImageCache(Arc<Mutex<HashMap<PathBuf, Kept>>>);

/// The images of a file, and the files that they came from.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub(crate) images: Vec<ImageDesc>,
    pub(crate) files: BTreeSet<PathBuf>,
}

impl ImageCache {
    /// The images of a file, if it has been read and has so many.
    pub(crate) fn get(&self, file: &Path, count: usize) -> Option<Kept> {
        self.0.lock().ok()?.get(file).filter(|kept| kept.images.len() == count).cloned()
    }

    pub(crate) fn keep(&self, file: &Path, kept: Kept) {
        // Poisoned by a thread that broke down: then nothing is kept.
        if let Ok(mut all) = self.0.lock() {
            all.insert(file.to_owned(), kept);
        }
    }
}
