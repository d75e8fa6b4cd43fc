//! The Python package `firsthit`: what is compiled of it. `python/firsthit` is what users import.
#![deny(unsafe_code)]
// What Python sees is documented in `_firsthit.pyi`.
#![allow(missing_docs, unreachable_pub)]

mod arrays;
mod change;
mod error;
mod hits;
mod mesh;
mod points;
mod pool;
mod rays;
mod render;
mod scene;

use pyo3::prelude::*;

/// The compiled part of the package.
#[pymodule]
mod _firsthit {
    #[pymodule_export]
    use super::hits::{ClosestPoints, HitLists, Hits};
    #[pymodule_export]
    use super::render::render;
    #[pymodule_export]
    use super::scene::{Scene, load, reload, restore};

    use super::*;

    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        m.add("INVALID_ID", hits::INVALID_ID)?;
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
