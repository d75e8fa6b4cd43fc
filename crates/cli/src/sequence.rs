//! `firsthit render --frames`: an animation as pictures, one after the other.

use std::path::{Path, PathBuf};

use crate::args::RenderArgs;
use crate::error::{Exit, Failure};
use crate::render::Job;
use crate::target::Target;

/// The frames that are rendered, and their files.
#[derive(Debug)]
pub(crate) struct Sequence {
    frames: (u32, u32),
    /// The name of a file before its number, how many digits that has at least, and the name after it.
    name: (String, usize, String),
}

impl Sequence {
    /// What `--frames` asks for, if it is there.
    pub(crate) fn new(args: &RenderArgs) -> Result<Option<Self>, Failure> {
        let Some(frames) = args.animation.frames else { return Ok(None) };
        let Some(output) = &args.output.output else {
            let Target::File(path, _) = Target::new(None, &args.model)? else { return Ok(None) };
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            return Ok(Some(Self { frames, name: (stem + "_", 4, ".png".into()) }));
        };
        let name = pattern(&output.to_string_lossy()).ok_or_else(|| {
            let failure = Failure::usage("--frames: the name of the output says nowhere where the number belongs");
            failure.hint("write it as in -o frame_%04d.png")
        })?;
        Ok(Some(Self { frames, name }))
    }

    pub(crate) fn first(&self) -> u32 {
        self.frames.0
    }

    fn file(&self, frame: u32) -> PathBuf {
        let (before, digits, after) = &self.name;
        format!("{before}{frame:0digits$}{after}").into()
    }

    pub(crate) fn target(&self, frame: u32, model: &Path) -> Result<Target, Failure> {
        Target::new(Some(&self.file(frame)), model)
    }

    /// Renders the frames. A frame that is interrupted is not written.
    pub(crate) fn run(&self, job: &mut Job<'_>) -> Result<Exit, Failure> {
        let (first, end) = self.frames;
        let mut skipped = 0;
        for frame in first..end {
            if job.interrupt.requested() {
                return Ok(Exit::Interrupted);
            }
            if job.args.animation.skip_existing && self.file(frame).exists() {
                skipped += 1;
                continue;
            }
            job.target = self.target(frame, &job.args.model)?;
            let time = job.args.animation.time_of(frame);
            if let Some(play) = &mut job.shot.play {
                play.time = time;
            }
            job.console.say(format_args!("frame {frame} of {first}..{end}, at {time:.3} s"));
            if job.run()? == Exit::Interrupted {
                return Ok(Exit::Interrupted);
            }
        }
        if skipped > 0 {
            job.console.say(format_args!("{skipped} frames were there already"));
        }
        Ok(Exit::Done)
    }
}

/// Finds `%04d` or `%d` in a name.
fn pattern(name: &str) -> Option<(String, usize, String)> {
    let (before, rest) = name.split_once('%')?;
    let (digits, after) = rest.split_once('d')?;
    let digits = if digits.is_empty() { 1 } else { digits.strip_prefix('0')?.parse().ok().filter(|n| *n <= 9)? };
    (!after.contains('%')).then(|| (before.to_owned(), digits, after.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_their_place_in_the_name() {
        let name = |text: &str, frame| {
            pattern(text).map(|name| Sequence { frames: (0, 1), name }.file(frame).display().to_string())
        };
        assert_eq!(name("a/b_%04d.png", 7).as_deref(), Some("a/b_0007.png"));
        assert_eq!(name("%d.exr", 12).as_deref(), Some("12.exr"));
        assert_eq!(name("%02d.exr", 123).as_deref(), Some("123.exr"));
        for none in ["a.png", "%04.png", "%4d.png", "%s%d.png", "%04d%04d.png", "%099d.png"] {
            assert_eq!(pattern(none), None, "{none}");
        }
    }
}
