//! Animated models against a second evaluation of their own: straight from the JSON and the buffers, in f64, by the
//! formulas of the specification, sharing no code with the reader.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};

use firsthit_import::scene::SurfaceDesc;
use firsthit_import::{AnimationChoice, Options, Play, SceneDesc, gltf};
use glam::{DMat4, DQuat, DVec3, DVec4};
use serde_json::Value;

/// A glTF file as it is.
struct File {
    json: Value,
    buffers: Vec<Vec<u8>>,
}

impl File {
    fn open(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        if bytes.starts_with(b"glTF") {
            let end = 20 + word(12);
            let json = serde_json::from_slice(&bytes[20..end]).unwrap();
            return Self { json, buffers: vec![bytes[end + 8..].to_vec()] };
        }
        let json: Value = serde_json::from_slice(&bytes).unwrap();
        let buffers = list(&json["buffers"]).iter().map(|b| {
            let uri = b["uri"].as_str().unwrap();
            fs::read(path.parent().unwrap().join(uri)).unwrap()
        });
        Self { buffers: buffers.collect(), json }
    }

    /// The elements of an accessor, as fractions where it says so.
    fn elements(&self, accessor: &Value) -> Vec<Vec<f64>> {
        let a = &self.json["accessors"][index(accessor)];
        let width = match a["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let component = a["componentType"].as_u64().unwrap();
        let normalized = a["normalized"].as_bool().unwrap_or(false);
        let count = index(&a["count"]);
        let mut all = match a.get("bufferView") {
            Some(view) => self.numbers(view, offset(a), count, width, component, normalized),
            None => vec![vec![0.0; width]; count],
        };
        if let Some(sparse) = a.get("sparse") {
            let part = |key: &str| &sparse[key];
            let (at, values, n) = (part("indices"), part("values"), index(&sparse["count"]));
            let at_type = at["componentType"].as_u64().unwrap();
            let places = self.numbers(&at["bufferView"], offset(at), n, 1, at_type, false);
            let values = self.numbers(&values["bufferView"], offset(values), n, width, component, normalized);
            for (place, value) in places.iter().zip(values) {
                all[place[0] as usize] = value;
            }
        }
        all
    }

    /// Elements in a buffer view.
    fn numbers(
        &self,
        view: &Value,
        start: usize,
        count: usize,
        width: usize,
        component: u64,
        normalized: bool,
    ) -> Vec<Vec<f64>> {
        let size = match component {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            _ => 4,
        };
        let view = &self.json["bufferViews"][index(view)];
        let start = offset(view) + start;
        let stride = view["byteStride"].as_u64().map_or(width * size, |s| s as usize);
        let buffer = &self.buffers[index(&view["buffer"])];
        let number = |at: usize| {
            let b = &buffer[at..];
            let (x, most) = match component {
                5120 => (f64::from(b[0] as i8), 127.0),
                5121 => (f64::from(b[0]), 255.0),
                5122 => (f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
                5123 => (f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
                5125 => (f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])), 1.0),
                _ => (f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])), 1.0),
            };
            if normalized { (x / most).max(-1.0) } else { x }
        };
        let element = |i: usize| (0..width).map(|k| number(start + i * stride + k * size)).collect();
        (0..count).map(element).collect()
    }

    /// The value of a sampler at a time; weights are as many scalars for each key.
    fn sample(&self, sampler: &Value, time: f64, rotation: bool) -> Vec<f64> {
        let times: Vec<f64> = self.elements(&sampler["input"]).concat();
        let numbers = self.elements(&sampler["output"]).concat();
        let cubic = sampler["interpolation"] == "CUBICSPLINE";
        let parts = if cubic { 3 } else { 1 };
        let width = numbers.len() / times.len() / parts;
        let part = |key: usize, part: usize| &numbers[(key * parts + part) * width..][..width];
        let value = |key| part(key, parts / 2).to_vec();
        let last = times.len() - 1;
        if time <= times[0] {
            return value(0);
        }
        if time >= times[last] {
            return value(last);
        }
        let k = (0..last).rfind(|&k| times[k] <= time).unwrap();
        let span = times[k + 1] - times[k];
        let t = (time - times[k]) / span;
        let (a, b) = (value(k), value(k + 1));
        if sampler["interpolation"] == "STEP" {
            a
        } else if cubic {
            let (out, into) = (part(k, 2), part(k + 1, 0));
            let at = |i: usize| {
                (2.0 * t.powi(3) - 3.0 * t.powi(2) + 1.0) * a[i]
                    + span * (t.powi(3) - 2.0 * t.powi(2) + t) * out[i]
                    + (-2.0 * t.powi(3) + 3.0 * t.powi(2)) * b[i]
                    + span * (t.powi(3) - t.powi(2)) * into[i]
            };
            (0..width).map(at).collect()
        } else if rotation {
            // Appendix C.4 of the specification.
            let length = |q: &[f64]| q.iter().map(|x| x * x).sum::<f64>().sqrt();
            let (la, lb) = (length(&a), length(&b));
            let dot: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum::<f64>() / (la * lb);
            let (angle, side) = (dot.abs().min(1.0).acos(), dot.signum());
            let (wa, wb) = if angle < 1e-9 {
                (1.0 - t, t)
            } else {
                (((1.0 - t) * angle).sin() / angle.sin(), (t * angle).sin() / angle.sin())
            };
            (0..4).map(|i| wa * a[i] / la + side * wb * b[i] / lb).collect()
        } else {
            (0..width).map(|i| (1.0 - t) * a[i] + t * b[i]).collect()
        }
    }

    /// Writes what an animation's channels say into the JSON.
    fn pose(&mut self, animation: usize, time: f64) {
        let animation = self.json["animations"][animation].clone();
        for channel in list(&animation["channels"]) {
            let sampler = &animation["samplers"][index(&channel["sampler"])];
            let path = match channel["target"].get("node") {
                Some(node) => format!("/nodes/{node}/{}", channel["target"]["path"].as_str().unwrap()),
                None => match channel["target"].pointer("/extensions/KHR_animation_pointer/pointer") {
                    Some(pointer) => pointer.as_str().unwrap().to_owned(),
                    None => continue,
                },
            };
            let (element, key) = path.rsplit_once('/').unwrap();
            let value = self.sample(sampler, time, key == "rotation");
            // Other pointers move no vertex.
            if ["translation", "rotation", "scale", "weights"].contains(&key) && !element.contains("extensions") {
                self.json.pointer_mut(element).unwrap()[key] = Value::from(value);
            }
        }
    }

    fn world(&self) -> Vec<DMat4> {
        let nodes = list(&self.json["nodes"]);
        let local: Vec<DMat4> = nodes.iter().map(local).collect();
        let mut parents = vec![None; nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            list(&node["children"]).iter().for_each(|c| parents[index(c)] = Some(i));
        }
        let to_world = |i: usize| {
            let mut m = local[i];
            let mut at = i;
            while let Some(parent) = parents[at] {
                m = local[parent] * m;
                at = parent;
            }
            m
        };
        (0..nodes.len()).map(to_world).collect()
    }

    /// Where the corners of all triangles are, in the order of nodes, primitives and triangles.
    fn corners(&self) -> Vec<DVec3> {
        let world = self.world();
        let scene = &self.json["scenes"][self.json["scene"].as_u64().unwrap_or(0) as usize];
        let mut stack: Vec<usize> = list(&scene["nodes"]).iter().rev().map(index).collect();
        let mut corners = Vec::new();
        while let Some(i) = stack.pop() {
            let node = &self.json["nodes"][i];
            stack.extend(list(&node["children"]).iter().rev().map(index));
            let Some(mesh) = node.get("mesh").map(|m| &self.json["meshes"][index(m)]) else { continue };
            let weights = list(node.get("weights").unwrap_or(&mesh["weights"]));
            for primitive in list(&mesh["primitives"]) {
                corners.extend(self.primitive(primitive, weights, &node["skin"], &world, i));
            }
        }
        corners
    }

    fn primitive(&self, json: &Value, weights: &[Value], skin: &Value, world: &[DMat4], node: usize) -> Vec<DVec3> {
        let vector = |v: &[f64]| DVec3::new(v[0], v[1], v[2]);
        let attributes = &json["attributes"];
        let mut positions: Vec<DVec3> = self.elements(&attributes["POSITION"]).iter().map(|p| vector(p)).collect();
        for (target, weight) in list(&json["targets"]).iter().zip(weights) {
            if let Some(deltas) = target.get("POSITION") {
                let weight = weight.as_f64().unwrap();
                for (p, d) in positions.iter_mut().zip(self.elements(deltas)) {
                    *p += weight * vector(&d);
                }
            }
        }
        let skin = skin.as_u64().map(|s| &self.json["skins"][s as usize]);
        let joints: Vec<DMat4> = skin.map_or_else(Vec::new, |skin| {
            let inverse = skin.get("inverseBindMatrices").map(|m| self.elements(m));
            let bind = |j: usize| match &inverse {
                Some(all) => DMat4::from_cols_slice(&all[j]),
                None => DMat4::IDENTITY,
            };
            list(&skin["joints"]).iter().enumerate().map(|(j, n)| world[index(n)] * bind(j)).collect()
        });
        let sets: Vec<_> = (0..)
            .map_while(|s| Some((attributes.get(format!("JOINTS_{s}"))?, attributes.get(format!("WEIGHTS_{s}"))?)))
            .map(|(j, w)| (self.elements(j), self.elements(w)))
            .collect();
        let moved: Vec<DVec3> = positions
            .iter()
            .enumerate()
            .map(|(v, p)| {
                if joints.is_empty() || sets.is_empty() {
                    return world[node].transform_point3(*p);
                }
                let mut sum = DVec4::ZERO;
                for (joint, weight) in &sets {
                    for k in 0..4 {
                        if weight[v][k] != 0.0 {
                            sum += weight[v][k] * (joints[joint[v][k] as usize] * p.extend(1.0));
                        }
                    }
                }
                // Weights are fractions of a whole.
                sum.truncate() / sum.w
            })
            .collect();
        let indices: Vec<usize> = match json.get("indices") {
            Some(i) => self.elements(i).iter().map(|i| i[0] as usize).collect(),
            None => (0..moved.len()).collect(),
        };
        assert_eq!(json["mode"].as_u64().unwrap_or(4), 4, "only triangles here");
        indices.chunks_exact(3).flatten().map(|&i| moved[i]).collect()
    }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn index(value: &Value) -> usize {
    value.as_u64().unwrap() as usize
}

