//! What all formats have in common.

mod loading;

use std::fs;
use std::path::Path;

use firsthit_geometry::transform::Transform;

use crate::scene::{MaterialModel, SurfaceDesc};
use crate::{ErrorKind, Imported, Limits, NotAnAxis, Options, UpAxis, open};

/// A folder with these files; one that is called `*.png` is an image.
fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("temporary folder");
    for (name, text) in files {
        let path = dir.path().join(name);
        if name.ends_with(".png") {
            image::RgbaImage::new(2, 2).save(path).expect("image");
        } else {
            fs::write(path, text).expect("file");
        }
    }
    dir
}

fn read(path: impl AsRef<Path>) -> Imported {
    open(path, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn all_files_that_were_read_are_named() {
    let gltf = r#"{"asset": {"version": "2.0"},
        "buffers": [{"byteLength": 4, "uri": "data.bin"}],
        "images": [{"uri": "leaf.png"}], "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]}"#;
    let scene = "env = { type = 'latlong', file = 'sky.png' }
        objects = [{ shape = 'model', file = 'a.obj' }, { shape = 'model', file = 'a.gltf' }]";
    let dir = folder(&[
        ("scene.toml", scene),
        ("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n"),
        ("a.mtl", "newmtl m\nmap_Kd cow.png\nmap_Ks gone.png\n"),
        ("a.gltf", gltf),
        ("data.bin", "...."),
        ("leaf.png", ""),
        ("cow.png", ""),
        ("sky.png", ""),
        ("not named.png", ""),
    ]);
    let real = dir.path().canonicalize().expect("folder");
    let names = |imported: Imported| -> Vec<String> {
        let relative = |f: &std::path::PathBuf| f.strip_prefix(&real).map(|f| f.to_string_lossy().into_owned());
        imported.report.files.iter().map(|f| relative(f).expect("canonical and in the folder")).collect()
    };
    assert_eq!(names(read(dir.path().join("a.obj"))), ["a.mtl", "a.obj", "cow.png"]);
    assert_eq!(names(read(dir.path().join("a.gltf"))), ["a.gltf", "data.bin", "leaf.png"]);
    assert_eq!(
        names(read(dir.path())),
        ["a.gltf", "a.mtl", "a.obj", "cow.png", "data.bin", "leaf.png", "scene.toml", "sky.png"]
    );
}

#[test]
fn axes_are_read_by_their_names() {
    assert_eq!(["+X", "y", "Z"].map(str::parse), [Ok(UpAxis::PosX), Ok(UpAxis::PosY), Ok(UpAxis::PosZ)]);
    assert_eq!(["-x", "-Y", "-Z"].map(str::parse), [Ok(UpAxis::NegX), Ok(UpAxis::NegY), Ok(UpAxis::NegZ)]);
    assert_eq!(["", "W", "+ X", "--X"].map(str::parse::<UpAxis>), [Err(NotAnAxis); 4]);
}

fn warnings(imported: &Imported) -> Vec<String> {
    imported.report.warnings.iter().map(|w| format!("{}: {}", w.place, w.message)).collect()
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
/// Stands on its edge: along z it has an extent.
const UPRIGHT: &str = "v 0 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\n";

#[test]
fn hopeless_transforms_are_baked_or_left_out() {
    let ball = "{ shape = 'sphere', center = [0, 0, 0], radius = 1 }";
    let thin =
        |scale: &str| format!("{{ shape = 'model', file = 'a.obj', transform = {{ scale = [1, 1, {scale}] }} }}");
    let flat =
        "{ shape = 'box', name = 'lid', min = [0, 0, 0], max = [1, 1, 1], transform = { scale = [1, 1, 1e-7] } }";
    let nothing = "{ shape = 'sphere', name = 'dot', center = [0, 0, 0], radius = 1, transform = { scale = 0 } }";
    let dir = folder(&[
        ("scene.toml", &format!("objects = [{ball}, {flat}, {nothing}, {}]", thin("1e-7"))),
        ("product.toml", "objects = [{ shape = 'model', file = 'part.toml', transform = { scale = [1, 1, 1e-4] } }]"),
        ("part.toml", &format!("objects = [{}]", thin("1e-4"))),
        ("undone.toml", "objects = [{ shape = 'model', file = 'thin.toml', transform = { scale = [1, 1, 1e7] } }]"),
        ("thin.toml", &format!("objects = [{}]", thin("1e-7"))),
        ("a.obj", UPRIGHT),
    ]);
    let imported = read(dir.path());
    assert_eq!(imported.scene.instances.len(), 2);
    let said = warnings(&imported);
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].starts_with("instance 'lid': the transform's condition number is 1.000e7"), "{said:?}");
    assert_eq!(said[1], "instance 'dot': the transform is singular: not drawn");

    for (file, depth) in [("scene.toml", 1e-7_f32), ("product.toml", 1e-8), ("undone.toml", 1.0)] {
        let scene = read(dir.path().join(file)).scene;
        let instance = scene.instances.last().expect("the triangle");
        assert!(Transform::new(instance.transform).is_ok());
        let SurfaceDesc::Triangles(mesh) = &scene.meshes[instance.mesh].geometries[0].surface else { panic!() };
        let z = instance.transform.transform_point3(mesh.positions[1].as_dvec3()).z as f32;
        assert!((z - depth).abs() <= 1e-7 * depth, "{file}: {z}");
    }
}

#[test]
fn a_scene_without_a_surface_is_warned_of() {
    let dir = folder(&[
        ("a.toml", "lights = [{ type = 'point', position = [0, 1, 0], intensity = 1 }]"),
        ("a.gltf", r#"{"asset": {"version": "2.0"}}"#),
        ("a.obj", "v 0 0 0\n"),
        ("b.obj", TRIANGLE),
        ("b.toml", "objects = [{ shape = 'sphere', center = [0, 0, 0], radius = 1 }]"),
    ]);
    for file in ["a.toml", "a.gltf", "a.obj"] {
        let said = warnings(&read(dir.path().join(file)));
        assert!(said.last().is_some_and(|w| w == ": has no surface: there is nothing to see"), "{file}: {said:?}");
    }
    for file in ["b.obj", "b.toml"] {
        assert_eq!(warnings(&read(dir.path().join(file))), [""; 0], "{file}");
    }
}

#[test]
fn a_folder_stands_for_its_scene_file_and_no_other_toml() {
    let scene = |name: &str| format!("{{\"name\": \"{name}\"}}");
    let dir = folder(&[("Cargo.toml", "[package]"), ("b.obj", TRIANGLE)]);
    assert_eq!(read(dir.path()).scene.name, "b");
    fs::write(dir.path().join("scene.json"), scene("of json")).expect("file");
    assert_eq!(read(dir.path()).scene.name, "of json");
    fs::write(dir.path().join("scene.toml"), "name = 'of toml'").expect("file");
    assert_eq!(read(dir.path()).scene.name, "of toml");
}

#[test]
fn a_file_of_another_kind_is_not_read_to_tell() {
    let dir = folder(&[("a.xyz", "ten bytes."), ("b", "glTF, it says")]);
    let few = Options { limits: Limits { file_bytes: 4, ..Limits::default() }, ..Options::default() };
    let e = open(dir.path().join("a.xyz"), &few).expect_err("no model");
    assert!(e.to_string().contains("'.xyz' files are not read"), "{e}");
    let e = open(dir.path().join("b"), &few).expect_err("too large");
    assert!(matches!(e.kind, ErrorKind::Limit(_)), "{e}");
}

/// A glTF file whose only material shows an image file.
fn painted(image: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "images": [{{"uri": "{image}"}}], "textures": [{{"source": 0}}],
            "materials": [{{"name": "paint", "pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
            "buffers": [{{"byteLength": 36, "uri": "a.bin"}}], "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
            "accessors": [{{"bufferView": 0, "type": "VEC3", "componentType": 5126, "count": 3}},
                {{"bufferView": 0, "type": "VEC2", "componentType": 5126, "count": 3}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "material": 0}}]}}],
            "nodes": [{{"mesh": 0}}, {{"mesh": 0}}], "scenes": [{{"nodes": [0]}}, {{"nodes": [1]}}], "scene": 0}}"#
    )
}

