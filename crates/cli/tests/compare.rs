//! `firsthit compare` as a user meets it.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn run(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firsthit"));
    command.current_dir(folder).args(args).env_clear().stdin(Stdio::null()).output().unwrap()
}

/// A NumPy array of one colour.
fn write_npy(path: &Path, width: usize, height: usize, color: [f32; 3]) {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}, 3), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for _ in 0..width * height {
        color.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn formats_compare_with_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("ball.toml"), "[[objects]]\nshape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\n").unwrap();
    for name in ["a.exr", "a.hdr"] {
        let output = run(folder.path(), &["render", "ball.toml", "--resolution", "48x32", "-s", "4", "-o", name]);
        assert!(output.status.success());
    }
    let output = run(folder.path(), &["compare", "a.exr", "a.exr", "a.hdr", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["width"], &report["height"]), (&48.into(), &32.into()));
    let [same, hdr] = &report["images"].as_array().unwrap()[..] else { panic!("{report}") };
    assert_eq!((&same["mse"], &same["psnr"]), (&0.0.into(), &Value::Null));
    // Eight bits of mantissa, shared.
    let rel = hdr["rel_mse"].as_f64().unwrap();
    assert!(rel > 0.0 && rel < 1e-4, "{rel}");
    assert!((hdr["mean_ratio"].as_f64().unwrap() - 1.0).abs() < 0.01);
    assert_eq!(hdr["image"], "a.hdr");
}

#[test]
fn numpy_arrays_and_a_heatmap() {
    let folder = tempfile::tempdir().unwrap();
    write_npy(&folder.path().join("a.npy"), 16, 8, [0.0, 1.0, 0.0]);
    write_npy(&folder.path().join("b.npy"), 16, 8, [0.0, 0.0, 1.0]);
    let output = run(folder.path(), &["compare", "a.npy", "b.npy", "--heatmap", "heat.png"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("1.00000") && text.contains("b.npy"), "{text}");
    assert!(std::fs::read(folder.path().join("heat.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn what_cannot_be_compared_is_said() {
    let folder = tempfile::tempdir().unwrap();
    write_npy(&folder.path().join("a.npy"), 16, 8, [1.0; 3]);
    write_npy(&folder.path().join("b.npy"), 8, 8, [1.0; 3]);
    for (args, code, words) in [
        (&["compare", "a.npy", "b.npy"][..], 1, "16 x 8"),
        (&["compare", "a.npy", "none.exr"], 1, "none.exr"),
        (&["compare", "a.npy"], 2, "IMAGE"),
        (&["compare", "a.npy", "a.npy", "a.npy", "--heatmap", "h.png"], 2, "--heatmap"),
        (&["compare", "a.npy", "a.npy", "--heatmap", "h.exr"], 2, ".png"),
    ] {
        let output = run(folder.path(), args);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{text}");
        assert!(text.contains(words), "{text}");
    }
}
