//! Images that are decoded once for several readings of one file.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::scene::ImageDesc;
use crate::{Limits, Report};

/// Decoded images of files that are read again and again, as for the frames of an animation. Clones share them.
///
/// Whoever changes a file or its images meanwhile sees the old images.
#[derive(Clone, Debug, Default)]
pub struct ImageCache(Arc<Mutex<HashMap<PathBuf, Kept>>>);

/// The images of a file, and what there was to say of them.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub(crate) key: Key,
    pub(crate) images: Vec<ImageDesc>,
    pub(crate) report: Report,
}

/// What decides which images a reading of a file has: other variants use others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Key {
    pub(crate) limits: Limits,
    /// The images, and whether they are decoded.
    pub(crate) images: Vec<(Shown, bool)>,
}

/// What a texture shows, by numbers in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Shown {
    /// An image.
    Image(usize),
    /// Nothing that can be read.
    Nothing { texture: usize },
}

impl ImageCache {
    /// The images of a file, if the last reading of it had the same.
    pub(crate) fn get(&self, file: &Path, key: &Key) -> Option<Kept> {
        self.0.lock().ok()?.get(file).filter(|kept| kept.key == *key).cloned()
    }

    pub(crate) fn keep(&self, file: &Path, kept: Kept) {
        // Poisoned by a thread that broke down: then nothing is kept.
        if let Ok(mut all) = self.0.lock() {
            all.insert(file.to_owned(), kept);
        }
    }
}
