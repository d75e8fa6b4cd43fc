//! Scene files and the door to all formats: reference scenes, the shipped scenes, merging.

use std::fs;
use std::path::{Path, PathBuf};

use firsthit_import::scene::{
    EnvironmentDesc, LightDesc, LightKind, MaterialModel, Pixels, Projection, SceneDesc, SurfaceDesc,
};
use firsthit_import::{ErrorKind, ImportError, Imported, Options, open};
use glam::{DAffine3, DVec3, Vec3};

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace")
}

/// Scenes of the reference images: another folder of them may be named.
fn references() -> PathBuf {
    std::env::var_os("FIRSTHIT_REFERENCES").map_or_else(|| workspace().join("tests/references"), PathBuf::from)
}

fn read(path: impl AsRef<Path>) -> Imported {
    open(path, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn failure(path: impl AsRef<Path>) -> ImportError {
    open(path, &Options::default()).expect_err("must be refused")
}

/// All files below a folder, sorted.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() { all.extend(files_below(&path)) } else { all.push(path) }
    }
    all.sort();
    all
}

/// Every index of a scene is in range, every array as long as it must be.
fn check(scene: &SceneDesc) {
    for i in &scene.instances {
        assert!(i.mesh < scene.meshes.len());
        assert!(i.transform.is_finite() && i.transform.matrix3.determinant() != 0.0);
    }
    for g in scene.meshes.iter().flat_map(|m| &m.geometries) {
        assert!(g.material.is_none_or(|m| m < scene.materials.len()));
        if let SurfaceDesc::Triangles(mesh) = &g.surface {
            let n = mesh.positions.len();
            assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < n));
            let lengths = [mesh.normals.len(), mesh.tangents.len(), mesh.colors.len()];
            assert!(lengths.into_iter().chain(mesh.uvs.iter().map(Vec::len)).all(|l| l == 0 || l == n));
        }
    }
    for m in &scene.materials {
        if let MaterialModel::Pbr(pbr) = &m.model {
            assert!(pbr.base_color_texture.as_ref().is_none_or(|t| t.image < scene.images.len()));
        }
    }
    for image in &scene.images {
        let pixels = match &image.pixels {
            Pixels::Rgba8(p) => p.len(),
            Pixels::Rgba16(p) => p.len(),
            Pixels::Rgb32F(p) => p.len(),
        };
        assert_eq!(pixels, image.width as usize * image.height as usize);
    }
}

#[test]
fn every_reference_scene_opens_by_its_conventions() {
    let scenes: Vec<_> = files_below(&references()).into_iter().filter(|p| p.ends_with("scene.json")).collect();
    assert!(!scenes.is_empty());
    for path in scenes {
        let Imported { scene, report } = read(&path);
        assert_eq!(report.warnings, [], "{}", path.display());
        check(&scene);
        assert!(scene.settings.reference_conventions);
        assert_eq!(scene.settings.resolution, Some((256, 256)));
        assert_eq!(scene.settings.camera, Some(0));
        assert!(scene.environment.is_some(), "black where the file says nothing");
        assert!(!scene.instances.is_empty());
        // A folder stands for its scene.
        assert_eq!(read(path.parent().expect("a folder")).scene.name, scene.name);
    }
}

