//! EXT_mesh_gpu_instancing.

use firsthit_import::{ErrorKind, Limits, Options, gltf};
use glam::{DMat3, DQuat, DVec3};
use serde_json::json;

use super::{asset, edited, read};

#[test]
fn instances_share_their_mesh() {
    let Some(path) = asset("gpu-instancing-teapots/teapots_galore.gltf") else { return };
    let read = read(&path).unwrap();
    let scene = &read.scene;
    assert_eq!(scene.meshes.len(), 2);
    assert_eq!(read.report.triangles_all_scenes, 7_656_770);
    assert!(read.report.warnings.is_empty());
    let stored: usize = (0..2).map(|m| super::mesh(scene, m, 0).triangles.len()).sum();
    assert_eq!(stored, 4034);
    for (name, count) in [("teapot", 958), ("teapot0", 941), ("plane", 1)] {
        let all: Vec<_> = scene.instances.iter().filter(|i| i.name == name).collect();
        assert_eq!((all.len(), all[0].mesh), (count, usize::from(name == "plane")), "{name}");
    }
}

#[test]
fn a_place_is_a_scale_a_rotation_and_a_translation_below_the_node() {
    let Some(path) = asset("khronos/SimpleInstancing/glTF/SimpleInstancing.gltf") else { return };
    let plain = read(&path).unwrap().scene;
    assert_eq!(plain.instances.len(), 125);
    let moved = edited(&path, |v| {
        let node = v["nodes"].as_array_mut().unwrap().iter_mut().find(|n| n.get("mesh").is_some()).unwrap();
        node["translation"] = json!([100, 0, 0]);
        node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"].as_object_mut().unwrap().remove("ROTATION");
    })
    .unwrap()
    .scene;
    for (a, b) in plain.instances.iter().zip(&moved.instances) {
        let translation = a.transform.translation + 100.0 * DVec3::X;
        assert!((translation - b.transform.translation).length() < 1e-9);
        // The scale alone is left.
        let scale = DVec3::from_array([0, 1, 2].map(|k| a.transform.matrix3.col(k).length()));
        assert!((DMat3::from_diagonal(scale) - b.transform.matrix3).to_cols_array().iter().all(|x| x.abs() < 1e-6));
    }
    assert!(plain.instances.iter().any(|i| i.transform.matrix3.x_axis.y.abs() > 0.1), "some are turned");
}

/// The rotations of the animations of this file are stored plainly, compressed, and through the filter QUATERNION.
#[test]
fn rotations_may_be_compressed_with_their_filter() {
    let Some(path) = asset("meshopt-cube-test/glTF-Meshopt/MeshoptCubeTest.gltf") else { return };
    let file: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let animation = &file["animations"];
    let outputs = animation.as_array().unwrap().iter().flat_map(|a| a["samplers"].as_array().unwrap());
    let outputs: Vec<u64> = outputs.map(|s| s["output"].as_u64().unwrap()).collect();
    assert_eq!(outputs.len(), 5);
    let rotations = |accessor: u64| -> Vec<DQuat> {
        let scene = edited(&path, |v| {
            let nodes = v["nodes"].as_array_mut().unwrap();
            nodes.iter_mut().for_each(|n| drop(n.as_object_mut().unwrap().remove("rotation")));
            let node = nodes.iter_mut().find(|n| n["name"].as_str().unwrap().starts_with("Cube_0")).unwrap();
            node["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"ROTATION": accessor}}});
        })
        .unwrap()
        .scene;
        let instances = scene.instances.iter().filter(|i| i.name.starts_with("Cube_0"));
        instances.map(|i| i.transform.to_scale_rotation_translation().1).collect()
    };
    let plain = rotations(outputs[0]);
    assert!(plain.len() > 2, "{}", plain.len());
    let mut most = 0.0_f64;
    for &output in &outputs[1..] {
        let packed = rotations(output);
        assert_eq!(packed.len(), plain.len());
        let apart = packed.iter().zip(&plain).map(|(a, b)| (*a - *b).length().min((*a + *b).length()));
        most = apart.fold(most, f64::max);
    }
    println!("quaternions differ by {most} at most");
    assert!(most < 1e-3, "{most}");
}

#[test]
fn what_an_extension_says_is_checked() {
    let Some(path) = asset("khronos/SimpleInstancing/glTF/SimpleInstancing.gltf") else { return };
    for (key, value, cause) in [
        ("TRANSLATION", json!(99), "does not exist"),
        ("TRANSLATION", json!(-1), "invalid value"),
        ("ROTATION", json!(0), "expected Vec4"),
    ] {
        let error = edited(&path, |v| {
            let node = v["nodes"].as_array_mut().unwrap().iter_mut().find(|n| n.get("mesh").is_some()).unwrap();
            node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"][key] = value.clone();
        })
        .unwrap_err();
        assert!(error.place.contains("/extensions/EXT_mesh_gpu_instancing/attributes"), "{error}");
        assert!(error.to_string().contains(cause), "{key}: {error}");
    }
    let options = Options { limits: Limits { instances: 124, ..Limits::default() }, ..Options::default() };
    assert!(matches!(gltf::read(&path, &options).unwrap_err().kind, ErrorKind::Limit(_)));
}
