//! The binary container (GLB): a header and chunks, glTF 2.0 specification section 4.

/// What a GLB file holds.
pub(super) struct Glb<'a> {
    /// The JSON text.
    pub(super) json: &'a [u8],
    /// The binary chunk.
    pub(super) bin: Option<&'a [u8]>,
}

/// Whether a file is a GLB, by its first bytes.
pub(super) fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

/// The container's version: the 1 of glTF 1.0 or the 2 of glTF 2.0.
pub(super) fn version(bytes: &[u8]) -> Option<u32> {
    word(bytes, 4)
}

/// What a file that is called a GLB begins with, if that is neither a GLB's first word nor JSON.
pub(super) fn wrong_magic(bytes: &[u8]) -> Option<String> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let is_json = text.iter().find(|b| !b.is_ascii_whitespace()).is_some_and(|&b| b == b'{');
    (!is_json && !is_glb(bytes)).then(|| bytes[..bytes.len().min(4)].escape_ascii().to_string())
}

/// Takes a GLB apart. Chunks of unknown kinds are passed over, as the specification asks.
///
/// # Errors
/// What is wrong, and the byte at which it stands.
pub(super) fn split(bytes: &[u8]) -> Result<Glb<'_>, (usize, String)> {
    let Some(length) = word(bytes, 8).map(|length| length as usize) else {
        return Err((0, format!("the header is cut off: the file has {} of its 12 bytes", bytes.len())));
    };
    if length > bytes.len() {
        return Err((8, format!("the header says {length} bytes, but the file has {}", bytes.len())));
    }
    if length < 20 {
        let cause = format!("the header says {length} bytes, but it and a JSON chunk have at least 20");
        return Err((8, cause));
    }
    // What comes after the end is no part of it.
    let bytes = &bytes[..length];
    let mut glb = Glb { json: &[], bin: None };
    let (mut at, mut number) = (12, 0);
    while at < length {
        let (Some(size), Some(kind)) = (word(bytes, at), word(bytes, at + 4)) else {
            return Err((at, format!("a chunk's header is cut off: {} of its 8 bytes are there", length - at)));
        };
        let start = at + 8;
        let Some(data) = bytes.get(start..).and_then(|rest| rest.get(..size as usize)) else {
            return Err((at, format!("the chunk says {size} bytes, but {} follow", length - start)));
        };
        match (number, kind) {
            (0, JSON) => glb.json = data,
            (0, _) => return Err((at + 4, format!("the first chunk is {}, expected JSON", kind_name(kind)))),
            (1, BIN) => glb.bin = Some(data),
            (_, JSON | BIN) => {
                let cause = format!("chunk {number} is {}; expected one JSON, then at most one BIN", kind_name(kind));
                return Err((at + 4, cause));
            }
            _ => {}
        }
        at = start + size as usize;
        number += 1;
    }
    Ok(glb)
}

const JSON: u32 = u32::from_le_bytes(*b"JSON");
const BIN: u32 = u32::from_le_bytes(*b"BIN\0");

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn kind_name(kind: u32) -> String {
    match kind {
        JSON => "JSON".into(),
        BIN => "BIN".into(),
        _ => format!("{kind:#010x}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, data) in chunks {
            body.extend((data.len() as u32).to_le_bytes());
            body.extend(*kind);
            body.extend(*data);
        }
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend((12 + body.len() as u32).to_le_bytes());
        file.extend(body);
        file
    }

    #[test]
    fn chunks_are_found_and_unknown_ones_passed_over() {
        let file = glb(&[(b"JSON", b"{}  "), (b"BIN\0", b"abcd"), (b"ODD!", b"1234")]);
        let found = split(&file).unwrap();
        assert_eq!((found.json, found.bin), (&b"{}  "[..], Some(&b"abcd"[..])));
        assert_eq!(split(&glb(&[(b"JSON", b"{}")])).unwrap().bin, None);
    }

    #[test]
    fn every_truncation_is_an_error() {
        let file = glb(&[(b"JSON", b"{}  "), (b"BIN\0", b"abcd")]);
        for end in 0..file.len() {
            assert!(split(&file[..end]).is_err(), "{end} bytes");
            // Also where the header's length is made to agree.
            let mut cut = file[..end].to_vec();
            if let Some(length) = cut.get_mut(8..12) {
                length.copy_from_slice(&(end as u32).to_le_bytes());
                // At byte 24 the JSON chunk is whole and no other has begun.
                assert_eq!(split(&cut).is_ok(), end == 24, "{end} bytes");
            }
        }
    }

    #[test]
    fn misplaced_chunks_are_errors() {
        for chunks in [
            &[(b"BIN\0", &b"abcd"[..])][..],
            &[(b"JSON", b"{}"), (b"JSON", b"{}")],
            &[(b"JSON", b"{}"), (b"BIN\0", b""), (b"BIN\0", b"")],
            &[],
        ] {
            assert!(split(&glb(chunks)).is_err());
        }
    }
}
