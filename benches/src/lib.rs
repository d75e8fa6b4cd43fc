//! Criterion benches of firsthit: `cargo bench -p firsthit-benches`. They lie in `benches/benches/`; this library is
//! empty, since cargo asks every package for one.
