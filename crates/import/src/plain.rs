//! Meshes without materials, as PLY and STL files have them: made into a scene by what OBJ files go through, so that
//! polygons, missing normals, colours and places far from the origin are treated alike.

use std::path::Path;

use glam::DAffine3;

use crate::files;
use crate::obj::mesh;
use crate::obj::{Model, neutral};
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
    let mut first = None;
    let before = model.faces.len();
    let (faces, corners, positions) = (&mut model.faces, &model.corners, &model.positions);
    faces.retain(|face| {
        let finite = |p: [f64; 3]| p.iter().all(|x| x.abs() <= f64::from(f32::MAX));
        let keep = corners[face.range()].iter().all(|c| finite(positions[c.position as usize]));
        if !keep {
            first.get_or_insert(face.line);
        }
        keep
    });
    if let Some(first) = first {
        let lost = before - faces.len();
        let message = format!("{lost} faces left out, because a vertex of theirs is infinite or not a number");
        report.warn(path, format!("{unit} {first}"), message);
    }
}
