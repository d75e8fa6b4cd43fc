//! What is read of a file, how much it may become, and what is kept for the next time.

use std::fs;
use std::path::Path;

use crate::scene::{ImageDesc, SurfaceDesc};
use crate::{
    Decode, ErrorKind, ImageCache, ImportError, Imported, Limits, Options, Play, Stage, Stages, open, open_with,
};

/// A car of two wheels and a door, beside a tree; the wheels and the tree share a mesh. The materials of the meshes have
/// an image each, a third is of nothing.
fn car() -> tempfile::TempDir {
    let primitive = |material: u32| format!(r#"{{"attributes": {{"POSITION": 0}}, "material": {material}}}"#);
    let gltf = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0, 4]}}],
        "nodes": [{{"name": "car", "children": [1, 2, 3], "translation": [5, 0, 0]}},
            {{"name": "wheel.1", "mesh": 0}}, {{"name": "wheel.2", "mesh": 0}}, {{"name": "door", "mesh": 1}},
            {{"name": "tree", "mesh": 0}}],
        "meshes": [{{"name": "round", "primitives": [{}]}}, {{"name": "flat", "primitives": [{}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{{"byteLength": 36, "uri": "car.bin"}}],
        "images": [{{"uri": "0.png"}}, {{"uri": "1.png"}}, {{"uri": "2.png"}}],
        "textures": [{{"source": 0}}, {{"source": 1}}, {{"source": 2}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}},
            {{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 1}}}}}},
            {{"emissiveTexture": {{"index": 2}}}}]}}"#,
        primitive(0),
        primitive(1)
    );
    let dir = tempfile::tempdir().expect("temporary folder");
    fs::write(dir.path().join("car.gltf"), gltf).expect("file");
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(dir.path().join("car.bin"), corners.map(f32::to_le_bytes).as_flattened()).expect("file");
    for name in ["0.png", "1.png", "2.png"] {
        image::RgbaImage::new(64, 64).save(dir.path().join(name)).expect("image");
    }
    dir
}

const PARTS: &str =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\no car\ng wheel left\nf 1 2 3\ng door\nf 1 3 2\nf 1 2 3\no tree\nf 1 2 3\n";

fn only(path: &Path, names: &[&str]) -> Result<Imported, ImportError> {
    open(path, &Options { only: names.iter().map(|&name| name.to_owned()).collect(), ..Options::default() })
}

fn geometries(imported: &Imported) -> Vec<(String, usize)> {
    let geometries = imported.scene.meshes.iter().flat_map(|m| &m.geometries);
    let triangles = |surface: &SurfaceDesc| match surface {
        SurfaceDesc::Triangles(mesh) => mesh.triangles.len(),
        SurfaceDesc::Shape(_) => 1,
    };
    geometries.map(|g| (g.name.clone(), triangles(&g.surface))).collect()
}

#[test]
fn parts_of_obj_are_chosen_by_object_and_group() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("parts.obj");
    fs::write(&path, PARTS).expect("file");
    let names = |wishes: &[&str]| -> Vec<String> {
        geometries(&only(&path, wishes).expect("found")).into_iter().map(|(name, _)| name).collect()
    };
    assert_eq!(names(&[]), ["car/wheel left", "car/door", "tree"]);
    assert_eq!(names(&["car"]), ["car/wheel left", "car/door"]);
    assert_eq!(names(&["wheel", "tree"]), ["car/wheel left", "tree"]);
    assert_eq!(names(&["d*r"]), ["car/door"]);
    assert_eq!(geometries(&only(&path, &["door"]).expect("found"))[0].1, 2);
    let error = only(&path, &["dor"]).expect_err("no such part").to_string();
    assert!(
        error.ends_with("is called 'dor': there are 'door', 'car', 'left', 'tree', 'wheel', 'wheel left'"),
        "{error}"
    );
}

#[test]
fn nodes_are_chosen_with_all_below_them() {
    let dir = car();
    let path = dir.path().join("car.gltf");
    let nodes = |wishes: &[&str]| -> Vec<String> {
        let scene = only(&path, wishes).expect("found").scene;
        assert_eq!((scene.materials.len(), scene.images.len()), (3, 3), "they stay as they are");
        scene.instances.into_iter().map(|i| i.name).collect()
    };
    assert_eq!(nodes(&["car"]), ["wheel.1", "wheel.2", "door"]);
    assert_eq!(nodes(&["wheel.2"]), ["wheel.2"]);
    assert_eq!(nodes(&["round"]), ["wheel.1", "wheel.2", "tree"]);
    assert_eq!(nodes(&["*.1", "tree"]), ["wheel.1", "tree"]);
    assert_eq!(only(&path, &["door"]).expect("found").scene.instances[0].transform.translation.x, 5.0);
    assert!(only(&path, &["door", "roof"]).is_err(), "every wish has to come true");

    let scene = dir.path().join("both.toml");
    fs::write(
        &scene,
        "objects = [{ shape = 'model', file = 'car.gltf' }, { shape = 'sphere', center = [0, 0, 0], radius = 1 }]",
    )
    .expect("file");
    assert_eq!(only(&scene, &["wheel*"]).expect("found").scene.instances.len(), 2);
}

