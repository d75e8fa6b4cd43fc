//! The glTF reader against every glTF file of the public data: the verdict of Khronos's validator, triangle counts,
//! time, and what single models are known to hold.

use std::f64::consts::FRAC_1_SQRT_2;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use firsthit_import::scene::{
    AlphaMode, Channel, Filter, LightKind, MaterialModel, PbrMaterial, Projection, SpotRamp, SurfaceDesc, TriangleMesh,
    Wrap,
};
use firsthit_import::{ErrorKind, ImportError, Imported, Limits, Options, SceneDesc, Support, gltf};
use glam::{DVec3, Vec2, Vec3, Vec4};
use proptest::prelude::*;
use serde_json::{Value, json};

/// A row of `gltf-inventory.csv`.
struct Row {
    file: String,
    valid: bool,
    first_error: String,
    required: Vec<String>,
    triangles_instanced: u64,
}

/// The table's rows. Fields may be in quotes, with quotes doubled.
fn inventory(text: &str) -> Vec<Row> {
    let mut lines = text.lines().map(firsthit_tests::csv_fields);
    let header = lines.next().unwrap();
    lines
        .map(|fields| {
            let get = |name: &str| fields[header.iter().position(|h| h == name).unwrap()].clone();
            let list = |name: &str| get(name).split_whitespace().map(str::to_owned).collect();
            Row {
                file: get("file"),
                valid: get("valid") == "yes",
                first_error: get("first_error"),
                required: list("extensionsRequired"),
                triangles_instanced: get("triangles_instanced").parse().unwrap_or(0),
            }
        })
        .collect()
}

fn read(path: &Path) -> Result<Imported, ImportError> {
    gltf::read(path, &Options::default())
}

/// Faults by which a reader cannot know what is meant; the codes are those of Khronos's validator. All others leave
/// the meaning plain (unsorted lists, missing bounds, ...) or are in what no picture shows (animations, ...).
const FATAL: &[&str] = &[
    "ACCESSOR_INDEX_OOB",
    "ACCESSOR_INDEX_PRIMITIVE_RESTART",
    "ACCESSOR_SMALL_BYTESTRIDE",
    "ACCESSOR_SPARSE_COUNT_OUT_OF_RANGE",
    "ASSET_MIN_VERSION_GREATER_THAN_VERSION",
    "BUFFER_BYTE_LENGTH_MISMATCH",
    "BUFFER_VIEW_TOO_LONG",
    "GLB_CHUNK_TOO_BIG",
    "GLB_DUPLICATE_CHUNK",
    "GLB_EMPTY_CHUNK",
    "GLB_INVALID_VERSION",
    "GLB_LENGTH_MISMATCH",
    "GLB_LENGTH_TOO_SMALL",
    "GLB_UNEXPECTED_BIN_CHUNK",
    "GLB_UNEXPECTED_END_OF_CHUNK_DATA",
    "GLB_UNEXPECTED_FIRST_CHUNK",
    "INVALID_INDEX",
    "INVALID_JSON",
    "IO_ERROR",
    "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT",
    "MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT",
    "MESH_PRIMITIVE_JOINTS_WEIGHTS_MISMATCH",
    "MESH_PRIMITIVE_MORPH_TARGET_INVALID_ATTRIBUTE_COUNT",
    "MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT",
    "NODE_LOOP",
    "NODE_MATRIX_NON_TRS",
    "NODE_MATRIX_TRS",
    "SCENE_NON_ROOT_NODE",
    "TYPE_MISMATCH",
    "UNDEFINED_PROPERTY",
    "UNKNOWN_ASSET_MAJOR_VERSION",
    "UNRESOLVED_REFERENCE",
    "VALIDATOR_REFUSED: Invalid data: could not detect glTF format.",
];

/// Files with one of those faults that load nevertheless, and why that is right.
const HARMLESS: &[(&str, &str)] = &[
    ("/animation/", "animations are looked at when one is played"),
    ("/KHR_materials_variants/", "variants are only looked at when one is asked for"),
    ("/bom.", "a byte order mark is passed over"),
    ("/image/not_found.gltf", "images that are missing are warnings, and nothing uses this one"),
    ("meshopt-cube-test/", "images that are missing are warnings"),
    ("data/root/extensions_non_objects.gltf", "only unknown extensions are no objects"),
    ("/light/spot_light_without_spot_object.gltf", "no node has this light"),
];

/// Files without faults by the letter that nevertheless cannot be shown: their buffers have no data.
const EMPTY: &[&str] = &["data/root/named_objects.gltf", "data/root/unused_objects.gltf"];

