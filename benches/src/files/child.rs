//! A process, and what it took.

use std::io::{self, Read, Seek};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use wait4::Wait4;

/// How a process ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// Its exit code; none if a signal ended it.
    pub exit: Option<i32>,
    /// Whether it was ended because its time was up.
    pub hung: bool,
    /// What it printed.
    pub stdout: String,
    /// What it printed as errors.
    pub stderr: String,
    /// From its start to its end.
    pub seconds: f64,
    /// Of the processor, its own and the system's for it.
    pub processor_seconds: f64,
    /// The most memory that it had at any time (the system's maximum of the resident set).
    pub peak_bytes: u64,
}

/// Runs a command to its end, or for so long.
///
/// # Errors
/// If it cannot be started or waited for.
pub fn run(command: &mut Command, limit: Duration) -> io::Result<Ended> {
    // Files take any amount of text; a pipe that nobody empties would stop the process.
    let (mut stdout, mut stderr) = (tempfile::tempfile()?, tempfile::tempfile()?);
    command.stdin(Stdio::null()).stdout(stdout.try_clone()?).stderr(stderr.try_clone()?);
    let started = Instant::now();
    let mut child = command.spawn()?;
    let pid = Pid::from_child(&child);
    let handle = pidfd_open(pid, PidfdFlags::empty())?;
    let time = Timespec::try_from(limit).map_err(io::Error::other)?;
    // Readable as soon as the process has ended.
    let hung = poll(&mut [PollFd::new(&handle, PollFlags::IN)], Some(&time))? == 0;
    if hung {
        child.kill()?;
    }
    let end = child.wait4()?;
    let seconds = started.elapsed().as_secs_f64();
    Ok(Ended {
        exit: end.status.code(),
        hung,
        stdout: text(&mut stdout)?,
        stderr: text(&mut stderr)?,
        seconds,
        processor_seconds: (end.rusage.utime + end.rusage.stime).as_secs_f64(),
        peak_bytes: end.rusage.maxrss,
    })
}

fn text(file: &mut std::fs::File) -> io::Result<String> {
    let mut bytes = Vec::new();
    file.rewind()?;
    file.read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_has_its_words_and_its_end() {
        let mut command = Command::new("sh");
        let ended = run(command.args(["-c", "echo out; echo err >&2; exit 3"]), Duration::from_secs(20)).unwrap();
        assert_eq!((ended.exit, ended.hung), (Some(3), false));
        assert_eq!((ended.stdout.as_str(), ended.stderr.as_str()), ("out\n", "err\n"));
        // A shell has some hundred kibibytes and far from a gibibyte.
        assert!((1 << 16..1 << 30).contains(&ended.peak_bytes), "{}", ended.peak_bytes);
    }

    #[test]
    fn a_process_that_hangs_is_ended() {
        let ended = run(Command::new("sleep").arg("60"), Duration::from_millis(50)).unwrap();
        assert!(ended.hung && ended.exit.is_none() && ended.seconds < 30.0);
    }
}
