//! Any bytes as model and scene files.
//!
//! Each check writes what the bytes say as files of one format and opens them by the front door, as a user would who
//! was sent them. [`promise`] says what must hold then.

mod accessors;
mod promise;
mod rest;
mod sound;
mod wrapped;

pub use accessors::accessors;
pub use promise::{Counting, prepare, promise};
pub use wrapped::{draco, image, meshopt};

use crate::Check;

/// All checks of files, by the names of their fuzz targets.
pub const FILES: [(&str, Check); 14] = [
    ("obj", obj),
    ("mtl", mtl),
    ("ply", ply),
    ("stl", stl),
    ("gltf_json", gltf_json),
    ("glb", glb),
    ("accessors", accessors),
    ("draco", draco),
    ("meshopt", meshopt),
    ("ktx2", image),
    ("image", image),
    ("environment", environment),
    ("toml", toml),
    ("packed", packed),
];

/// What stands before and after the first zero byte, if there is one: two files as one.
fn two(data: &[u8]) -> (&[u8], &[u8]) {
    match data.iter().position(|&b| b == 0) {
        Some(at) => (&data[..at], &data[at + 1..]),
        None => (data, &[]),
    }
}

/// An OBJ file, and after a zero byte its material library `m.mtl`.
pub fn obj(data: &[u8]) -> bool {
    let (obj, mtl) = two(data);
    promise(&[("m.obj", obj), ("m.mtl", mtl)]).is_some()
}

/// A material library alone; its materials `a`, `b` and `c` are shown.
pub fn mtl(data: &[u8]) -> bool {
    let model = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n\
        usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 2/2 3/3 1/1\nusemtl c\nf 3 2 1\n";
    promise(&[("m.obj", model), ("m.mtl", data)]).is_some()
}

/// A PLY file.
pub fn ply(data: &[u8]) -> bool {
    promise(&[("m.ply", data)]).is_some()
}

/// An STL file, of either kind.
pub fn stl(data: &[u8]) -> bool {
    promise(&[("m.stl", data)]).is_some()
}

/// A `.gltf` file, and after a zero byte its buffer `m.bin`.
pub fn gltf_json(data: &[u8]) -> bool {
    let (json, bin) = two(data);
    promise(&[("m.gltf", json), ("m.bin", bin)]).is_some()
}

/// A `.glb` file.
pub fn glb(data: &[u8]) -> bool {
    promise(&[("m.glb", data)]).is_some()
}

/// A scene file, and after a zero byte another one, `n.toml`.
pub fn toml(data: &[u8]) -> bool {
    let (scene, part) = two(data);
    promise(&[("m.toml", scene), ("n.toml", part)]).is_some()
}

/// An image that surrounds a scene.
pub fn environment(data: &[u8]) -> bool {
    let scene = b"env = { type = 'latlong', file = 'm.hdr' }\n\
        objects = [{ shape = 'sphere', center = [0, 0, 0], radius = 1 }]";
    promise(&[("m.toml", scene), ("m.hdr", data)]).is_some()
}

/// A compressed OBJ file: by Zstandard if its first bytes say so, else by gzip.
pub fn packed(data: &[u8]) -> bool {
    let zstandard = data.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]);
    promise(&[(if zstandard { "m.obj.zst" } else { "m.obj.gz" }, data)]).is_some()
}
