//! The program as a user meets it: exit codes, streams, files, messages.

#[cfg(unix)]
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// A folder of its own, where the program is run.
struct Folder(TempDir);

const CUBE: &str = "\
mtllib cube.mtl
v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1
v -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
usemtl red
f 5 6 7 8\nf 2 1 4 3\nf 6 2 3 7\nf 1 5 8 4\nf 8 7 3 4\nf 1 2 6 5
";

impl Folder {
    /// With `cube.obj` and its material in it.
    fn new() -> Self {
        let folder = Self(TempDir::new().unwrap());
        folder.write("cube.obj", CUBE);
        folder.write("cube.mtl", "newmtl red\nKd 0.8 0.1 0.1\n");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_firsthit"));
        command.current_dir(self.0.path()).args(args).env_clear().stdin(Stdio::null());
        command
    }

    fn run(&self, args: &[&str]) -> Run {
        Run(self.command(args).output().unwrap())
    }

    /// Renders the cube, small, with these options.
    fn render(&self, args: &[&str]) -> Run {
        self.run(&[&["render", "cube.obj", "--resolution", "32x18", "-s", "1"], args].concat())
    }

    /// The names of its files, sorted.
    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

struct Run(Output);

impl Run {
    fn stdout(&self) -> String {
        String::from_utf8(self.0.stdout.clone()).unwrap()
    }

    fn stderr(&self) -> String {
        String::from_utf8(self.0.stderr.clone()).unwrap()
    }

    /// Expects an exit code.
    #[track_caller]
    fn code(self, code: i32) -> Self {
        assert_eq!(self.0.status.code(), Some(code), "{}", self.stderr());
        self
    }

    /// Expects an exit code, an error with these words and nothing on standard output.
    #[track_caller]
    fn fails(self, code: i32, words: &[&str]) -> Self {
        let run = self.code(code);
        let text = run.stderr();
        for word in words {
            assert!(text.contains(word), "no '{word}' in: {text}");
        }
        assert!(text.contains("error: "), "{text}");
        assert!(run.0.stdout.is_empty(), "{}", run.stdout());
        run
    }

    fn json(&self) -> Value {
        serde_json::from_slice(&self.0.stdout).unwrap_or_else(|e| panic!("{e}: {}", self.stdout()))
    }
}

/// Width, height and bits per channel from the header of a PNG.
#[track_caller]
fn header(bytes: &[u8]) -> (u32, u32, u8) {
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n"), "no PNG");
    let number = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    (number(16), number(20), bytes[24])
}

fn png_file(path: &Path) -> (u32, u32, u8) {
    header(&std::fs::read(path).unwrap())
}

struct Pixels {
    line_size: usize,
    pixels: Vec<u8>,
}

fn decode(png: &[u8]) -> Pixels {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    Pixels { line_size: info.line_size, pixels }
}

#[test]
fn a_render_writes_an_image_named_after_the_model_and_one_line() {
    let folder = Folder::new();
    let run = folder.render(&[]).code(0);
    assert_eq!(png_file(&folder.path("cube.png")), (32, 18, 8));
    assert_eq!(run.stdout(), "");
    let text = run.stderr();
    let line = text.lines().last().unwrap();
    for word in ["done: 12 triangles", "rays (camera ", "load", "build", "render", "wrote cube.png"] {
        assert!(line.contains(word), "{text}");
    }
    assert_eq!(folder.files(), ["cube.mtl", "cube.obj", "cube.png"], "nothing else is left behind");
}

#[test]
fn the_folder_names_the_image_of_a_scene_json() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("room")).unwrap();
    // Not readable as a scene: the name is told by what the message would write.
    folder.write("room/scene.json", "{");
    folder.run(&["render", "room/scene.json"]).fails(1, &["room/scene.json"]);
    assert!(!folder.path("room.png").exists());
}

#[test]
fn quiet_is_quiet() {
    let folder = Folder::new();
    let run = folder.render(&["-q"]).code(0);
    assert_eq!((run.stdout(), run.stderr()), (String::new(), String::new()));
}

#[test]
fn standard_output_takes_the_image_alone() {
    let folder = Folder::new();
    let run = folder.render(&["-o", "-", "--bit-depth=16", "--explain", "--progress"]).code(0);
    assert_eq!(header(&run.0.stdout), (32, 18, 16));
    assert_eq!(folder.files(), ["cube.mtl", "cube.obj"]);
}

