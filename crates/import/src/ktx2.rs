//! KTX2 images with Basis Universal data, ETC1S or UASTC, as KHR_texture_basisu has them.

use crate::ErrorKind;
use crate::scene::Pixels;

/// Whether a file is KTX2, by its first bytes.
pub(crate) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n")
}

/// Width and height in pixels, from the header.
///
/// # Errors
/// If it is cut off.
pub(crate) fn size(bytes: &[u8]) -> Result<(u32, u32), ErrorKind> {
    Ok((word(bytes, 20)?, word(bytes, 24)?))
}

/// The finest level, eight bits a channel; its size must have been found to be allowed.
///
/// # Errors
/// If the file is no single flat picture, its data are of another kind or damaged, or this was built without them.
pub(crate) fn decode(bytes: &[u8]) -> Result<(u32, u32, Pixels), ErrorKind> {
    let (width, height) = size(bytes)?;
    let [depth, layers, faces, scheme] = [word(bytes, 28)?, word(bytes, 32)?, word(bytes, 36)?, word(bytes, 44)?];
    if depth > 0 || layers > 1 || faces != 1 {
        return Err(ErrorKind::Unsupported("KTX2: only single flat pictures are read".into()));
    }
    // The first of the levels is the finest.
    let [start, length, whole] = [long(bytes, 80)?, long(bytes, 88)?, long(bytes, 96)?];
    if start.checked_add(length).is_none_or(|end| end > bytes.len() as u64) {
        let cause = format!("KTX2: {length} bytes from byte {start} leave the file, which has {}", bytes.len());
        return Err(ErrorKind::Invalid(cause));
    }
    // What Zstandard makes of it is allocated as declared: blocks of 4 x 4 pixels have 16 bytes each.
    let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    if scheme == ZSTANDARD && whole != 16 * blocks {
        let cause = format!("KTX2: {whole} bytes are declared for {width} x {height} pixels; expected {}", 16 * blocks);
        return Err(ErrorKind::Invalid(cause));
    }
    let pixels = transcode(bytes)?;
    if pixels.len() as u64 != 4 * u64::from(width) * u64::from(height) {
        return Err(ErrorKind::Invalid("KTX2: the data are not of the declared size".into()));
    }
    Ok((width, height, Pixels::Rgba8(bytemuck::cast_slice(&pixels).into())))
}

const ZSTANDARD: u32 = 2;

#[cfg(feature = "ktx2")]
fn transcode(bytes: &[u8]) -> Result<Vec<u8>, ErrorKind> {
    use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
    let invalid = |e: basisu::Error| ErrorKind::Invalid(format!("KTX2: {e:?}"));
    let attempt = || {
        let transcoder = Transcoder::new(bytes).map_err(invalid)?;
        match transcoder.source_format() {
            SourceFormat::Etc1s | SourceFormat::UastcLdr => {
                transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(invalid)
            }
            other => Err(ErrorKind::Unsupported(format!("KTX2: {other:?} is not read, only ETC1S and UASTC"))),
        }
    };
    // The decoder checks what it reads; but it is young, and nothing in a file may end the program.
    std::panic::catch_unwind(attempt).unwrap_or_else(|_| Err(ErrorKind::Invalid("KTX2: the decoder failed".into())))
}

#[cfg(not(feature = "ktx2"))]
fn transcode(_: &[u8]) -> Result<Vec<u8>, ErrorKind> {
    Err(ErrorKind::Unsupported("KTX2 images are read only where firsthit is built with its feature `ktx2`".into()))
}

fn word(bytes: &[u8], at: usize) -> Result<u32, ErrorKind> {
    field(bytes, at).map(u32::from_le_bytes)
}

fn long(bytes: &[u8], at: usize) -> Result<u64, ErrorKind> {
    field(bytes, at).map(u64::from_le_bytes)
}

fn field<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N], ErrorKind> {
    let field = bytes.get(at..).and_then(|rest| rest.first_chunk());
    field.copied().ok_or_else(|| ErrorKind::Invalid("KTX2: the header is cut off".into()))
}
