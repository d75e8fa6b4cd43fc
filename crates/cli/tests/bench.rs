//! `firsthit bench` as a user meets it.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use firsthit_accel::{Layout, Level};
use serde_json::Value;

/// An octahedron: closed, and quick.
const MODEL: &str = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n\
f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

fn folder_with_model() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("octa.obj"), MODEL).unwrap();
    folder
}

fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firsthit"));
    command.current_dir(folder).args(args).env_clear().stdin(Stdio::null());
    command
}

fn bench(folder: &Path, args: &[&str]) -> Output {
    command(folder, &[&["bench", "--quick", "--count", "2000"], args].concat()).output().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn a_model_is_measured_and_told_of_as_json_and_as_a_page() {
    let folder = folder_with_model();
    let output = bench(folder.path(), &["octa.obj", "--json", "--html", "page.html", "--seed", "7"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&json["seed"], &json["threads"]), (&7.into(), &1.into()));
    assert_eq!((&json["models"][0]["name"], &json["models"][0]["triangles"]), (&"octa.obj".into(), &8.into()));
    let engines = 2 * Layout::ALL.len() + 2;
    let builds = json["builds"].as_array().unwrap();
    assert_eq!(builds.len(), engines);
    for row in builds {
        assert!(row["seconds"].as_f64().unwrap() > 0.0 && row["bytes_per_triangle"].as_f64().unwrap() > 10.0, "{row}");
        assert_eq!(row["sah_cost"].is_null(), row["engine"].as_str().unwrap().starts_with("obvhs"));
    }
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), engines * 5);
    for row in rows {
        let number = |field: &str| row[field].as_f64().unwrap();
        assert!(number("mrays_per_s_best") >= number("mrays_per_s_median") && number("mrays_per_s_median") > 0.0);
        assert!(number("count") == 2000.0 && number("repetitions") >= 5.0, "{row}");
    }
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.starts_with("<!") && page.contains("octa.obj") && page.contains("robust wide8"));
    let files = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(files, 2, "nothing else is left behind");
}

#[test]
fn only_what_is_asked_for_is_printed() {
    let folder = folder_with_model();
    let args = ["octa.obj", "--rays", "ao,random", "--precision", "exact", "--layout", "bvh2", "--build", "fast,high"];
    let table = stdout(&bench(folder.path(), &[&args[..], &["--no-peers", "-t", "2"]].concat()));
    for words in ["octa.obj: 8 triangles", "SAH cost", "exact bvh2 fast", "exact bvh2 high", "random", "threads: 2"] {
        assert!(table.contains(words), "no '{words}' in {table}");
    }
    assert!(!table.contains("obvhs bvh2") && !table.contains("primary") && !table.contains("wide8"), "{table}");
}

#[test]
fn the_level_of_instructions_is_forced_from_outside() {
    let folder = folder_with_model();
    let bench = ["bench", "octa.obj", "--quick", "--count", "500", "--no-peers", "--rays", "ao"];
    let run = |args: &[&str], level: &str| command(folder.path(), args).env("FIRSTHIT_SIMD", level).output().unwrap();
    let table = stdout(&run(&bench, "scalar"));
    assert!(table.contains("robust wide8"), "{table}");
    if Level::default().is_available() {
        assert!(table.contains("robust wide8 scalar"), "not the usual level: it is named: {table}");
    }
    let render = ["render", "octa.obj", "-s1", "--resolution=8x8", "-o", "octa.png"];
    let renders = ["bench", "--render", "octa.obj", "--spp", "1", "--resolution=8x8"];
    for args in [&bench[..], &render, &renders, &["inspect", "octa.obj"], &["accuracy", "octa.obj", "--quick"]] {
        let output = run(args, "mmx");
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(stderr(&output).contains("FIRSTHIT_SIMD: unknown SIMD level 'mmx'"), "{}", stderr(&output));
        assert!(output.stdout.is_empty());
    }
    assert_eq!(run(&render, "scalar").status.code(), Some(0));
}

