//! EXT_meshopt_compression and KHR_meshopt_compression.

use firsthit_import::{ErrorKind, Limits, Options, gltf};
use glam::{Vec3, Vec4};
use proptest::prelude::*;
use serde_json::json;

use super::{assert_same, asset, damaged, edited, mesh, read, unmatched};

const CUBES: &str = "meshopt-cube-test/glTF-Meshopt/MeshoptCubeTest.gltf";

/// Five cubes stored plainly, then the same in rows: indices as sequences, as triangles, with filters, and with
/// filters in the later version of the codec. All modes and filters but QUATERNION, which is for animations.
#[test]
fn every_mode_and_filter_gives_what_is_stored_plainly() {
    let Some(path) = asset(CUBES) else { return };
    let scene = read(&path).unwrap().scene;
    let cube = |row: usize, column: usize| mesh(&scene, 10 + 5 * row + column, 0);
    let (mut normals, mut colors) = (0.0_f32, 0.0_f32);
    for row in 1..5 {
        for column in 0..5 {
            let (plain, packed) = (cube(0, column), cube(row, column));
            let corners = |m: &firsthit_import::scene::TriangleMesh| {
                m.triangles.iter().map(|t| t.map(|v| m.positions[v as usize].as_dvec3())).collect::<Vec<_>>()
            };
            let (a, b) = (corners(packed), corners(plain));
            assert_eq!((a.len(), unmatched(&a, &b, 1e-30)), (b.len(), 0), "row {row}, column {column}");
            // Attributes are compared by what stands at the corners; each face of a cube has its own.
            let find = |p: Vec3, n: Vec3| {
                let near = |&v: &usize| plain.positions[v] == p && plain.normals[v].dot(n) > 0.9;
                (0..plain.positions.len()).find(near).unwrap()
            };
            for v in 0..packed.positions.len() {
                let twin = find(packed.positions[v], packed.normals[v]);
                let normal = (packed.normals[v] - plain.normals[twin]).abs().max_element();
                let color = match packed.colors.get(v) {
                    Some(&c) => (c - plain.colors[twin]).abs().max_element(),
                    None => Vec4::ZERO.x,
                };
                // Without a filter nothing is lost.
                if row < 3 {
                    assert_eq!((normal, color), (0.0, 0.0), "row {row}, column {column}, vertex {v}");
                }
                (normals, colors) = (normals.max(normal), colors.max(color));
            }
        }
    }
    println!("through filters: normals off by {normals}, colours by {colors}");
    // Eight bits, of which filters take one.
    assert!(normals < 1.0 / 127.0 && colors < 2.0 / 255.0, "{normals} {colors}");
}

#[test]
fn models_agree_with_their_plain_twins() {
    for packed in ["gltf-transform-tests/BoxMeshopt.gltf", "gltf-transform-tests/BoxMeshopt.glb"] {
        assert_same(packed, "khronos/Box/glTF-Binary/Box.glb", 1e-4);
    }
    assert_same(
        "meshopt-box-textured/BoxTextured_meshopt.glb",
        "khronos/BoxTextured/glTF-Binary/BoxTextured.glb",
        1e-4,
    );
    // One under both names of the extension.
    let folder = |name: &str| format!("gltf-pipeline-tests/{name}/meshopt-no-fallback/meshopt-no-fallback.gltf");
    assert_same(&folder("KHR_meshopt_compression"), &folder("EXT_meshopt_compression"), 1e-12);
}

#[test]
fn what_an_extension_says_is_checked() {
    let Some(path) = asset("gltf-transform-tests/BoxMeshopt.gltf") else { return };
    for (key, value, cause) in [
        ("buffer", json!(7), "element 7 does not exist"),
        ("byteOffset", json!(200), "leave buffer 0, which has"),
        ("byteLength", json!(u64::MAX), "leave buffer 0, which has"),
        ("count", json!(1), "are not the"),
        ("count", json!(u64::MAX), "are not the"),
        ("byteStride", json!(0), "are not the"),
        ("mode", json!("LINES"), "'LINES' is none of"),
        ("filter", json!("SEPIA"), "'SEPIA' is none of"),
        ("filter", json!("QUATERNION"), ""),
        ("mode", json!(3), "invalid type"),
    ] {
        let error = edited(&path, |v| {
            v["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][key] = value.clone();
        })
        .unwrap_err();
        assert!(error.place.starts_with("/bufferViews/0/extensions/EXT_meshopt_compression"), "{error}");
        assert!(error.to_string().contains(cause), "{key}: {error}");
    }
}

#[test]
fn declared_sizes_are_limited_before_anything_is_allocated() {
    let Some(path) = asset("gltf-transform-tests/BoxMeshopt.gltf") else { return };
    let declare = |v: &mut serde_json::Value, count: u64, stride: u64| {
        let view = &mut v["bufferViews"][0];
        view["byteLength"] = json!(count * stride);
        view["byteStride"] = json!(stride);
        let extension = &mut view["extensions"]["EXT_meshopt_compression"];
        (extension["count"], extension["byteStride"]) = (json!(count), json!(stride));
        v["buffers"][1]["byteLength"] = json!(count * stride + 1000);
    };
    let error = edited(&path, |v| declare(v, 1 << 28, 8)).unwrap_err();
    assert!(error.to_string().contains("cannot become 2147483648"), "{error}");
    let options = Options { limits: Limits { file_bytes: 250, ..Limits::default() }, ..Options::default() };
    let error = gltf::read(&path, &options).unwrap_err();
    assert!(matches!(error.kind, ErrorKind::Limit(_)), "{error}");
}

#[test]
fn a_fallback_is_only_read_where_it_is_needed() {
    let Some(path) = asset("gltf-transform-tests/BoxMeshopt.gltf") else { return };
    // The file of the fallback is not there.
    let missing = |v: &mut serde_json::Value| v["buffers"][1]["uri"] = json!("fallback.bin");
    assert!(edited(&path, missing).is_ok());
    let error = edited(&path, |v| {
        missing(v);
        v["bufferViews"][0].as_object_mut().unwrap().remove("extensions");
    })
    .unwrap_err();
    assert_eq!(error.place, "/buffers/1/uri");
    let error = edited(&path, |v| {
        v["bufferViews"][0].as_object_mut().unwrap().remove("extensions");
    })
    .unwrap_err();
    assert!(error.to_string().contains("has no data"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn damaged_streams_do_no_harm(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
    ) {
        let Some(path) = asset(CUBES) else { return Ok(()) };
        let _ = damaged(&path, "MeshoptCubeTest.bin", |bytes| {
            for (at, byte) in changes {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
        });
    }
}
