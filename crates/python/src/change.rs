//! New scenes of old ones.

use std::sync::Arc;

use firsthit_accel::SceneUpdate;
use pyo3::prelude::*;

use crate::error;
use crate::mesh::Mesh;
use crate::pool::pool;
use crate::scene::{Scene, Source};

/// The scene's own mesh, changed: its tree gets new boxes, or is built anew where that became too costly.
pub(crate) fn refit(py: Python<'_>, scene: &Scene, vertices: &Bound<'_, PyAny>, threads: usize) -> PyResult<Scene> {
    let old = mesh_of(scene)?;
    let mut mesh = Mesh::new(vertices, old.triangles.clone())?;
    if mesh.positions.len() != old.positions.len() {
        let (before, now) = (old.positions.len(), mesh.positions.len());
        return Err(error::value(format_args!("the mesh has {before} vertices, {now} are given")));
    }
    mesh.places.clone_from(&old.places);
    let mut update = scene.trees().update();
    update.move_vertices(0, vec![mesh.geometry()]);
    finish(py, scene, update, mesh, threads)
}

/// The same mesh at other places.
pub(crate) fn with_transforms(
    py: Python<'_>,
    scene: &Scene,
    transforms: &Bound<'_, PyAny>,
    masks: Option<&Bound<'_, PyAny>>,
    threads: usize,
) -> PyResult<Scene> {
    let mut mesh = mesh_of(scene)?.clone();
    mesh.place(Some(transforms), masks)?;
    finish(py, scene, scene.trees().update(), mesh, threads)
}

fn mesh_of(scene: &Scene) -> PyResult<&Mesh> {
    match &scene.source {
        Source::Arrays(mesh) => Ok(mesh),
        Source::File { .. } => Err(error::value("only scenes of arrays can be changed, not those of files")),
    }
}

fn finish(py: Python<'_>, scene: &Scene, mut update: SceneUpdate, mesh: Mesh, threads: usize) -> PyResult<Scene> {
    let before = scene.trees().instance_count();
    for (i, (transform, mask)) in mesh.placed().enumerate() {
        let i = if i < before { i } else { update.add_instance(0, transform) };
        update.set_transform(i, transform).set_mask(i, mask);
    }
    for i in mesh.places.len()..before {
        update.remove_instance(i);
    }
    let pool = pool(threads)?;
    let (trees, _) = py.detach(|| pool.install(|| update.finish())).map_err(error::value)?;
    Ok(scene.of_trees(trees, Source::Arrays(Arc::new(mesh))))
}