#[test]
fn every_file_gives_the_right_answer_or_a_clear_error() {
    let Some(shared) = firsthit_tests::shared() else { return };
    let assets = shared.join("assets");
    let rows = inventory(&fs::read_to_string(assets.join("gltf-inventory.csv")).unwrap());
    assert!(rows.len() > 500, "{} rows", rows.len());
    let (mut loaded, mut refused, mut absent) = (0, 0, 0);
    let mut wrong = Vec::new();
    for row in &rows {
        let path = assets.join(&row.file);
        if !path.exists() {
            absent += 1;
            continue;
        }
        let Ok((result, time)) = catch_unwind(AssertUnwindSafe(|| timed(&path))) else {
            wrong.push(format!("{}: panics", row.file));
            continue;
        };
        if time > Duration::from_secs(2) {
            wrong.push(format!("{}: takes {time:?}", row.file));
        }
        if let Some(complaint) = judge(row, &result) {
            wrong.push(format!("{}: {complaint}", row.file));
        }
        *(if result.is_ok() { &mut loaded } else { &mut refused }) += 1;
    }
    firsthit_tests::summary(&format!(
        "glTF files: {loaded} loaded, {refused} refused, skipped: {absent} of the table's files that are not there"
    ));
    println!("{} disagreements\n{}", wrong.len(), wrong.join("\n"));
    if let Some(bytes) = peak_memory() {
        println!("at most {} MB of memory", bytes >> 20);
        assert!(bytes < 1 << 30, "{bytes} bytes");
    }
    assert!(wrong.is_empty());
}

/// Reads a file, again if that took too long: other processes may have been in the way.
fn timed(path: &Path) -> (Result<Imported, ImportError>, Duration) {
    let once = || {
        let start = Instant::now();
        (read(path), start.elapsed())
    };
    (0..3).map(|_| once()).find(|(_, time)| *time < Duration::from_secs(2)).unwrap_or_else(once)
}

/// What is wrong with an answer.
fn judge(row: &Row, result: &Result<Imported, ImportError>) -> Option<String> {
    let unsupported =
        row.required.iter().find(|name| gltf::find_extension(name).is_none_or(|e| e.support == Support::Unsupported));
    match result {
        Ok(_) if unsupported.is_some() => Some(format!("loads, though it requires {unsupported:?}")),
        Ok(read) if row.valid => {
            let (found, wanted) = (read.report.triangles_all_scenes, row.triangles_instanced);
            if found != wanted {
                return Some(format!("{found} triangles, expected {wanted}"));
            }
            check(&read.scene)
        }
        Ok(read) => {
            let harmless = HARMLESS.iter().any(|(part, _)| row.file.contains(part));
            let fatal = FATAL.contains(&row.first_error.as_str()) && !harmless;
            fatal.then(|| format!("loads in spite of {}", row.first_error)).or_else(|| check(&read.scene))
        }
        Err(error) if row.valid => match (&error.kind, unsupported) {
            (ErrorKind::Unsupported(cause), Some(name)) if cause.contains(name.as_str()) => None,
            (ErrorKind::Unsupported(_), None) if error.place == "/asset/minVersion" => None,
            _ if EMPTY.iter().any(|name| row.file.ends_with(name)) && error.to_string().contains("has no data") => None,
            _ => Some(format!("refused though valid: {error}")),
        },
        Err(error) => {
            let text = error.to_string();
            (error.place.is_empty() && text.len() < 20).then(|| format!("unclear: {text}"))
        }
    }
}

/// What a scene may not be, by its own documentation.
fn check(scene: &SceneDesc) -> Option<String> {
    for instance in &scene.instances {
        if instance.mesh >= scene.meshes.len() || !(instance.transform.matrix3.determinant().abs() > 0.0) {
            return Some(format!("instance {} is broken", instance.name));
        }
    }
    for geometry in scene.meshes.iter().flat_map(|m| &m.geometries) {
        let SurfaceDesc::Triangles(mesh) = &geometry.surface else { continue };
        let count = mesh.positions.len();
        let attributes = [mesh.normals.len(), mesh.tangents.len(), mesh.colors.len()];
        let lengths = attributes.into_iter().chain(mesh.uvs.iter().map(Vec::len)).all(|n| n == 0 || n == count);
        let indices = mesh.triangles.as_flattened().iter().all(|&i| (i as usize) < count);
        let unit = |v: Vec3| (v.length() - 1.0).abs() < 1e-5;
        let directions = mesh.normals.iter().all(|&n| unit(n)) && mesh.tangents.iter().all(|t| unit(t.truncate()));
        let finite = mesh.positions.iter().all(|p| p.is_finite());
        let material = geometry.material.is_none_or(|m| m < scene.materials.len());
        if !(lengths && indices && directions && finite && material) {
            return Some(format!("geometry {} is broken", geometry.name));
        }
    }
    None
}

/// The most memory that this process ever had.
fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}

/// A model of `assets/khronos`.
fn khronos(file: &str) -> Option<PathBuf> {
    Some(firsthit_tests::shared()?.join("assets/khronos").join(file))
}