fn offset(value: &Value) -> usize {
    value["byteOffset"].as_u64().unwrap_or(0) as usize
}

fn numbers<const N: usize>(node: &Value, key: &str, default: [f64; N]) -> [f64; N] {
    match node.get(key) {
        Some(list) => std::array::from_fn(|k| list[k].as_f64().unwrap()),
        None => default,
    }
}

fn local(node: &Value) -> DMat4 {
    if node.get("matrix").is_some() {
        return DMat4::from_cols_array(&numbers(node, "matrix", [0.0; 16]));
    }
    let rotation = DQuat::from_array(numbers(node, "rotation", [0.0, 0.0, 0.0, 1.0])).normalize();
    let scale = DVec3::from_array(numbers(node, "scale", [1.0; 3]));
    DMat4::from_scale_rotation_translation(scale, rotation, DVec3::from_array(numbers(node, "translation", [0.0; 3])))
}

/// Where the corners of all triangles are, as they were read.
fn corners(scene: &SceneDesc) -> Vec<DVec3> {
    let mut corners = Vec::new();
    for instance in &scene.instances {
        for geometry in &scene.meshes[instance.mesh].geometries {
            let SurfaceDesc::Triangles(mesh) = &geometry.surface else { panic!("a shape from glTF") };
            let at = |v: &u32| instance.transform.transform_point3(mesh.positions[*v as usize].as_dvec3());
            corners.extend(mesh.triangles.as_flattened().iter().map(at));
        }
    }
    corners
}

