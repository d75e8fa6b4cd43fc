//! Small files, and what is in them at a time.

use std::fs;

use serde_json::{Value, json};

use crate::scene::{LightKind, MaterialModel, Projection, SurfaceDesc};
use crate::{AnimationChoice, ErrorKind, ImportError, Imported, Limits, Options, Play};

/// A file with a triangle at node 0 and its numbers in a buffer.
struct File {
    json: Value,
    bytes: Vec<u8>,
}

impl File {
    fn new() -> Self {
        let mut file = Self { json: Value::Null, bytes: Vec::new() };
        file.json = json!({
            "asset": {"version": "2.0"},
            "bufferViews": [], "accessors": [],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "nodes": [{"mesh": 0}],
            "animations": [{"channels": [], "samplers": []}],
        });
        file.accessor("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        file
    }

    /// Adds floats; the answer is the number of the accessor.
    fn accessor(&mut self, kind: &str, numbers: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            other => usize::from(other.as_bytes()[3] - b'0'),
        };
        let (start, length) = (self.bytes.len(), 4 * numbers.len());
        self.bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        let views = self.list("bufferViews");
        views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": length}));
        let view = views.len() - 1;
        let accessors = self.list("accessors");
        accessors.push(json!({
            "bufferView": view, "type": kind, "componentType": 5126, "count": numbers.len() / width,
        }));
        accessors.len() - 1
    }

    fn list(&mut self, key: &str) -> &mut Vec<Value> {
        self.json[key].as_array_mut().expect("list")
    }

    /// Adds a channel of two keys, at 0 and 2 seconds.
    fn channel(&mut self, target: &str, kind: &str, numbers: &[f32]) -> &mut Self {
        let input = self.accessor("SCALAR", &[0.0, 2.0]);
        let output = self.accessor(kind, numbers);
        let target = match target.strip_prefix("node 0 ") {
            Some(path) => json!({"node": 0, "path": path}),
            None => json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": target}}}),
        };
        let animation = &mut self.json["animations"][0];
        let samplers = animation["samplers"].as_array_mut().expect("samplers");
        samplers.push(json!({"input": input, "output": output}));
        let sampler = samplers.len() - 1;
        let channels = animation["channels"].as_array_mut().expect("channels");
        channels.push(json!({"sampler": sampler, "target": target}));
        self
    }

    fn read(&self, options: &Options) -> Result<Imported, ImportError> {
        let folder = tempfile::tempdir().expect("folder");
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.bytes.len(), "uri": "a.bin"}]);
        fs::write(folder.path().join("a.bin"), &self.bytes).expect("file");
        fs::write(folder.path().join("a.gltf"), json.to_string()).expect("file");
        crate::open(folder.path().join("a.gltf"), options)
    }

    fn at(&self, time: f64) -> Imported {
        self.read(&at(time)).expect("readable")
    }

    fn fails(&self) -> String {
        let error = self.read(&at(1.0)).expect_err("wrong");
        format!("{}: {}", error.place, error.kind)
    }
}

fn at(time: f64) -> Options {
    Options { play: Some(Play { time, ..Play::default() }), ..Options::default() }
}

fn warnings(read: &Imported) -> Vec<String> {
    read.report.warnings.iter().map(|w| format!("{}: {}", w.place, w.message)).collect()
}

