//! Animations as a user meets them: moments, sequences, motion blur.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

/// A folder with `a.gltf`: a triangle that stands, one that bends by a morph target, and one that goes to the right;
/// both take two seconds.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(TempDir::new().unwrap());
        let numbers: [&[f32]; 6] = [
            &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            &[0.0, 0.0, 0.0, 1.0, 0.5, 0.3, 0.0, 0.0, 0.7],
            &[0.0, 2.0],
            &[0.0, 1.0],
            &[1.5, 0.0, 0.0, 3.0, 0.5, 0.0],
            &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0],
        ];
        let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
        for (i, (list, kind)) in numbers.iter().zip(["VEC3", "VEC3", "SCALAR", "SCALAR", "VEC3", "VEC3"]).enumerate() {
            views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 4 * list.len()}));
            let width = if kind == "VEC3" { 3 } else { 1 };
            accessors.push(json!({
                "bufferView": i, "type": kind, "componentType": 5126, "count": list.len() / width,
                "min": [0.0], "max": [list[list.len() - 1]],
            }));
            bytes.extend(list.iter().flat_map(|x| x.to_le_bytes()));
        }
        let primitive = json!({"attributes": {"POSITION": 0, "NORMAL": 5}, "material": 0});
        let mut bending = primitive.clone();
        bending["targets"] = json!([{"POSITION": 1}]);
        let channel = |sampler: usize, node: usize, path: &str| json!({"sampler": sampler, "target": {"node": node, "path": path}});
        let file = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"uri": "a.bin", "byteLength": bytes.len()}], "bufferViews": views, "accessors": accessors,
            "materials": [{"doubleSided": true}],
            "meshes": [{"primitives": [primitive]}, {"primitives": [bending], "weights": [0.0]}],
            "nodes": [
                {"mesh": 0}, {"mesh": 1, "translation": [0.0, 1.2, 0.0]}, {"mesh": 0, "translation": [1.5, 0.0, 0.0]},
            ],
            "scenes": [{"nodes": [0, 1, 2], "name": "all"}, {"nodes": [0], "name": "one"}],
            "scene": 0,
            "animations": [{
                "name": "Go",
                "samplers": [{"input": 2, "output": 3}, {"input": 2, "output": 4}],
                "channels": [channel(0, 1, "weights"), channel(1, 2, "translation")],
            }],
        });
        std::fs::write(folder.path("a.bin"), bytes).unwrap();
        std::fs::write(folder.path("a.gltf"), file.to_string()).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    fn run(&self, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_firsthit"));
        command.current_dir(self.0.path()).args(args).env_clear().stdin(Stdio::null());
        command.output().unwrap()
    }

    /// Renders small, with these options; the answer is what was said.
    #[track_caller]
    fn render(&self, args: &[&str]) -> String {
        let run = self.run(&[&["render", "a.gltf", "--resolution", "48x27", "-s", "4"], args].concat());
        let said = String::from_utf8(run.stderr).unwrap();
        assert!(run.status.success(), "{said}");
        said
    }
}

#[test]
fn frames_of_a_sequence_have_the_bits_of_frames_alone() {
    let folder = Folder::new();
    let said = folder.render(&["--frames", "0..5", "--fps", "2", "-o", "f_%02d.exr"]);
    assert!(said.contains("trees: 1 kept, 1 refitted, 0 built"), "{said}");
    for frame in 0..5 {
        let number = frame.to_string();
        folder.render(&["--frame", &number, "--fps", "2", "-o", "alone.exr"]);
        assert!(folder.read("alone.exr") == folder.read(&format!("f_{frame:02}.exr")), "frame {frame}");
    }
    assert!(folder.read("f_00.exr") != folder.read("f_01.exr"), "something moves");
    folder.render(&["--animation", "Go", "--animation-time", "1s", "-o", "time.exr"]);
    assert!(folder.read("time.exr") == folder.read("f_02.exr"), "a frame is a time");
    folder.render(&["--animation", "all", "--animation-time", "9", "-o", "end.exr"]);
    assert!(folder.read("end.exr") == folder.read("f_04.exr"), "after the end as at the end");
}

#[test]
fn frames_that_are_there_are_rendered_again_unless_that_is_not_wanted() {
    let folder = Folder::new();
    let frames = ["--frames", "0..3", "--fps", "1", "-o", "f%d.png"];
    folder.render(&frames);
    let second = folder.read("f1.png");
    std::fs::write(folder.path("f0.png"), "mine").unwrap();
    std::fs::remove_file(folder.path("f1.png")).unwrap();
    let said = folder.render(&[&frames[..], &["--skip-existing"]].concat());
    assert!(said.contains("2 frames were there already"), "{said}");
    assert!(folder.read("f0.png") == b"mine" && folder.read("f1.png") == second);
    folder.render(&frames);
    assert!(folder.read("f0.png") != b"mine");
}

#[test]
fn what_moves_is_blurred_while_the_shutter_is_open() {
    let folder = Folder::new();
    folder.render(&["--animation-time", "0.5", "-o", "sharp.exr"]);
    let said = folder.render(&["--animation-time", "0.5", "--shutter", "500ms", "-o", "blurred.exr"]);
    assert!(!said.contains("not blurred"), "{said}");
    assert!(folder.read("sharp.exr") != folder.read("blurred.exr"));
}

#[test]
fn inspect_lists_animations_and_scenes() {
    let folder = Folder::new();
    let run = folder.run(&["inspect", "a.gltf", "--json"]);
    let report: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!((&report["animations"], &report["scenes"]), (&json!(1), &json!(2)));
    assert_eq!(report["animation_list"], json!([{"name": "Go", "seconds": 2.0, "channels": 2}]));
    assert_eq!(report["scene_list"], json!(["all", "one"]));
    let text = String::from_utf8(folder.run(&["inspect", "a.gltf"]).stdout).unwrap();
    for words in ["animations  1", "Go  2 s, 2 channels", "scenes      all, one"] {
        assert!(text.contains(words), "no '{words}' in {text}");
    }
}

#[test]
fn a_scene_is_chosen_and_wrong_wishes_are_explained() {
    let folder = Folder::new();
    let said = folder.render(&["--scene", "one", "-o", "one.png"]);
    assert!(said.contains("done: 1 triangle"), "{said}");
    let fails = |args: &[&str], code: i32, words: &str| {
        let run = folder.run(&[&["render", "a.gltf", "-s", "1", "--resolution", "8x8"], args].concat());
        let said = String::from_utf8(run.stderr).unwrap();
        assert!(run.status.code() == Some(code) && said.contains(words), "{args:?}: {said}");
    };
    fails(&["--scene", "two"], 1, "there is no scene 'two': there are 0 'all', 1 'one'");
    fails(&["--animation", "Run"], 1, "there is no animation 'Run': there are 0 'Go'");
    fails(&["--frames", "0..2", "-o", "f.png"], 2, "frame_%04d.png");
    fails(&["--frames", "2..2"], 2, "A below B");
    fails(&["--frames", "0..2", "--frame", "1"], 2, "--frame");
    fails(&["--frames", "0..2", "--checkpoint", "a.sums"], 2, "--checkpoint");
}
