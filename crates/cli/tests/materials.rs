//! Options about materials as a user meets them.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn run(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firsthit"));
    command.current_dir(folder).args(args).env_clear().stdin(Stdio::null()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

const BALL: &str = "\
env = { type = 'constant', radiance = 1 }
[materials]
rough = { type = 'pbr', base_color = 1, metallic = 1, roughness = 1, clearcoat = 0.5 }
[[objects]]
shape = 'sphere'
center = [0, 0, 0]
radius = 1
material = 'rough'
";

#[test]
fn energy_compensation_is_a_switch() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ball.toml"), BALL).unwrap();
    let render = ["render", "ball.toml", "--resolution", "32x24", "-s", "8", "-o"];
    for (name, switch) in [("on.exr", "on"), ("off.exr", "off")] {
        let output = run(folder.path(), &[&render[..], &[name, "--energy-compensation", switch]].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    let output = run(folder.path(), &["compare", "off.exr", "on.exr", "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["images"][0]["mean_ratio"].as_f64().unwrap() > 1.02, "{report}");

    for wrong in [&["--energy-compensation", "maybe"], &["--texture-filter", "cubic"]] {
        let output = run(folder.path(), &[&render[..], &["x.exr"], &wrong[..]].concat());
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains("expected"), "{}", text(&output.stderr));
    }
}

#[test]
fn layers_are_effects_that_are_explained_and_left_out_by_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ball.toml"), BALL).unwrap();
    let render = ["render", "ball.toml", "--resolution", "16x12", "-s", "1", "-o", "x.png", "--json", "--effects"];
    for (effects, simulated) in [("auto", true), ("auto,-clearcoat", false)] {
        let output = run(folder.path(), &[&render[..], &[effects]].concat());
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        let all = report["effects"].as_array().unwrap();
        let coat = all.iter().find(|e| e["name"] == "clearcoat").unwrap();
        assert_eq!(coat["called_for"], true, "{coat}");
        assert_eq!(coat["simulated"], simulated, "{coat}");
    }
}

#[test]
fn a_variant_that_is_not_there_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ball.toml"), BALL).unwrap();
    let output = run(folder.path(), &["render", "ball.toml", "--variant", "Navy"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("only glTF files have variants"), "{}", text(&output.stderr));
}
