//! OBJ files as they are found: every file of the public corpora gives the right count or a clear error.

use std::path::{Path, PathBuf};

use firsthit_import::scene::{MaterialModel, PbrMaterial, SceneDesc, SurfaceDesc, TriangleMesh};
use firsthit_import::{Imported, Options, obj};
use glam::{DAffine3, Vec3};

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

/// A row of the inventory.
struct Row {
    path: PathBuf,
    /// How many triangles fans would make.
    triangles: usize,
    largest_face: usize,
}

fn inventory(assets: &Path) -> Vec<Row> {
    let text = std::fs::read_to_string(assets.join("obj-inventory.csv")).expect("the inventory is beside the models");
    let mut rows = text.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let head = rows.next().expect("a head");
    let column = |name: &str| head.iter().position(|c| *c == name).expect("a column of that name");
    let (file, triangles, largest) = (column("file"), column("triangles_fan"), column("max_face_vertices"));
    rows.map(|row| Row {
        path: assets.join(row[file]),
        triangles: row[triangles].parse().expect("a count"),
        largest_face: row[largest].parse().expect("a count"),
    })
    .collect()
}

fn read(path: impl AsRef<Path>) -> Imported {
    obj::read(path, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn every_public_file_gives_its_triangles_or_says_why_not() {
    let Some(assets) = assets() else { return };
    // Broken on purpose: the error each must give.
    let broken = [
        ("assimp-invalid/empty.obj", "no OBJ statement"),
        ("assimp-invalid/malformed.obj", "line 28: vertex 0 does not exist; the file has 8"),
        ("invalid-relative-texture-index.obj", "line 2: vertex 1 does not exist; the file has 0"),
        ("invalid-relative-vertex-index.obj", "line 1: vertex -4 does not exist; the file has 0 so far"),
    ];
    let mut seen = 0;
    for Row { path, triangles: fans, .. } in inventory(&assets) {
        if let Some((_, cause)) = broken.iter().find(|(name, _)| path.ends_with(name)) {
            let error = obj::read(&path, &Options::default()).expect_err("broken on purpose").to_string();
            assert!(error.contains(cause), "{error}");
            seen += 1;
            continue;
        }
        let imported = read(&path);
        check(&imported.scene, &path);
        // One quadrilateral of this file has corners that are no numbers.
        let left_out = if path.ends_with("test-nan.obj") { 2 } else { 0 };
        assert_eq!(triangles(&imported.scene), fans - left_out, "{}: {:?}", path.display(), imported.report.warnings);
    }
    assert_eq!(seen, broken.len());
}

/// Corners of a triangle: bits of position and texture coordinates.
type Corners = [[u32; 5]; 3];

fn corners(position: impl Fn(u32) -> [f32; 3], uv: impl Fn(u32) -> [f32; 2], triangle: [u32; 3]) -> Corners {
    triangle.map(|i| {
        let ([x, y, z], [u, v]) = (position(i), uv(i));
        // Zero has two forms, which count as one.
        [x, y, z, u, v].map(|c| (c + 0.0).to_bits())
    })
}

/// tobj is an independent reader of the same statements; where it can read a file of triangles, both must give the
/// same ones.
#[test]
fn triangles_are_those_that_tobj_reads() {
    let Some(assets) = assets() else { return };
    let options =
        tobj::LoadOptions { single_index: true, ignore_lines: true, ignore_points: true, ..Default::default() };
    let mut compared = 0;
    for Row { path, largest_face, .. } in inventory(&assets) {
        let Ok(bytes) = std::fs::read(&path) else { continue };
        if largest_face != 3 || path.extension().is_none_or(|e| e != "obj") {
            continue;
        }
        let Ok((models, _)) =
            tobj::load_obj_buf(&mut bytes.as_slice(), &options, |_| tobj::MTLLoadResult::Ok(Default::default()))
        else {
            continue;
        };
        // With one index for all, tobj mixes up files in which only some corners have texture coordinates.
        if models.iter().any(|m| ![0, m.mesh.positions.len() / 3 * 2].contains(&m.mesh.texcoords.len())) {
            continue;
        }
        let mut theirs: Vec<Corners> = models
            .iter()
            .flat_map(|m| {
                let m = &m.mesh;
                let position = |i: u32| std::array::from_fn(|k| m.positions[i as usize * 3 + k]);
                let uv = |i: u32| match m.texcoords.as_slice() {
                    [] => [0.0; 2],
                    t => [t[i as usize * 2], 1.0 - t[i as usize * 2 + 1]],
                };
                m.indices.chunks_exact(3).map(move |t| corners(position, uv, [t[0], t[1], t[2]])).collect::<Vec<_>>()
            })
            .collect();
        let imported = read(&path);
        // A model far from its origin is moved there before it is rounded to f32.
        if imported.scene.instances[0].transform != DAffine3::IDENTITY {
            continue;
        }
        let mut ours: Vec<Corners> = meshes(&imported.scene)
            .flat_map(|m| {
                let position = |i: u32| m.positions[i as usize].to_array();
                let uv = |i: u32| m.uvs.first().map_or([0.0; 2], |uvs| uvs[i as usize].to_array());
                m.triangles.iter().map(move |&t| corners(position, uv, t)).collect::<Vec<_>>()
            })
            .collect();
        // The order differs where parts of the same name come back later in the file.
        theirs.sort_unstable();
        ours.sort_unstable();
        assert!(ours == theirs, "{}: {} and {}", path.display(), ours.len(), theirs.len());
        compared += 1;
    }
    assert!(compared >= 15, "only {compared} files compared");
}

fn pbr<'a>(scene: &'a SceneDesc, name: &str) -> &'a PbrMaterial {
    let material = scene.materials.iter().find(|m| m.name == name);
    match material.map(|m| &m.model) {
        Some(MaterialModel::Pbr(pbr)) => pbr,
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn the_cornell_box_has_its_lamp_mirror_and_glass() {
    let Some(assets) = assets() else { return };
    let imported = read(assets.join("cornell-box/CornellBox-Sphere.obj"));
    assert_eq!(imported.report.warnings, []);
    let mirror = pbr(&imported.scene, "leftSphere");
    assert!(mirror.metallic > 0.98 && mirror.roughness == 0.0);
    let glass = pbr(&imported.scene, "rightSphere");
    assert_eq!((glass.transmission, glass.ior, glass.roughness), (1.0, 2.5, 0.0));
    let imported = read(assets.join("cornell-box/CornellBox-Original.obj"));
    assert_eq!(imported.report.warnings, []);
    assert_eq!(pbr(&imported.scene, "light").emissive, Vec3::new(17.0, 12.0, 4.0));
    assert_eq!(pbr(&imported.scene, "leftWall").specular, 0.0);
    // Every wall is a plane: flat, though the file has neither normals nor smoothing groups.
    assert!(meshes(&imported.scene).all(|m| m.normals.is_empty()));
}

#[test]
fn sponza_has_all_its_textures() {
    let Some(assets) = assets() else { return };
    let imported = read(assets.join("dabrovic-sponza/sponza.obj"));
    let scene = &imported.scene;
    assert_eq!(scene.materials.len(), 20);
    let with = |f: fn(&PbrMaterial) -> bool| {
        scene.materials.iter().filter(|m| matches!(&m.model, MaterialModel::Pbr(p) if f(p))).count()
    };
    // As many materials of the library have the statement.
    assert_eq!(with(|p| p.base_color_texture.is_some()), 19);
    assert_eq!(with(|p| p.bump_texture.is_some()), 18);
    assert_eq!(with(|p| p.normal_texture.is_some()), 0, "its bump maps are heights");
    let warnings: Vec<_> = imported.report.warnings.iter().map(ToString::to_string).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("faces without area"), "{warnings:?}");
}

#[test]
fn spot_without_a_library_is_plain_and_smooth() {
    let Some(assets) = assets() else { return };
    let imported = read(assets.join("spot/spot.obj"));
    assert_eq!(imported.report.warnings, []);
    let mesh = meshes(&imported.scene).next().expect("a mesh");
    assert_eq!(mesh.uvs.len(), 1);
    assert_eq!(mesh.normals.len(), mesh.positions.len());
    assert_eq!(pbr(&imported.scene, "").metallic, 0.0);
}
