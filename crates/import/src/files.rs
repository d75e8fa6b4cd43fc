//! Files that other files name: found only inside the model's folder, and read only up to a limit.

use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::{Component, Path, PathBuf};

use crate::{ErrorKind, ImportError, Limits};

/// The folder of a model: every file that the model names must lie in it.
///
/// A reference is refused ([`ErrorKind::Outside`]) if it is absolute, has a scheme or a drive letter, climbs out by
/// `..`, or reaches the outside through a symbolic link.
#[derive(Clone, Debug)]
pub(crate) struct Folder {
    /// The model's folder, canonical: the fence.
    root: PathBuf,
    /// The folder that references start from: the root or below it; as the user wrote it, for messages.
    base: PathBuf,
    /// `base`, canonical.
    real_base: PathBuf,
    /// There is no fence.
    open: bool,
}

impl Folder {
    /// The folder of a model file.
    ///
    /// # Errors
    /// If there is no such folder.
    pub(crate) fn of(file: &Path, limits: &Limits) -> Result<Self, ImportError> {
        let base = parent(file);
        let root = base.canonicalize().map_err(|e| ImportError::io(file, e))?;
        Ok(Self { real_base: root.clone(), root, base, open: limits.allow_outside })
    }

    /// The same fence, with references that start from beside `file` (one that was found through `self`).
    pub(crate) fn beside(&self, file: &Path) -> Self {
        let base = parent(file);
        let real_base = base.canonicalize().unwrap_or_else(|_| self.real_base.clone());
        Self { root: self.root.clone(), base, real_base, open: self.open }
    }

    /// Finds the file of a plain relative path.
    ///
    /// # Errors
    /// [`ErrorKind::Outside`], or [`ErrorKind::Io`] if there is no such file.
    pub(crate) fn find(&self, reference: &str) -> Result<PathBuf, ErrorKind> {
        let outside = || ErrorKind::Outside(reference.to_owned());
        if self.open {
            let path = reference.strip_prefix("file://").unwrap_or(reference);
            // Nothing is fetched from anywhere.
            if has_scheme(path) && !cfg!(windows) {
                return Err(outside());
            }
            let path = self.base.join(path);
            path.canonicalize()?;
            return Ok(path);
        }
        let relative = Path::new(reference);
        let absolute = |c| matches!(c, Component::Prefix(_) | Component::RootDir);
        if has_scheme(reference) || relative.components().any(absolute) {
            return Err(outside());
        }
        // By its words first, so that nothing can be learnt about which files there are outside.
        if !without_dots(&self.real_base.join(relative)).starts_with(&self.root) {
            return Err(outside());
        }
        let path = self.base.join(relative);
        if path.canonicalize()?.starts_with(&self.root) { Ok(path) } else { Err(outside()) }
    }

    /// Finds the file of a URI: percent escapes are undone; a name that really has a `%` is found as well.
    ///
    /// # Errors
    /// As for [`Folder::find`].
    pub(crate) fn find_uri(&self, uri: &str) -> Result<PathBuf, ErrorKind> {
        let decoded = percent_decoded(uri);
        match self.find(&decoded) {
            Err(ErrorKind::Io(_)) if decoded != uri => self.find(uri),
            found => found,
        }
    }

    /// Finds a file by a name as OBJ and MTL files have it: with the separators of Windows, in any case.
    ///
    /// # Errors
    /// As for [`Folder::find`].
    pub(crate) fn find_loosely(&self, name: &str) -> Result<PathBuf, ErrorKind> {
        let name = name.replace('\\', "/");
        match self.find(&name) {
            Err(ErrorKind::Io(e)) if e.kind() == io::ErrorKind::NotFound => {
                let actual = self.in_any_case(&name).ok_or(e)?;
                self.find(&actual)
            }
            found => found,
        }
    }

    /// The name of an existing file below `base` that differs from `name` at most in its case.
    fn in_any_case(&self, name: &str) -> Option<String> {
        let mut actual = PathBuf::new();
        for component in Path::new(name).components() {
            let Component::Normal(part) = component else {
                actual.push(component);
                continue;
            };
            if self.base.join(&actual).join(part).exists() {
                actual.push(part);
                continue;
            }
            // Nothing outside is listed, whatever dots led here.
            if !self.open && !without_dots(&self.real_base.join(&actual)).starts_with(&self.root) {
                return None;
            }
            let wanted = part.to_str()?.to_lowercase();
            let mut entries: Vec<_> =
                fs::read_dir(self.base.join(&actual)).ok()?.filter_map(|e| Some(e.ok()?.file_name())).collect();
            entries.sort();
            actual.push(entries.iter().find(|e| e.to_str().is_some_and(|e| e.to_lowercase() == wanted))?);
        }
        actual.to_str().map(str::to_owned)
    }
}

