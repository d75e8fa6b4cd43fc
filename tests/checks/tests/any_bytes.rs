//! The checks of the fuzz targets on random bytes, and on every input on which one of them ever failed.

use std::{cell::Cell, path::Path};

use firsthit_checks::Check;
use proptest::collection::vec;
use proptest::prelude::any;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Ten thousand inputs of up to `length` bytes, of which at least `least` hit something.
fn hold(check: Check, length: usize, least: u32) {
    let met = Cell::new(0);
    let config = Config { cases: 10_000, failure_persistence: None, ..Config::default() };
    // The same inputs in every run: exploring is for the fuzzer.
    TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha))
        .run(&vec(any::<u8>(), 0..length), |data| {
            met.set(met.get() + u32::from(check(&data)));
            Ok(())
        })
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(met.get() >= least, "{} of 10,000", met.get());
}

#[test]
fn triangles_of_any_numbers() {
    hold(firsthit_checks::triangle, 150, 1000);
}

#[test]
fn shapes_of_any_numbers() {
    hold(firsthit_checks::shapes, 150, 1000);
}

/// S9: ten thousand meshes with NaN, huge, denormal and coincident vertices, and indices out of range.
#[test]
fn meshes_of_any_numbers() {
    hold(firsthit_checks::mesh, 500, 1000);
}

/// `fuzz/regressions/TARGET/` holds what the fuzzer found; it must stay mended.
#[test]
fn what_once_failed_stays_mended() {
    for (name, check) in firsthit_checks::RAYS {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/regressions").join(name);
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        for entry in entries {
            let path = entry.expect("a readable folder").path();
            println!("{}", path.display());
            check(&std::fs::read(&path).expect("a readable file"));
        }
    }
}