#[test]
fn what_cannot_work_is_refused_before_anything_is_loaded() {
    let folder = Folder::new();
    // The model does not exist either: the option is what is complained about.
    let render = |args: &[&str]| folder.run(&[&["render", "nothing.obj"], args].concat());
    render(&["-o", "-", "--json"]).fails(2, &["--json", "hint"]);
    render(&["-o", "-", "--aov", "depth"]).fails(2, &["--aov"]);
    render(&["-o", "image.xyz"]).fails(2, &["image.xyz", ".png"]);
    render(&["-o", "image"]).fails(2, &[".png"]);
    render(&["-o", "missing/image.png"]).fails(1, &["missing", "mkdir"]);
    // There is no room for so long a name.
    render(&["-o", &format!("{}.png", "x".repeat(300))]).fails(1, &["cannot write"]);
    assert_eq!(folder.files(), ["cube.mtl", "cube.obj"]);
}

#[test]
fn wrong_usage_exits_with_2() {
    let folder = Folder::new();
    for args in [
        &["render"][..],
        &["render", "cube.obj", "--no-such-option"],
        &["render", "cube.obj", "--resolution", "huge"],
        &["render", "cube.obj", "--resolution", "0x5"],
        &["render", "cube.obj", "--spp", "0"],
        &["render", "cube.obj", "--threads", "0"],
        &["render", "cube.obj", "--camera-position", "1,2"],
        &["render", "cube.obj", "--effects", "sparkles"],
        &["render", "cube.obj", "--bit-depth", "12"],
        &["render", "cube.obj", "--crop", "0,0,9999,1"],
        &["render", "cube.obj", "--up", "W"],
        &["render", "cube.obj", "--camera-zoom-factor", "-1"],
        &["render", "cube.obj", "extra.obj"],
    ] {
        folder.run(args).fails(2, &[]);
    }
    folder.run(&["render", "cube.obj", "--camera-zoom-factor", "-1"]).fails(2, &["expected a number above 0"]);
    folder.run(&["render", "cube.obj", "--camera-view-angle", "-20"]).fails(2, &["expected degrees"]);
    folder.run(&[]).code(2);
    folder.run(&["cube.obj"]).fails(2, &["hint: to render a model: firsthit render cube.obj"]);
    assert_eq!(folder.files(), ["cube.mtl", "cube.obj"]);
}

#[test]
fn a_file_that_cannot_be_read_is_named_with_the_place_and_nothing_is_written() {
    let folder = Folder::new();
    folder.run(&["render", "nothing.obj"]).fails(1, &["nothing.obj", "hint"]);
    folder.write("bad.gltf", r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [7]}], "scene": 0}"#);
    folder.run(&["render", "bad.gltf"]).fails(1, &["bad.gltf"]);
    folder.run(&["render", "cube.mtl"]).fails(1, &["cube.mtl"]);
    folder.run(&["inspect", "nothing.obj"]).fails(1, &["nothing.obj"]);
    folder.render(&["--hdri", "nothing.hdr"]).fails(1, &["nothing.hdr"]);
    folder.render(&["--camera", "nobody"]).fails(1, &["nobody"]);
    assert_eq!(folder.files(), ["bad.gltf", "cube.mtl", "cube.obj"]);
}

#[test]
fn a_failed_render_leaves_the_old_image_alone() {
    let folder = Folder::new();
    folder.write("old.png", "old");
    folder.run(&["render", "nothing.obj", "-o", "old.png"]).code(1);
    assert_eq!(std::fs::read(folder.path("old.png")).unwrap(), b"old");
    folder.render(&["-o", "old.png"]).code(0);
    assert_eq!(png_file(&folder.path("old.png")), (32, 18, 8));
}

#[test]
fn a_file_that_was_read_is_not_written_over() {
    let folder = Folder::new();
    // The model's own texture has the name that the image would get.
    folder.render(&[]).code(0);
    folder.write("cube.mtl", "newmtl red\nmap_Kd cube.png\n");
    let texture = std::fs::read(folder.path("cube.png")).unwrap();
    folder.render(&[]).fails(1, &["cube.png", "hint", "-o FILE"]);
    folder.render(&["-o", "./cube.png"]).fails(1, &["cube.png"]);
    assert!(std::fs::read(folder.path("cube.png")).unwrap() == texture);
    folder.render(&["-o", "other.png"]).code(0);

    folder.render(&["-o", "sky.exr"]).code(0);
    folder.render(&["-o", "sky.exr", "--hdri", "sky.exr"]).fails(1, &["sky.exr"]);
    std::fs::rename(folder.path("sky.exr"), folder.path("new.depth.exr")).unwrap();
    let beside = ["-o", "new.png", "--aov", "depth", "--hdri", "new.depth.exr"];
    folder.render(&beside).fails(1, &["new.depth.exr"]);
    assert!(!folder.path("new.png").exists());
}