fn triangles(scene: &SceneDesc, mesh: usize, geometry: usize) -> &TriangleMesh {
    match &scene.meshes[mesh].geometries[geometry].surface {
        SurfaceDesc::Triangles(mesh) => mesh,
        SurfaceDesc::Shape(_) => panic!("glTF has no shapes"),
    }
}

fn pbr(scene: &SceneDesc, material: usize) -> &PbrMaterial {
    match &scene.materials[material].model {
        MaterialModel::Pbr(pbr) => pbr,
        _ => panic!("glTF has one model of materials"),
    }
}

#[test]
fn khronos_layered_materials_are_read() {
    let Some(path) = khronos("ClearCoatTest/glTF-Binary/ClearCoatTest.glb") else { return };
    let scene = read(&path).unwrap().scene;
    assert!(pbr(&scene, 0).clearcoat.is_none());
    let coat = pbr(&scene, 7).clearcoat.as_ref().unwrap();
    assert_eq!((coat.factor, coat.roughness), (1.0, 1.0));
    assert_eq!(coat.roughness_texture.as_ref().unwrap().channel, Channel::Green);
    let coat = pbr(&scene, 13).clearcoat.as_ref().unwrap();
    assert!(coat.normal_texture.is_some() && pbr(&scene, 13).normal_texture.is_none());
    assert!(
        scene.instances.iter().any(|i| {
            let geometry = &scene.meshes[i.mesh].geometries[0];
            geometry.material == Some(13) && !triangles(&scene, i.mesh, 0).tangents.is_empty()
        }),
        "the coat's normal map needs tangents"
    );

    let Some(path) = khronos("IridescenceSuzanne/glTF-Binary/IridescenceSuzanne.glb") else { return };
    let scene = read(&path).unwrap().scene;
    let film = pbr(&scene, 2).iridescence.as_ref().unwrap();
    assert_eq!((film.factor, film.ior, film.thickness_min, film.thickness_max), (1.0, 1.8, 200.0, 600.0));
    assert_eq!(film.thickness_texture.as_ref().unwrap().channel, Channel::Green);
    assert_eq!(pbr(&scene, 0).iridescence.as_ref().unwrap().thickness_min, 100.0, "the format's default");

    let Some(path) = khronos("AnisotropyRotationTest/glTF-Binary/AnisotropyRotationTest.glb") else { return };
    let scene = read(&path).unwrap().scene;
    let brushed = pbr(&scene, 3).anisotropy.as_ref().unwrap();
    assert_eq!((brushed.strength, brushed.rotation), (0.5, 0.349_065_850_398_866_f64 as f32), "what the file says");
    assert!(brushed.texture.is_some());
}

#[test]
fn a_variant_is_chosen_by_name_or_number() {
    let Some(path) = khronos("GlamVelvetSofa/glTF-Binary/GlamVelvetSofa.glb") else { return };
    let fabric = |variant: Option<&str>| {
        let options = Options { variant: variant.map(str::to_owned), ..Options::default() };
        let Imported { scene, report } = gltf::read(&path, &options)?;
        assert_eq!(report.variants, ["Champagne", "Navy", "Gray", "Black", "Pale Pink"]);
        let used = scene.instances.iter().flat_map(|i| &scene.meshes[i.mesh].geometries).filter_map(|g| g.material);
        let mut names: Vec<_> = used.map(|m| scene.materials[m].name.clone()).collect();
        names.retain(|name| name.contains("fabric"));
        Ok::<_, ImportError>(names)
    };
    assert_eq!(fabric(None).unwrap(), ["GlamVelvetSofa_fabric_navy"]);
    assert_eq!(fabric(Some("Pale Pink")).unwrap(), ["GlamVelvetSofa_fabric_palepink"]);
    assert_eq!(fabric(Some("0")).unwrap(), ["GlamVelvetSofa_fabric_champagne"]);
    let error = fabric(Some("Red")).unwrap_err().to_string();
    assert!(error.contains("'Red'") && error.contains("4 'Pale Pink'"), "{error}");

    let Some(path) = khronos("Box/glTF-Binary/Box.glb") else { return };
    let options = Options { variant: Some("x".into()), ..Options::default() };
    assert!(gltf::read(&path, &options).unwrap_err().to_string().contains("the file has none"));
}

/// All corners of triangles, in the world, in the order of the file.
fn corners(scene: &SceneDesc) -> Vec<DVec3> {
    let mut corners = Vec::new();
    for instance in &scene.instances {
        for g in 0..scene.meshes[instance.mesh].geometries.len() {
            let mesh = triangles(scene, instance.mesh, g);
            let world = |&v: &u32| instance.transform.transform_point3(mesh.positions[v as usize].as_dvec3());
            corners.extend(mesh.triangles.as_flattened().iter().map(world));
        }
    }
    corners
}