/// Two such files, beside a scene.
fn painted_folder(scene: &str) -> tempfile::TempDir {
    let dir = folder(&[
        ("scene.toml", scene),
        ("a.gltf", &painted("a.png")),
        ("b.gltf", &painted("b.png")),
        ("a.png", ""),
        ("b.png", ""),
    ]);
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(dir.path().join("a.bin"), corners.map(f32::to_le_bytes).as_flattened()).expect("file");
    dir
}

#[test]
fn the_limit_on_images_counts_for_all_models_of_a_scene() {
    let dir = painted_folder("objects = [{ shape = 'model', file = 'a.gltf' }, { shape = 'model', file = 'b.gltf' }]");
    assert_eq!(warnings(&read(dir.path())), [""; 0]);
    // Each of the images has four pixels of four bytes.
    let one = Options { limits: Limits { image_bytes: 31, ..Limits::default() }, ..Options::default() };
    let imported = open(dir.path(), &one).expect("images are not needed");
    let said = warnings(&imported);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].starts_with("/images/0: b.png: an image of 2 x 2 pixels needs 16 bytes; 15 are left"), "{said:?}");
}

#[test]
fn encoded_images_of_obj_are_limited_together() {
    let dir = folder(&[
        ("a.obj", &format!("mtllib a.mtl\n{TRIANGLE}")),
        ("a.mtl", "newmtl m\nmap_Kd a.png\nmap_Ks b.png\n"),
        ("a.png", ""),
        ("b.png", ""),
    ]);
    let size = fs::metadata(dir.path().join("a.png")).expect("image").len();
    for (file_bytes, warned) in [(2 * size, 0), (2 * size - 1, 1)] {
        let options = Options { limits: Limits { file_bytes, ..Limits::default() }, ..Options::default() };
        let said = warnings(&open(dir.path(), &options).expect("images are not needed"));
        assert_eq!(said.iter().filter(|w| w.contains("the most that is read")).count(), warned, "{said:?}");
    }
}