#[test]
fn a_picture_too_large_for_memory_is_refused_wherever_its_size_is_given() {
    let folder = Folder::new();
    folder.write("huge.toml", "film = { width = 16384, height = 16384 }\n");
    folder.run(&["render", "huge.toml"]).fails(1, &["huge.toml", "too large"]);
    folder.render(&["--resolution", "99999x99999"]).fails(1, &["too large"]);
    folder.render(&["--resolution", "99999x99999", "--crop", "40000,40000,8,8"]).code(0);
}

#[test]
fn samples_that_are_no_light_fail_a_strict_render() {
    let folder = Folder::new();
    // So strong that f32 has no number for what arrives, once it is divided by densities: paths do without them here.
    folder.write(
        "burnt.toml",
        "camera = { origin = [0, 0, 5], target = [0, 0, 0] }\n\
         env = { type = \"constant\", radiance = 3e38 }\n\
         objects = [{ shape = \"sphere\", center = [0, 0, 0], radius = 1 }]\n",
    );
    let render = |args: &[&str]| {
        folder.run(&[&["render", "burnt.toml", "--resolution=32x18", "-s1", "--integrator=whitted"], args].concat())
    };
    let run = render(&[]).code(0);
    assert!(run.stderr().contains("warning: ") && run.stderr().contains("not finite"), "{}", run.stderr());
    render(&["--strict"]).fails(1, &["not finite", "--strict"]);
}

#[test]
fn control_characters_in_files_do_not_reach_the_terminal() {
    let folder = Folder::new();
    folder.write("cube.mtl", "newmtl red\nKd 1 1 1\nstrange\x1b]0;title\x07 1\n");
    folder.write(
        "named.gltf",
        r#"{"asset": {"version": "2.0"}, "cameras": [{"name": "\u001b[2J\n\u009bm",
        "type": "perspective", "perspective": {"yfov": 1, "znear": 1}}], "nodes": [{"camera": 0}],
        "scenes": [{"nodes": [0]}], "scene": 0}"#,
    );
    let runs = [
        folder.render(&["-v"]),
        folder.render(&["--hdri", "\x1b[2Jsky.hdr"]),
        folder.run(&["inspect", "cube.obj"]),
        folder.run(&["inspect", "named.gltf"]),
        folder.run(&["render", "named.gltf", "--camera", "nobody"]),
    ];
    for run in runs {
        let text = run.stdout() + &run.stderr();
        assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{text:?}");
    }
    let listed = folder.run(&["inspect", "named.gltf"]).code(0).stdout();
    assert!(listed.contains("\\u{1b}[2J\\n"), "{listed}");
}

#[test]
fn strict_takes_warnings_as_errors() {
    let folder = Folder::new();
    std::fs::remove_file(folder.path("cube.mtl")).unwrap();
    let run = folder.render(&[]).code(0);
    assert!(run.stderr().contains("warning: cube.obj"), "{}", run.stderr());
    std::fs::remove_file(folder.path("cube.png")).unwrap();
    folder.render(&["--strict"]).fails(1, &["cube.obj", "--strict"]);
    folder.render(&["--strict", "--quiet"]).fails(1, &["cube.mtl"]);
    folder.run(&["inspect", "--strict", "cube.obj"]).fails(1, &["cube.mtl"]);
    assert_eq!(folder.files(), ["cube.obj"]);
}

