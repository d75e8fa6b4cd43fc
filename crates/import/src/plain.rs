//! Meshes without materials, as PLY and STL files have them: made into a scene by what OBJ files go through, so that
//! polygons, missing normals, colours and places far from the origin are treated alike.

use std::path::Path;

use glam::DAffine3;

use crate::files;
use crate::obj::model::{Faces, Model};
use crate::obj::{mesh, neutral};
use crate::scene::{GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc};
use crate::{Imported, Report, SceneDesc};

/// The scene of a model whose indices are in range. `unit` is what faces are counted in where they are warned of:
/// `line`, `face`, `triangle`.
pub(crate) fn scene(mut model: Model, path: &Path, unit: &str, mut report: Report) -> Imported {
    report.reads(path);
    drop_infinite(&mut model, path, unit, &mut report);
    let meshes = mesh::build(&mut model, path, unit, &mut report);
    report.triangles_all_scenes = meshes.parts.iter().map(|m| m.triangles.len() as u64).sum();
    let name = files::stem(path);
    let geometries = model.parts.iter().zip(meshes.parts).map(|(part, mesh)| GeometryDesc {
        name: part.object.clone(),
        surface: SurfaceDesc::Triangles(mesh),
        material: Some(0),
    });
    let mesh = MeshDesc { name: name.clone(), geometries: geometries.collect() };
    let transform = DAffine3::from_translation(meshes.origin);
    let scene = SceneDesc {
        instances: vec![InstanceDesc { name: name.clone(), mesh: 0, transform, moves_to: None }],
        meshes: vec![mesh],
        materials: vec![neutral("", !model.colors.is_empty())],
        name,
        ..SceneDesc::default()
    };
    Imported { scene, report }
}

/// Leaves out faces with a vertex that f32 has no finite number for.
fn drop_infinite(model: &mut Model, path: &Path, unit: &str, report: &mut Report) {
    let finite = |vertex: u32| {
        let place = model.positions[model.vertices[vertex as usize].position as usize];
        place.iter().all(|x| x.abs() <= f64::from(f32::MAX))
    };
    if (0..model.vertices.len() as u32).all(finite) {
        return;
    }
    let (mut first, mut lost) = (None, 0);
    let (mut faces, mut corners) = (Faces::default(), Vec::new());
    for (f, face) in (0..model.faces.len()).map(|f| (f, model.faces.get(f))) {
        let of_face = model.corners_of(f);
        if of_face.iter().all(|&vertex| finite(vertex)) {
            corners.extend_from_slice(of_face);
            faces.push(of_face.len() as u32, face.line, face.part, face.smoothing);
        } else {
            first.get_or_insert(face.line);
            lost += 1;
        }
    }
    (model.faces, model.corners) = (faces, corners);
    if let Some(first) = first {
        let message = format!("{lost} faces left out, because a vertex of theirs is infinite or not a number");
        report.warn(path, format!("{unit} {first}"), message);
    }
}
