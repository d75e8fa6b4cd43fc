//! One door for all formats.

use std::path::Path;

use crate::{ImportError, Limits, Report, SceneDesc};

/// Which axis of the file points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// +X
    PosX,
    /// -X
    NegX,
    /// +Y: what glTF says, and most OBJ files mean.
    #[default]
    PosY,
    /// -Y
    NegY,
    /// +Z: CAD and scans.
    PosZ,
    /// -Z
    NegZ,
}

/// What a reader should do with a file.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The file's upward axis; the scene is turned so that it becomes +Y. `None`: as the format says (+Y).
    pub up: Option<UpAxis>,
    /// Limits against hostile files.
    pub limits: Limits,
}

/// A file's content.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The scene.
    pub scene: SceneDesc,
    /// What could be read only in part.
    pub report: Report,
}

/// Reads a model or scene file.
///
/// # Errors
/// [`ImportError`] says which file, where in it and why.
pub fn open(path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let _ = options;
    Err(ImportError::unsupported(path, "", "no reader yet"))
}
