//! Wavefront OBJ with its material libraries (MTL).

mod material;
mod mesh;
mod mtl;
mod normals;
mod parse;
mod polygon;
mod text;
mod texture;

use std::collections::HashMap;
use std::path::Path;

use glam::DAffine3;

use self::parse::Model;
use crate::files::{self, Folder};
use crate::scene::{GeometryDesc, ImageDesc, InstanceDesc, MaterialDesc, MeshDesc, SurfaceDesc};
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
    let materials = Materials::load(&model, path, options, &mut report);
    let name = scene_name(path);
    report.triangles_all_scenes = meshes.parts.iter().map(|m| m.triangles.len() as u64).sum();
    let geometries = model.parts.iter().zip(meshes.parts).map(|(part, mesh)| {
        let name = match (part.object.as_str(), part.group.as_str()) {
            (object, "") => object.to_owned(),
            ("", group) => group.to_owned(),
            (object, group) => format!("{object}/{group}"),
        };
        let material = part.material.map_or(materials.none, |m| Some(materials.of_name[m as usize]));
        GeometryDesc { name, surface: SurfaceDesc::Triangles(mesh), material }
    });
    let mesh = MeshDesc { name: name.clone(), geometries: geometries.collect() };
    let transform = DAffine3::from_translation(meshes.origin);
    let scene = SceneDesc {
        instances: vec![InstanceDesc { name: name.clone(), mesh: 0, transform }],
        meshes: vec![mesh],
        materials: materials.materials,
        images: materials.images,
        name,
        ..SceneDesc::default()
    };
    Ok(Imported { scene, report })
}

/// The materials of a model.
struct Materials {
    materials: Vec<MaterialDesc>,
    images: Vec<ImageDesc>,
    /// For each name that `usemtl` gives, the index of its material.
    of_name: Vec<usize>,
    /// The material of faces before any `usemtl`, if there are such.
    none: Option<usize>,
}

impl Materials {
    fn load(model: &Model, path: &Path, options: &Options, report: &mut Report) -> Self {
        let limits = &options.limits;
        let (mut materials, images, found) = match Folder::of(path) {
            Ok(folder) => {
                let entries = mtl::load(&model.libraries, path, &folder, limits, report);
                let (materials, images) = material::map(&entries, &folder, limits, report);
                let found = entries.into_iter().enumerate().map(|(i, e)| (e.material.name, i)).collect();
                (materials, images, found)
            }
            // Bytes without a file: nothing lies beside them.
            Err(_) => (Vec::new(), Vec::new(), HashMap::new()),
        };
        let has_colors = !model.colors.is_empty();
        let mut missing = Vec::new();
        let of_name = model.materials.iter().map(|(line, name)| {
            found.get(mtl::key(name)).copied().unwrap_or_else(|| {
                missing.push((*line, name));
                materials.push(material::neutral(name, has_colors));
                materials.len() - 1
            })
        });
        let of_name = of_name.collect();
        if let Some((line, name)) = missing.first() {
            let reason = if model.libraries.is_empty() { " (the file names no material library)" } else { "" };
            let more = if missing.len() > 1 { format!(" and {} more", missing.len() - 1) } else { String::new() };
            let message = format!("no material '{name}'{more}{reason}; shown grey");
            report.warn(path, parse::place(*line), message);
        }
        let none = model.parts.iter().any(|p| p.material.is_none()).then(|| {
            materials.push(material::neutral("", has_colors));
            materials.len() - 1
        });
        Self { materials, images, of_name, none }
    }
}

/// The file's name without `.obj` and what may follow it.
fn scene_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let end = name.to_ascii_lowercase().rfind(".obj").unwrap_or(name.len());
    name.get(..end).unwrap_or_default().to_owned()
}