#[test]
fn json_reports_the_render() {
    let folder = Folder::new();
    let run = folder.render(&["--json", "-t", "2", "--seed", "7", "--max-depth=3", "-o", "a.exr"]).code(0);
    let report = run.json();
    assert_eq!(report["output"], "a.exr");
    for (key, value) in
        [("width", 32), ("height", 18), ("spp", 1), ("seed", 7), ("max_depth", 3), ("threads", 2), ("triangles", 12)]
    {
        assert_eq!(report[key], value, "{key}");
    }
    for step in ["load", "build", "render", "write"] {
        assert!(report["seconds"][step].as_f64().is_some_and(|s| s >= 0.0), "{step}");
    }
    // No rays where the camera meets nothing for certain; one for each pixel where that is not looked for.
    assert!((1..32 * 18).contains(&report["rays"]["camera"].as_u64().unwrap()), "{}", report["rays"]);
    let lens = folder.render(&["--json", "--aperture", "1e-6", "-o", "lens.exr"]).code(0).json();
    assert_eq!(lens["rays"]["camera"], 32 * 18);
    for kind in ["shadow", "reflection", "refraction"] {
        assert!(report["rays"][kind].is_u64(), "{kind}");
    }
    let effects = report["effects"].as_array().unwrap();
    for effect in effects {
        assert!(effect["name"].is_string() && effect["by"].is_array(), "{effect}");
        assert!(effect["called_for"].is_boolean() && effect["simulated"].is_boolean(), "{effect}");
    }
    let shadows = effects.iter().find(|e| e["name"] == "shadows").unwrap();
    assert!(shadows["rays"].is_u64(), "{shadows}");
    assert_eq!(report["warnings"], Value::Array(Vec::new()));
    assert_eq!(report["interrupted"], false);
    let seven = folder.render(&["--json", "-q", "--effects", "auto,-shadows"]).json();
    assert_eq!(seven["rays"]["shadow"], 0, "what is switched off casts no rays");
}

#[test]
fn without_a_number_samples_are_taken_until_the_noise_is_low_or_time_is_up() {
    let folder = Folder::new();
    let render = |args: &[&str]| folder.run(&[&["render", "cube.obj", "--resolution", "16x16"], args].concat()).code(0);
    let text = render(&[]).stderr();
    for word in ["noise is below 0.03", "at most 1024 samples per pixel", "at most 1 min 00 s", "noise at most 0.0"] {
        assert!(text.contains(word), "no '{word}' in: {text}");
    }
    let report = render(&["--noise-threshold", "1000", "--json", "--aov", "samples,variance"]).json();
    assert_eq!((report["samples"].as_u64(), report["out_of_time"].as_bool()), (Some(16 * 16 * 32), Some(false)));
    assert!(report["noise"].as_f64().is_some_and(|n| n < 1.0));
    assert!(folder.path("cube.samples.exr").exists() && folder.path("cube.variance.exr").exists());
    let run = render(&["--time-limit", "1ms", "--noise-threshold=1e-9", "-s", "1000000", "--json"]);
    assert_eq!(run.json()["out_of_time"], true);
    assert!(run.stderr().contains("time is up: 12 triangles"), "{}", run.stderr());
    let whitted = render(&["--integrator", "whitted", "--json"]).json();
    assert_eq!((whitted["samples"].as_u64(), whitted["noise"].is_null()), (Some(16 * 16 * 16), true));
    let seeds = [render(&["-s", "8", "--sampler", "independent", "--json"]), render(&["-s", "8", "--json"])];
    assert!(seeds.iter().all(|run| run.json()["samples"] == 16 * 16 * 8));
    folder.run(&["render", "cube.obj", "--time-limit", "soon"]).fails(2, &["expected a time"]);
}

#[test]
fn a_render_is_put_aside_gone_on_with_and_joined_of_shares() {
    let folder = Folder::new();
    let render = |args: &[&str]| folder.run(&[&["render", "cube.obj", "--resolution", "16x16"], args].concat());
    let bytes = |name: &str| std::fs::read(folder.path(name)).unwrap();
    render(&["-s", "64", "-o", "whole.exr"]).code(0);
    render(&["-s", "20", "-o", "part.exr", "--checkpoint", "part.sums"]).code(0);
    render(&["-s", "64", "-o", "resumed.exr", "--resume", "part.sums", "--checkpoint", "part.sums"]).code(0);
    assert!(bytes("whole.exr") == bytes("resumed.exr"));
    for share in ["0..16", "16..48", "48..64"] {
        let name = format!("{share}.sums");
        render(&["--samples-range", share, "--checkpoint", &name, "-o", "share.exr"]).code(0);
    }
    folder.run(&["merge", "48..64.sums", "0..16.sums", "16..48.sums", "-o", "merged.exr"]).code(0);
    assert!(bytes("whole.exr") == bytes("merged.exr"));
    folder.run(&["merge", "48..64.sums", "0..16.sums", "-o", "m.exr"]).fails(1, &["48..64.sums", "after sample 16"]);
    render(&["-s", "64", "--seed", "1", "--resume", "part.sums"]).fails(1, &["part.sums", "other options"]);
    folder.run(&["merge", "cube.obj", "-o", "m.exr"]).fails(1, &["cube.obj", "no checkpoint"]);
    render(&["--samples-range", "3..9"]).fails(2, &["multiple of 16"]);
    assert!(!folder.path("m.exr").exists());
}

