//! Why a file cannot be read: which file, where in it, and what is wrong.

use std::fmt;
use std::path::{Path, PathBuf};

/// A file that cannot be read.
///
/// Printed as `file: place: cause`, for example
/// `box.gltf: /accessors/2/count: 36 elements of 12 bytes need 432 bytes, but the buffer view has 288`.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {kind}", file.display(), Place(place))]
pub struct ImportError {
    /// The file that is at fault (not always the one that was opened).
    pub file: PathBuf,
    /// Where in the file: a line (`line 12`), a JSON pointer (`/meshes/0/primitives/1`), a key. Empty if it is the
    /// file as a whole.
    pub place: String,
    /// What is wrong.
    pub kind: ErrorKind,
}

struct Place<'a>(&'a str);

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { Ok(()) } else { write!(f, ": {}", self.0) }
    }
}

/// What is wrong with a file, sorted by whose fault it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The file cannot be opened or read.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The file breaks its format.
    #[error("{0}")]
    Invalid(String),
    /// The file is well-formed, but asks for something that firsthit does not do.
    #[error("{0}")]
    Unsupported(String),
    /// The file asks for more than the limits allow.
    #[error("{0}")]
    Limit(String),
    /// A path in the file leads outside the model's folder, or is no plain relative path.
    #[error("refused to read '{0}': it lies outside the model's folder")]
    Outside(String),
}

impl ImportError {
    /// An error at a place in a file.
    pub fn new(file: impl AsRef<Path>, place: impl Into<String>, kind: ErrorKind) -> Self {
        Self { file: file.as_ref().to_owned(), place: place.into(), kind }
    }

    /// The file breaks its format.
    pub fn invalid(file: impl AsRef<Path>, place: impl Into<String>, cause: impl Into<String>) -> Self {
        Self::new(file, place, ErrorKind::Invalid(cause.into()))
    }

    /// The file asks for something that is not done here.
    pub fn unsupported(file: impl AsRef<Path>, place: impl Into<String>, cause: impl Into<String>) -> Self {
        Self::new(file, place, ErrorKind::Unsupported(cause.into()))
    }

    /// The file cannot be read.
    pub fn io(file: impl AsRef<Path>, error: std::io::Error) -> Self {
        Self::new(file, "", ErrorKind::Io(error))
    }
}
