//! Renders that are put aside: all that has been summed so far, to go on with later or to be joined with other shares.

use std::collections::TryReserveError;
use std::io::{self, Read, Write};

use crate::film::Accumulator;
use crate::noise::Tiles;
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
    /// There is not enough memory for it.
    #[error("there is not enough memory for it")]
    Memory(#[from] TryReserveError),
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

const MAGIC: &[u8; 16] = b"firsthit film 2\n";
/// Longer words about a picture are not read.
const MOST_WORDS: u32 = 1 << 20;

impl Sums<'_> {
    /// The picture so far.
    #[must_use]
    pub fn film(&self) -> &Film {
        self.film
    }

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

/// A checkpoint of which only the head has been read: enough to see which picture it is of.
#[derive(Debug)]
pub struct CheckpointReader<R> {
    input: R,
    picture: String,
    size: (u32, u32),
    window: Crop,
    aovs: Vec<Aov>,
    rest: Rest,
}

impl<R: Read> CheckpointReader<R> {
    /// Reads the head.
    ///
    /// # Errors
    /// When it is no checkpoint, or reading fails.
    pub fn new(mut input: R) -> Result<Self, CheckpointError> {
        if bytes::<16>(&mut input)? != *MAGIC {
            return Err(CheckpointError::Format);
        }
        let mut head = [0; 12];
        for n in &mut head {
            *n = u32::from_le_bytes(bytes(&mut input)?);
        }
        let [width, height, x, y, w, h, first, pass, threshold, tiles, aovs, words] = head;
        let threshold = Some(f32::from_bits(threshold)).filter(|t| *t >= 0.0);
        let samples = first.is_multiple_of(16) && first <= pass && pass <= RenderOptions::MOST_SAMPLES;
        if !samples || words > MOST_WORDS || aovs as usize > Aov::ALL.len() {
            return Err(CheckpointError::Format);
        }
        let mut picture = vec![0; words as usize];
        input.read_exact(&mut picture).map_err(cut_off)?;
        let picture = String::from_utf8(picture).map_err(|_| CheckpointError::Format)?;
        let mut list: Vec<Aov> = Vec::new();
        for _ in 0..aovs {
            let name = bytes::<32>(&mut input)?;
            let name = std::str::from_utf8(&name).map_err(|_| CheckpointError::Format)?;
            let aov = name.trim_end().parse().map_err(|_| CheckpointError::Format)?;
            if list.contains(&aov) {
                return Err(CheckpointError::Format);
            }
            list.push(aov);
        }
        let window = Crop { x, y, width: w, height: h };
        let options = RenderOptions { width, height, crop: Some(window), aovs: list, ..RenderOptions::default() };
        options.check().map_err(|_| CheckpointError::Format)?;
        let inside = |from: u32, size: u32, end: u32| from.checked_add(size).is_some_and(|sum| sum <= end);
        if !inside(x, w, width) || !inside(y, h, height) || tiles as usize != Tiles::new(window).count() {
            return Err(CheckpointError::Format);
        }
        let mut active = vec![0; tiles as usize];
        input.read_exact(&mut active).map_err(cut_off)?;
        let active = active.into_iter().map(|a| a != 0).collect();
        let rest = Rest { first, pass, active, threshold };
        Ok(Self { input, picture, size: (width, height), window, aovs: options.aovs, rest })
    }

    /// The words that say which picture it is of.
    #[must_use]
    pub fn picture(&self) -> &str {
        &self.picture
    }

    /// The first of its samples.
    #[must_use]
    pub fn first_sample(&self) -> u32 {
        self.rest.first
    }

    /// Reads the film. Memory is taken as bytes come, not by what the head says.
    ///
    /// # Errors
    /// When numbers are none that a render has, when bytes are missing, or reading fails.
    pub fn read(self) -> Result<Checkpoint, CheckpointError> {
        let Self { mut input, size, window, aovs, rest, .. } = self;
        let most = RenderOptions::MOST_SAMPLES.saturating_sub(rest.first);
        let mut count = 0;
        let film = Film::from_records(size, window, &aovs, |layer| {
            let pixel = Accumulator::from_bytes(&bytes(&mut input)?);
            if layer == 0 {
                count = pixel.count();
            }
            let sound = pixel.count() == count && count <= most && pixel.is_sound(layer == 0);
            if sound { Ok(pixel) } else { Err(CheckpointError::Format) }
        })?;
        if bytes::<16>(&mut input)? != *MAGIC {
            return Err(CheckpointError::Format);
        }
        Ok(Checkpoint { film, rest })
    }
}

/// So many bytes.
fn bytes<const N: usize>(input: &mut impl Read) -> Result<[u8; N], CheckpointError> {
    let mut bytes = [0; N];
    input.read_exact(&mut bytes).map_err(cut_off)?;
    Ok(bytes)
}

/// A file that ends too early is no whole checkpoint.
fn cut_off(error: io::Error) -> CheckpointError {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => CheckpointError::Format,
        _ => CheckpointError::Io(error),
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
        let reader = CheckpointReader::new(input)?;
        let picture = reader.picture.clone();
        Ok((reader.read()?, picture))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A checkpoint of 4 x 2 pixels with 20 samples each, beside them normals.
    fn sound() -> Vec<u8> {
        let mut film = Film::new(4, 2, None, &[Aov::Normal]).unwrap();
        for pixel in film.records_mut() {
            (0..20).for_each(|_| pixel.add([0.5, 0.25, 1.0, 1.0]));
        }
        let rest = Rest { first: 32, pass: 52, active: vec![true], threshold: None };
        let mut out = Vec::new();
        Sums { film: &film, rest: &rest }.write(&mut out, "words").unwrap();
        out
    }

    fn refused(file: &[u8]) -> bool {
        matches!(Checkpoint::read(&mut &*file), Err(CheckpointError::Format))
    }

    #[test]
    fn what_is_cut_off_is_no_checkpoint() {
        let file = sound();
        assert_eq!(Checkpoint::read(&mut file.as_slice()).unwrap().0.samples(), 32..52);
        assert!((0..file.len()).all(|end| refused(&file[..end])));
    }

    #[test]
    fn numbers_that_no_render_has_are_refused() {
        let file = sound();
        let with = |at: usize, new: &[u8]| {
            let mut bad = file.clone();
            bad[at..at + new.len()].copy_from_slice(new);
            refused(&bad)
        };
        let first = file.len() - 16 - 16 * crate::film::RECORD;
        for x in [f64::NAN, f64::INFINITY, -1.0, 1e300] {
            assert!((0..7).all(|i| with(first + 8 * i, &x.to_le_bytes())), "{x}");
        }
        for x in [f32::NAN, f32::INFINITY, -1.0] {
            assert!((0..4).all(|i| with(first + 56 + 4 * i, &x.to_le_bytes())), "{x}");
        }
        // A pixel with another number of samples than its normal, or with too many.
        assert!(with(first + 72, &19_u32.to_le_bytes()) && with(first + 72, &u32::MAX.to_le_bytes()));
        // First sample and pass.
        assert!(with(16 + 24, &8_u32.to_le_bytes()) && with(16 + 24, &64_u32.to_le_bytes()));
        assert!(with(16 + 28, &u32::MAX.to_le_bytes()));
        // A window that leaves the picture.
        assert!(with(16 + 8, &1_u32.to_le_bytes()) && with(16 + 8, &u32::MAX.to_le_bytes()));
    }
}