#[test]
fn images_of_replaced_materials_are_not_kept() {
    let dir = painted_folder(
        "objects = [
            { shape = 'model', file = 'a.gltf', material = 'm' },
            { shape = 'model', file = 'a.gltf', materials = { paint = 'm' } },
            { shape = 'model', file = 'b.gltf' }]
         [materials]
         m = { type = 'diffuse', albedo = 0.5 }
         idle = { type = 'pbr', base_color_texture = 'a.png' }",
    );
    let scene = read(dir.path()).scene;
    assert_eq!(scene.images.iter().map(|i| i.name.as_str()).collect::<Vec<_>>(), ["b.png"]);
    let textures = scene.materials.iter().filter_map(|m| match &m.model {
        MaterialModel::Pbr(pbr) => pbr.base_color_texture.as_ref(),
        _ => None,
    });
    assert_eq!(textures.map(|t| t.image).collect::<Vec<_>>(), [0]);
}

#[test]
fn triangles_of_scenes_that_are_not_shown_are_counted_wherever_the_model_stands() {
    let dir = painted_folder("objects = [{ shape = 'model', file = 'a.gltf' }, { shape = 'model', file = 'a.gltf' }]");
    assert_eq!(read(dir.path().join("a.gltf")).report.triangles_all_scenes, 2);
    let imported = read(dir.path());
    assert_eq!((imported.scene.instances.len(), imported.report.triangles_all_scenes), (2, 4));
}
