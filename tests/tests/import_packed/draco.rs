//! KHR_draco_mesh_compression.

use std::time::{Duration, Instant};

use firsthit_import::{ErrorKind, Limits, Options, gltf};
use proptest::prelude::*;
use serde_json::json;

use super::{assert_same, asset, damaged, edited, mesh, read, scene};

/// Compressed models and the same without compression; positions have 11 to 14 bits.
const TWINS: &[(&str, &str)] = &[
    ("khronos/Box/glTF-Draco/Box.gltf", "khronos/Box/glTF-Binary/Box.glb"),
    ("gltf-transform-tests/BoxDraco.gltf", "khronos/Box/glTF-Binary/Box.glb"),
    ("khronos/Duck/glTF-Draco/Duck.gltf", "khronos/Duck/glTF-Binary/Duck.glb"),
    ("khronos/RiggedSimple/glTF-Draco/RiggedSimple.gltf", "khronos/RiggedSimple/glTF-Binary/RiggedSimple.glb"),
    (
        "khronos/MorphPrimitivesTest/glTF-Draco/MorphPrimitivesTest.gltf",
        "khronos/MorphPrimitivesTest/glTF-Binary/MorphPrimitivesTest.glb",
    ),
];

#[test]
fn models_agree_with_their_plain_twins() {
    for (packed, plain) in TWINS {
        assert_same(packed, plain, 1e-3);
    }
}

/// Attributes belong to the right vertices: those of the nearest one in the twin are nearly the same.
#[test]
fn attributes_stay_with_their_vertices() {
    for (packed, plain) in [TWINS[2], TWINS[3]] {
        let (Some(packed), Some(plain)) = (asset(packed), asset(plain)) else { return };
        let (a, b) = (scene(&packed), scene(&plain));
        let (a, b) = (mesh(&a, 0, 0), mesh(&b, 0, 0));
        let size = b.positions.iter().fold(0.0_f32, |most, p| most.max(p.abs().max_element()));
        let mut apart = 0;
        for v in 0..a.positions.len() {
            // Among the vertices that stand there one has this normal and these coordinates.
            let same = |w: usize| {
                let uv = |m: &firsthit_import::scene::TriangleMesh, i: usize| m.uvs.first().map(|set| set[i]);
                let uvs = uv(a, v).zip(uv(b, w)).is_none_or(|(s, t)| s.distance(t) < 2e-3);
                a.positions[v].distance(b.positions[w]) < 2e-3 * size && a.normals[v].dot(b.normals[w]) > 0.99 && uvs
            };
            apart += usize::from(!(0..b.positions.len()).any(same));
        }
        assert_eq!(apart, 0, "of {}", a.positions.len());
    }
}

#[test]
fn larger_models_are_read_whole_and_in_time() {
    for (file, triangles) in [
        ("khronos/BrainStem/glTF-Draco/BrainStem.gltf", 61_666),
        ("chess-board/chess-board.glb", 178_848),
        ("gltf-transform-tests/DenseSphere.glb", 30_720),
        ("playcanvas-examples/heart_draco.glb", 180),
    ] {
        let Some(path) = asset(file) else { return };
        let start = Instant::now();
        let scene = scene(&path);
        println!("{file}: {:?}", start.elapsed());
        assert!(start.elapsed() < Duration::from_secs(5), "{file}: {:?}", start.elapsed());
        assert_eq!(super::triangles(&scene).len(), triangles, "{file}");
    }
    let Some(path) = asset("gltf-transform-tests/DenseSphere.glb") else { return };
    let scene = scene(&path);
    // Nearly a sphere of radius 1: all triangles face outwards.
    let mesh = mesh(&scene, 0, 0);
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        assert!((b - a).cross(c - a).normalize().dot(a) > 0.95, "{a} {b} {c}");
        assert!((a.length() - 1.0).abs() < 0.01, "{a}");
    }
}

#[test]
fn what_an_extension_says_is_checked() {
    let Some(path) = asset("khronos/Box/glTF-Draco/Box.gltf") else { return };
    let with = |edit: &dyn Fn(&mut serde_json::Value)| edited(&path, |v| edit(v)).unwrap_err();
    let primitive = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    for (pointer, value, cause) in [
        ("/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression/bufferView", json!(9), "does not exist"),
        ("/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression/bufferView", json!("x"), ""),
        ("/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression/attributes/POSITION", json!(7), "missing"),
        ("/meshes/0/primitives/0/mode", json!(1), "only triangles"),
        ("/accessors/0/count", json!(39), "39"),
        ("/accessors/0/count", json!(u64::MAX), ""),
        ("/accessors/2/count", json!(25), "25"),
        ("/bufferViews/0/byteLength", json!(60), ""),
    ] {
        let error = with(&|v| *v.pointer_mut(pointer).unwrap() = value.clone());
        let placed = error.place.starts_with(primitive) || error.place.starts_with("/accessors");
        assert!(placed && error.to_string().contains(cause), "{pointer}: {error}");
    }
}

#[test]
fn what_streams_become_is_limited() {
    let Some(path) = asset("gltf-transform-tests/DenseSphere.glb") else { return };
    for limits in
        [Limits { elements: 20_000, ..Limits::default() }, Limits { file_bytes: 100_000, ..Limits::default() }]
    {
        let error = gltf::read(&path, &Options { limits, ..Options::default() }).unwrap_err();
        assert!(matches!(error.kind, ErrorKind::Limit(_)), "{error}");
    }
    // Ten thousand primitives that claim a million corners each of the same few bytes.
    let Some(path) = asset("khronos/Box/glTF-Draco/Box.gltf") else { return };
    let error = edited(&path, |v| {
        v["accessors"][0]["count"] = json!(1_000_000);
        let primitive = v["meshes"][0]["primitives"][0].clone();
        v["meshes"][0]["primitives"] = vec![primitive; 10_000].into();
    })
    .unwrap_err();
    assert!(matches!(error.kind, ErrorKind::Limit(_)), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    /// Streams changed anywhere, most often at their beginning, where the counts stand.
    #[test]
    fn damaged_streams_do_no_harm(
        which in 0_usize..3,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), any::<bool>()), 1..8),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let (model, bin) = [
            ("khronos/Box/glTF-Draco/Box.gltf", "Box.bin"),
            ("khronos/RiggedSimple/glTF-Draco/RiggedSimple.gltf", "RiggedSimple0.bin"),
            ("khronos/MorphPrimitivesTest/glTF-Draco/MorphPrimitivesTest.gltf", "MorphPrimitivesTest.bin"),
        ][which];
        let Some(path) = asset(model) else { return Ok(()) };
        let start = Instant::now();
        let result = damaged(&path, bin, |bytes| {
            for (at, byte, early) in changes {
                let at = at.index(if early { 64 } else { bytes.len() });
                bytes[at] = byte;
            }
            if let Some(cut) = cut {
                let end = cut.index(bytes.len());
                bytes[end..].fill(0);
            }
        });
        prop_assert!(start.elapsed() < Duration::from_secs(5));
        if let Err(error) = result {
            prop_assert!(!error.to_string().contains("decoder of Draco streams failed"), "{}", error);
        }
    }
}

#[test]
fn an_optional_extension_needs_no_fallback() {
    let Some(path) = asset("gltf-transform-tests/BoxDraco.gltf") else { return };
    assert!(read(&path).unwrap().report.warnings.is_empty());
}