fn bounds(scene: &SceneDesc) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    corners(scene).into_iter().fold(start, |(low, high), p| (low.min(p), high.max(p)))
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

/// Reads a `.glb` after its JSON was changed.
fn edited_glb(path: &Path, edit: impl FnOnce(&mut Value)) -> Result<Imported, ImportError> {
    let bytes = fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let (json, rest) = bytes[20..].split_at(length);
    let mut value: Value = serde_json::from_slice(json).unwrap();
    edit(&mut value);
    let mut json = value.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend(((20 + json.len() + rest.len()) as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend(rest);
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("edited.glb");
    fs::write(&copy, file).unwrap();
    read(&copy)
}

/// Reads a file made of JSON alone.
fn of_json(value: &Value, options: &Options) -> Result<Imported, ImportError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.gltf");
    fs::write(&path, value.to_string()).unwrap();
    gltf::read(&path, options)
}

/// One triangle (0,0,0), (1,0,0), (0,1,0), with nodes to place it.
fn one_triangle(nodes: &Value) -> Value {
    let floats = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let escaped: String = floats.iter().flat_map(|f| f.to_le_bytes()).map(|b| format!("%{b:02x}")).collect();
    json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 36, "uri": format!("data:application/octet-stream,{escaped}")}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "type": "VEC3", "componentType": 5126, "count": 3}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": nodes,
    })
}

fn placed(nodes: &Value) -> Imported {
    of_json(&one_triangle(nodes), &Options::default()).unwrap()
}

#[test]
fn nodes_share_their_mesh() {
    let Some(path) = khronos("SimpleMeshes/glTF/SimpleMeshes.gltf") else { return };
    let scene = read(&path).unwrap().scene;
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    assert_eq!(scene.instances[1].transform.translation, DVec3::X);
}

#[test]
fn transforms_keep_f64() {
    let scene = placed(&json!([
        {"translation": [10_000_000.3, 0.0, 0.0], "children": [1]},
        {"translation": [0.1, 0.0, 0.0], "mesh": 0},
    ]))
    .scene;
    assert!((scene.instances[0].transform.translation.x - 10_000_000.4).abs() < 1e-8);
}

#[test]
fn mirrors_stay_in_the_transform() {
    let scene = placed(&json!([{"scale": [-1.0, 1.0, 1.0], "mesh": 0}])).scene;
    assert!(scene.instances[0].transform.matrix3.determinant() < 0.0);
    assert_eq!(triangles(&scene, 0, 0).triangles, [[0, 1, 2]]);
}

#[test]
fn flattened_meshes_are_drawn_and_vanished_ones_are_not() {
    let read = placed(&json!([
        {"scale": [2.0, 2.0, 0.0], "translation": [0.0, 0.0, 1e7], "mesh": 0},
        {"scale": [0.0, 2.0, 2.0], "mesh": 0},
        {"scale": [0.0, 0.0, 0.0], "mesh": 0},
        {"mesh": 0},
    ]));
    let scene = &read.scene;
    assert_eq!(scene.instances.len(), 2);
    assert_eq!(scene.instances[0].name, "node 0");
    assert_eq!(corners(scene)[..3], [DVec3::new(0.0, 0.0, 1e7), DVec3::new(2.0, 0.0, 1e7), DVec3::new(0.0, 2.0, 1e7)]);
    let places: Vec<&str> = read.report.warnings.iter().map(|w| w.place.as_str()).collect();
    assert_eq!(places, ["/nodes/1", "/nodes/2"]);
    assert_eq!(read.report.triangles_all_scenes, 4);
}

#[test]
fn hierarchies_of_any_depth_need_no_stack() {
    let depth = 100_000;
    let nodes: Vec<Value> = (0..depth)
        .map(
            |i| if i + 1 < depth { json!({"children": [i + 1], "translation": [1, 0, 0]}) } else { json!({"mesh": 0}) },
        )
        .collect();
    let file = one_triangle(&Value::Array(nodes));
    let error = of_json(&file, &Options::default()).unwrap_err();
    assert!(matches!(error.kind, ErrorKind::Limit(_)), "{error}");
    let limits = Limits { depth, ..Limits::default() };
    let scene = of_json(&file, &Options { limits, ..Options::default() }).unwrap().scene;
    assert_eq!(scene.instances[0].transform.translation.x, f64::from(depth - 1));
}

