//! How far a render or a measurement is: a bar on a terminal, a line now and then elsewhere.

use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use firsthit_render::output::write_checkpoint;
use firsthit_render::{Monitor, Sums};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::console::{message, short};
use crate::interrupt::Interrupt;

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    /// Not at all.
    Hidden,
    /// A bar with the time left.
    Bar,
    /// A line, not more often than this.
    Lines(Duration),
}

impl Style {
    /// What the options ask for. Without any: a bar on a terminal, sparse lines elsewhere.
    pub(crate) fn new(wanted: bool, unwanted: bool, quiet: bool) -> Self {
        match (wanted, unwanted || quiet) {
            (false, true) => Self::Hidden,
            _ if io::stderr().is_terminal() => Self::Bar,
            (true, _) => Self::Lines(Duration::from_secs(1)),
            _ => Self::Lines(Duration::from_secs(15)),
        }
    }
}

/// Watches a render or a measurement for the user.
pub(crate) struct Progress {
    style: Style,
    /// What is being done.
    label: &'static str,
    started: Instant,
    last: Mutex<Instant>,
    bar: ProgressBar,
    interrupt: Interrupt,
    keep: Option<Keep>,
}

/// A file in which sums are kept now and then.
pub(crate) struct Keep {
    pub(crate) path: PathBuf,
    /// Words that say which picture it is.
    pub(crate) picture: String,
    last: Mutex<Instant>,
}

/// So often. What rows take that are begun, and writing the file, comes on top: together less than a minute.
const KEEP: Duration = Duration::from_secs(45);

impl Keep {
    pub(crate) fn new(path: PathBuf, picture: String) -> Self {
        Self { path, picture, last: Mutex::new(Instant::now()) }
    }
}

/// A bar is not redrawn more often than this.
const REDRAW: Duration = Duration::from_millis(100);

impl Progress {
    pub(crate) fn new(style: Style, label: &'static str, interrupt: Interrupt) -> Self {
        Self::keeping(style, label, interrupt, None)
    }

    /// With a file in which sums are kept.
    pub(crate) fn keeping(style: Style, label: &'static str, interrupt: Interrupt, keep: Option<Keep>) -> Self {
        let bar = match style {
            Style::Bar => ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr()),
            _ => ProgressBar::hidden(),
        };
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3}%  {msg}") {
            bar.set_style(style);
        }
        let now = Instant::now();
        Self { style, label, started: now, last: Mutex::new(now), bar, interrupt, keep }
    }

    /// Takes the bar away: only the results stay.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Monitor for Progress {
    fn progress(&self, done: u64, total: u64, rays: u64) {
        let pause = match self.style {
            Style::Hidden => return,
            Style::Bar => REDRAW,
            Style::Lines(pause) => pause,
        };
        // A thread that finds another one here has nothing newer to tell.
        let Ok(mut last) = self.last.try_lock() else { return };
        if last.elapsed() < pause {
            return;
        }
        *last = Instant::now();
        let text = describe(done, total, rays, self.started.elapsed());
        if self.style == Style::Bar {
            self.bar.set_length(total);
            self.bar.set_position(done);
            self.bar.set_message(text);
        } else {
            let percent = 100.0 * done as f64 / total.max(1) as f64;
            message(format_args!("{}: {percent:.0}%, {text}", self.label));
        }
    }

    fn wants_checkpoint(&self) -> bool {
        self.keep.as_ref().is_some_and(|keep| keep.last.lock().is_ok_and(|last| last.elapsed() >= KEEP))
    }

    fn checkpoint(&self, sums: &Sums<'_>) {
        let Some(keep) = &self.keep else { return };
        if let Err(error) = write_checkpoint(&keep.path, sums, &keep.picture) {
            // The render is worth more: at its end the error is told again.
            message(format_args!("warning: {error}"));
        }
        if let Ok(mut last) = keep.last.lock() {
            *last = Instant::now();
        }
    }

    fn cancelled(&self) -> bool {
        self.interrupt.requested()
    }
}

/// Speed and time left.
fn describe(done: u64, total: u64, rays: u64, elapsed: Duration) -> String {
    let seconds = elapsed.as_secs_f64();
    let speed = if seconds > 0.0 { rays as f64 / seconds } else { 0.0 };
    let left = if done > 0 { seconds * total.saturating_sub(done) as f64 / done as f64 } else { 0.0 };
    format!("{} rays/s, {} left", short(speed), duration(left))
}

/// Seconds as a person says them.
pub(crate) fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_from_the_part_done() {
        let text = describe(25, 100, 5_000_000, Duration::from_secs(5));
        assert_eq!(text, "1.00M rays/s, 15 s left");
        assert_eq!(describe(0, 0, 0, Duration::ZERO), "0 rays/s, 0 s left");
    }

    #[test]
    fn durations_are_readable() {
        assert_eq!([0.4, 59.4, 61.0, 3660.0].map(duration), ["0 s", "59 s", "1 min 01 s", "1 h 01 min"]);
    }

    #[test]
    fn options_choose_the_style() {
        assert_eq!(Style::new(false, true, false), Style::Hidden);
        assert_eq!(Style::new(false, false, true), Style::Hidden);
        assert_ne!(Style::new(true, false, true), Style::Hidden);
    }
}
