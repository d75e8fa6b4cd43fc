//! A glTF file with its buffers: what all other modules here read from.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashSet};
use std::ops::Range;
use std::path::Path;

use gltf::json::{Index, Root, buffer};

use super::accessor::ZeroBudget;
use super::meshopt::{self, Compressed};
use super::uri::{self, Uri};
use crate::files::{self, Folder};
use crate::timing::{Stage, timed};
use crate::{ErrorKind, ImageCache, ImportError, Limits, Options, Report, Stages};

/// The parsed JSON, its references checked, and the bytes that it refers to.
pub(super) struct Source<'a> {
    pub(super) file: &'a Path,
    pub(super) root: &'a Root,
    pub(super) folder: Folder,
    pub(super) limits: &'a Limits,
    pub(super) stages: Option<&'a Stages>,
    pub(super) cache: Option<&'a ImageCache>,
    pub(super) zeros: ZeroBudget,
    /// `None`: the file gives no data (a fallback of a compressed buffer).
    buffers: Vec<Option<Cow<'a, [u8]>>>,
    /// The buffer views that were compressed, by their numbers.
    decompressed: BTreeMap<usize, Vec<u8>>,
}

impl<'a> Source<'a> {
    /// Reads the buffers and decompresses buffer views.
    ///
    /// # Errors
    /// If a buffer is not there, or shorter than it says; if a compressed buffer view is damaged.
    pub(super) fn new(
        file: &'a Path,
        root: &'a Root,
        bin: Option<&'a [u8]>,
        options: &'a Options,
        report: &mut Report,
    ) -> Result<Self, ImportError> {
        let (limits, stages) = (&options.limits, options.stages.as_ref());
        let (folder, zeros) = (Folder::of(file, limits)?, ZeroBudget::new(limits));
        let (buffers, decompressed) = (Vec::new(), BTreeMap::new());
        let mut source =
            Self { file, root, folder, limits, stages, cache: options.images.as_ref(), zeros, buffers, decompressed };
        let compressed = Compressed::all(&source)?;
        let fallback = meshopt::unread_buffers(root, &compressed);
        let (mut total, mut distinct, mut named) = (0_u64, 0_u64, HashSet::new());
        for (i, buffer) in root.buffers.iter().enumerate() {
            let place = format!("/buffers/{i}");
            let bytes = match (&buffer.uri, bin) {
                _ if fallback[i] => None,
                (Some(uri), _) => Some(Cow::Owned(source.resource(uri, &format!("{place}/uri"), limits, report)?)),
                (None, Some(bin)) if i == 0 => Some(Cow::Borrowed(bin)),
                (None, _) => None,
            };
            let length = bytes.as_ref().map_or(0, |b| b.len() as u64);
            total += length;
            // Buffers that name one file hold it once each.
            if buffer.uri.as_deref().is_none_or(|uri| named.insert(uri)) {
                distinct += length;
            }
            limits.check_memory("its buffers", total, distinct).map_err(|kind| source.at(place.as_str(), kind))?;
            if total > limits.file_bytes {
                let cause = format!("the buffers have more bytes than the limit of {}", limits.file_bytes);
                return Err(source.at(place, ErrorKind::Limit(cause)));
            }
            let (wanted, found) = (buffer.byte_length.0, bytes.as_ref().map(|b| b.len() as u64));
            if found.is_some_and(|found| found < wanted) {
                let cause = format!("says {wanted} bytes, but its data have {}", found.unwrap_or(0));
                return Err(source.invalid(format!("{place}/byteLength"), cause));
            }
            source.buffers.push(bytes);
        }
        source.decompressed = meshopt::decompress(&source, &compressed, limits.decompressed(total))?;
        Ok(source)
    }