#[test]
fn the_default_scene_is_shown_and_hidden_nodes_are_not() {
    let mut file = one_triangle(&json!([
        {"name": "a", "mesh": 0},
        {"name": "b", "mesh": 0, "children": [2]},
        {"name": "c", "mesh": 0, "extensions": {"KHR_node_visibility": {"visible": false}}, "children": [3]},
        {"name": "d", "mesh": 0},
    ]));
    let shown = |file: &Value| {
        let read = of_json(file, &Options::default()).unwrap();
        assert_eq!(read.report.triangles_all_scenes, 4);
        read.scene.instances.into_iter().map(|i| i.name).collect::<Vec<_>>()
    };
    assert_eq!(shown(&file), ["a", "b"], "all roots where there is no scene");
    file["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    assert_eq!(shown(&file), ["a"], "the first scene");
    file["scene"] = json!(1);
    assert_eq!(shown(&file), ["b"], "the default scene");
}

#[test]
fn cameras_keep_their_lens_and_lose_their_scale() {
    let Some(path) = khronos("Cameras/glTF/Cameras.gltf") else { return };
    let scene = edited(&path, |v| v["nodes"][2]["scale"] = json!([2, -3, 4])).unwrap().scene;
    let Projection::Perspective { vertical_fov, aspect } = scene.cameras[0].projection else { panic!() };
    assert!((vertical_fov - 0.7).abs() < 1e-6);
    assert_eq!(aspect, Some(1.0));
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic { half_height: 1.0, aspect: Some(1.0) });
    for camera in &scene.cameras {
        assert_eq!(camera.transform.translation, DVec3::new(0.5, 0.5, 3.0));
        assert!((camera.transform.matrix3.determinant() - 1.0).abs() < 1e-12);
        assert_eq!(camera.transform.transform_vector3(DVec3::NEG_Z), DVec3::NEG_Z);
    }
}

#[test]
fn punctual_lights_stand_in_the_world() {
    let mut file = one_triangle(&json!([
        {"translation": [1, 2, 3], "scale": [5, 5, 5], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        // A quarter turn about X: from -Z to +Y.
        {"rotation": [FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2],
         "extensions": {"KHR_lights_punctual": {"light": 1}}},
        {"extensions": {"KHR_lights_punctual": {"light": 2}}},
    ]));
    file["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1, 0.5, 0], "intensity": 40, "range": 7},
        {"type": "directional", "intensity": 2},
        {"type": "spot", "spot": {"innerConeAngle": 0.25}},
    ]}});
    let scene = of_json(&file, &Options::default()).unwrap().scene;
    let LightKind::Point { position, intensity, range } = &scene.lights[0].kind else { panic!() };
    assert_eq!((*position, *intensity, *range), (DVec3::new(1.0, 2.0, 3.0), Vec3::new(40.0, 20.0, 0.0), Some(7.0)));
    let LightKind::Directional { direction, irradiance, .. } = &scene.lights[1].kind else { panic!() };
    assert!((*direction - DVec3::Y).length() < 1e-9);
    assert_eq!(*irradiance, Vec3::splat(2.0));
    let LightKind::Spot { direction, inner, outer, ramp, range, .. } = &scene.lights[2].kind else { panic!() };
    assert_eq!((*direction, *ramp, *range), (DVec3::NEG_Z, SpotRamp::Gltf, None));
    assert_eq!((*inner, *outer), (0.25, std::f32::consts::FRAC_PI_4));
}

#[test]
fn primitives_of_all_modes_make_their_triangles() {
    let Some(path) = khronos("MeshPrimitiveModes/glTF/MeshPrimitiveModes.gltf") else { return };
    let read = read(&path).unwrap();
    assert_eq!(corners(&read.scene).len(), 3 * 16);
    assert!(read.report.warnings.iter().any(|w| w.message.contains("points or lines are not drawn")));
    // Lists, strips and fans of the same surface face the same way.
    for instance in &read.scene.instances {
        let mesh = triangles(&read.scene, instance.mesh, 0);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            assert!((b - a).cross(c - a).z > 0.0, "{}", instance.name);
        }
    }
}

#[test]
fn sparse_positions_are_put_in() {
    let Some(path) = khronos("SimpleSparseAccessor/glTF/SimpleSparseAccessor.gltf") else { return };
    let scene = read(&path).unwrap().scene;
    // The bounds that the file states hold only with the sparse elements in place.
    assert_eq!(bounds(&scene), (DVec3::ZERO, DVec3::new(6.0, 4.0, 0.0)));
    let positions = &triangles(&scene, 0, 0).positions;
    assert_eq!([positions[8], positions[10], positions[12]].map(|p| (p.x, p.y)), [(1.0, 2.0), (3.0, 3.0), (5.0, 4.0)]);
}

#[test]
fn quantized_and_plain_meshes_agree() {
    let (Some(plain), Some(quantized)) =
        (khronos("Duck/glTF-Binary/Duck.glb"), khronos("Duck/glTF-Quantized/Duck.gltf"))
    else {
        return;
    };
    let ((low, high), (low_q, high_q)) =
        (bounds(&read(&plain).unwrap().scene), bounds(&read(&quantized).unwrap().scene));
    let step = (high - low).max_element() / 1000.0;
    assert!((low - low_q).length() < step && (high - high_q).length() < step, "{low} {low_q} {high} {high_q}");
    let used = |v: &mut Value| {
        v["extensionsUsed"] = json!(["KHR_texture_transform"]);
        v["extensionsRequired"] = json!([]);
    };
    let error = edited(&quantized, used).unwrap_err().to_string();
    assert!(error.contains("expected VEC3 of FLOAT (5126)"), "{error}");
}

