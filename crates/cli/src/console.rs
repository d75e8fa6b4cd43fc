//! Standard error for messages, standard output for results. A closed pipe is never a panic.

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use firsthit_import::Report;

use crate::error::Failure;

/// How much is said on standard error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Console {
    /// Errors only.
    Quiet,
    /// The first warnings and one line at the end.
    Normal,
    /// Every warning and every step.
    Verbose,
}

/// Warnings shown unless `--verbose` asks for all.
const FIRST_WARNINGS: usize = 5;

impl Console {
    pub(crate) fn new(quiet: bool, verbose: bool) -> Self {
        match (quiet, verbose) {
            (true, _) => Self::Quiet,
            (_, true) => Self::Verbose,
            _ => Self::Normal,
        }
    }

    /// A line that everyone but `--quiet` wants.
    pub(crate) fn say(self, line: impl Display) {
        if self >= Self::Normal {
            message(line);
        }
    }

    /// A line for `--verbose`.
    pub(crate) fn detail(self, line: impl Display) {
        if self >= Self::Verbose {
            message(line);
        }
    }

    /// What a reader could honour only in part; an error if `strict`.
    pub(crate) fn warnings(self, report: &Report, strict: bool) -> Result<(), Failure> {
        let all = report.warnings.len() as u64 + report.more_warnings;
        let word = if strict { "error" } else { "warning" };
        let shown = if self >= Self::Verbose { report.warnings.len() } else { FIRST_WARNINGS };
        // The reason why nothing is rendered is said even when quiet.
        if strict || self >= Self::Normal {
            for warning in report.warnings.iter().take(shown) {
                message(format_args!("{word}: {warning}"));
            }
            let left = all - report.warnings.len().min(shown) as u64;
            if left > 0 {
                let how = if report.warnings.len() > shown { " (--verbose shows them)" } else { "" };
                message(format_args!("{word}: and {left} more{how}"));
            }
        }
        if strict && all > 0 {
            let s = if all == 1 { "" } else { "s" };
            return Err(Failure::failed(format_args!("{all} warning{s}, taken as errors by --strict")));
        }
        Ok(())
    }

    /// Samples that were no light; an error if `strict`.
    pub(crate) fn bad_samples(self, count: u64, strict: bool) -> Result<(), Failure> {
        let text = format!("{} samples were not finite and count as black", grouped(count));
        match (count, strict) {
            (0, _) => {}
            (_, true) => return Err(Failure::failed(format_args!("{text}, taken as an error by --strict"))),
            (_, false) => self.say(format_args!("warning: {text}")),
        }
        Ok(())
    }
}

/// Writes a message to standard error, if anyone listens. It may quote from files: see [`visible`].
pub(crate) fn message(text: impl Display) {
    let mut out = io::stderr().lock();
    for line in text.to_string().lines() {
        let _ = writeln!(out, "{}", visible(line));
    }
}

/// Text from a file with its control characters escaped, so that it is shown by a terminal and not obeyed.
pub(crate) fn visible(text: &str) -> Cow<'_, str> {
    if !text.contains(char::is_control) {
        return text.into();
    }
    let escaped = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.into() };
    text.chars().map(escaped).collect()
}

/// Writes to standard output. A reader that has seen enough (`| head`) is no error.
pub(crate) fn print(text: &[u8]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Failure::failed(format_args!("standard output: {e}"))),
        _ => Ok(()),
    }
}

/// Writes a value as JSON to standard output.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| Failure::failed(format_args!("JSON: {e}")))?;
    text.push(b'\n');
    print(&text)
}

/// 1234567 as `1 234 567`.
pub(crate) fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(d);
    }
    out
}

/// `1 shape`, `2 shapes`.
pub(crate) fn count(n: u64, noun: &str) -> String {
    format!("{} {noun}{}", grouped(n), if n == 1 { "" } else { "s" })
}

/// 1234567 as `1.23M`: for speeds and large counts.
pub(crate) fn short(n: f64) -> String {
    match n {
        n if n >= 1e9 => format!("{:.2}G", n / 1e9),
        n if n >= 1e6 => format!("{:.2}M", n / 1e6),
        n if n >= 1e4 => format!("{:.1}k", n / 1e3),
        n => format!("{n:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_readable() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1 000", "1 234 567"]);
        assert_eq!([1, 2000].map(|n| count(n, "shape")), ["1 shape", "2 000 shapes"]);
        assert_eq!([0.0, 9999.0, 12_345.0, 1.5e6, 2e9].map(short), ["0", "9999", "12.3k", "1.50M", "2.00G"]);
    }

    #[test]
    fn control_characters_are_shown_not_sent() {
        assert_eq!(
            visible("\x1b]0;owned\x07 \u{9b}2J caf\u{e9} \r\n"),
            "\\u{1b}]0;owned\\u{7} \\u{9b}2J caf\u{e9} \\r\\n"
        );
        assert!(matches!(visible("plain \u{1f600}"), Cow::Borrowed(_)));
    }

    #[test]
    fn strict_takes_bad_samples_as_an_error() {
        assert!(Console::Quiet.bad_samples(0, true).is_ok());
        assert!(Console::Quiet.bad_samples(7, false).is_ok());
        let error = Console::Quiet.bad_samples(7, true).unwrap_err();
        assert_eq!(error.exit, crate::error::Exit::Failed);
        assert!(error.to_string().contains("7 samples"), "{error}");
    }

    #[test]
    fn strict_takes_warnings_as_errors() {
        let mut report = Report::default();
        assert!(Console::Quiet.warnings(&report, true).is_ok());
        report.warn("a.obj", "line 1", "something");
        assert!(Console::Quiet.warnings(&report, false).is_ok());
        assert!(Console::Quiet.warnings(&report, true).is_err());
    }
}