#[test]
fn nodes_move_and_rest_where_nothing_is_played() {
    let mut file = File::new();
    file.channel("node 0 translation", "VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let x = |read: &Imported| read.scene.instances[0].transform.translation.x;
    let moved: Vec<f64> = [-1.0, 0.0, 0.5, 2.0, 9.0].map(|t| x(&file.at(t))).into();
    assert_eq!(moved, [0.0, 0.0, 1.0, 4.0, 4.0]);
    file.json["nodes"][0]["translation"] = json!([7, 0, 0]);
    assert_eq!(x(&file.read(&Options::default()).expect("readable")), 7.0);
}

#[test]
fn an_animation_is_chosen_by_name_or_number() {
    let mut file = File::new();
    file.channel("node 0 translation", "VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    file.json["animations"][0]["name"] = json!("go");
    let turn = json!({"name": "stay", "channels": [], "samplers": []});
    file.list("animations").push(turn);
    let x = |animation| {
        let play = Play { animation, time: 2.0, ..Play::default() };
        let options = Options { play: Some(play), ..Options::default() };
        file.read(&options).map(|r| r.scene.instances[0].transform.translation.x).map_err(|e| e.to_string())
    };
    let named = |name: &str| AnimationChoice::Named(name.into());
    assert_eq!(x(AnimationChoice::First), Ok(4.0));
    assert_eq!(x(AnimationChoice::All), Ok(4.0));
    assert_eq!((x(named("go")), x(named("stay")), x(named("1"))), (Ok(4.0), Ok(0.0), Ok(0.0)));
    assert!(x(named("run")).is_err_and(|e| e.ends_with("there is no animation 'run': there are 0 'go', 1 'stay'")));
    let report = file.at(0.0).report;
    assert_eq!(
        report.animations.iter().map(|a| (a.name.as_str(), a.channels)).collect::<Vec<_>>(),
        [("go", 1), ("stay", 0)]
    );
}

#[test]
fn the_keys_of_all_animations_are_limited_together() {
    let mut file = File::new();
    // Two times and two values.
    file.channel("node 0 translation", "VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let again = file.json["animations"][0].clone();
    file.list("animations").push(again);
    let read = |elements: u64| {
        let play = Play { animation: AnimationChoice::All, time: 1.0, ..Play::default() };
        let limits = Limits { elements, ..Limits::default() };
        file.read(&Options { play: Some(play), limits, ..Options::default() })
    };
    assert!(read(8).is_ok());
    let error = read(7).expect_err("too many");
    assert!(matches!(error.kind, ErrorKind::Limit(_)) && error.place.starts_with("/animations/1/"), "{error}");
}

#[test]
fn pointers_change_materials_cameras_lights_and_visibility() {
    let mut file = File::new();
    file.json["materials"] = json!([{}]);
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    file.json["nodes"] = json!([
        {"mesh": 0}, {"camera": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}, {"mesh": 0},
    ]);
    file.channel(
        "/materials/0/pbrMetallicRoughness/baseColorFactor",
        "VEC4",
        &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.5, 0.0],
    )
    .channel("/cameras/0/perspective/yfov", "SCALAR", &[1.0, 2.0])
    .channel("/extensions/KHR_lights_punctual/lights/0/intensity", "SCALAR", &[0.0, 8.0])
    .channel("/extensions/KHR_lights_punctual/lights/0/color", "VEC3", &[1.0; 6])
    .channel("/nodes/3/extensions/KHR_node_visibility/visible", "SCALAR", &[0.0, 1.0])
    .channel("/materials/0/normalTexture/offset", "VEC2", &[0.0; 4])
    .channel("/materials/0/normalTexture/scale", "SCALAR", &[0.0; 2])
    .channel("/nodes/9/translation", "VEC3", &[0.0; 6]);
    let half = file.at(1.0);
    let MaterialModel::Pbr(pbr) = &half.scene.materials[0].model else { panic!("no PBR") };
    assert_eq!(pbr.base_color.to_array(), [0.5, 0.5, 0.25, 0.5]);
    let Projection::Perspective { vertical_fov, .. } = half.scene.cameras[0].projection else { panic!("no lens") };
    assert_eq!(vertical_fov, 1.5);
    let LightKind::Point { intensity, .. } = half.scene.lights[0].kind else { panic!("no point") };
    assert_eq!(intensity.to_array(), [4.0; 3]);
    assert_eq!((half.scene.instances.len(), file.at(2.0).scene.instances.len()), (1, 2));
    assert_eq!(
        warnings(&half),
        [
            "/animations/0/channels/5/target: '/materials/0/normalTexture/offset' is nothing that can be animated here: \
             it stays as it is",
            "/animations/0/channels/6/target: '/materials/0/normalTexture/scale' leads nowhere: nothing is changed",
            "/animations/0/channels/7/target: '/nodes/9/translation' leads nowhere: nothing is changed",
        ]
    );
}

#[test]
fn morph_weights_come_from_node_or_mesh() {
    let mut file = File::new();
    let targets: Vec<Value> =
        (0..2).map(|k| json!({"POSITION": file.accessor("VEC3", &[k as f32 + 1.0; 9])})).collect();
    file.json["meshes"][0]["primitives"][0]["targets"] = json!(targets);
    file.json["meshes"][0]["weights"] = json!([0.0, 0.5]);
    let x = |file: &File, time| {
        let SurfaceDesc::Triangles(mesh) = file.at(time).scene.meshes[0].geometries[0].surface.clone() else {
            panic!("no mesh")
        };
        mesh.positions[0].x
    };
    assert_eq!(x(&file, 0.0), 1.0);
    for target in ["node 0 weights", "/nodes/0/weights", "/meshes/0/weights"] {
        let mut file = File { json: file.json.clone(), bytes: file.bytes.clone() };
        file.channel(target, "SCALAR", &[1.0, 0.0, 0.0, 1.0]);
        assert_eq!([0.0, 1.0, 2.0].map(|t| x(&file, t)), [1.0, 1.5, 2.0], "{target}");
    }
    for target in ["/nodes/0/weights/0", "/meshes/0/weights/0"] {
        let mut file = File { json: file.json.clone(), bytes: file.bytes.clone() };
        file.channel(target, "SCALAR", &[0.0, 4.0]);
        assert_eq!([0.0, 1.0, 2.0].map(|t| x(&file, t)), [1.0, 3.0, 5.0], "{target}");
    }
    file.channel("node 0 weights", "SCALAR", &[1.0; 6]);
    assert_eq!(warnings(&file.at(0.0)).len(), 1);
    assert_eq!(x(&file, 0.0), 1.0);
}

#[test]
fn wrong_data_are_named_by_their_place() {
    type Change = fn(&mut File);
    let cases: [(Change, &str); 9] = [
        (
            |f| f.json["animations"][0]["channels"][0]["sampler"] = json!(5),
            "/animations/0/channels/0/sampler: element 5",
        ),
        (
            |f| f.json["animations"][0]["channels"][0]["target"]["node"] = json!(5),
            "/animations/0/channels/0/target/node: e",
        ),
        (|f| f.json["animations"][0]["samplers"][0]["input"] = json!(99), "/animations/0/samplers/0/input: element 99"),
        (
            |f| f.json["animations"][0]["samplers"][0]["input"] = json!(0),
            "/animations/0/samplers/0/input: expected SCALAR",
        ),
        (|f| f.json["accessors"][1]["count"] = json!(0), "/animations/0/samplers/0/input: has no keys"),
        (|f| f.json["accessors"][2]["count"] = json!(1), "/animations/0/samplers/0/output: 3 numbers for 2 keys"),
        (
            |f| f.json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBIC"),
            "/animations/0/samplers/0/interp",
        ),
        (
            |f| f.bytes[36..40].copy_from_slice(&9_f32.to_le_bytes()),
            "/animations/0/samplers/0/input: time 2 (number 1)",
        ),
        (
            |f| f.bytes[44..48].copy_from_slice(&f32::NAN.to_le_bytes()),
            "/animations/0/samplers/0/output: number 0 is not",
        ),
    ];
    for (change, expected) in cases {
        let mut file = File::new();
        file.channel("node 0 translation", "VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
        change(&mut file);
        let error = file.fails();
        assert!(error.starts_with(expected), "{error}");
        assert!(file.read(&Options::default()).is_ok(), "what is not played cannot be wrong");
    }
}

#[test]
fn scenes_are_chosen_by_name_or_number() {
    let mut file = File::new();
    file.json["nodes"] = json!([{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}]);
    file.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1], "name": "other"}]);
    let shown = |scene: Option<&str>| {
        let options = Options { scene: scene.map(str::to_owned), ..Options::default() };
        file.read(&options).map(|r| r.scene.instances[0].name.clone()).map_err(|e| e.to_string())
    };
    assert_eq!([None, Some("0"), Some("1"), Some("other")].map(|s| shown(s).expect("scene")), ["a", "a", "b", "b"]);
    let error = shown(Some("2")).expect_err("two scenes");
    assert!(error.ends_with("there is no scene '2': there are 0 'scene 0', 1 'other'"), "{error}");
}