fn at(animation: AnimationChoice, time: f64) -> Options {
    Options { play: Some(Play { animation, time, ..Play::default() }), ..Options::default() }
}

/// The models of the public data that move, and whose data anyone can read.
fn animated() -> Vec<PathBuf> {
    let Some(shared) = firsthit_tests::shared() else { return Vec::new() };
    let mut found = Vec::new();
    let mut folders = vec![shared.join("assets")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            let name = entry.file_name().unwrap().to_string_lossy().into_owned();
            if entry.is_dir() {
                let other = ["validator", "negative", "gltf-1.0", "Draco", "Meshopt", "Embedded"];
                if !other.iter().any(|o| name.contains(o)) {
                    folders.push(entry);
                }
            } else if name.ends_with(".glb") || name.ends_with(".gltf") {
                let bytes = fs::read(&entry).unwrap();
                let word = |w: &[u8]| bytes.windows(w.len()).any(|x| x == w);
                if bytes.len() < 2_000_000
                    && !word(b"data:application")
                    && (word(b"\"animations\"") || word(b"JOINTS_") || word(b"\"targets\""))
                {
                    found.push(entry);
                }
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_animated_model_is_where_a_second_evaluation_has_it() {
    let (mut files, mut poses, mut vertices, mut worst) = (0, 0, 0, 0.0_f64);
    for path in animated() {
        let name = path.display();
        let file = File::open(&path);
        let animations = list(&file.json["animations"]);
        let rest = (None, vec![0.0]);
        let all = animations.iter().enumerate().map(|(i, a)| {
            let ends = list(&a["samplers"]).iter().map(|s| *file.elements(&s["input"]).concat().last().unwrap());
            let end = ends.fold(0.0, f64::max);
            // Before, at, between and after the keys.
            (Some(i), [-0.1, 0.0, 0.2, 1.0 / PI, 0.5, 0.77, 1.0, 1.5].map(|t| t * end).to_vec())
        });
        for (animation, times) in std::iter::once(rest).chain(all) {
            for time in times {
                let mut posed = File::open(&path);
                let options = match animation {
                    Some(i) => {
                        posed.pose(i, time);
                        at(AnimationChoice::Named(i.to_string()), time)
                    }
                    None => Options::default(),
                };
                let read = firsthit_import::open(&path, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
                let (expected, found) = (posed.corners(), corners(&read.scene));
                assert_eq!(expected.len(), found.len(), "{name} at {time}");
                let size = expected.iter().fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
                for (k, (e, f)) in expected.iter().zip(&found).enumerate() {
                    let error = (*e - *f).abs().max_element() / size.max(1e-30);
                    // Vertices are f32.
                    assert!(error < 1e-6, "{name}, animation {animation:?} at {time}: corner {k} is {f}, not {e}");
                    worst = worst.max(error);
                }
                poses += 1;
                vertices += found.len();
            }
        }
        files += 1;
    }
    firsthit_tests::summary(&format!(
        "animations: {files} files, {poses} poses, {vertices} corners, the worst off by {worst:.1e} of the model's size"
    ));
}

/// Blender's test of pointers, by numbers worked out by hand from its accessors' first and last keys.
#[test]
fn pointers_of_blenders_test_are_followed() {
    let Some(shared) = firsthit_tests::shared() else { return };
    let path = shared.join("assets/blender-io/24_animation_pointer/24_animation_pointer.gltf");
    let file = File::open(&path);
    let animation = &file.json["animations"][0];
    let value = |pointer: &str, time: f64| {
        let of = |c: &&Value| c["target"]["extensions"]["KHR_animation_pointer"]["pointer"] == pointer;
        let channel = list(&animation["channels"]).iter().find(of).unwrap();
        file.sample(&animation["samplers"][index(&channel["sampler"])], time, false)
    };
    let mut changed = 0;
    for time in [0.0, 0.4, 1.0, 2.5] {
        let read = firsthit_import::open(&path, &at(AnimationChoice::First, time)).unwrap();
        let scene = &read.scene;
        let pbr = |i: usize| match &scene.materials[i].model {
            firsthit_import::scene::MaterialModel::Pbr(pbr) => pbr,
            other => panic!("{other:?}"),
        };
        let close = |found: &[f32], expected: &[f64]| {
            let near = |(f, e): (&f32, &f64)| (f64::from(*f) - e).abs() <= 1e-6 * e.abs().max(1.0);
            assert!(found.len() == expected.len() && found.iter().zip(expected).all(near), "{found:?} {expected:?}");
        };
        close(&pbr(2).base_color.to_array(), &value("/materials/2/pbrMetallicRoughness/baseColorFactor", time));
        close(&[pbr(2).metallic], &value("/materials/2/pbrMetallicRoughness/metallicFactor", time));
        close(&[pbr(12).ior], &value("/materials/12/extensions/KHR_materials_ior/ior", time));
        let strength = value("/materials/3/extensions/KHR_materials_emissive_strength/emissiveStrength", time)[0];
        let glow: Vec<f64> = value("/materials/3/emissiveFactor", time).iter().map(|c| c * strength).collect();
        close(&pbr(3).emissive.to_array(), &glow);
        let way = "/materials/5/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform";
        let texture = pbr(5).base_color_texture.as_ref().unwrap();
        close(&texture.transform.translation.to_array(), &value(&format!("{way}/offset"), time));
        let scale = value(&format!("{way}/scale"), time);
        close(&[texture.transform.x_axis.x, texture.transform.y_axis.y], &scale);
        changed += usize::from(pbr(2).metallic != 0.0);
        // A normal texture has no offset of its own: Blender means that of its transform.
        let said: Vec<&str> = read.report.warnings.iter().map(|w| w.message.as_str()).collect();
        assert!(said.iter().any(|w| w.contains("'/materials/5/normalTexture/offset' is nothing")), "{said:?}");
    }
    assert!(changed > 0);
}

/// `FIRSTHIT_BLESS=1` writes the table anew.
#[test]
fn the_page_of_animation_lists_what_can_be_changed() {
    use gltf::AnimatedKind::{Numbers, Rotation, Switch, Weights};
    let mut table = String::from("| path | value |\n|---|---|\n");
    for property in gltf::ANIMATED_PROPERTIES {
        let value = match property.kind {
            Numbers(1) => "a number".to_owned(),
            Numbers(count) => format!("{count} numbers"),
            Rotation => "a quaternion".into(),
            Weights => "a number for each morph target".into(),
            Switch => "true or false, in steps".into(),
        };
        table += &format!("| `{}` | {value} |\n", property.path);
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/animation.md");
    let page = fs::read_to_string(&path).unwrap().replace('\r', "");
    let text = page.split("| path |").next().unwrap();
    let expected = format!("{text}{table}");
    if std::env::var_os("FIRSTHIT_BLESS").is_some_and(|v| v == "1") {
        fs::write(&path, &expected).unwrap();
        return;
    }
    assert!(page == expected, "run with FIRSTHIT_BLESS=1");
}