#[test]
fn a_checkpoint_replaces_nothing_that_is_read_or_written() {
    let folder = Folder::new();
    let bytes = |name: &str| std::fs::read(folder.path(name)).unwrap();
    folder.render(&["-o", "a.png", "--checkpoint", "cube.mtl"]).fails(1, &["cube.mtl", "--checkpoint FILE"]);
    folder.render(&["-o", "a.png", "--checkpoint", "a.png"]).fails(2, &["a.png", "the image is written"]);
    assert!(!folder.path("a.png").exists(), "nothing was rendered");
    folder.render(&["-o", "a.png", "--checkpoint", "none/a.sums"]).fails(1, &["mkdir -p none"]);
    for (share, name) in [("0..16", "a.sums"), ("16..32", "b.sums")] {
        let args = ["render", "cube.obj", "--resolution", "8x8", "--samples-range", share, "--checkpoint", name];
        folder.run(&args).code(0);
    }
    let before = bytes("a.sums");
    folder.run(&["merge", "a.sums", "b.sums", "-o", "m.png", "--checkpoint", "a.sums"]).fails(1, &["a.sums"]);
    assert!(before == bytes("a.sums") && !folder.path("m.png").exists());
    let view = ["--bit-depth", "16", "--background-color", "1,0,0", "--checkpoint", "m.sums"];
    folder.run(&[&["merge", "a.sums", "b.sums", "-o", "m.png"], &view[..]].concat()).code(0);
    folder.run(&["merge", "a.sums", "-o", "none/m.png"]).fails(1, &["mkdir -p none"]);
}

#[test]
fn a_checkpoint_knows_its_scene_by_content() {
    let folder = Folder::new();
    let render = |args: &[&str]| folder.run(&[&["render", "cube.obj", "--resolution", "8x8"], args].concat());
    render(&["-s", "4", "-o", "a.png", "--checkpoint", "a.sums"]).code(0);
    // The default integrator by its name is the same picture.
    let more = ["-s", "8", "-o", "a.png", "--resume", "a.sums"];
    let run = render(&[&more[..], &["--integrator", "path"]].concat()).code(0);
    assert!(run.stderr().contains("8 samples per pixel"), "{}", run.stderr());
    // As long as before, with another colour in it.
    folder.write("cube.mtl", "newmtl red\nKd 0.1 0.8 0.1\n");
    render(&more).fails(1, &["a.sums", "another model"]);
}

#[test]
fn explain_says_what_was_chosen_and_what_each_effect_cost() {
    let folder = Folder::new();
    let run = folder.render(&["--explain"]).code(0);
    let text = run.stderr();
    for word in ["effects:", "shadows", "refraction", "not called for", "rays", "kernel: ", "samples"] {
        assert!(text.contains(word), "no '{word}' in {text}");
    }
    assert_eq!(run.stdout(), "");
}

