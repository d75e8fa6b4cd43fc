//! Whole files: what they may cost, and what is said of them.

use std::fs;

use serde_json::{Value, json};

use crate::{Decode, ErrorKind, ImportError, Imported, Limits, Options};

/// Reads a file beside images that are hard to compress.
fn read(document: &Value, limits: Limits) -> Result<Imported, ImportError> {
    read_with(document, &Options { limits, ..Options::default() })
}

fn read_with(document: &Value, options: &Options) -> Result<Imported, ImportError> {
    let dir = tempfile::tempdir().expect("temporary folder");
    for (k, name) in ["a.png", "b.png", "c.png"].into_iter().enumerate() {
        let noise =
            |x: u32, y: u32| image::Rgb([x * 97 + y * 31, x * y * 53, x * 7 + y * 89 + k as u32].map(|c| c as u8));
        image::RgbImage::from_fn(24, 24, noise).save(dir.path().join(name)).expect("image");
    }
    let path = dir.path().join("made.gltf");
    fs::write(&path, document.to_string()).expect("file");
    super::read(&path, options)
}

#[test]
fn zeros_are_limited_for_all_accessors_together() {
    // Each primitive is 100 points of twelve bytes, of which the file has none.
    let file = |primitives: usize| {
        json!({
            "asset": {"version": "2.0"},
            "accessors": [{"type": "VEC3", "componentType": 5126, "count": 100}],
            "meshes": [{"primitives": vec![json!({"attributes": {"POSITION": 0}}); primitives]}],
        })
    };
    let limits = Limits { file_bytes: 3600, ..Limits::default() };
    assert!(read(&file(3), limits).is_ok());
    let e = read(&file(4), limits).expect_err("too much");
    assert!(matches!(e.kind, ErrorKind::Limit(_)) && e.place == "/accessors/0", "{e}");
}

/// A material for each texture, a texture for each image.
fn painted(images: &Value) -> Value {
    let count = images.as_array().map_or(0, Vec::len);
    let paint = |i: usize| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}});
    json!({
        "asset": {"version": "2.0"},
        "images": images,
        "textures": (0..count).map(|i| json!({"source": i})).collect::<Vec<_>>(),
        "materials": (0..count).map(paint).collect::<Vec<_>>(),
    })
}

#[test]
fn images_of_one_file_are_one() {
    let images = json!([{"uri": "a.png"}, {"uri": "b.png"}, {"uri": "a.png", "name": "again"}]);
    let scene = read(&painted(&images), Limits::default()).expect("readable").scene;
    assert_eq!(scene.images.iter().map(|i| i.name.as_str()).collect::<Vec<_>>(), ["a.png", "b.png"]);
}

/// Adds a mesh that has the first two materials.
fn show_materials(document: &mut Value) {
    let accessor = |kind: &str| json!({"type": kind, "componentType": 5126, "count": 3});
    document["accessors"] = json!([accessor("VEC3"), accessor("VEC2")]);
    let attributes = json!({"POSITION": 0, "TEXCOORD_0": 1});
    let primitive = |material: u32| json!({"attributes": attributes, "material": material});
    document["meshes"] = json!([{"primitives": [primitive(0), primitive(1)]}]);
    document["nodes"] = json!([{"mesh": 0}]);
}

#[test]
fn kept_images_are_those_that_a_reading_needs() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("made.gltf");
    image::RgbImage::new(2, 2).save(dir.path().join("a.png")).expect("image");
    let images = json!([{"uri": "a.png"}, {"uri": "missing.png"}]);
    let mut document = painted(&images);
    document["materials"][0] = json!({"occlusionTexture": {"index": 0}});
    show_materials(&mut document);
    fs::write(&path, document.to_string()).expect("file");
    let cache = crate::ImageCache::default();
    let read = |seen: bool, image_bytes: u64| {
        let limits = Limits { image_bytes, ..Limits::default() };
        let images = Some(cache.clone());
        let decode = if seen { Decode::Seen } else { Decode::All };
        let options = Options { decode, limits, images, ..Options::default() };
        let read = super::read(&path, &options).expect("readable");
        (read.scene.images[0].width, read.report.warnings.len(), read.report.files.len())
    };
    // The image that is not there is warned of each time; the other one is a pixel where it is not decoded.
    assert_eq!([read(true, 1 << 20), read(true, 1 << 20)], [(1, 1, 1); 2]);
    assert_eq!([read(false, 1 << 20), read(false, 1 << 20)], [(2, 1, 2); 2]);
    assert_eq!(read(false, 8), (1, 2, 2));
}