/// Reads a whole file. One named `*.zst` or `*.gz` is decompressed.
///
/// # Errors
/// As for [`Input`].
pub(crate) fn read(path: &Path, limits: &Limits) -> Result<Vec<u8>, ImportError> {
    Input::open(path, limits)?.rest()
}

/// A file that is read piece by piece, up to a limit. One named `*.zst` or `*.gz` is decompressed.
///
/// # Errors
/// [`ErrorKind::Io`] if it is no regular file or cannot be read, [`ErrorKind::Limit`] if it is too large,
/// [`ErrorKind::Invalid`] if the compressed data are damaged.
pub(crate) struct Input<'a> {
    path: &'a Path,
    reader: Box<dyn Read + 'a>,
    /// What was read ahead.
    ahead: Vec<u8>,
    compressed: bool,
    /// How many bytes it has, where that is known.
    length: u64,
    limit: u64,
    /// How many bytes there may still be.
    left: u64,
}

impl<'a> Input<'a> {
    pub(crate) fn open(path: &'a Path, limits: &Limits) -> Result<Self, ImportError> {
        let io = |e| ImportError::io(path, e);
        let meta = fs::metadata(path).map_err(io)?;
        if !meta.is_file() {
            // A folder, a device, or a pipe, which would be waited for without end.
            let cause = if meta.is_dir() { "is a folder" } else { "is not a regular file" };
            return Err(io(io::Error::new(io::ErrorKind::InvalidInput, cause)));
        }
        let most = limits.file_bytes.min(limits.memory.unwrap_or(u64::MAX));
        if meta.len() > most {
            return Err(too_large(path, most, false));
        }
        let file = File::open(path).map_err(io)?;
        // A small file that becomes a huge one is no model.
        let limit = limits.decompressed(meta.len());
        let (reader, limit, length): (Box<dyn Read>, _, _) = match compression(path) {
            Compression::None => (Box::new(file), most, meta.len()),
            Compression::Gzip => (Box::new(flate2::bufread::MultiGzDecoder::new(BufReader::new(file))), limit, 0),
            Compression::Zstandard => {
                let decoder = ruzstd::decoding::StreamingDecoder::new(BufReader::new(file))
                    .map_err(|e| damaged(path, io::Error::other(e)))?;
                (Box::new(decoder), limit, 0)
            }
        };
        let compressed = !matches!(compression(path), Compression::None);
        Ok(Self { path, reader, ahead: Vec::new(), compressed, length, limit, left: limit })
    }

    /// Bytes at hand, as they are.
    pub(crate) fn of_bytes(bytes: &'a [u8], path: &'a Path) -> Self {
        let (reader, limit) = (Box::new(bytes), bytes.len() as u64);
        Self { path, reader, ahead: Vec::new(), compressed: false, length: limit, limit, left: limit }
    }

    /// The first bytes, which are read again later: so many, or all that there are.
    pub(crate) fn start(&mut self, count: usize) -> Result<&[u8], ImportError> {
        let mut start = std::mem::take(&mut self.ahead);
        while start.len() < count && self.read(count - start.len(), &mut start)? {}
        self.ahead = start;
        Ok(&self.ahead)
    }

    /// Appends about so many bytes; whether there may be more.
    pub(crate) fn read(&mut self, count: usize, bytes: &mut Vec<u8>) -> Result<bool, ImportError> {
        if !self.ahead.is_empty() {
            bytes.append(&mut self.ahead);
            return Ok(true);
        }
        // One byte more than allowed tells "all of it" from "too much".
        let most = (count as u64).min(self.left.saturating_add(1));
        let read = self.reader.by_ref().take(most).read_to_end(bytes).map_err(|e| match self.compressed {
            true => damaged(self.path, e),
            false => ImportError::io(self.path, e),
        })?;
        if read as u64 > self.left {
            return Err(too_large(self.path, self.limit, self.compressed));
        }
        self.left -= read as u64;
        Ok(read as u64 == most)
    }

    /// All that follows.
    pub(crate) fn rest(mut self) -> Result<Vec<u8>, ImportError> {
        let mut bytes = Vec::new();
        bytes.reserve_exact(usize::try_from(self.length).unwrap_or(0));
        while self.read(usize::MAX, &mut bytes)? {}
        Ok(bytes)
    }
}

fn damaged(path: &Path, error: io::Error) -> ImportError {
    ImportError::invalid(path, "", format!("damaged compressed data: {error}"))
}

fn too_large(path: &Path, limit: u64, decompressed: bool) -> ImportError {
    let after = if decompressed { " after decompression" } else { "" };
    let cause = format!("more than {limit} bytes{after}, the most that is read");
    ImportError::new(path, "", ErrorKind::Limit(cause))
}