#[test]
fn ablations_say_what_the_image_would_be_without_each_effect() {
    let folder = Folder::new();
    let run = folder.render(&["--explain=ablate", "--json", "--effects", "auto,-reflection,+ao"]).code(0);
    let text = run.stderr();
    for word in ["without each effect in turn", "rmse", "saves", "other random numbers"] {
        assert!(text.contains(word), "no '{word}' in {text}");
    }
    let json = run.json();
    let simulated = json["effects"].as_array().unwrap().iter().filter(|e| e["simulated"] == true);
    let simulated: Vec<_> = simulated.map(|e| e["name"].as_str().unwrap().to_owned()).collect();
    let ablated = json["ablation"]["effects"].as_array().unwrap();
    let names: Vec<_> = ablated.iter().map(|e| e["name"].as_str().unwrap().to_owned()).collect();
    assert_eq!(names, simulated);
    assert!(!names.iter().any(|n| n == "reflection"));
    let of = |name: &str| ablated.iter().find(|e| e["name"] == name).unwrap()["rmse"].as_f64().unwrap();
    // Path tracing has no use for ambient occlusion; without its surroundings the scene is black.
    assert_eq!(of("ambient-occlusion"), 0.0);
    assert!(of("environment") > 0.01);
    assert!(ablated.iter().all(|e| e["seconds"].as_f64().unwrap() > 0.0));
    folder.render(&["--explain=everything"]).fails(2, &["costs or ablate"]);
    folder.write("firsthit.toml", "explain = true\n");
    assert!(folder.render(&[]).code(0).stderr().contains("effects:"));
    folder.write("firsthit.toml", "explain = false\n");
    assert!(!folder.render(&[]).code(0).stderr().contains("effects:"));
    folder.write("firsthit.toml", "explain = \"ablate\"\n");
    assert!(folder.render(&["-q"]).code(0).stderr().contains("rmse"));
}

#[test]
fn options_come_in_either_form_and_negative_numbers_are_values() {
    let folder = Folder::new();
    let all: &[&str] = &[
        "--resolution=40,20",
        "--camera-position",
        "-3,-2.5,4",
        "--camera-focal-point=-0.1,0,0",
        "--camera-view-up",
        "0,1,-0.5",
        "--camera-view-angle=40",
        "--camera-azimuth-angle",
        "-30",
        "--camera-elevation-angle",
        "-5",
        "--camera-zoom-factor",
        "1.5",
        "--camera-orthographic",
        "--up",
        "-Z",
        "--exposure",
        "-0.5",
        "--hdri",
        "white",
        "--hdri-rotation",
        "-90",
        "--background-color",
        "0.1,0.2,0.3",
        "--tone-mapping=agx",
        "--clip-box",
        "-9,-9,-9,9,9,9",
        "--clip-plane",
        "-1,0,0,5",
        "--clip-plane=0,1,0,5",
        "--precision",
        "double",
        "--integrator",
        "whitted",
        "--effects",
        "-shadows,+ao",
        "--crop",
        "1,2,30,10",
        "--samples",
        "2",
        "--no-progress",
    ];
    folder.render(all).code(0);
    assert_eq!(png_file(&folder.path("cube.png")), (30, 10, 8), "the crop of the last resolution given");
}

#[test]
fn every_integrator_and_precision_renders() {
    let folder = Folder::new();
    let names =
        ["auto", "path", "whitted", "direct", "ao", "depth", "normal", "geometric-normal", "albedo", "uv", "heat"];
    for name in names.into_iter().chain(["barycentric", "instance-id", "material-id", "primitive-id"]) {
        folder.render(&["--integrator", name]).code(0);
    }
    for tier in ["fast", "robust", "double"] {
        folder.render(&["--precision", tier]).code(0);
    }
}

