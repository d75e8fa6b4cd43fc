//! Wavefront OBJ with its material libraries (MTL).

mod mesh;
mod normals;
mod parse;
mod polygon;
mod text;

use std::path::Path;

use glam::DAffine3;

use crate::files;
use crate::scene::{GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc};
use crate::{ImportError, Imported, Options, Report, SceneDesc};

/// Reads an OBJ file and the files it names.
///
/// # Errors
/// [`ImportError`] names the line.
pub fn read(path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let path = path.as_ref();
    read_bytes(files::read(path, &options.limits)?, path, options)
}

/// As [`read`], of bytes at hand; the files they name are looked for beside `path`.
///
/// # Errors
/// [`ImportError`] names the line.
pub fn read_bytes(bytes: Vec<u8>, path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let path = path.as_ref();
    let mut report = Report::default();
    let text = text::to_utf8(bytes);
    let mut model = parse::parse(&text, path, &options.limits, &mut report)?;
    drop(text);
    let meshes = mesh::build(&mut model, path, &mut report);
    let name = scene_name(path);
    report.triangles_all_scenes = meshes.parts.iter().map(|m| m.triangles.len() as u64).sum();
    let geometries = model.parts.iter().zip(meshes.parts).map(|(part, mesh)| {
        let name = match (part.object.as_str(), part.group.as_str()) {
            (object, "") => object.to_owned(),
            ("", group) => group.to_owned(),
            (object, group) => format!("{object}/{group}"),
        };
        GeometryDesc { name, surface: SurfaceDesc::Triangles(mesh), material: None }
    });
    let mesh = MeshDesc { name: name.clone(), geometries: geometries.collect() };
    let transform = DAffine3::from_translation(meshes.origin);
    let scene = SceneDesc {
        instances: vec![InstanceDesc { name: name.clone(), mesh: 0, transform }],
        meshes: vec![mesh],
        name,
        ..SceneDesc::default()
    };
    Ok(Imported { scene, report })
}

/// The file's name without `.obj` and what may follow it.
fn scene_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let end = name.to_ascii_lowercase().rfind(".obj").unwrap_or(name.len());
    name.get(..end).unwrap_or_default().to_owned()
}
