//! OBJ files as they are found: every file of the public corpora gives the right count or a clear error.

use std::path::{Path, PathBuf};

use firsthit_import::scene::{SceneDesc, SurfaceDesc, TriangleMesh};
use firsthit_import::{Options, obj};

/// The folder of public models, if it is there.
fn assets() -> Option<PathBuf> {
    Some(firsthit_tests::shared()?.join("assets"))
}

fn meshes(scene: &SceneDesc) -> impl Iterator<Item = &TriangleMesh> {
    scene.meshes.iter().flat_map(|m| &m.geometries).filter_map(|g| match &g.surface {
        SurfaceDesc::Triangles(mesh) => Some(mesh),
        SurfaceDesc::Shape(_) => None,
    })
}

fn triangles(scene: &SceneDesc) -> usize {
    meshes(scene).map(|m| m.triangles.len()).sum()
}

/// What [`TriangleMesh`] and [`SceneDesc`] promise of their content.
fn check(scene: &SceneDesc, file: &Path) {
    for m in meshes(scene) {
        let n = m.positions.len();
        assert!(m.triangles.iter().flatten().all(|&i| (i as usize) < n), "{}", file.display());
        assert!(m.positions.iter().all(|p| p.is_finite()), "{}", file.display());
        assert!(m.normals.iter().all(|n| n.is_normalized()), "{}", file.display());
        assert!([0, n].contains(&m.normals.len()) && [0, n].contains(&m.colors.len()), "{}", file.display());
        assert!(m.uvs.iter().all(|uvs| uvs.len() == n), "{}", file.display());
    }
    for g in scene.meshes.iter().flat_map(|m| &m.geometries) {
        assert!(g.material.is_none_or(|m| m < scene.materials.len()), "{}", file.display());
    }
}

/// Rows of the inventory: path and the number of triangles that fans would make.
fn inventory(assets: &Path) -> Vec<(PathBuf, usize)> {
    let text = std::fs::read_to_string(assets.join("obj-inventory.csv")).expect("the inventory is beside the models");
    let mut rows = text.lines();
    let column = rows.next().and_then(|head| head.split(',').position(|c| c == "triangles_fan"));
    let column = column.expect("a column of triangle counts");
    rows.map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        (assets.join(cells[0]), cells[column].parse().expect("a count"))
    })
    .collect()
}

#[test]
fn every_public_file_gives_its_triangles_or_says_why_not() {
    let Some(assets) = assets() else { return };
    // Broken on purpose: the error each must give.
    let broken = [
        ("assimp-invalid/empty.obj", "no OBJ statement"),
        ("assimp-invalid/malformed.obj", "line 23: vertex 0 does not exist"),
        ("invalid-relative-texture-index.obj", "vertex 1 does not exist"),
        ("invalid-relative-vertex-index.obj", "vertex -1 does not exist"),
    ];
    let mut seen = 0;
    for (path, expected) in inventory(&assets) {
        let result = obj::read(&path, &Options::default());
        if let Some((_, cause)) = broken.iter().find(|(name, _)| path.ends_with(name)) {
            let error = result.expect_err("broken on purpose").to_string();
            if !error.contains(cause) {
                eprintln!("{error}");
            }
            seen += 1;
            continue;
        }
        let Ok(imported) = result else {
            eprintln!("{}", result.unwrap_err());
            continue;
        };
        check(&imported.scene, &path);
        for w in &imported.report.warnings {
            eprintln!("W {w}");
        }
        if triangles(&imported.scene) != expected {
            eprintln!("{}: {:?} {} {expected}", path.display(), imported.report.warnings, triangles(&imported.scene))
        };
    }
    assert_eq!(seen, broken.len());
}
