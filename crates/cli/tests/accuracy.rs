//! `firsthit accuracy` as a user meets it.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// The hard cases that come with the tests.
const CORPUS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/corpus");

fn accuracy(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_firsthit"))
        .current_dir(folder)
        .arg("accuracy")
        .args(args)
        .env_clear()
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[track_caller]
fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", stderr(output)))
}

#[test]
fn the_hard_cases_pass_and_are_listed_by_group_category_and_tier() {
    let folder = tempfile::tempdir().unwrap();
    let output = accuracy(folder.path(), &["--corpus", CORPUS, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let json = json(&output);
    let rows = json["corpus"].as_array().unwrap();
    let of = |group: &str, tier: &str, field: &str| -> u64 {
        let rows = rows.iter().filter(|r| r["group"] == group && r["tier"] == tier);
        rows.map(|r| r[field].as_u64().unwrap()).sum()
    };
    for tier in firsthit_geometry::Precision::ALL.map(|p| p.name()) {
        assert_eq!((of("watertight", tier, "cases"), of("watertight", tier, "failed")), (263, 0), "{tier}");
        assert_eq!(of("invalid", tier, "required"), of("invalid", tier, "passed"), "{tier}");
    }
    assert!(of("watertight", "fast", "passed") < 263, "the fast tier leaks, and the table says so");
    assert_eq!(rows[0]["failed_ids"], serde_json::json!([]));

    let table = stdout(&accuracy(folder.path(), &["--corpus", CORPUS, "--precision", "robust"]));
    assert!(table.contains("watertight") && table.contains("robust") && !table.contains("fast"), "{table}");
}

#[test]
fn a_wrong_answer_fails_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let cases = std::fs::read_to_string(Path::new(CORPUS).join("watertight.jsonl")).unwrap();
    // A hit called a miss: now every tier but the fast one, of which nothing is required, is "wrong".
    let case = cases.lines().find(|l| l.contains(r#""level":"f32""#) && l.contains(r#""result":"hit""#)).unwrap();
    let id = serde_json::from_str::<Value>(case).unwrap()["id"].as_str().unwrap().to_owned();
    std::fs::write(folder.path().join("a.jsonl"), case.replace(r#""result":"hit""#, r#""result":"miss""#)).unwrap();
    let output = accuracy(folder.path(), &["--corpus", ".", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains(&format!("failed: {id} at robust")), "{}", stderr(&output));
    let json = json(&output);
    let row = json["corpus"].as_array().unwrap().iter().find(|r| r["tier"] == "robust").unwrap();
    assert_eq!((&row["failed"], &row["failed_ids"][0]), (&1.into(), &id.into()));
}

#[test]
fn a_folder_that_is_no_corpus_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    let fails = |words: &[&str]| {
        let output = accuracy(folder.path(), &["--corpus", "cases", "--json"]);
        assert_eq!(output.status.code(), Some(1));
        assert!(output.stdout.is_empty());
        let text = stderr(&output);
        assert!(words.iter().all(|w| text.contains(w)) && text.contains("error: "), "{text}");
    };
    fails(&["cases"]);
    std::fs::create_dir(folder.path().join("cases")).unwrap();
    fails(&["no .jsonl file"]);
    std::fs::write(folder.path().join("cases/a.jsonl"), "\n{\"id\": \"x/1\", \"group\": 3}\n").unwrap();
    fails(&["a.jsonl, line 2 (case x/1)", "group"]);
    assert_eq!(accuracy(folder.path(), &[]).status.code(), Some(2));
    assert_eq!(accuracy(folder.path(), &["--corpus", ".", "--precision", "best"]).status.code(), Some(2));
}

/// A tetrahedron: closed, and quick.
const MODEL: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

fn folder_with_model() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("tetra.obj"), MODEL).unwrap();
    folder
}

#[test]
fn a_model_is_measured_at_every_tier() {
    let folder = folder_with_model();
    let args = ["tetra.obj", "--quick", "--json", "--html", "page.html", "--svg", "charts.svg", "--seed", "7"];
    let output = accuracy(folder.path(), &args);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let json = json(&output);
    assert_eq!((&json["seed"], &json["effort"]), (&7.into(), &"quick".into()));
    assert_eq!(json["models"][0]["closed"], true);
    let rows = json["tiers"].as_array().unwrap();
    let tiers = firsthit_geometry::Precision::ALL;
    assert_eq!(rows.len(), tiers.len() * 4);
    for row in rows {
        assert_eq!(row["guard"], "");
        assert!(row["ns_per_ray"].as_f64().unwrap() > 0.0 && row["ratio_to_fast"].as_f64().unwrap() > 0.0);
        if row["tier"] != "fast" && row["rays"] == "aimed" {
            assert_eq!((&row["leaks"], &row["aimed_rays"]), (&0.into(), &30_000.into()), "{row}");
        }
    }
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.starts_with("<!") && page.contains("tetra.obj") && page.contains("<svg"));
    let charts: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(charts.iter().any(|n| n.to_string_lossy().starts_with("charts") && n.to_string_lossy().ends_with(".svg")));
}

#[test]
fn a_measurement_is_printed_as_a_table_or_csv() {
    let folder = folder_with_model();
    let quick = ["tetra.obj", "--quick", "--rays", "aimed,shadow", "--precision", "fast,robust"];
    let table = stdout(&accuracy(folder.path(), &quick));
    for words in ["tetra.obj: 4 triangles, closed", "ns/ray", "x fast", "robust", "< 1.0e-4", "Use ", "sphere"] {
        assert!(table.contains(words), "no '{words}' in {table}");
    }
    assert!(!table.contains("double") && !table.contains("primary"), "{table}");

    let csv = stdout(&accuracy(folder.path(), &[&quick[..], &["--csv"]].concat()));
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 1 + 2 * 2, "{csv}");
    assert!(lines[0].contains("ns_per_ray") && lines[0].contains("false_misses_by_level_exact"), "{csv}");
    assert!(lines.iter().all(|l| l.matches(',').count() == lines[0].matches(',').count()), "{csv}");
}

#[test]
fn what_cannot_be_measured_or_written_is_refused_in_time() {
    let folder = folder_with_model();
    std::fs::write(folder.path().join("none.obj"), "v 0 0 0\n").unwrap();
    for (args, code, words) in [
        (&["none.obj"][..], 1, "none.obj"),
        (&["missing.obj"], 1, "missing.obj"),
        (&["tetra.obj", "--html", "no/such/page.html"], 1, "no folder no/such"),
        (&["tetra.obj", "--svg", "tetra.obj"], 1, "one of the models"),
        (&["tetra.obj", "--rays", "x"], 2, "unknown rays 'x'"),
        (&["tetra.obj", "--corpus", "."], 2, "cannot be used with"),
        (&["tetra.obj", "--csv", "--json"], 2, "cannot be used with"),
    ] {
        let output = accuracy(folder.path(), args);
        assert_eq!(output.status.code(), Some(code), "{args:?}");
        assert!(stderr(&output).contains(words), "{args:?}: {}", stderr(&output));
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn scenarios_say_what_held_and_how_to_repeat_it() {
    let folder = folder_with_model();
    let run = |args: &[&str]| accuracy(folder.path(), &[&["--scenarios", "--quick"], args].concat());
    let output = run(&["--only", "S1,s10", "--count", "2e5", "--json", "--seed", "5"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report = json(&output);
    let s1 = &report["scenarios"][0];
    assert_eq!((&s1["id"], &s1["failures"], &s1["seed"]), (&"S1".into(), &0.into(), &5.into()));
    assert!(s1["count"].as_u64().unwrap() > 190_000, "{s1}");
    assert_eq!(report["scenarios"][1]["id"], "S10");

    let text = stdout(&run(&["--only", "S1", "--count", "300000", "--from", "262144", "tetra.obj"]));
    assert!(text.contains("passed") && text.contains("tetra.obj, fast"), "{text}");

    std::fs::write(folder.path().join("open.obj"), MODEL.replace("f 2 3 4\n", "")).unwrap();
    let open = run(&["open.obj"]);
    assert_eq!(open.status.code(), Some(1));
    assert!(stderr(&open).contains("not closed"), "{}", stderr(&open));
    assert_eq!(run(&["--only", "S99"]).status.code(), Some(2));
    assert_eq!(accuracy(folder.path(), &["--builtin", "--count", "5"]).status.code(), Some(2));
}
