//! Pictures from files, as linear radiance: OpenEXR, Radiance HDR, PNG and the like, and NumPy arrays.

use std::path::Path;

use firsthit_import::scene::Pixels;
use firsthit_import::{ErrorKind, ImportError, Limits, image};
use firsthit_render::{film::Picture, view::srgb_to_linear};

/// Reads a picture. OpenEXR, Radiance HDR and NPY hold radiance; 8 and 16 bits are taken as sRGB.
///
/// An NPY file holds an array of 32- or 64-bit floats in C order, rows from the top: `[height, width, channels]` with
/// 1, 3 or 4 channels, or `[height, width]` in grey.
///
/// # Errors
/// If the file cannot be read, or is no picture.
pub fn read(path: impl AsRef<Path>) -> Result<Picture, ImportError> {
    let path = path.as_ref();
    let limits = Limits::default();
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        let meta = std::fs::metadata(path).map_err(|e| ImportError::io(path, e))?;
        if meta.len() > limits.image_bytes {
            let kind = ErrorKind::Limit(format!("{} bytes are more than {}", meta.len(), limits.image_bytes));
            return Err(ImportError::new(path, "", kind));
        }
        let bytes = std::fs::read(path).map_err(|e| ImportError::io(path, e))?;
        return npy(&bytes).map_err(|cause| ImportError::new(path, "", ErrorKind::Invalid(cause)));
    }
    let image = image::read(path, &limits)?;
    let linear = |[r, g, b, a]: [f32; 4]| [srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b), a];
    let pixels = match &image.pixels {
        Pixels::Rgba8(p) => p.iter().map(|p| linear(p.map(|v| f32::from(v) / 255.0))).collect(),
        Pixels::Rgba16(p) => p.iter().map(|p| linear(p.map(|v| f32::from(v) / 65535.0))).collect(),
        Pixels::Rgb32F(p) => p.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect(),
    };
    Ok(Picture { width: image.width, height: image.height, pixels })
}

/// Reads an array as NumPy writes it: magic, version, length of the header, a Python dictionary, the data.
fn npy(bytes: &[u8]) -> Result<Picture, String> {
    let short = || "the file ends too early".to_owned();
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("not a NumPy array")?;
    /// The bytes of the header's length.
    fn size<const N: usize>(rest: &[u8]) -> Option<&[u8; N]> {
        rest.get(2..)?.first_chunk()
    }
    let (length, start) = match rest.first().ok_or_else(short)? {
        1 => (usize::from(u16::from_le_bytes(*size(rest).ok_or_else(short)?)), 4),
        2 | 3 => (u32::from_le_bytes(*size(rest).ok_or_else(short)?) as usize, 6),
        other => return Err(format!("version {other} of NumPy's format is not known")),
    };
    let header = rest.get(start..).and_then(|r| r.get(..length)).ok_or_else(short)?;
    let header = std::str::from_utf8(header).map_err(|_| "the header is no text")?;
    let data = &rest[start + length..];

    let value = |key: &str| {
        let after = header.split_once(&format!("'{key}':")).ok_or_else(|| format!("the header lacks '{key}'"))?.1;
        Ok::<_, String>(after.trim_start())
    };
    if value("fortran_order")?.starts_with("True") {
        return Err("an array in Fortran order is not read: use numpy.ascontiguousarray".into());
    }
    let kind = value("descr")?;
    let numbers: Vec<f32> = if kind.starts_with("'<f4'") {
        data.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
    } else if kind.starts_with("'<f8'") {
        data.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b) as f32).collect()
    } else {
        return Err("only arrays of 32- and 64-bit little-endian floats are read".into());
    };
    let shape = value("shape")?.strip_prefix('(').and_then(|s| s.split_once(')')).ok_or("the shape is no tuple")?.0;
    let sides: Result<Vec<u32>, _> =
        shape.split(',').map(str::trim).filter(|s| !s.is_empty()).map(str::parse).collect();
    let sides = sides.map_err(|_| format!("the shape ({shape}) is not one of a picture"))?;
    let (height, width, channels) = match sides[..] {
        [height, width] => (height, width, 1),
        [height, width, channels @ (1 | 3 | 4)] => (height, width, channels as usize),
        _ => return Err(format!("the shape ({shape}) is not one of a picture")),
    };
    let count = (u64::from(width) * u64::from(height)).checked_mul(channels as u64);
    if width == 0 || height == 0 || count != Some(numbers.len() as u64) {
        return Err(format!("the shape ({shape}) does not fit {} numbers", numbers.len()));
    }
    let pixel = |p: &[f32]| match *p {
        [r, g, b, a] => [r, g, b, a],
        [r, g, b] => [r, g, b, 1.0],
        _ => [p[0], p[0], p[0], 1.0],
    };
    Ok(Picture { width, height, pixels: numbers.chunks_exact(channels).map(pixel).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(kind: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
    }

    #[test]
    fn numpy_arrays_are_read_row_by_row() {
        let floats: Vec<u8> = (0..6).flat_map(|i| (i as f32).to_le_bytes()).collect();
        let p = npy(&array("<f4", "False", "(1, 2, 3)", &floats)).unwrap();
        assert_eq!((p.width, p.height), (2, 1));
        assert_eq!(p.pixels, [[0.0, 1.0, 2.0, 1.0], [3.0, 4.0, 5.0, 1.0]]);
        let doubles: Vec<u8> = [0.5f64, 2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let p = npy(&array("<f8", "False", "(2, 1)", &doubles)).unwrap();
        assert_eq!((p.width, p.height, p.pixels), (1, 2, vec![[0.5, 0.5, 0.5, 1.0], [2.0, 2.0, 2.0, 1.0]]));
    }

    #[test]
    fn what_is_no_picture_is_refused_by_its_reason() {
        let floats = [0u8; 24];
        for (bytes, cause) in [
            (array("<f4", "True", "(1, 2, 3)", &floats), "Fortran"),
            (array("<i4", "False", "(1, 2, 3)", &floats), "floats"),
            (array("<f4", "False", "(1, 3, 3)", &floats), "does not fit 6 numbers"),
            (array("<f4", "False", "(6,)", &floats), "not one of a picture"),
            (array("<f4", "False", "(4294967295, 4294967295, 4)", &floats), "does not fit"),
            (array("<f4", "False", "(0, 2, 3)", &[]), "does not fit"),
            (b"\x93NUMPY\x01\x00\xff\xff{}".to_vec(), "too early"),
            (b"\x93NUMPY\x01".to_vec(), "too early"),
            (b"PNG".to_vec(), "not a NumPy array"),
        ] {
            let error = npy(&bytes).unwrap_err();
            assert!(error.contains(cause), "{error}");
        }
    }
}