#[test]
fn the_cornell_box_has_the_materials_of_its_scene_file() {
    let scene = read(workspace().join("tests/references/cornell/scene.json")).scene;
    let names: Vec<_> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["white", "red", "green", "light"], "each once");
    let mut glowing = 0;
    for g in scene.meshes.iter().flat_map(|m| &m.geometries) {
        match &scene.materials[g.material.expect("a material")].model {
            MaterialModel::Diffuse { .. } => {}
            MaterialModel::Emission { radiance } => {
                glowing += 1;
                assert_eq!(*radiance, Vec3::new(17.0, 12.0, 4.0));
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(glowing, 1);
    let camera = &scene.cameras[0];
    assert_eq!(camera.transform, DAffine3::from_translation(DVec3::new(0.0, 0.0, 3.9)));
    assert!(matches!(camera.projection, Projection::Perspective { vertical_fov, .. }
        if vertical_fov == 39.3_f64.to_radians()));
    assert!(matches!(scene.environment, Some(EnvironmentDesc::Constant { radiance: Vec3::ZERO })));
}

#[test]
fn an_obj_in_a_reference_scene_is_plain_without_the_scene_files_help() {
    let dir = tempfile::tempdir().expect("temporary folder");
    for file in ["cornell.obj", "cornell.mtl"] {
        fs::copy(workspace().join("tests/references/cornell").join(file), dir.path().join(file)).expect("copy");
    }
    let path = dir.path().join("scene.json");
    fs::write(&path, r#"{"objects": [{"shape": "obj", "file": "cornell.obj"}]}"#).expect("file");
    let scene = read(&path).scene;
    for m in &scene.materials {
        match (m.name.as_str(), &m.model) {
            ("light", MaterialModel::Emission { radiance }) => assert_eq!(*radiance, Vec3::new(17.0, 12.0, 4.0)),
            ("white", MaterialModel::Diffuse { albedo }) => assert_eq!(*albedo, Vec3::new(0.73, 0.71, 0.68)),
            (_, MaterialModel::Diffuse { .. }) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn every_shipped_scene_and_model_opens_without_a_warning() {
    let mut opened = 0;
    for path in files_below(&workspace().join("assets")) {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        if matches!(extension, "toml" | "obj" | "gltf" | "glb") {
            let Imported { scene, report } = read(&path);
            check(&scene);
            assert_eq!(report.warnings, [], "{}", path.display());
            assert!(!scene.instances.is_empty(), "{}", path.display());
            opened += 1;
        }
    }
    assert!(opened >= 10, "{opened}");
}

#[test]
fn the_example_of_the_manual_is_a_scene() {
    let manual = fs::read_to_string(workspace().join("docs/scene-files.md")).expect("the manual");
    let example = manual.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).expect("an example");
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("example.toml");
    fs::write(&path, example).expect("file");
    let Imported { scene, report } = read(&path);
    assert_eq!(report.warnings, []);
    assert_eq!((scene.instances.len(), scene.materials.len(), scene.cameras.len()), (2, 2, 1));
}

/// What each geometry looks like, by names: material, then image of its base colour.
fn looks(scene: &SceneDesc, instances: std::ops::Range<usize>) -> Vec<(String, Option<String>)> {
    let geometries = scene.instances[instances].iter().flat_map(|i| &scene.meshes[i.mesh].geometries);
    geometries
        .filter_map(|g| g.material)
        .map(|m| {
            let MaterialModel::Pbr(pbr) = &scene.materials[m].model else { panic!("pbr") };
            let image = pbr.base_color_texture.as_ref().map(|t| scene.images[t.image].name.clone());
            (scene.materials[m].name.clone(), image)
        })
        .collect()
}

#[test]
fn merging_keeps_every_index_with_its_data() {
    let assets = workspace().join("assets");
    let helmet = read(assets.join("flight-helmet/FlightHelmet.gltf")).scene;
    let cow = read(assets.join("spot/spot.toml")).scene;
    let (n, m) = (helmet.instances.len(), cow.instances.len());

    let mut scene = cow.clone();
    scene.append(helmet.clone(), DAffine3::from_translation(DVec3::X));
    scene.append(cow.clone(), DAffine3::from_translation(2.0 * DVec3::X));
    check(&scene);
    assert_eq!(scene.instances.len(), n + 2 * m);
    assert_eq!(looks(&scene, 0..m), looks(&cow, 0..m));
    assert_eq!(looks(&scene, m..m + n), looks(&helmet, 0..n));
    assert_eq!(looks(&scene, m + n..n + 2 * m), looks(&cow, 0..m));
    assert_eq!(scene.instances[m].transform, DAffine3::from_translation(DVec3::X) * helmet.instances[0].transform);
}

#[test]
fn moving_a_scene_moves_its_lights() {
    let light = |kind| LightDesc { name: String::new(), kind };
    let radiance = Vec3::ONE;
    let rectangle = LightKind::Rectangle { corner: DVec3::ZERO, edge_u: DVec3::X, edge_v: DVec3::Y, radiance };
    let ball = LightKind::Sphere { center: DVec3::X, radius: 1.0, radiance };
    let mut scene = SceneDesc { lights: vec![light(rectangle), light(ball)], ..SceneDesc::default() };
    scene.transform(DAffine3::from_scale(DVec3::new(2.0, 2.0, -2.0)));
    let LightKind::Rectangle { edge_u, edge_v, .. } = scene.lights[0].kind else { panic!("a rectangle") };
    assert_eq!(edge_u.cross(edge_v), DVec3::new(0.0, 0.0, -4.0), "mirrored, it shines to the other side");
    let LightKind::Sphere { center, radius, .. } = scene.lights[1].kind else { panic!("a ball") };
    assert_eq!((center, radius), (2.0 * DVec3::X, 2.0));
}

#[test]
fn what_cannot_be_opened_is_told_with_what_to_do() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let at = |name: &str| dir.path().join(name);

    let e = failure(at("none.toml"));
    assert!(matches!(e.kind, ErrorKind::Io(_)) && e.to_string().contains("none.toml"), "{e}");
    let e = failure(at("none.xyz"));
    assert!(matches!(e.kind, ErrorKind::Io(_)), "a file that is not there is told as that: {e}");
    fs::write(at("a.fbx"), "Kaydara").expect("file");
    let e = failure(at("a.fbx")).to_string();
    assert!(e.contains("'.fbx' files are not read; firsthit reads .obj") && e.contains(".gltf, .glb"), "{e}");
    assert!(e.contains(".ply") && e.contains(".stl") && e.contains("scene files (.toml, .json)"), "{e}");
    fs::write(at("noname"), "").expect("file");
    assert!(failure(at("noname")).to_string().contains("the file name has no extension"));

    let e = failure(dir.path()).to_string();
    assert!(e.contains("is a folder with no model in it; firsthit reads .obj"), "{e}");
    fs::write(at("b.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("file");
    assert_eq!(read(dir.path()).scene.instances.len(), 1, "the only model");
    fs::write(at("c.OBJ"), "").expect("file");
    let e = failure(dir.path()).to_string();
    assert!(e.ends_with("is a folder with several models; name one of them: b.obj, c.OBJ"), "{e}");
    fs::write(at("scene.toml"), "").expect("file");
    assert_eq!(read(dir.path()).scene.instances.len(), 0, "a scene file speaks for its folder");
}

#[test]
fn the_format_of_a_file_is_told_by_its_content_where_its_name_does_not() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let glb = fs::read(workspace().join("assets/box/Box.glb")).expect("file");
    let unnamed = dir.path().join("box");
    fs::write(&unnamed, glb).expect("file");
    assert_eq!(read(&unnamed).report.triangles_all_scenes, 12);

    let json = dir.path().join("a.json");
    fs::write(&json, r#"{"asset": {"version": "2.0"}, "scenes": [{}], "scene": 0}"#).expect("file");
    assert!(!read(&json).scene.settings.reference_conventions, "glTF");
    fs::write(&json, r#"{"objects": []}"#).expect("file");
    assert!(read(&json).scene.settings.reference_conventions, "a scene file");
}