#[test]
fn environments_share_the_limit_of_the_textures() {
    // A texture and six faces of 24 x 24 pixels of four bytes; the map takes 96 for each pixel of a face.
    let mut document = painted(&json!([{"uri": "a.png"}, {"uri": "b.png"}]));
    document["materials"].as_array_mut().expect("list").truncate(1);
    document["scenes"] = json!([{"extensions": {"EXT_lights_image_based": {"light": 0}}}]);
    let light = json!({"specularImages": [[1, 1, 1, 1, 1, 1]]});
    document["extensions"] = json!({"EXT_lights_image_based": {"lights": [light]}});
    let read = |image_bytes: u64| read(&document, Limits { image_bytes, ..Limits::default() }).expect("readable");
    let enough = 24 * 24 * (4 + 96);
    let found = read(enough);
    assert!(found.scene.environment.is_some(), "{:?}", found.report.warnings);
    let tight = read(enough - 1);
    assert!(tight.scene.environment.is_none());
    assert!(tight.report.warnings[0].message.contains("the environment needs 55296 bytes; 55295 are left"));
}

#[test]
fn encoded_images_are_limited_together() {
    // Other spellings of a path are other files to the reader.
    let images = json!([{"uri": "a.png"}, {"uri": "b.png"}, {"uri": "./a.png"}, {"uri": "./b.png"}]);
    let all = read(&painted(&images), Limits::default()).expect("readable");
    assert_eq!((all.scene.images.len(), all.report.more_warnings, all.report.warnings.len()), (4, 0, 0));
    // Each takes more than a kilobyte.
    let tight = read(&painted(&images), Limits { file_bytes: 3000, ..Limits::default() }).expect("readable");
    let limit = |w: &&crate::Warning| w.message.contains("bytes, the most that is read: white is shown instead");
    assert!(tight.report.warnings.iter().filter(limit).count() >= 2, "{:?}", tight.report.warnings);
}

#[test]
fn points_and_lines_are_counted_once() {
    let file = json!({
        "asset": {"version": "2.0"},
        "accessors": [{"type": "VEC3", "componentType": 5126, "count": 3}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0}, "mode": 4},
            {"attributes": {"POSITION": 0}, "mode": 0},
            {"attributes": {"POSITION": 0}, "mode": 3},
        ]}],
        "nodes": [{"mesh": 0, "weights": [0.5]}, {"mesh": 0, "weights": [1.0]}],
    });
    let report = read(&file, Limits::default()).expect("readable").report;
    let said: Vec<String> = report.warnings.iter().map(|w| format!("{}: {}", w.place, w.message)).collect();
    let undrawn: Vec<_> = said.iter().filter(|w| w.contains("points or lines")).collect();
    assert_eq!(undrawn, ["/meshes/0/primitives/1: 2 primitives of points or lines are not drawn"], "{said:?}");
}

