//! S5 to S9: inputs that break builders, as the scenarios have them.

use crate::holds;

/// S6, with 100 000 triangles each.
#[test]
fn coincident_and_concentric_triangles_build_fast() {
    holds("S6", 100_000);
}

/// S7.
#[test]
fn deep_trees_do_not_overflow() {
    holds("S7", 100_000);
}

/// S8.
#[test]
fn few_flat_and_degenerate_triangles() {
    holds("S8", 2_000);
}

/// S9 and S10.
#[test]
fn bad_numbers_and_indices_are_named() {
    holds("S9", 500);
    holds("S10", 1);
}

/// S5: strips of needles cover a plane without gaps.
#[test]
fn needles_leave_no_gaps() {
    holds("S5", 80_000);
}
