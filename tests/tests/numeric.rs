//! The hard cases at every tier: exact expected answers, by each primitive's own test and through a scene.

use firsthit_geometry::Precision;
use firsthit_tests::corpus::{self, Case, Engine};

fn cases() -> Vec<Case> {
    corpus::read(&corpus::folder()).expect("the hard cases can be read")
}

/// Prints the table and fails on what the tier must have right.
fn check(name: &str, engine: Engine) {
    let cases = cases();
    let mut failures = Vec::new();
    println!("{name}:");
    for precision in Precision::ALL {
        let summary = corpus::run(&cases, precision, engine);
        print!("{summary}");
        failures.extend(summary.failures);
    }
    assert!(failures.is_empty(), "{} required answers are wrong:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn primitives_pass_the_hard_cases() {
    check("primitive tests", corpus::primitives);
}

#[test]
fn box_tests_of_the_trees_pass_the_hard_cases() {
    check("slab tests", corpus::slab);
}

#[test]
fn scenes_pass_the_hard_cases() {
    check("scenes", corpus::scene);
}

/// The suite has teeth: cutting corners, as the fast tier does, shows.
#[test]
fn the_fast_tier_is_caught_leaking() {
    let watertight: Vec<Case> = cases().into_iter().filter(|c| c.group == "watertight").collect();
    let fast = corpus::run(&watertight, Precision::Fast, corpus::primitives);
    assert!(watertight.is_empty() || !fast.excused.is_empty(), "no case shows the leaks of the shortest formula");
}
