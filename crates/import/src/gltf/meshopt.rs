//! Compressed buffer views: KHR_meshopt_compression, and EXT_meshopt_compression, of which it is the later version.

use std::collections::BTreeMap;
use std::ops::Range;
use std::panic::catch_unwind;

use draco_gltf::meshopt::decode_buffer_view;
use draco_gltf::{GltfError, MeshoptFilter, MeshoptMode};
use gltf::json::Root;
use rayon::prelude::*;
use serde::Deserialize;

use super::json;
use super::source::Source;
use crate::{ErrorKind, ImportError};

const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// A buffer view that is compressed.
pub(super) struct Compressed {
    view: usize,
    /// Where the extension stands in the file.
    place: String,
    buffer: usize,
    range: Range<usize>,
    count: usize,
    stride: usize,
    mode: MeshoptMode,
    filter: MeshoptFilter,
}

/// What the extension says.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Says {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: String,
    filter: Option<String>,
}

impl Compressed {
    /// The compressed buffer views of a file, checked but for their data.
    ///
    /// # Errors
    /// If one leaves its buffer, is of a kind that is not known, or does not give the bytes that its view says.
    pub(super) fn all(source: &Source<'_>) -> Result<Vec<Self>, ImportError> {
        let mut all = Vec::new();
        for (i, view) in source.root.buffer_views.iter().enumerate() {
            let Some(others) = view.extensions.as_ref().map(|e| &e.others) else { continue };
            if let Some((name, value)) = NAMES.iter().find_map(|&name| Some((name, others.get(name)?))) {
                let place = format!("/bufferViews/{i}/extensions/{name}");
                let says = json::typed(source.file, &place, value)?;
                all.push(Self::new(source, i, place, says)?);
            }
        }
        Ok(all)
    }

    fn new(source: &Source<'_>, view: usize, place: String, says: Says) -> Result<Self, ImportError> {
        let invalid = |key: &str, cause: String| source.invalid(format!("{place}/{key}"), cause);
        let Says { buffer, byte_offset, byte_length, byte_stride, count, mode, filter } = says;
        let buffers = source.root.buffers.len();
        if buffer >= buffers {
            return Err(invalid("buffer", format!("element {buffer} does not exist: there are {buffers}")));
        }
        let range = source.range(buffer, byte_offset, byte_length, || place.clone())?;
        let Ok(known) = MeshoptMode::from_name(&mode) else {
            return Err(invalid("mode", format!("'{mode}' is none of ATTRIBUTES, TRIANGLES and INDICES")));
        };
        let filter = filter.as_deref().unwrap_or("NONE");
        let Ok(filter) = MeshoptFilter::from_name(filter) else {
            let known = "NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL and COLOR";
            return Err(invalid("filter", format!("'{filter}' is none of {known}")));
        };
        let (wanted, found) = (source.root.buffer_views[view].byte_length.0, count.checked_mul(byte_stride));
        if found != Some(wanted) {
            let cause = format!("{count} elements of {byte_stride} bytes are not the {wanted} of the buffer view");
            return Err(invalid("count", cause));
        }
        // Of a whole block of 8 KiB at least one byte is left for every four bytes of an element; triangles and
        // indices take a byte each.
        const MOST: u64 = 1024;
        if wanted > byte_length.saturating_mul(MOST) {
            let cause = format!("{byte_length} bytes cannot become {wanted}");
            return Err(invalid("byteLength", cause));
        }
        let (count, stride) = (count as usize, byte_stride as usize);
        Ok(Self { view, place, buffer, range, count, stride, mode: known, filter })
    }

    fn decode(&self, data: &[u8]) -> Result<Vec<u8>, GltfError> {
        // The decoder checks what it reads; but it is young, and nothing in a file may end the program.
        let decoded = catch_unwind(|| {
            let mut bytes = vec![0; self.count * self.stride];
            decode_buffer_view(&mut bytes, data, self.mode, self.filter, self.count, self.stride)?;
            Ok(bytes)
        });
        decoded.unwrap_or_else(|_| Err(GltfError::InvalidGltf("the decoder of meshopt streams failed".into())))
    }
}

/// For each buffer whether it is only there for readers without the extension: its data may be missing.
pub(super) fn unread_buffers(root: &Root, compressed: &[Compressed]) -> Vec<bool> {
    let says = |b: &gltf::json::Buffer| {
        let others = b.extensions.as_ref().map(|e| &e.others);
        NAMES.iter().find_map(|&name| others?.get(name)?.get("fallback")?.as_bool()).unwrap_or(false)
    };
    let mut unread: Vec<bool> = root.buffers.iter().map(says).collect();
    // What is read nevertheless is needed, whatever the file says.
    let mut views = compressed.iter().map(|c| c.view).peekable();
    for (i, view) in root.buffer_views.iter().enumerate() {
        if views.next_if_eq(&i).is_none() {
            unread[view.buffer.value()] = false;
        }
    }
    compressed.iter().for_each(|c| unread[c.buffer] = false);
    unread
}

/// Decodes all compressed buffer views, if that makes no more than `most` bytes.
///
/// # Errors
/// If it does, or one is damaged or has no data.
pub(super) fn decompress(
    source: &Source<'_>,
    compressed: &[Compressed],
    most: u64,
) -> Result<BTreeMap<usize, Vec<u8>>, ImportError> {
    let total = compressed.iter().fold(0_u64, |sum, c| sum.saturating_add((c.count * c.stride) as u64));
    if total > most {
        let cause = format!("the compressed buffer views become {total} bytes, more than the limit of {most}");
        return Err(source.at("/bufferViews", ErrorKind::Limit(cause)));
    }
    let data = |c: &Compressed| source.buffer(c.buffer, c.range.clone(), || format!("{}/buffer", c.place));
    let data = compressed.iter().map(data).collect::<Result<Vec<_>, _>>()?;
    let decoded: Vec<_> = compressed.par_iter().zip(data).map(|(c, data)| c.decode(data)).collect();
    let placed = |(c, bytes): (&Compressed, Result<_, GltfError>)| match bytes {
        Ok(bytes) => Ok((c.view, bytes)),
        Err(GltfError::InvalidGltf(cause) | GltfError::Unsupported(cause)) => {
            let cause = cause.strip_prefix("EXT_meshopt_compression: ").unwrap_or(&cause);
            Err(source.invalid(c.place.as_str(), cause))
        }
        Err(e) => Err(source.invalid(c.place.as_str(), e.to_string())),
    };
    compressed.iter().zip(decoded).map(placed).collect()
}
