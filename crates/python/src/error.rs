//! Errors of the library as Python's, with the library's words.

use std::fmt::Display;
use std::io;

use firsthit_import::{ErrorKind, ImportError};
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyPermissionError, PyValueError};
use pyo3::prelude::*;

/// What was given is wrong.
pub(crate) fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A file cannot be read, or what is in it is wrong.
pub(crate) fn import(error: &ImportError) -> PyErr {
    let text = error.to_string();
    match &error.kind {
        ErrorKind::Io(e) => match e.kind() {
            io::ErrorKind::NotFound => PyFileNotFoundError::new_err(text),
            io::ErrorKind::PermissionDenied => PyPermissionError::new_err(text),
            _ => PyOSError::new_err(text),
        },
        _ => PyValueError::new_err(text),
    }
}