fn sizes(images: &[ImageDesc]) -> Vec<u32> {
    images.iter().map(|i| i.width).collect()
}

#[test]
fn only_images_that_are_seen_are_decoded() {
    let dir = car();
    let path = dir.path().join("car.gltf");
    let widths = |decode, wishes: &[&str]| {
        let only = wishes.iter().map(|&name| name.to_owned()).collect();
        let options = Options { decode, only, ..Options::default() };
        sizes(&open(&path, &options).expect("readable").scene.images)
    };
    assert_eq!(widths(Decode::All, &[]), [64, 64, 64]);
    assert_eq!(widths(Decode::Seen, &[]), [64, 64, 1]);
    assert_eq!(widths(Decode::Seen, &["door"]), [1, 64, 1]);
    assert_eq!(widths(Decode::Nothing, &[]), [1, 1, 1]);

    let obj = dir.path().join("a.obj");
    fs::write(&obj, "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n").expect("file");
    fs::write(dir.path().join("a.mtl"), "newmtl a\nmap_Kd 0.png\nnewmtl b\nmap_Kd 1.png\n").expect("file");
    for (decode, count) in [(Decode::All, 2), (Decode::Seen, 1), (Decode::Nothing, 0)] {
        let scene = open(&obj, &Options { decode, ..Options::default() }).expect("readable").scene;
        assert_eq!((scene.images.len(), scene.materials.len()), (count, 2), "{decode:?}");
    }
}

#[test]
fn what_is_held_is_limited() {
    let dir = car();
    let read = |name: &str, memory| {
        let limits = Limits { memory: Some(memory), ..Limits::default() };
        open(dir.path().join(name), &Options { limits, ..Options::default() })
    };
    let refused = |name: &str, memory, what: &str| {
        let error = read(name, memory).expect_err("too much");
        assert!(matches!(error.kind, ErrorKind::Limit(_)) && error.to_string().contains(what), "{error}");
    };
    // Three images of 64 x 64 pixels of four bytes.
    assert!(read("car.gltf", 60_000).is_ok());
    refused("car.gltf", 49_151, "car.gltf: /images: its images take 49152 bytes, more than 49151, the limit on memory");
    refused("car.gltf", 1000, "more than 1000 bytes, the most that is read");
    let grid: String = (0..100).map(|i| format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nf -1 -2 -3\n")).collect();
    fs::write(dir.path().join("grid.obj"), &grid).expect("file");
    // 300 positions and 100 triangles of 12 bytes each, and an instance.
    refused("grid.obj", 4500, "its meshes and images take");
    assert!(read("grid.obj", 20_000).is_ok());
}

#[test]
fn a_small_image_may_not_become_a_huge_one() {
    // 28 MiB are more than 4 bytes for each of the file's beyond those that are free.
    let limits = Limits { expansion: 4, ..Limits::default() };
    let dir = tempfile::tempdir().expect("temporary folder");
    fs::write(dir.path().join("a.mtl"), (0..10).map(|i| format!("newmtl {i}\nmap_Kd {i}.png\n")).collect::<String>())
        .expect("file");
    let uses: String = (0..10).map(|i| format!("usemtl {i}\nf 1 2 3\n")).collect();
    fs::write(dir.path().join("a.obj"), format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{uses}")).expect("file");
    let mut png = std::io::Cursor::new(Vec::new());
    image::GrayImage::new(2700, 2700).write_to(&mut png, image::ImageFormat::Png).expect("in memory");
    for i in 0..10 {
        fs::write(dir.path().join(format!("{i}.png")), png.get_ref()).expect("file");
    }
    let error = open(dir.path().join("a.obj"), &Options { limits, ..Options::default() }).expect_err("ten of 29 MB");
    assert!(error.to_string().contains("its images take 291600000 bytes"), "{error}");
}

#[test]
fn files_are_read_once_for_many_moments() {
    let dir = car();
    let path = dir.path().join("car.gltf");
    let cache = ImageCache::default();
    let stages = Stages::default();
    let options = Options {
        play: Some(Play::default()),
        images: Some(cache),
        stages: Some(stages.clone()),
        ..Options::default()
    };
    let first = open(&path, &options).expect("readable");
    assert_eq!(stages.images(), 3);
    fs::write(dir.path().join("car.bin"), "too short").expect("file");
    let second = open(&path, &options).expect("kept");
    assert_eq!(stages.images(), 3, "decoded once");
    assert_eq!(format!("{:?}", first.scene.meshes), format!("{:?}", second.scene.meshes));
    assert!(first.scene.images[0].pixels.is_same(&second.scene.images[0].pixels));
}

#[test]
fn shapes_are_there_before_the_images() {
    let dir = car();
    let stages = Stages::default();
    let options = Options { stages: Some(stages.clone()), ..Options::default() };
    let (imported, (instances, images)) =
        open_with(dir.path().join("car.gltf"), &options, |scene| (scene.instances.len(), scene.images.len()))
            .expect("readable");
    assert_eq!((instances, images, imported.scene.images.len()), (4, 0, 3));
    for stage in [Stage::Read, Stage::Parse, Stage::Meshes, Stage::Images, Stage::ImagesInAll] {
        assert!(!stages.get(stage).is_zero(), "{stage:?}");
    }
}