/// The extension that tells the format, in lower case: `obj` for `A.OBJ` and for `a.obj.zst`; empty if there is none.
pub(crate) fn format_extension(path: &Path) -> String {
    let inner = match compression(path) {
        Compression::None => path.extension(),
        _ => path.file_stem().and_then(|s| Path::new(s).extension()),
    };
    inner.and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// The file's name without the extensions of its format and compression.
pub(crate) fn stem(path: &Path) -> String {
    let name = match compression(path) {
        Compression::None => path.file_stem(),
        _ => path.file_stem().and_then(|s| Path::new(s).file_stem()),
    };
    name.unwrap_or_default().to_string_lossy().into_owned()
}

enum Compression {
    None,
    Gzip,
    Zstandard,
}

fn compression(path: &Path) -> Compression {
    match path.extension().and_then(|e| e.to_str()) {
        Some(e) if e.eq_ignore_ascii_case("zst") => Compression::Zstandard,
        Some(e) if e.eq_ignore_ascii_case("gz") => Compression::Gzip,
        _ => Compression::None,
    }
}

fn parent(file: &Path) -> PathBuf {
    match file.parent() {
        Some(p) if !p.as_os_str().is_empty() => p.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// `http:`, `file:`, and also `C:`; and the paths of Windows that begin with a backslash.
fn has_scheme(reference: &str) -> bool {
    reference.starts_with('\\')
        || reference.split_once(':').is_some_and(|(scheme, _)| {
            scheme.starts_with(|c: char| c.is_ascii_alphabetic())
                && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
        })
}

/// An absolute path with its `.` and `..` worked out, whether or not there is such a file.
fn without_dots(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            c => out.push(c),
        }
    }
    out
}

/// What is no escape, or gives no UTF-8, stays as it is.
fn percent_decoded(uri: &str) -> String {
    let mut rest = uri.as_bytes();
    let mut out = Vec::with_capacity(rest.len());
    while let [first, tail @ ..] = rest {
        let (byte, after) = percent_escape(rest).unwrap_or((*first, tail));
        out.push(byte);
        rest = after;
    }
    String::from_utf8(out).unwrap_or_else(|_| uri.to_owned())
}

/// The byte of the escape that a text begins with (RFC 3986, section 2.1), and what follows it.
pub(crate) fn percent_escape(text: &[u8]) -> Option<(u8, &[u8])> {
    let [b'%', high, low, rest @ ..] = text else { return None };
    let digit = |b: u8| char::from(b).to_digit(16);
    Some(((digit(*high)? << 4 | digit(*low)?) as u8, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> (tempfile::TempDir, Folder) {
        let dir = tempfile::tempdir().expect("temporary folder");
        let at = |p: &str| dir.path().join(p);
        fs::create_dir_all(at("model/Textures")).expect("folder");
        fs::write(at("model/a.obj"), "").expect("file");
        fs::write(at("model/Textures/Wood one.PNG"), "wood").expect("file");
        fs::write(at("model/50%25.png"), "").expect("file");
        fs::write(at("secret.txt"), "secret").expect("file");
        let folder = Folder::of(&at("model/a.obj"), &Limits::default()).expect("folder");
        (dir, folder)
    }

    #[test]
    fn names_inside_the_folder_are_found() {
        let (_dir, f) = model();
        assert!(f.find("Textures/Wood one.PNG").is_ok());
        assert!(f.find("./Textures/../a.obj").is_ok());
        assert!(f.find("../model/a.obj").is_ok(), "out and in again is inside");
        assert!(f.find_uri("Textures/Wood%20one.PNG").is_ok());
        assert!(f.find_uri("50%2525.png").is_ok());
        assert!(f.find_uri("50%25.png").is_ok(), "a name that only looks escaped");
        assert!(f.find_loosely(r"textures\wood ONE.png").is_ok());
        let below = f.beside(&f.find("Textures/Wood one.PNG").expect("found"));
        assert!(below.find("../a.obj").is_ok(), "up, but not out of the model's folder");
    }

    #[test]
    fn names_outside_are_refused_whether_they_exist_or_not() {
        let (dir, f) = model();
        let absolute = dir.path().join("secret.txt");
        let names = [
            "../secret.txt",
            "../nothing.txt",
            "Textures/../../secret.txt",
            "Nothing/../../secret.txt",
            absolute.to_str().expect("UTF-8"),
            "/etc/passwd",
            "file:///etc/passwd",
            "http://example.org/a.png",
            "C:/a.png",
            r"C:\a.png",
            r"\\server\share\a.png",
            r"..\secret.txt",
            "//server/a.png",
        ];
        for name in names {
            assert!(matches!(f.find_loosely(name), Err(ErrorKind::Outside(_))), "{name}");
        }
        assert!(matches!(f.find_uri("%2e%2e/secret.txt"), Err(ErrorKind::Outside(_))));
        assert!(matches!(f.find_uri("..%2Fsecret.txt"), Err(ErrorKind::Outside(_))));
        assert!(matches!(f.find("nothing.txt"), Err(ErrorKind::Io(_))));
        assert!(matches!(f.find("nul\0.txt"), Err(ErrorKind::Io(_))));
    }

    #[cfg(unix)]
    #[test]
    fn without_a_fence_files_outside_are_found() {
        let (dir, _) = model();
        let at = |p: &str| dir.path().join(p);
        std::os::unix::fs::symlink(at("secret.txt"), at("model/out.txt")).expect("link");
        let limits = Limits { allow_outside: true, ..Limits::default() };
        let f = Folder::of(&at("model/a.obj"), &limits).expect("folder");
        let absolute = at("secret.txt").to_str().expect("UTF-8").to_owned();
        for name in ["../secret.txt", "out.txt", &absolute, &format!("file://{absolute}"), r"..\SECRET.txt"] {
            assert!(f.find_loosely(name).is_ok(), "{name}");
        }
        assert!(f.find_uri("%2e%2e/secret.txt").is_ok());
        assert!(matches!(f.find_uri("http://example.org/a.png"), Err(ErrorKind::Outside(_))));
    }

    #[cfg(unix)]
    #[test]
    fn links_may_not_lead_outside() {
        let (dir, f) = model();
        let at = |p: &str| dir.path().join(p);
        std::os::unix::fs::symlink(at("secret.txt"), at("model/out.txt")).expect("link");
        std::os::unix::fs::symlink(at("model/a.obj"), at("model/in.obj")).expect("link");
        assert!(matches!(f.find("out.txt"), Err(ErrorKind::Outside(_))));
        assert!(f.find("in.obj").is_ok());
    }

    #[test]
    fn reading_keeps_to_the_limit_and_to_regular_files() {
        let (dir, _) = model();
        let wood = dir.path().join("model/Textures/Wood one.PNG");
        let limits = |file_bytes| Limits { file_bytes, ..Limits::default() };
        assert_eq!(read(&wood, &limits(4)).expect("as long as allowed"), b"wood");
        assert!(matches!(read(&wood, &limits(3)), Err(ImportError { kind: ErrorKind::Limit(_), .. })));
        assert!(matches!(read(dir.path(), &limits(9)), Err(ImportError { kind: ErrorKind::Io(_), .. })));
    }

    #[test]
    fn a_small_file_may_not_become_a_huge_one() {
        use std::io::Write;
        let dir = tempfile::tempdir().expect("temporary folder");
        let gz = dir.path().join("a.obj.gz");
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        (0..300).for_each(|_| encoder.write_all(&[b' '; 1 << 20]).expect("in memory"));
        fs::write(&gz, encoder.finish().expect("in memory")).expect("file");
        let e = read(&gz, &Limits { expansion: 4, ..Limits::default() }).expect_err("300 MiB of 1.3");
        assert!(matches!(e.kind, ErrorKind::Limit(_)) && e.to_string().contains("after decompression"), "{e}");
        let allowed = Limits { expansion: 1000, ..Limits::default() };
        assert_eq!(read(&gz, &allowed).expect("allowed").len(), 300 << 20);
    }

    #[test]
    fn compressed_files_are_read_up_to_the_limit() {
        use std::io::Write;
        let dir = tempfile::tempdir().expect("temporary folder");
        let text = vec![b'x'; 100_000];
        let zst = dir.path().join("a.OBJ.zst");
        let packed = ruzstd::encoding::compress_to_vec(&text[..], ruzstd::encoding::CompressionLevel::Fastest);
        fs::write(&zst, packed).expect("file");
        let gz = dir.path().join("a.obj.gz");
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(&text).expect("in memory");
        fs::write(&gz, encoder.finish().expect("in memory")).expect("file");
        for path in [&zst, &gz] {
            assert_eq!(read(path, &Limits::default()).expect("readable"), text);
            let small = Limits { file_bytes: 99_999, ..Limits::default() };
            assert!(matches!(read(path, &small), Err(ImportError { kind: ErrorKind::Limit(_), .. })));
            assert_eq!(format_extension(path), "obj");
            // Within what any file may become.
            let tight = Limits { expansion: 0, ..Limits::default() };
            assert_eq!(read(path, &tight).expect("within the free share"), text);
            let whole = fs::read(path).expect("readable");
            fs::write(path, &whole[..whole.len() / 2]).expect("file");
            assert!(matches!(read(path, &Limits::default()), Err(ImportError { kind: ErrorKind::Invalid(_), .. })));
        }
    }
}
