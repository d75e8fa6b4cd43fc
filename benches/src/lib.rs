//! Benches of firsthit, and the peers that it is measured against on the same rays.
//!
//! * `cargo bench -p firsthit-benches`: criterion benches of traversal (`benches/benches/`).
//! * `cargo run --release -p firsthit-benches --bin leaks`: rays lost through closed meshes, firsthit beside its peers.

pub mod peer;