#[test]
fn skins_follow_their_joints_and_not_their_node() {
    let Some(path) = khronos("SimpleSkin/glTF/SimpleSkin.gltf") else { return };
    let scene = read(&path).unwrap().scene;
    assert_eq!(bounds(&scene), (DVec3::new(-0.5, 0.0, 0.0), DVec3::new(0.5, 2.0, 0.0)));
    // The upper joint, at (0, 1), turned by 90 degrees about Z: what hangs at it alone, (+-0.5, 2), goes to
    // (-1, 1 +- 0.5). The node's own transform does not count.
    let half = FRAC_1_SQRT_2;
    let scene = edited(&path, |v| {
        v["nodes"][2]["rotation"] = json!([0.0, 0.0, half, half]);
        v["nodes"][0]["translation"] = json!([100, 0, 0]);
    })
    .unwrap()
    .scene;
    let moved = corners(&scene);
    for want in [DVec3::new(-1.0, 1.5, 0.0), DVec3::new(-1.0, 0.5, 0.0), DVec3::new(0.5, 0.0, 0.0)] {
        assert!(moved.iter().any(|p| (*p - want).length() < 1e-6), "{want}");
    }
}

#[test]
fn skinned_models_stand_as_modelled() {
    // A man of 1.5 m on his feet, and a fox of 79 on its paws, nose towards +Z.
    for (file, height) in [("CesiumMan/glTF-Binary/CesiumMan.glb", 1.5), ("Fox/glTF-Binary/Fox.glb", 79.0)] {
        let Some(path) = khronos(file) else { return };
        let (low, high) = bounds(&read(&path).unwrap().scene);
        assert!(low.y.abs() < 0.05 * height && (high.y - height).abs() < 0.1 * height, "{file}: {low} {high}");
    }
}

#[test]
fn morph_targets_move_by_their_weights() {
    let Some(path) = khronos("SimpleMorph/glTF/SimpleMorph.gltf") else { return };
    // The tip (0.5, 0.5) moves by (-1, 1) and (1, 1), each by half: to (0.5, 1.5).
    let tip = |read: Imported| corners(&read.scene).into_iter().max_by(|a, b| a.y.total_cmp(&b.y)).unwrap();
    assert_eq!(tip(read(&path).unwrap()), DVec3::new(0.5, 1.5, 0.0));
    let weights = edited(&path, |v| v["nodes"][0]["weights"] = json!([1, 0])).unwrap();
    assert_eq!(tip(weights), DVec3::new(-0.5, 1.5, 0.0));
}

#[test]
fn computed_tangents_agree_with_those_of_the_file() {
    let Some(path) = khronos("NormalTangentMirrorTest/glTF-Binary/NormalTangentMirrorTest.glb") else { return };
    let given = read(&path).unwrap().scene;
    let computed = edited_glb(&path, |v| {
        for primitive in
            v["meshes"].as_array_mut().unwrap().iter_mut().flat_map(|m| m["primitives"].as_array_mut().unwrap())
        {
            primitive["attributes"].as_object_mut().unwrap().remove("TANGENT");
        }
    })
    .unwrap()
    .scene;
    let (mut total, mut agree) = (0, 0);
    for (m, mesh) in given.meshes.iter().enumerate() {
        for g in 0..mesh.geometries.len() {
            let (given, computed) = (triangles(&given, m, g), triangles(&computed, m, g));
            if given.tangents.is_empty() || computed.tangents.is_empty() {
                continue;
            }
            for (a, b) in given.triangles.as_flattened().iter().zip(computed.triangles.as_flattened()) {
                let (a, b) = (given.tangents[*a as usize], computed.tangents[*b as usize]);
                total += 1;
                agree += usize::from(a.truncate().dot(b.truncate()) > 0.95 && a.w == b.w);
            }
        }
    }
    println!("{agree} of {total} tangents agree");
    assert!(total > 10_000 && agree * 100 > total * 98, "{agree} of {total}");
}

