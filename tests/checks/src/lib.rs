//! What the fuzz targets check: bytes become primitives, meshes and rays, or model and scene files, and whatever they
//! say must hold.
//!
//! The same functions run under cargo-fuzz (`fuzz/` beside the workspace), which looks for inputs that reach new code,
//! and as tests on random bytes and on every input that ever failed. A check panics when a promise is broken.
//!
//! A crate of its own, since what it needs is little and is built with sanitizers too.

#[cfg(feature = "rays")]
mod bytes;
#[cfg(feature = "rays")]
pub mod exact;
#[cfg(feature = "files")]
pub mod files;
#[cfg(feature = "rays")]
mod mesh;
#[cfg(feature = "rays")]
mod shapes;
#[cfg(feature = "rays")]
mod triangle;

#[cfg(feature = "rays")]
pub use mesh::mesh;
#[cfg(feature = "rays")]
pub use shapes::shapes;
#[cfg(feature = "rays")]
pub use triangle::triangle;

/// A check of any bytes; whether a ray met something, or a file could be read.
pub type Check = fn(&[u8]) -> bool;

/// The checks of primitives, meshes and rays, by the names of their fuzz targets.
#[cfg(feature = "rays")]
pub const RAYS: [(&str, Check); 3] = [("triangle", triangle), ("shapes", shapes), ("mesh", mesh)];
