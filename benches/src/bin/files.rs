//! What firsthit makes of every model file of a folder, as a table; and a picture of each.
//!
//! `cargo run --release -p firsthit-benches --bin files -- FOLDER [--render DIR] [--markdown FILE] [--json FILE]`

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    firsthit_benches::files::run::main()
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("error: other processes are watched by means of Linux only");
    std::process::exit(2);
}