#[test]
fn pictures_beside_the_colour_are_written_and_reported() {
    let folder = Folder::new();
    let report = folder.render(&["--aov", "depth,normal", "--json"]).code(0).json();
    let files: Vec<&str> = report["aov_files"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert_eq!(files, ["cube.depth.exr", "cube.normal.exr"]);
    for file in files {
        assert!(std::fs::read(folder.path(file)).unwrap().starts_with(&[0x76, 0x2f, 0x31, 0x01]), "{file}");
    }
    let report = folder.render(&["--aov", "depth,normal", "--json", "-o", "all.exr"]).code(0).json();
    assert_eq!(report["aov_files"], Value::Array(Vec::new()));
}

#[test]
fn a_background_colour_is_shown_exactly() {
    let folder = Folder::new();
    let rgb = |bytes: &[u8]| {
        let image = decode(bytes);
        assert_eq!(image.line_size, 3 * 32, "opaque");
        [image.pixels[0], image.pixels[1], image.pixels[2]]
    };
    for tone_mapping in ["pbr-neutral", "agx", "srgb"] {
        let run = folder.render(&["--background-color", "#ff8040", "--tone-mapping", tone_mapping, "-o", "-"]);
        assert_eq!(rgb(&run.code(0).0.stdout), [0xff, 0x80, 0x40], "{tone_mapping}");
    }
    let transparent = folder.render(&["--no-background", "-o", "-"]).code(0);
    let image = decode(&transparent.0.stdout);
    assert_eq!((image.line_size, image.pixels[3]), (4 * 32, 0));
}

#[test]
fn the_number_of_threads_does_not_change_a_byte() {
    let folder = Folder::new();
    folder.render(&["-s", "4", "-t", "1", "-o", "one.png"]).code(0);
    folder.render(&["-s", "4", "-t", "2", "-o", "two.png"]).code(0);
    let bytes = |name| std::fs::read(folder.path(name)).unwrap();
    assert!(bytes("one.png") == bytes("two.png"));
    folder.render(&["-s", "4", "--seed", "1", "-o", "other.png"]).code(0);
    assert!(bytes("one.png") != bytes("other.png"), "another seed is another image");
}

#[test]
fn the_configuration_file_comes_before_the_command_line() {
    let folder = Folder::new();
    folder.write("firsthit.toml", "resolution = [20, 10]\nspp = 2\nseed = 5\noutput = \"c.png\"\n");
    folder.write("other.toml", "resolution = \"16x8\"\n");
    let report = |args: &[&str]| folder.run(&[&["render", "cube.obj", "--json"], args].concat()).code(0).json();
    let implicit = report(&["--spp", "1"]);
    let of = |report: &Value, key: &str| report[key].as_u64().unwrap();
    assert_eq!((of(&implicit, "width"), of(&implicit, "spp"), of(&implicit, "seed")), (20, 1, 5));
    assert_eq!(implicit["output"], "c.png");
    let named = report(&["--config", "other.toml"]);
    assert_eq!((of(&named, "width"), of(&named, "seed")), (16, 0), "it replaces the implicit one");
    let none = report(&["--no-config", "--resolution", "12x6"]);
    assert_eq!((of(&none, "width"), of(&none, "spp"), of(&none, "seed")), (12, 1024, 0));
    assert_eq!(none["output"], "cube.png");

    folder.write("firsthit.toml", "camera_position = [1, 2, 3]\n");
    folder.run(&["render", "cube.obj"]).fails(2, &["firsthit.toml", "camera-position", "--no-config"]);
    folder.run(&["render", "cube.obj", "--config", "missing.toml"]).fails(1, &["missing.toml"]);
    folder.run(&["render", "cube.obj", "--config", "."]).fails(1, &["no regular file"]);
    folder.write("long.toml", &"#".repeat((1 << 20) + 1));
    folder.run(&["render", "cube.obj", "--config", "long.toml"]).fails(1, &["long.toml", "1 MiB"]);
    #[cfg(unix)]
    folder.run(&["render", "cube.obj", "--config", "/dev/zero"]).fails(1, &["/dev/zero"]);
}

#[test]
fn inspect_reports_what_is_in_the_file() {
    let folder = Folder::new();
    let report = folder.run(&["inspect", "cube.obj", "--json"]).code(0).json();
    for (key, value) in [
        ("triangles", 12),
        ("triangles_all_scenes", 12),
        ("stored_triangles", 12),
        ("instances", 1),
        ("materials", 1),
        ("textures", 0),
        ("lights", 0),
        ("cameras", 0),
        ("animations", 0),
    ] {
        assert_eq!(report[key], value, "{key}");
    }
    assert_eq!(report["bounds"]["min"], serde_json::json!([-1.0, -1.0, -1.0]));
    assert_eq!(report["bounds"]["max"], serde_json::json!([1.0, 1.0, 1.0]));
    for key in ["extensions", "effects", "warnings"] {
        assert!(report[key].is_array(), "{key}");
    }
    for key in ["sah_cost", "depth", "bytes"] {
        assert!(report["bvh"][key].as_f64().is_some_and(|x| x > 0.0), "{key}: {}", report["bvh"]);
    }
    assert_eq!(report["mesh_list"][0]["closed"], true);
    assert_eq!(report["mesh_list"][0]["degenerate"], 0);

    let text = folder.run(&["inspect", "cube.obj"]).code(0).stdout();
    for word in ["cube.obj", "triangles   12", "closed", "red", "bounds", "SAH cost", "effects", "warnings    0"] {
        assert!(text.contains(word), "no '{word}' in {text}");
    }
}

#[test]
fn an_open_mesh_and_faces_without_area_are_found() {
    let folder = Folder::new();
    folder.write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\n");
    let report = folder.run(&["inspect", "open.obj", "--json"]).code(0).json();
    assert_eq!(report["mesh_list"][0]["closed"], false);
    assert_eq!(report["degenerate_triangles"], 1);
}

#[test]
fn help_lists_every_option_in_groups_with_examples() {
    let folder = Folder::new();
    let help = folder.run(&["render", "--help"]).code(0).stdout();
    for option in [
        "-o, --output",
        "--resolution",
        "-s, --spp",
        "--max-depth",
        "--seed",
        "-t, --threads",
        "--integrator",
        "--effects",
        "--precision",
        "--camera <",
        "--camera-position",
        "--camera-focal-point",
        "--camera-view-up",
        "--camera-view-angle",
        "--camera-azimuth-angle",
        "--camera-elevation-angle",
        "--camera-zoom-factor",
        "--camera-orthographic",
        "--up",
        "--hdri <",
        "--hdri-rotation",
        "--background-color",
        "--no-background",
        "--exposure",
        "--tone-mapping",
        "--aov",
        "--crop",
        "--clip-box",
        "--clip-plane",
        "--config",
        "--no-config",
        "--strict",
        "--explain",
        "--json",
        "--progress",
        "--no-progress",
        "-q, --quiet",
        "-v, --verbose",
        "Image:",
        "Quality:",
        "Camera:",
        "Scene:",
        "Program:",
        "Examples:",
        "Exit codes:",
    ] {
        assert!(help.contains(option), "no '{option}' in the help");
    }
    assert!(folder.run(&["--help"]).code(0).stdout().contains("firsthit render helmet.glb"));
    assert!(folder.run(&["--version"]).code(0).stdout().starts_with("firsthit "));
}

#[test]
fn completions_and_manual_come_from_the_same_definitions() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = folder.run(&["completions", shell]).code(0).stdout();
        assert!(script.contains("camera-focal-point"), "{shell}");
    }
    let manual = folder.run(&["man"]).code(0).stdout();
    assert!(manual.contains(".TH") && manual.contains("render"));
    let page = folder.run(&["man", "render"]).code(0).stdout();
    assert!(page.contains("\\-\\-camera\\-focal\\-point") && page.contains("firsthit"));
    for command in ["inspect", "query", "accuracy", "bench", "completions", "man"] {
        assert!(folder.run(&["man", command]).code(0).stdout().contains(".TH"), "{command}");
    }
}

