//! Renders that are put aside: all that has been summed so far, to go on with later or to be joined with other shares.

use std::io::{self, Read, Write};

use crate::film::{Accumulator, RECORD};
use crate::{Aov, Crop, Film, RenderOptions};

/// Where a render goes on.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Rest {
    /// The first sample of every pixel: 0 but for shares of a render.
    pub(crate) first: u32,
    /// The first sample of the pass that is not finished.
    pub(crate) pass: u32,
    /// Of each tile, whether it still gets samples.
    pub(crate) active: Vec<bool>,
    /// The threshold by which that was decided.
    pub(crate) threshold: Option<f32>,
}

/// What a render has come to, while it goes on: see [`crate::Monitor::checkpoint`].
#[derive(Clone, Copy, Debug)]
pub struct Sums<'a> {
    pub(crate) film: &'a Film,
    pub(crate) rest: &'a Rest,
}

/// What a render has come to: its film, and where it would go on.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The sums.
    pub film: Film,
    pub(crate) rest: Rest,
}

/// A checkpoint that cannot be read, gone on with or joined.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// Reading or writing failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It is something else, or broken.
    #[error("this is no checkpoint, or not a whole one")]
    Format,
    /// It is of another picture.
    #[error("it is of another picture: {0}")]
    Other(&'static str),
    /// Samples between two shares are missing, there twice, or not the same number in each pixel.
    #[error("after sample {end} comes sample {next}: shares must follow each other, in blocks of 16 samples")]
    Gap {
        /// Where the first share ends.
        end: u32,
        /// Where the next begins.
        next: u32,
    },
}

const MAGIC: &[u8; 16] = b"firsthit film 1\n";
/// Longer words about a picture are not read.
const MOST_WORDS: u32 = 1 << 20;

impl Sums<'_> {
    /// Writes it, with words that say which picture it is of.
    ///
    /// # Errors
    /// When writing fails.
    pub fn write(&self, out: &mut impl Write, picture: &str) -> io::Result<()> {
        let too_long = |_| io::Error::other("too long");
        out.write_all(MAGIC)?;
        let mut number = |n: u32| out.write_all(&n.to_le_bytes());
        let ((width, height), window) = (self.film.size(), self.film.window());
        for n in [width, height, window.x, window.y, window.width, window.height, self.rest.first, self.rest.pass] {
            number(n)?;
        }
        number(self.rest.threshold.unwrap_or(-1.0).to_bits())?;
        number(u32::try_from(self.rest.active.len()).map_err(too_long)?)?;
        number(u32::try_from(self.film.aovs().len()).map_err(too_long)?)?;
        number(u32::try_from(picture.len()).map_err(too_long)?)?;
        out.write_all(picture.as_bytes())?;
        for aov in self.film.aovs() {
            let mut name = [b' '; 32];
            name[..aov.name().len()].copy_from_slice(aov.name().as_bytes());
            out.write_all(&name)?;
        }
        let active: Vec<u8> = self.rest.active.iter().map(|a| u8::from(*a)).collect();
        out.write_all(&active)?;
        for pixel in self.film.records() {
            out.write_all(&pixel.to_bytes())?;
        }
        out.write_all(MAGIC)
    }
}

impl Checkpoint {
    /// As it is while the render goes on.
    #[must_use]
    pub fn sums(&self) -> Sums<'_> {
        Sums { film: &self.film, rest: &self.rest }
    }

    /// Its samples: from the first to the one after the last that any pixel has.
    #[must_use]
    pub fn samples(&self) -> std::ops::Range<u32> {
        let most = self.film.records().map(Accumulator::count).max().unwrap_or(0);
        self.rest.first..self.rest.first.saturating_add(most)
    }

    /// Reads what [`Sums::write`] wrote, with its words.
    ///
    /// # Errors
    /// When it is no checkpoint, or reading fails.
    pub fn read(input: &mut impl Read) -> Result<(Self, String), CheckpointError> {
        let mut magic = [0; 16];
        input.read_exact(&mut magic)?;
        if magic != *MAGIC {
            return Err(CheckpointError::Format);
        }
        let mut head = [0; 12];
        for n in &mut head {
            let mut bytes = [0; 4];
            input.read_exact(&mut bytes)?;
            *n = u32::from_le_bytes(bytes);
        }
        let [width, height, x, y, w, h, first, pass, threshold, tiles, aovs, words] = head;
        let threshold = Some(f32::from_bits(threshold)).filter(|t| *t >= 0.0);
        if words > MOST_WORDS || aovs as usize > Aov::ALL.len() {
            return Err(CheckpointError::Format);
        }
        let mut picture = vec![0; words as usize];
        input.read_exact(&mut picture)?;
        let picture = String::from_utf8(picture).map_err(|_| CheckpointError::Format)?;
        let mut list = Vec::new();
        for _ in 0..aovs {
            let mut name = [0; 32];
            input.read_exact(&mut name)?;
            let name = std::str::from_utf8(&name).map_err(|_| CheckpointError::Format)?;
            list.push(name.trim_end().parse().map_err(|_| CheckpointError::Format)?);
        }
        let crop = Crop { x, y, width: w, height: h };
        let options = RenderOptions { width, height, crop: Some(crop), aovs: list, ..RenderOptions::default() };
        options.check().map_err(|_| CheckpointError::Format)?;
        let mut film = Film::new(width, height, options.crop, &options.aovs).map_err(|_| CheckpointError::Format)?;
        if film.window() != crop || tiles as usize != crate::noise::Tiles::new(crop).count() {
            return Err(CheckpointError::Format);
        }
        let mut active = vec![0; tiles as usize];
        input.read_exact(&mut active)?;
        let active = active.into_iter().map(|a| a != 0).collect();
        for pixel in film.records_mut() {
            let mut bytes = [0; RECORD];
            input.read_exact(&mut bytes)?;
            *pixel = Accumulator::from_bytes(&bytes);
        }
        input.read_exact(&mut magic)?;
        if magic != *MAGIC {
            return Err(CheckpointError::Format);
        }
        Ok((Self { film, rest: Rest { first, pass, active, threshold } }, picture))
    }

    /// Adds the share that follows: its first sample must be the one after the last of each pixel here. The sums are
    /// those of one render of all samples.
    ///
    /// # Errors
    /// When the shares are of different pictures, or do not follow each other.
    pub fn join(&mut self, next: &Self) -> Result<(), CheckpointError> {
        let (a, b) = (&self.film, &next.film);
        if a.size() != b.size() || a.window() != b.window() || a.aovs() != b.aovs() {
            return Err(CheckpointError::Other("size, window or pictures beside the colour differ"));
        }
        let counts = |film: &Film| film.records().fold((u32::MAX, 0), |(a, b), p| (a.min(p.count()), b.max(p.count())));
        let (least, most) = counts(a);
        let end = self.rest.first.saturating_add(most);
        let even = least == most && counts(b).0 == counts(b).1;
        if !even || end != next.rest.first || !end.is_multiple_of(16) {
            return Err(CheckpointError::Gap { end, next: next.rest.first });
        }
        for (pixel, more) in self.film.records_mut().zip(next.film.records()) {
            pixel.join(more);
        }
        self.rest.pass = next.rest.pass;
        Ok(())
    }
}
