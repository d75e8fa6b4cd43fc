//! Model and scene files, read into plain data.
//!
//! [`open`] looks at the file's name and first bytes, reads it whole, checks everything in it, and returns a
//! [`SceneDesc`] with a [`Report`] of what could be read only in part. What cannot be read at all is an
//! [`ImportError`] that names the file, the place in it and the cause. No ray is traced here.
//!
//! | format | module |
//! |---|---|
//! | OBJ with MTL (`.obj`) | [`obj`] |
//! | PLY (`.ply`) | [`ply`] |
//! | STL (`.stl`) | [`stl`] |
//! | glTF 2.0 (`.gltf`, `.glb`) | [`gltf`] |
//! | firsthit scene files (`.toml`, `.json`) | [`toml`] |
//!
//! All of them may be compressed: `.obj.zst`, `.ply.gz`.
#![forbid(unsafe_code)]

mod bake;
mod cache;
mod error;
mod files;
pub mod gltf;
pub mod image;
mod ktx2;
mod limits;
pub mod obj;
mod only;
mod open;
mod place;
mod plain;
mod play;
pub mod ply;
mod report;
pub mod scene;
mod shutter;
pub mod srgb;
pub mod stl;
#[cfg(test)]
mod tests;
mod timing;
pub mod toml;
mod unit;

pub use cache::ImageCache;
pub use error::{ErrorKind, ImportError};
pub use limits::Limits;
pub use open::{Decode, Imported, NotAnAxis, Options, UpAxis, open, open_with};
pub use play::{AnimationChoice, AnimationInfo, Play};
pub use report::{ExtensionUse, Report, Support, Warning};
pub use scene::SceneDesc;
pub use timing::{Stage, Stages};