#[test]
fn morph_targets_change_colours_and_texture_coordinates_too() {
    let mut file = File::new();
    let (colors, uvs) = (file.accessor("VEC3", &[0.5; 9]), file.accessor("VEC2", &[0.25; 6]));
    let (brighter, further) = (file.accessor("VEC3", &[1.0; 9]), file.accessor("VEC2", &[2.0; 6]));
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["attributes"] = json!({"POSITION": 0, "COLOR_0": colors, "TEXCOORD_0": uvs});
    primitive["targets"] = json!([{"COLOR_0": brighter, "TEXCOORD_0": further}]);
    file.channel("node 0 weights", "SCALAR", &[0.0, 0.5]);
    let read = |time| match &file.at(time).scene.meshes[0].geometries[0].surface {
        SurfaceDesc::Triangles(mesh) => (mesh.colors[0].to_array(), mesh.uvs[0][0].x),
        SurfaceDesc::Shape(_) => panic!("no mesh"),
    };
    assert_eq!(read(0.0), ([0.5, 0.5, 0.5, 1.0], 0.25));
    assert_eq!(read(1.0), ([0.75, 0.75, 0.75, 1.0], 0.75));
    assert_eq!(read(2.0), ([1.0; 4], 1.25));
    file.json["meshes"][0]["primitives"][0]["targets"][0]["COLOR_0"] = json!(99);
    assert!(file.fails().starts_with("/meshes/0/primitives/0/targets/0/COLOR_0: no such accessor"), "{}", file.fails());
}

