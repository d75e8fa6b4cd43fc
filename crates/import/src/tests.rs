//! What all formats have in common.

use std::fs;
use std::path::Path;

use crate::{Imported, NotAnAxis, Options, UpAxis, open};

/// A folder with these files; one that is called `*.png` is an image.
fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("temporary folder");
    for (name, text) in files {
        let path = dir.path().join(name);
        if name.ends_with(".png") {
            image::RgbaImage::new(2, 2).save(path).expect("image");
        } else {
            fs::write(path, text).expect("file");
        }
    }
    dir
}

fn read(path: impl AsRef<Path>) -> Imported {
    open(path, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn all_files_that_were_read_are_named() {
    let gltf = r#"{"asset": {"version": "2.0"},
        "buffers": [{"byteLength": 4, "uri": "data.bin"}],
        "images": [{"uri": "leaf.png"}], "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]}"#;
    let scene = "env = { type = 'latlong', file = 'sky.png' }
        objects = [{ shape = 'model', file = 'a.obj' }, { shape = 'model', file = 'a.gltf' }]";
    let dir = folder(&[
        ("scene.toml", scene),
        ("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n"),
        ("a.mtl", "newmtl m\nmap_Kd cow.png\nmap_Ks gone.png\n"),
        ("a.gltf", gltf),
        ("data.bin", "...."),
        ("leaf.png", ""),
        ("cow.png", ""),
        ("sky.png", ""),
        ("not named.png", ""),
    ]);
    let real = dir.path().canonicalize().expect("folder");
    let names = |imported: Imported| -> Vec<String> {
        let relative = |f: &std::path::PathBuf| f.strip_prefix(&real).map(|f| f.to_string_lossy().into_owned());
        imported.report.files.iter().map(|f| relative(f).expect("canonical and in the folder")).collect()
    };
    assert_eq!(names(read(dir.path().join("a.obj"))), ["a.mtl", "a.obj", "cow.png"]);
    assert_eq!(names(read(dir.path().join("a.gltf"))), ["a.gltf", "data.bin", "leaf.png"]);
    assert_eq!(
        names(read(dir.path())),
        ["a.gltf", "a.mtl", "a.obj", "cow.png", "data.bin", "leaf.png", "scene.toml", "sky.png"]
    );
}

#[test]
fn axes_are_read_by_their_names() {
    assert_eq!(["+X", "y", "Z"].map(str::parse), [Ok(UpAxis::PosX), Ok(UpAxis::PosY), Ok(UpAxis::PosZ)]);
    assert_eq!(["-x", "-Y", "-Z"].map(str::parse), [Ok(UpAxis::NegX), Ok(UpAxis::NegY), Ok(UpAxis::NegZ)]);
    assert_eq!(["", "W", "+ X", "--X"].map(str::parse::<UpAxis>), [Err(NotAnAxis); 4]);
}
