//! Compressed and packed models against their plain twins in the public data.

mod basisu;
mod draco;
mod environment;
mod instancing;
mod meshopt;
mod ply_stl;

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use firsthit_import::scene::{SurfaceDesc, TriangleMesh};
use firsthit_import::{ImportError, Imported, Options, SceneDesc, gltf};
use glam::DVec3;
use serde_json::Value;

/// A file of the public models.
fn asset(file: &str) -> Option<PathBuf> {
    Some(firsthit_tests::shared()?.join("assets").join(file))
}

fn read(path: &Path) -> Result<Imported, ImportError> {
    gltf::read(path, &Options::default())
}

fn scene(path: &Path) -> SceneDesc {
    read(path).unwrap_or_else(|e| panic!("{e}")).scene
}

fn mesh(scene: &SceneDesc, mesh: usize, geometry: usize) -> &TriangleMesh {
    match &scene.meshes[mesh].geometries[geometry].surface {
        SurfaceDesc::Triangles(mesh) => mesh,
        SurfaceDesc::Shape(_) => panic!("glTF has no shapes"),
    }
}

/// All triangles in the world.
fn triangles(scene: &SceneDesc) -> Vec<[DVec3; 3]> {
    let mut all = Vec::new();
    for instance in &scene.instances {
        for g in 0..scene.meshes[instance.mesh].geometries.len() {
            let mesh = mesh(scene, instance.mesh, g);
            let world = |v: u32| instance.transform.transform_point3(mesh.positions[v as usize].as_dvec3());
            all.extend(mesh.triangles.iter().map(|t| t.map(world)));
        }
    }
    all
}

fn size(triangles: &[[DVec3; 3]]) -> f64 {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = triangles.as_flattened().iter().fold(start, |(l, h), p| (l.min(*p), h.max(*p)));
    (high - low).length()
}

/// How many triangles of one list have none in the other that is as far away as `tolerance` at most, corner by corner,
/// whichever corner comes first; each serves once.
fn unmatched(a: &[[DVec3; 3]], b: &[[DVec3; 3]], tolerance: f64) -> usize {
    let cell = |t: &[DVec3; 3]| ((t[0] + t[1] + t[2]) / 3.0 / (2.0 * tolerance)).floor().as_i64vec3();
    let mut cells: HashMap<_, Vec<usize>> = HashMap::new();
    b.iter().enumerate().for_each(|(i, t)| cells.entry(cell(t)).or_default().push(i));
    let fits = |s: &[DVec3; 3], t: &[DVec3; 3]| {
        (0..3).any(|turn| (0..3).all(|k| s[k].distance(t[(k + turn) % 3]) <= tolerance))
    };
    let mut lost = 0;
    for s in a {
        let home = cell(s);
        let found = (0..27).any(|n| {
            let near = home + glam::I64Vec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
            let Some(list) = cells.get_mut(&near) else { return false };
            let Some(k) = list.iter().position(|&i| fits(s, &b[i])) else { return false };
            list.swap_remove(k);
            true
        });
        lost += usize::from(!found);
    }
    lost
}

/// Asserts that two files show the same triangles, to a fraction of their size.
fn assert_same(packed: &str, plain: &str, fraction: f64) {
    let (Some(packed_path), Some(plain)) = (asset(packed), asset(plain)) else { return };
    let (a, b) = (triangles(&scene(&packed_path)), triangles(&scene(&plain)));
    assert_eq!(a.len(), b.len(), "{packed}");
    assert_eq!(unmatched(&a, &b, fraction * size(&b)), 0, "{packed}: of {}", b.len());
}

/// Reads a `.gltf` after its JSON was changed.
fn edited(path: &Path, edit: impl FnOnce(&mut Value)) -> Result<Imported, ImportError> {
    let folder = tempfile::tempdir().unwrap();
    for file in fs::read_dir(path.parent().unwrap()).unwrap() {
        let file = file.unwrap();
        if file.path().is_file() {
            fs::copy(file.path(), folder.path().join(file.file_name())).unwrap();
        }
    }
    let mut value: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    edit(&mut value);
    let copy = folder.path().join("edited.gltf");
    fs::write(&copy, value.to_string()).unwrap();
    read(&copy)
}

/// Reads a file after its bytes, which are in `name`, were changed.
fn damaged(path: &Path, name: &str, damage: impl FnOnce(&mut Vec<u8>)) -> Result<Imported, ImportError> {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join(path.file_name().unwrap());
    fs::copy(path, &model).unwrap();
    let mut bytes = fs::read(path.with_file_name(name)).unwrap();
    damage(&mut bytes);
    fs::write(folder.path().join(name), bytes).unwrap();
    read(&model)
}