#[test]
fn what_cannot_be_measured_or_written_is_refused_in_time() {
    let folder = folder_with_model();
    std::fs::write(folder.path().join("none.obj"), "v 0 0 0\n").unwrap();
    std::fs::write(folder.path().join("bad.obj"), "v 0 0\nf 1 2 3\n").unwrap();
    for (args, code, words) in [
        (&["none.obj"][..], 1, "none.obj"),
        (&["bad.obj"], 1, "bad.obj"),
        (&["missing.obj"], 1, "missing.obj"),
        (&["octa.obj", "--html", "no/such/page.html"], 1, "no folder no/such"),
        (&["octa.obj", "--html", "octa.obj"], 1, "one of the models"),
        (&["octa.obj", "--rays", "x"], 2, "unknown rays 'x'"),
        (&["octa.obj", "--layout", "x"], 2, "unknown layout 'x'"),
        (&["octa.obj", "--build", "x"], 2, "unknown build 'x'"),
        (&["octa.obj", "--simd", "x"], 2, "unknown SIMD level 'x'"),
        (&[], 2, "required"),
    ] {
        let output = bench(folder.path(), args);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(words), "{args:?}: {}", stderr(&output));
        assert!(output.stdout.is_empty());
    }
}

/// A folder with a scene and its picture is compared; a model tells of time alone.
#[test]
fn scenes_are_rendered_and_compared_with_their_references() {
    let folder = folder_with_model();
    let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/references/furnace_diffuse");
    let args = ["bench", "--render", reference.to_str().unwrap(), "octa.obj", "--resolution", "32x18", "--spp", "1,4"];
    let output = command(folder.path(), &[&args[..], &["-t", "2", "--json"]].concat()).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 4);
    for (i, row) in rows.iter().enumerate() {
        assert_eq!(
            (&row["scene"], &row["spp"]),
            (&["furnace_diffuse", "octa.obj"][i / 2].into(), &[1, 4][i % 2].into())
        );
        assert_eq!(row["threads"], 2);
        assert!(row["seconds"].as_f64().unwrap() > 0.0 && row["mrays_per_s"].as_f64().unwrap() > 0.0);
        for field in ["mse", "trimmed_rel_mse", "mean_ratio", "efficiency", "cost"] {
            assert_eq!(row[field].is_null(), i >= 2, "{field} of {row}");
        }
    }
    // In a white furnace the picture is right at once.
    assert!((rows[0]["mean_ratio"].as_f64().unwrap() - 1.0).abs() < 1e-4);
    let (fewer, more) = (rows[2]["rays"].as_u64().unwrap(), rows[3]["rays"].as_u64().unwrap());
    assert!(fewer >= 32 * 18 && more > 3 * fewer);
    for parts in json["parts"].as_array().unwrap() {
        let share = |part: &str| parts[part].as_f64().unwrap();
        let sum: f64 = ["traversal", "shading", "texturing", "sampling"].into_iter().map(share).sum();
        assert!(sum > 0.99 && sum < 1.0 + 1e-9 && share("traversal") > 0.0, "{parts}");
    }
    let table = stdout(&command(folder.path(), &["bench", "--render", "octa.obj", "--spp=1", "-t1"]).output().unwrap());
    for words in ["1/(s x MSE)", "time: traversal", "octa.obj: there is no reference", "seed 0"] {
        assert!(table.contains(words), "no '{words}' in {table}");
    }
    let refused = command(folder.path(), &["bench", "octa.obj", "--spp", "4"]).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "samples are of renders");
}

/// The first Ctrl-C ends the measurement, and what there is so far is printed whole.
#[cfg(unix)]
#[test]
fn an_interrupted_measurement_ends_clean() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = command(folder.path(), &["bench", "--builtin", "--json", "--progress", "--count", "200000"]);
    let mut bench = bench.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // The first progress says that it is at work.
    let mut line = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(bench.stderr.as_mut().unwrap()), &mut line).unwrap();
    assert!(line.contains("measuring"), "{line}");
    let kill = Command::new("kill").args(["-INT", &bench.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let output = bench.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["notes"].to_string().contains("interrupted"));
}

#[cfg(unix)]
#[test]
fn an_interrupted_render_ends_clean() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = command(folder.path(), &["bench", "--render", "--json", "--progress", "--spp", "65536"]);
    let mut bench = bench.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(bench.stderr.as_mut().unwrap()), &mut line).unwrap();
    assert!(line.contains("rendering"), "{line}");
    let kill = Command::new("kill").args(["-INT", &bench.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let output = bench.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["rows"].as_array().unwrap().is_empty() && json["notes"].to_string().contains("interrupted"));
}