    /// The data of a URI: of the URI itself or of a file in the model's folder.
    pub(super) fn resource(
        &self,
        text: &str,
        place: &str,
        limits: &Limits,
        report: &mut Report,
    ) -> Result<Vec<u8>, ImportError> {
        match uri::parse(text).map_err(|cause| self.invalid(place, cause))? {
            Uri::Data(bytes) => Ok(bytes),
            Uri::File(name) => {
                let path = self.folder.find_uri(name).map_err(|kind| match kind {
                    ErrorKind::Io(e) => self.at(place, ErrorKind::Invalid(format!("'{name}' cannot be read: {e}"))),
                    kind => self.at(place, kind),
                })?;
                report.reads(&path);
                let read = || timed(self.stages, Stage::Read, || files::read(&path, limits));
                match self.cache {
                    Some(cache) => cache.bytes(&path, read).map(|bytes| bytes.to_vec()),
                    None => read(),
                }
            }
        }
    }

    /// The bytes of a buffer view.
    ///
    /// # Errors
    /// If it leaves its buffer, or the buffer has no data.
    pub(super) fn view(&self, index: Index<buffer::View>) -> Result<&[u8], ImportError> {
        let range = self.check_view(index)?;
        if let Some(bytes) = self.decompressed.get(&index.value()) {
            return Ok(bytes);
        }
        let buffer = self.root.buffer_views[index.value()].buffer.value();
        self.buffer(buffer, range, || format!("/bufferViews/{}/buffer", index.value()))
    }

    /// Bytes of a buffer, which lie in what it says to have; `place` is where it is named.
    ///
    /// # Errors
    /// If the buffer has no data.
    pub(super) fn buffer(
        &self,
        buffer: usize,
        range: Range<usize>,
        place: impl FnOnce() -> String,
    ) -> Result<&[u8], ImportError> {
        // The buffer has at least the bytes that it says.
        self.buffers[buffer].as_ref().map(|bytes| &bytes[range]).ok_or_else(|| {
            let cause =
                format!("buffer {buffer} has no data: neither a URI nor, as the first of a GLB, a binary chunk");
            self.invalid(place(), cause)
        })
    }

    /// The bytes of its buffer that a buffer view means.
    ///
    /// # Errors
    /// If it leaves its buffer.
    pub(super) fn check_view(&self, index: Index<buffer::View>) -> Result<Range<usize>, ImportError> {
        let view = &self.root.buffer_views[index.value()];
        let (start, length) = (view.byte_offset.map_or(0, |o| o.0), view.byte_length.0);
        self.range(view.buffer.value(), start, length, || format!("/bufferViews/{}", index.value()))
    }

    /// So many bytes of a buffer; `place` is where they are asked for.
    ///
    /// # Errors
    /// If they leave the buffer.
    pub(super) fn range(
        &self,
        buffer: usize,
        start: u64,
        length: u64,
        place: impl FnOnce() -> String,
    ) -> Result<Range<usize>, ImportError> {
        let available = self.root.buffers[buffer].byte_length.0;
        match start.checked_add(length).filter(|&end| end <= available) {
            Some(end) => Ok(start as usize..end as usize),
            None => {
                let cause = format!("{length} bytes from byte {start} leave buffer {buffer}, which has {available}");
                Err(self.invalid(place(), cause))
            }
        }
    }

    /// How many bytes the buffers have.
    pub(super) fn bytes(&self) -> u64 {
        self.buffers.iter().flatten().map(|b| b.len() as u64).sum()
    }

    /// An error at a place in the file.
    pub(super) fn at(&self, place: impl Into<String>, kind: ErrorKind) -> ImportError {
        ImportError::new(self.file, place, kind)
    }

    /// The file breaks the format.
    pub(super) fn invalid(&self, place: impl Into<String>, cause: impl Into<String>) -> ImportError {
        self.at(place, ErrorKind::Invalid(cause.into()))
    }

    /// The same data behind another model of the same file, whose references are the same.
    pub(super) fn with_root<'b>(self, root: &'b Root) -> Source<'b>
    where
        'a: 'b,
    {
        Source { root, ..self }
    }

    /// Whether the file says that it uses an extension.
    pub(super) fn uses(&self, extension: &str) -> bool {
        let declared = |list: &[String]| list.iter().any(|e| e == extension);
        declared(&self.root.extensions_used) || declared(&self.root.extensions_required)
    }
}
