//! What the tests share: the hard cases, and where public data is found.

pub mod corpus;

pub mod oracle;

use std::path::{Path, PathBuf};

/// The folder of public models and references, which a clone does not hold.
///
/// It is named by the environment variable `FIRSTHIT_SHARED`, or else lies beside the workspace as `shared`. Where there
/// is none, says so and returns `None`, and the test that asked is skipped.
///
/// # Panics
/// If there is none though `FIRSTHIT_REQUIRE_SHARED` is 1, so that no test is skipped unseen.
#[must_use]
pub fn shared() -> Option<PathBuf> {
    // Worktrees lie one level deeper than the workspace.
    let up = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().skip(2);
    let folder = std::env::var_os("FIRSTHIT_SHARED")
        .map(PathBuf::from)
        .or_else(|| up.take(3).map(|p| p.join("shared")).find(|p| p.is_dir()));
    if let Some(folder) = folder.filter(|f| f.is_dir()) {
        return Some(folder);
    }
    assert!(std::env::var_os("FIRSTHIT_REQUIRE_SHARED").is_none_or(|v| v != "1"), "no folder of public data");
    eprintln!("skipped: no folder of public data (FIRSTHIT_SHARED names it)");
    None
}
