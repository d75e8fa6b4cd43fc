//! `FIRSTHIT_SIMD`: which instructions queries use, forced from outside to compare them.

use firsthit_accel::Level;

use crate::error::Failure;

/// The variable's name.
const VARIABLE: &str = "FIRSTHIT_SIMD";

/// The level that the environment asks for, if it asks.
pub(crate) fn forced() -> Result<Option<Level>, Failure> {
    let Some(word) = std::env::var_os(VARIABLE) else { return Ok(None) };
    let level: Level = word.to_string_lossy().parse().map_err(|e| Failure::usage(format_args!("{VARIABLE}: {e}")))?;
    available(level).map_err(|e| Failure::usage(format_args!("{VARIABLE}: {e}"))).map(Some)
}

/// What scenes are built with.
pub(crate) fn level() -> Result<Level, Failure> {
    Ok(forced()?.unwrap_or_default())
}

/// A level that this processor has.
pub(crate) fn available(level: Level) -> Result<Level, String> {
    if level.is_available() { Ok(level) } else { Err(format!("this processor has no {level}")) }
}