#[test]
fn what_moves_while_the_shutter_is_open_goes_on_moving() {
    let mut file = File::new();
    file.channel("node 0 translation", "VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let play = Play { time: 0.5, shutter: 0.25, ..Play::default() };
    let read = file.read(&Options { play: Some(play), ..Options::default() }).expect("readable");
    let instance = &read.scene.instances[0];
    assert_eq!((instance.transform.translation.x, instance.moves_to.map(|m| m.translation.x)), (1.0, Some(1.5)));
    assert!(read.report.warnings.is_empty());
}

/// The numbers of a value, to be changed.
fn numbers<'a>(value: &'a mut Value, found: &mut Vec<&'a mut Value>) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(|v| numbers(v, found)),
        Value::Object(object) => object.values_mut().for_each(|v| numbers(v, found)),
        Value::Number(_) => found.push(value),
        _ => {}
    }
}

#[test]
fn any_number_anywhere_makes_a_scene_or_an_error() {
    let mut file = File::new();
    let target = file.accessor("VEC3", &[1.0; 9]);
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": target}]);
    file.json["materials"] = json!([{}]);
    file.channel("node 0 rotation", "VEC4", &[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        .channel("node 0 weights", "SCALAR", &[0.0, 1.0])
        .channel("/nodes/0/weights/0", "SCALAR", &[0.0, 1.0])
        .channel("/materials/0/emissiveFactor", "VEC3", &[0.0; 6]);
    let mut found = Vec::new();
    numbers(&mut file.json, &mut found);
    let count = found.len();
    for k in 0..count {
        for other in
            [json!(-1), json!(0), json!(1), json!(2), json!(7), json!(0.5), json!(4_294_967_296_u64), json!(1e300)]
        {
            let mut changed = File { json: file.json.clone(), bytes: file.bytes.clone() };
            let mut found = Vec::new();
            numbers(&mut changed.json, &mut found);
            *found.swap_remove(k) = other;
            if let Ok(read) = changed.read(&at(1.0)) {
                assert!(read.scene.instances.iter().all(|i| i.transform.is_finite()));
            }
        }
    }
}
