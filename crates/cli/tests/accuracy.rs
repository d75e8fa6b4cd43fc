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
