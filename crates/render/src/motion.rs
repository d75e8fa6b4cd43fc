//! Things that move while the shutter is open.
//!
//! The time that the shutter is open is cut into steps, and each sample sees the scene as it is in the middle of one of
//! them: a stage of its own that shares materials, and all meshes and trees over triangles but those of meshes whose
//! vertices move, with the others. So a ray needs no time, and every query and every integrator sees motion. What moves by more pixels than there are steps shows as that
//! many faint pictures of itself.

use firsthit_import::SceneDesc;
use firsthit_import::scene::{CameraDesc, GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc, TriangleMesh};
use glam::{DAffine3, Vec3, Vec4};
use rayon::prelude::*;

/// How many instances move, as a whole or by their vertices.
pub(crate) fn count(scene: &SceneDesc) -> usize {
    let bends: Vec<bool> = scene.meshes.iter().map(bends).collect();
    let moves = |i: &&InstanceDesc| i.moves_to.is_some_and(|to| to != i.transform) || bends[i.mesh];
    scene.instances.iter().filter(moves).count()
}

/// Whether some of its vertices move.
fn bends(mesh: &MeshDesc) -> bool {
    mesh.geometries.iter().any(|g| matches!(&g.surface, SurfaceDesc::Triangles(m) if m.moves_to.is_some()))
}

/// The meshes whose vertices move, by their indices, as they are at a time from 0 to 1.
pub(crate) fn bent(scene: &SceneDesc, time: f64) -> Vec<(usize, MeshDesc)> {
    let moving = scene.meshes.par_iter().enumerate().filter(|(_, mesh)| bends(mesh));
    moving.map(|(i, mesh)| (i, bend(mesh, time as f32))).collect()
}

fn bend(mesh: &MeshDesc, time: f32) -> MeshDesc {
    let part = |g: &GeometryDesc| {
        let surface = match &g.surface {
            SurfaceDesc::Triangles(mesh) => SurfaceDesc::Triangles(bend_triangles(mesh, time)),
            shape @ SurfaceDesc::Shape(_) => shape.clone(),
        };
        GeometryDesc { name: g.name.clone(), surface, material: g.material }
    };
    MeshDesc { name: mesh.name.clone(), geometries: mesh.geometries.iter().map(part).collect() }
}

/// Positions go straight and evenly, normals and tangents turn with them.
fn bend_triangles(mesh: &TriangleMesh, time: f32) -> TriangleMesh {
    let Some(to) = &mesh.moves_to else { return mesh.clone() };
    let turned = |a: Vec3, b: Vec3| a.lerp(b, time).try_normalize().unwrap_or(a);
    let tangent = |(a, b): (&Vec4, &Vec4)| turned(a.truncate(), b.truncate()).extend(a.w);
    TriangleMesh {
        positions: mesh.positions.iter().zip(&to.positions).map(|(a, b)| a.lerp(*b, time)).collect(),
        triangles: mesh.triangles.clone(),
        normals: mesh.normals.iter().zip(&to.normals).map(|(a, b)| turned(*a, *b)).collect(),
        tangents: mesh.tangents.iter().zip(&to.tangents).map(tangent).collect(),
        uvs: mesh.uvs.clone(),
        colors: mesh.colors.clone(),
        moves_to: None,
    }
}

/// A camera's place at a time from 0 to 1.
pub(crate) fn camera(camera: &CameraDesc, time: f64) -> Option<CameraDesc> {
    camera.moves_to.map(|to| CameraDesc { transform: between(camera.transform, to, time), ..camera.clone() })
}

/// Where all instances are at a time from 0, when the shutter opens, to 1, when it closes.
pub(crate) fn transforms(scene: &SceneDesc, time: f64) -> Vec<DAffine3> {
    let at = |from: DAffine3, to: Option<DAffine3>| to.map_or(from, |to| between(from, to, time));
    scene.instances.iter().map(|i| at(i.transform, i.moves_to)).collect()
}

/// Between two places: scaled, turned along the shorter way and moved evenly. What is sheared goes straight, each number
/// of its matrix by itself.
fn between(from: DAffine3, to: DAffine3, time: f64) -> DAffine3 {
    let parts = |m: DAffine3| {
        let (scale, turn, place) = m.to_scale_rotation_translation();
        let again = DAffine3::from_scale_rotation_translation(scale, turn, place);
        let size = scale.abs().max_element();
        (again.matrix3 - m.matrix3)
            .to_cols_array()
            .iter()
            .all(|x| x.abs() <= 1e-9 * size)
            .then_some((scale, turn, place))
    };
    match (parts(from), parts(to)) {
        (Some((s0, r0, p0)), Some((s1, r1, p1))) => {
            DAffine3::from_scale_rotation_translation(s0.lerp(s1, time), r0.slerp(r1, time), p0.lerp(p1, time))
        }
        _ => DAffine3 {
            matrix3: from.matrix3 * (1.0 - time) + to.matrix3 * time,
            translation: from.translation.lerp(to.translation, time),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};

    #[test]
    fn halfway_is_half_turned_half_grown_and_half_moved() {
        let turn = DMat3::from_rotation_y(1.0);
        let to = DAffine3 { matrix3: turn * 3.0, translation: DVec3::new(4.0, 0.0, -2.0) };
        let half = between(DAffine3::IDENTITY, to, 0.5);
        let expected = DMat3::from_rotation_y(0.5) * 2.0;
        assert!((half.matrix3 - expected).to_cols_array().iter().all(|x| x.abs() < 1e-12));
        assert_eq!(half.translation, DVec3::new(2.0, 0.0, -1.0));
        let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        assert!(between(mirrored, mirrored, 0.3).abs_diff_eq(mirrored, 1e-12));
        let sheared = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::new(0.4, 1.0, 0.0), DVec3::Z));
        assert!(between(DAffine3::IDENTITY, sheared, 0.5).matrix3.y_axis.abs_diff_eq(DVec3::new(0.2, 1.0, 0.0), 1e-12));
    }
}
