//! Benches of firsthit, and the peers that it is measured against on the same rays.
//!
//! * `cargo bench -p firsthit-benches`: criterion benches of kernels, queries, builds and traversal (`benches/benches/`).
//! * `cargo run --release -p firsthit-benches --bin peers`: speed, memory, build time and wrong answers, firsthit beside
//!   its peers.
//! * `cargo run --release -p firsthit-benches --bin growth`: time of a ray as one mesh grows from 1,000 triangles to 10 M.
//! * `cargo run --release -p firsthit-benches --bin effects`: what it buys that scenes are rendered by kernels without the
//!   effects that they do not call for.
//! * `cargo run --release -p firsthit-benches --bin files`: what comes of every model file of a folder (Linux only).
//! * `cargo run --release -p firsthit-benches --bin leaks`: rays lost through closed meshes, firsthit beside its peers.
//! * `cargo run --release -p firsthit-benches --bin points`: closest points, signed distances, inside and outside beside peers,
//!   and what one query a call costs.
//! * `cargo run --release -p firsthit-benches --bin brute`: every answer of firsthit against all triangles, decided exactly.

pub mod brute;
pub mod effects;
pub mod engine;
#[cfg(target_os = "linux")]
pub mod files;
pub mod generated;
pub mod growth;
pub mod judge;
pub mod memory;
pub mod model;
pub mod peer;
pub mod points;
pub mod race;
pub mod random;
pub mod rays;
pub mod record;
pub mod reference;
pub mod small;
pub mod summary;