#[test]
fn materials_take_their_factors_textures_and_extensions() {
    let mut file = one_triangle(&json!([{"mesh": 0}]));
    file["images"] = json!([{"uri": "data:image/png;base64,AAAA"}, {"uri": "missing.png"}]);
    file["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]);
    file["textures"] = json!([{"source": 0, "sampler": 0}, {"source": 1}]);
    file["materials"] = json!([{
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1, 0.75], "metallicFactor": 0.5,
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [1, 2], "texCoord": 1}}},
            "metallicRoughnessTexture": {"index": 1},
        },
        "normalTexture": {"index": 0, "scale": 2, "extensions": {"KHR_texture_transform": {"scale": [3, 4]}}},
        "emissiveFactor": [1, 0.5, 0], "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_transmission": {"transmissionFactor": 0.5},
            "KHR_materials_volume": {"thicknessFactor": 2, "attenuationDistance": 3, "attenuationColor": [0.1, 0.2, 0.3]},
            "KHR_materials_specular": {"specularFactor": 0.25, "specularColorFactor": [2, 1, 0]},
            "KHR_materials_unlit": {},
        },
    }, {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"specularFactor": [0.04, 0.08, 0], "glossinessFactor": 0.75}}}]);
    let read = of_json(&file, &Options::default()).unwrap();
    let (scene, m) = (&read.scene, pbr(&read.scene, 0));
    assert_eq!((m.base_color, m.metallic, m.roughness), (Vec4::new(0.5, 0.25, 1.0, 0.75), 0.5, 1.0));
    let base = m.base_color_texture.as_ref().unwrap();
    assert_eq!((base.uv_set, base.wrap_u, base.wrap_v, base.filter), (1, Wrap::Clamp, Wrap::Mirror, Filter::Nearest));
    assert_eq!(base.transform.transform_point2(Vec2::ZERO), Vec2::new(1.0, 2.0));
    let normal = m.normal_texture.as_ref().unwrap();
    assert_eq!((normal.image, base.image, m.normal_scale), (0, 0, 2.0));
    assert_eq!(normal.transform.transform_point2(Vec2::ONE), Vec2::new(3.0, 4.0));
    let (metallic, roughness) = (m.metallic_texture.as_ref().unwrap(), m.roughness_texture.as_ref().unwrap());
    assert_eq!((metallic.image, roughness.image, roughness.wrap_u), (1, 1, Wrap::Repeat));
    assert_ne!(metallic.channel, roughness.channel);
    assert_eq!(m.emissive, Vec3::new(8.0, 4.0, 0.0));
    assert_eq!((m.alpha_mode, m.double_sided, m.unlit), (AlphaMode::Mask { cutoff: 0.25 }, true, true));
    assert_eq!((m.ior, m.transmission, m.thickness, m.attenuation_distance), (1.33, 0.5, 2.0, 3.0));
    assert_eq!(m.attenuation_color, Vec3::new(0.1, 0.2, 0.3));
    assert_eq!((m.specular, m.specular_color), (0.25, Vec3::new(2.0, 1.0, 0.0)));
    // Neither image can be read: a pixel stands in for each, with a warning that says where.
    assert!(scene.images.iter().all(|i| (i.width, i.height) == (1, 1)));
    let places: Vec<&str> = read.report.warnings.iter().map(|w| w.place.as_str()).collect();
    assert!(places.contains(&"/images/0") && places.contains(&"/images/1/uri"), "{places:?}");
    // Specular-glossiness as a dielectric with a coloured reflection.
    let m = pbr(scene, 1);
    assert_eq!((m.metallic, m.roughness), (0.0, 0.25));
    assert!((m.specular_color - Vec3::new(1.0, 2.0, 0.0)).length() < 1e-6);
}

#[test]
fn images_are_decoded_from_files_views_and_data_uris() {
    for variant in ["glTF/BoxTextured.gltf", "glTF-Binary/BoxTextured.glb", "glTF-Embedded/BoxTextured.gltf"] {
        let Some(path) = khronos(&format!("BoxTextured/{variant}")) else { return };
        let read = read(&path).unwrap();
        assert_eq!(read.scene.images.len(), 1, "{variant}");
        assert!(read.scene.images[0].width >= 256, "{variant}");
        assert!(read.report.warnings.is_empty(), "{variant}");
    }
    for name in ["Box With Spaces/glTF/Box With Spaces.gltf", "Unicode❤♻Test/glTF/Unicode❤♻Test.gltf"] {
        let Some(path) = khronos(name) else { return };
        let read = read(&path).unwrap();
        assert!(!read.scene.images.is_empty() && read.report.warnings.is_empty(), "{name}: {:?}", read.report.warnings);
    }
}

#[test]
fn extensions_are_reported_and_required_ones_refused_by_name() {
    let Some(shared) = firsthit_tests::shared() else { return };
    let report = read(&shared.join("assets/chess-board/chess-board.glb")).unwrap().report;
    let used = report.extensions.iter().find(|e| e.name == "KHR_draco_mesh_compression").unwrap();
    assert_eq!((used.support, used.required), (Support::Full, true));
    let mut file = one_triangle(&json!([{"mesh": 0}]));
    file["extensionsRequired"] = json!(["EXT_lights_ies"]);
    let error = of_json(&file, &Options::default()).unwrap_err();
    assert!(matches!(&error.kind, ErrorKind::Unsupported(c) if c.contains("EXT_lights_ies")), "{error}");
    file["extensionsRequired"] = json!([]);
    file["extensionsUsed"] = json!(["EXT_lights_ies"]);
    let report = of_json(&file, &Options::default()).unwrap().report;
    let used = report.extensions.iter().find(|e| e.name == "EXT_lights_ies").unwrap();
    assert_eq!((used.support, used.required), (Support::Unsupported, false));
    assert!(report.warnings.iter().any(|w| w.message.contains("EXT_lights_ies")));
}

