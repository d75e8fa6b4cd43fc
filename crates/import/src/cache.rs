//! What is kept for when a file is read again: its bytes, its JSON, its decoded images.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::gltf::{Document, DracoPrimitives};
use crate::scene::ImageDesc;
use crate::{Limits, Report};

/// Files that are read again and again, as for the frames of an animation: their bytes, their JSON and their decoded
/// images (glTF's). Clones share them.
///
/// Whoever changes a file or its images meanwhile sees the old ones.
#[derive(Clone, Debug, Default)]
pub struct ImageCache(Arc<Mutex<Shelves>>);

#[derive(Debug, Default)]
struct Shelves {
    images: HashMap<PathBuf, Kept>,
    bytes: HashMap<PathBuf, Arc<Vec<u8>>>,
    documents: HashMap<PathBuf, Arc<Document>>,
    draco: HashMap<PathBuf, Arc<DracoPrimitives>>,
}

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
        self.0.lock().ok()?.images.get(file).filter(|kept| kept.key == *key).cloned()
    }

    pub(crate) fn keep(&self, file: &Path, kept: Kept) {
        // Poisoned by a thread that broke down: then nothing is kept.
        if let Ok(mut all) = self.0.lock() {
            all.images.insert(file.to_owned(), kept);
        }
    }

    /// The bytes of a file, read if they are not there yet.
    pub(crate) fn bytes<E>(&self, file: &Path, read: impl FnOnce() -> Result<Vec<u8>, E>) -> Result<Arc<Vec<u8>>, E> {
        self.once(file, |all| &mut all.bytes, read)
    }

    /// The JSON of a glTF file, parsed if it is not there yet.
    pub(crate) fn document<E>(
        &self,
        file: &Path,
        parse: impl FnOnce() -> Result<Document, E>,
    ) -> Result<Arc<Document>, E> {
        self.once(file, |all| &mut all.documents, parse)
    }

    /// The compressed primitives of a glTF file, decoded if they are not there yet.
    pub(crate) fn draco<E>(
        &self,
        file: &Path,
        decode: impl FnOnce() -> Result<DracoPrimitives, E>,
    ) -> Result<Arc<DracoPrimitives>, E> {
        self.once(file, |all| &mut all.draco, decode)
    }

    /// What stands on a shelf, made if it is not there yet.
    fn once<T, E>(
        &self,
        file: &Path,
        shelf: fn(&mut Shelves) -> &mut HashMap<PathBuf, Arc<T>>,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<Arc<T>, E> {
        let known = self.0.lock().ok().and_then(|mut all| shelf(&mut all).get(file).cloned());
        if let Some(known) = known {
            return Ok(known);
        }
        let made = Arc::new(make()?);
        // Poisoned by a thread that broke down: then nothing is kept.
        if let Ok(mut all) = self.0.lock() {
            shelf(&mut all).insert(file.to_owned(), Arc::clone(&made));
        }
        Ok(made)
    }
}
