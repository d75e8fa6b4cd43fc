//! Pictures into files: whole, or not at all.

mod exr;
mod hdr;
mod png;

use std::fs;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

pub use png::write_png;

use crate::film::Picture;
use crate::{Aov, Film, Sums, View};

/// A file format for pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// PNG: what a display shows, through the view transform.
    Png,
    /// OpenEXR: linear 32-bit floats, with all AOVs.
    Exr,
    /// Radiance HDR: linear, three channels of shared exponent.
    Hdr,
}

impl Format {
    /// The format that a file name's extension stands for (`png`, `exr`, `hdr`, in any case).
    ///
    /// # Errors
    /// When there is none or it is not known.
    pub fn from_path(path: &Path) -> Result<Self, OutputError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            Some("hdr") => Ok(Self::Hdr),
            _ => Err(OutputError::UnknownFormat { path: path.to_owned() }),
        }
    }
}

/// How many bits a channel of a PNG has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BitDepth {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits.
    Sixteen,
}

/// How a film is written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WriteOptions {
    /// What a PNG shows. EXR and HDR hold the linear values, unexposed.
    pub view: View,
    /// Bits a channel of a PNG.
    pub bit_depth: BitDepth,
}

/// A picture that could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The extension names no format that can be written.
    #[error("{path}: the extension must be .png, .exr or .hdr", path = path.display())]
    UnknownFormat {
        /// The file asked for.
        path: PathBuf,
    },
    /// The picture has no pixels.
    #[error("the picture has no pixels")]
    Empty,
    /// The system refused.
    #[error("{path}: cannot write: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Writes a film to a file; the format follows the extension. The answer: all files that were written.
///
/// EXR holds colour and AOVs in one file. Beside a PNG or HDR, each AOV goes into an EXR of its own:
/// `picture.depth.exr` beside `picture.png`.
///
/// Each file is first written in full under another name in the same folder and then renamed: whoever looks finds the
/// old file or the new one, never a part.
///
/// # Errors
/// When the extension is unknown, there are no pixels, or the file cannot be written. Then nothing is left behind.
pub fn write_film(path: &Path, film: &Film, options: &WriteOptions) -> Result<Vec<PathBuf>, OutputError> {
    let format = Format::from_path(path)?;
    if film.window().width == 0 || film.window().height == 0 {
        return Err(OutputError::Empty);
    }
    match format {
        Format::Png => atomically(path, |out| write_png(out, &film.color(), &options.view, options.bit_depth)),
        Format::Hdr => atomically(path, |out| hdr::write(out, &film.color())),
        Format::Exr => atomically(path, |out| exr::write(out, film, exr::Layers::All)),
    }
    .map_err(failed(path))?;
    if format != Format::Exr {
        for aov in film.aovs() {
            let beside = beside(path, *aov);
            atomically(&beside, |out| exr::write(out, film, exr::Layers::Only(*aov))).map_err(failed(&beside))?;
        }
    }
    files(path, film.aovs())
}

/// The files that [`write_film`] writes for a film with these AOVs, the picture first.
///
/// # Errors
/// When the extension is unknown.
pub fn files(path: &Path, aovs: &[Aov]) -> Result<Vec<PathBuf>, OutputError> {
    let aovs = if Format::from_path(path)? == Format::Exr { &[] } else { aovs };
    Ok(std::iter::once(path.to_owned()).chain(aovs.iter().map(|aov| beside(path, *aov))).collect())
}

/// Writes a text so that it appears whole or not at all: reports that stand beside pictures.
///
/// # Errors
/// [`OutputError::Io`] when it cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
    atomically(path, |out| out.write_all(text.as_bytes())).map_err(failed(path))
}

/// Writes what a render has come to, whole or not at all: see [`Sums::write`].
///
/// # Errors
/// [`OutputError::Io`] when it cannot be written.
pub fn write_checkpoint(path: &Path, sums: &Sums<'_>, picture: &str) -> Result<(), OutputError> {
    atomically(path, |out| sums.write(out, picture)).map_err(failed(path))
}

/// Writes a picture as a PNG file of 8 bits a channel, whole or not at all.
///
/// # Errors
/// [`OutputError::Empty`] when there are no pixels, [`OutputError::Io`] when it cannot be written.
pub fn write_picture(path: &Path, picture: &Picture, view: &View) -> Result<(), OutputError> {
    if picture.pixels.is_empty() {
        return Err(OutputError::Empty);
    }
    atomically(path, |out| write_png(out, picture, view, BitDepth::Eight)).map_err(failed(path))
}

/// Whether a file can be written there, by creating and removing what [`write_film`] would rename at the end. A file
/// of that name stays as it is.
///
/// # Errors
/// [`OutputError::Io`] when it cannot.
pub fn try_path(path: &Path) -> Result<(), OutputError> {
    let temporary = temporary(path).map_err(failed(path))?;
    fs::File::create(&temporary).and_then(|_| fs::remove_file(&temporary)).map_err(failed(path))
}

fn beside(path: &Path, aov: Aov) -> PathBuf {
    path.with_extension(format!("{}.exr", aov.name()))
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> OutputError {
    let path = path.to_owned();
    move |source| OutputError::Io { path, source }
}

/// Writes a file so that it appears whole or not at all.
fn atomically(path: &Path, write: impl FnOnce(&mut WholeFile) -> io::Result<()>) -> io::Result<()> {
    let mut out = WholeFile::create(path)?;
    write(&mut out)?;
    out.finish()
}

/// A file that appears whole or not at all: it is written under another name in the same folder, which
/// [`WholeFile::finish`] renames. Dropped before that, it leaves nothing behind.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("rows.csv");
/// use std::io::Write;
/// let mut file = firsthit_render::output::WholeFile::create(&path)?;
/// writeln!(file, "1,2,3")?;
/// assert!(!path.exists());
/// file.finish()?;
/// assert!(path.exists());
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct WholeFile {
    out: BufWriter<fs::File>,
    temporary: PathBuf,
    path: PathBuf,
    finished: bool,
}

impl WholeFile {
    /// Begins a file. One of that name stays as it is until the end.
    ///
    /// # Errors
    /// When the path names no file, or the folder cannot be written to.
    pub fn create(path: &Path) -> io::Result<Self> {
        let temporary = temporary(path)?;
        let out = BufWriter::new(fs::File::create(&temporary)?);
        Ok(Self { out, temporary, path: path.to_owned(), finished: false })
    }

    /// Where it is until it is finished: what a program that is interrupted should remove.
    #[must_use]
    pub fn temporary(&self) -> &Path {
        &self.temporary
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// When the rest cannot be written, or the file not be renamed. Then nothing is left behind.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()?;
        fs::rename(&self.temporary, &self.path)?;
        self.finished = true;
        Ok(())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Seek for WholeFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.out.seek(to)
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if !self.finished {
            // What went wrong first is what the caller should hear of.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

/// Where a file is written before it is renamed to `path`: in the same folder.
fn temporary(path: &Path) -> io::Result<PathBuf> {
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a folder"));
    }
    let mut temporary = std::ffi::OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".{}.tmp", std::process::id()));
    Ok(path.with_file_name(temporary))
}

/// Errors of the codecs as those of the system.
fn other(error: impl std::error::Error + Send + Sync + 'static) -> io::Error {
    io::Error::other(error)
}

#[cfg(test)]
mod tests;
