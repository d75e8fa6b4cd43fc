//! What the fuzz targets check: bytes become primitives, meshes and rays, and whatever they say must hold.
//!
//! The same functions run under cargo-fuzz (`fuzz/` beside the workspace), which looks for inputs that reach new code,
//! and as tests on random bytes and on every input that ever failed. A check panics when a promise is broken.
//!
//! A crate of its own, since what it needs is little and is built with sanitizers too.

mod bytes;
pub mod exact;
mod mesh;
mod shapes;
mod triangle;

pub use mesh::mesh;
pub use shapes::shapes;
pub use triangle::triangle;

/// A check of any bytes; whether a ray met something.
pub type Check = fn(&[u8]) -> bool;

/// All checks, by the names of their fuzz targets.
pub const ALL: [(&str, Check); 3] = [("triangle", triangle), ("shapes", shapes), ("mesh", mesh)];