#[test]
fn files_outside_the_folder_are_refused() {
    for uri in ["../secret.bin", "/etc/passwd", "file:///etc/passwd", "http://example.com/a.bin", "%2e%2e/secret.bin"] {
        let mut file = one_triangle(&json!([{"mesh": 0}]));
        file["buffers"][0]["uri"] = json!(uri);
        let error = of_json(&file, &Options::default()).unwrap_err();
        assert!(matches!(error.kind, ErrorKind::Outside(_)), "{uri}: {error}");
        assert_eq!(error.place, "/buffers/0/uri");
    }
}

#[test]
fn broken_hierarchies_are_errors() {
    for (nodes, place) in [
        (json!([{"children": [0]}]), "/nodes/0"),
        (json!([{}, {"children": [2]}, {"children": [1]}]), "/nodes/1"),
        (json!([{"children": [2]}, {"children": [2]}, {}]), "/nodes/1/children/0"),
        (json!([{"rotation": [0, 0, 0, 0]}]), "/nodes/0/rotation"),
        (json!([{"mesh": 3}]), "/nodes/0/mesh"),
    ] {
        let error = of_json(&one_triangle(&nodes), &Options::default()).unwrap_err();
        assert_eq!(error.place, place, "{error}");
    }
}

/// A file with most kinds of elements, small enough to be damaged in many ways.
fn rich() -> Option<Vec<u8>> {
    Some(fs::read(khronos("RiggedSimple/glTF-Binary/RiggedSimple.glb")?).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Damaged files are read or refused: bytes changed anywhere, or the end cut off.
    #[test]
    fn damaged_files_do_no_harm(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..20),
        end in any::<prop::sample::Index>(), cut in any::<bool>(),
    ) {
        let Some(mut bytes) = rich() else { return Ok(()) };
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if cut {
            bytes.truncate(end.index(bytes.len()));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.glb");
        fs::write(&path, &bytes).unwrap();
        if let Ok(read) = read(&path) {
            prop_assert_eq!(check(&read.scene), None);
        }
    }

    /// Numbers in the JSON changed to any others.
    #[test]
    fn hostile_numbers_do_no_harm(which in any::<prop::sample::Index>(), number in prop_oneof![
        Just(json!(-1)), Just(json!(0)), Just(json!(1)), Just(json!(u32::MAX)), Just(json!(u64::MAX)), Just(json!(1e38)),
        Just(json!(1e300)), (0_u64..300).prop_map(|n| json!(n)), Just(json!(0.5)), Just(json!("x")), Just(Value::Null),
    ]) {
        let Some(path) = khronos("RiggedSimple/glTF-Binary/RiggedSimple.glb") else { return Ok(()) };
        let result = edited_glb(&path, |v| {
            let mut numbers = Vec::new();
            collect_numbers(v, &mut numbers);
            *numbers.swap_remove(which.index(numbers.len())) = number;
        });
        if let Ok(read) = result {
            prop_assert_eq!(check(&read.scene), None);
        }
    }
}

fn collect_numbers<'a>(value: &'a mut Value, numbers: &mut Vec<&'a mut Value>) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(|v| collect_numbers(v, numbers)),
        Value::Object(values) => values.values_mut().for_each(|v| collect_numbers(v, numbers)),
        Value::Number(_) => numbers.push(value),
        _ => {}
    }
}

/// `FIRSTHIT_BLESS=1` writes the page anew.
#[test]
fn the_page_of_extensions_is_the_table() {
    let mut page = String::from(
        "# glTF extensions\n\nWhat firsthit does with each, from the table that its reader uses \
         (`crates/import/src/gltf/extensions.rs`).\n\nA file that *requires* an unsupported or unknown extension is \
         refused with an error that names it; one that only uses it is read with a warning.\n\n| extension | support | \
         what is done |\n|---|---|---|\n",
    );
    for extension in gltf::EXTENSIONS {
        page += &format!("| `{}` | {} | {} |\n", extension.name, extension.support.name(), extension.note);
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/gltf-extensions.md");
    if std::env::var_os("FIRSTHIT_BLESS").is_some_and(|v| v == "1") {
        fs::write(&path, &page).unwrap();
    }
    assert_eq!(fs::read_to_string(&path).unwrap().replace('\r', ""), page, "run with FIRSTHIT_BLESS=1");
}