#[test]
fn what_lies_out_of_all_range_is_left_out() {
    let file = json!({
        "asset": {"version": "2.0"},
        "accessors": [{"type": "VEC3", "componentType": 5126, "count": 3}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [
            {"scale": [1e308, 1e308, 1e308], "children": [1]},
            {"translation": [10.0, 0.0, 0.0], "mesh": 0},
        ],
    });
    let read = read(&file, Limits::default()).expect("readable");
    assert!(read.scene.instances.is_empty() && read.scene.meshes.is_empty());
    assert_eq!(read.report.warnings.last().map(|w| w.place.as_str()), Some("/nodes/1"));
}

#[test]
fn images_of_occlusion_alone_are_left_out_where_that_is_asked() {
    let mut file = json!({
        "asset": {"version": "2.0"},
        "images": [{"uri": "a.png"}, {"uri": "b.png"}],
        "textures": [{"source": 0}, {"source": 1}],
        "materials": [{
            "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}},
            "occlusionTexture": {"index": 1},
        }, {"occlusionTexture": {"index": 0}}],
    });
    show_materials(&mut file);
    for (decode, widths) in [(Decode::All, [24, 24]), (Decode::Seen, [24, 1]), (Decode::Nothing, [1, 1])] {
        let scene = read_with(&file, &Options { decode, ..Options::default() }).expect("readable").scene;
        assert_eq!(scene.images.iter().map(|i| i.width).collect::<Vec<_>>(), widths);
    }
}

#[test]
fn points_and_lines_have_bodies_where_that_is_asked() {
    let file = json!({
        "asset": {"version": "2.0"},
        "accessors": [{"type": "VEC3", "componentType": 5126, "count": 3}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0}, "mode": 0},
            {"attributes": {"POSITION": 0}, "mode": 3},
        ]}],
        "nodes": [{"mesh": 0}],
    });
    let strokes = super::Strokes { points: Some(0.5), lines: Some(0.5), thin: false };
    let read = read_with(&file, &Options { strokes, ..Options::default() }).expect("readable");
    let crate::scene::SurfaceDesc::Triangles(mesh) = &read.scene.meshes[0].geometries[0].surface else {
        panic!("no triangles")
    };
    assert_eq!((mesh.triangles.len(), mesh.positions[0].length()), (3 * 32, 0.5));
    // All three stand at one place: lines between them have no length.
    assert_eq!(read.scene.meshes[0].geometries.len(), 1);
    assert!(!read.report.warnings.iter().any(|w| w.message.contains("not drawn")));
    let limits = Limits { elements: 90, ..Limits::default() };
    let error = read_with(&file, &Options { strokes, limits, ..Options::default() }).expect_err("too many");
    assert!(matches!(error.kind, ErrorKind::Limit(_)), "{error}");
}

#[test]
fn points_and_lines_without_a_radius_are_thin_and_not_too_many() {
    let bytes = [0.0_f32, 0.0, 0.0, 300.0, 400.0, 0.0].into_iter().flat_map(f32::to_le_bytes);
    let uri = format!("data:application/octet-stream,{}", bytes.map(|b| format!("%{b:02x}")).collect::<String>());
    let mut file = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 24, "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": 24}],
        "accessors": [{"type": "VEC3", "componentType": 5126, "count": 2, "bufferView": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}],
        "nodes": [{"mesh": 0}],
    });
    let strokes = super::Strokes { thin: true, ..super::Strokes::default() };
    let options = Options { strokes, ..Options::default() };
    let read = read_with(&file, &options).expect("readable");
    let crate::scene::SurfaceDesc::Triangles(mesh) = &read.scene.meshes[0].geometries[0].surface else {
        panic!("no triangles")
    };
    assert_eq!((mesh.triangles.len(), mesh.positions[0]), (2 * 32, glam::Vec3::new(500.0 / 400.0, 0.0, 0.0)));
    assert_eq!(read.report.warnings, []);
    // The same two points, 5,001 times.
    let primitive = file["meshes"][0]["primitives"][0].clone();
    file["meshes"][0]["primitives"] = vec![primitive; 5_001].into();
    let read = read_with(&file, &options).expect("readable");
    assert_eq!(read.scene.meshes[0].geometries.len(), 5_000);
    let said: Vec<_> = read.report.warnings.iter().map(|w| (w.place.as_str(), w.message.as_str())).collect();
    assert_eq!(
        said,
        [("/meshes/0/primitives/5000", "2 points or ends of lines are too many to be drawn unless a radius is given")]
    );
}

#[test]
fn textures_without_their_coordinates_are_told_of() {
    let file = json!({
        "asset": {"version": "2.0"},
        "images": [{"uri": "a.png"}],
        "textures": [{"source": 0}],
        "materials": [{"emissiveTexture": {"index": 0, "texCoord": 1}}],
        "accessors": [
            {"type": "VEC3", "componentType": 5126, "count": 3},
            {"type": "VEC2", "componentType": 5126, "count": 3},
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]},
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 1}, "material": 0}]},
        ],
    });
    let report = read_with(&file, &Options::default()).expect("readable").report;
    let told: Vec<_> = report.warnings.iter().filter(|w| w.message.contains("TEXCOORD_1")).collect();
    assert_eq!(told.len(), 1, "{:?}", report.warnings);
    assert_eq!(told[0].place, "/meshes/0/primitives/0/attributes");
}