#[test]
fn a_closed_pipe_is_no_panic() {
    let folder = Folder::new();
    for args in [
        &["inspect", "cube.obj", "--json"][..],
        &["render", "--help"],
        &["completions", "zsh"],
        &["render", "cube.obj", "-q", "-s1", "--resolution=300x300", "-o", "-"],
    ] {
        let mut child = folder.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let run = Run(child.wait_with_output().unwrap());
        assert_eq!(run.stderr(), "");
        run.code(0);
    }
    // Neither is it if nobody hears the messages.
    let mut child = folder.command(&["render", "cube.obj", "-s1", "--resolution=8x8", "-v"]);
    let mut child = child.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[cfg(unix)]
#[test]
fn a_quiet_render_is_interrupted_in_silence() {
    let folder = Folder::new();
    let args = ["render", "cube.obj", "--resolution=64x48", "-s", "1000000", "--quiet", "--progress"];
    let mut child = folder.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.by_ref().any(|line| line.starts_with("rendering: ")));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<String> = lines.filter(|line| !line.starts_with("rendering: ")).collect();
    assert_eq!((child.wait().unwrap().code(), rest), (Some(130), Vec::new()));
    assert_eq!(png_file(&folder.path("cube.png")), (64, 48, 8));
}

#[cfg(unix)]
#[test]
fn an_interrupted_render_writes_the_image_so_far() {
    let folder = Folder::new();
    // Hours of work, but for the interruption.
    let args = ["render", "cube.obj", "--resolution=640x480", "-s", "1000000", "--progress", "--json"];
    let mut child = folder.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let rendering = lines.by_ref().map(Result::unwrap).find(|line| line.starts_with("rendering: "));
    assert!(rendering.is_some_and(|line| line.contains("rays/s") && line.contains("left")));
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    let run = Run(child.wait_with_output().unwrap()).code(130);
    assert!(rest.iter().any(|line| line.contains("interrupted: writing the image so far")), "{rest:?}");
    assert_eq!(run.json()["interrupted"], true);
    assert_eq!(png_file(&folder.path("cube.png")), (640, 480, 8));
}
