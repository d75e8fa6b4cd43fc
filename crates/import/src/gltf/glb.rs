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

/// Takes a GLB apart. Chunks of unknown kinds are passed over, as the specification asks.
///
/// # Errors
/// What is wrong, with the byte at which it stands.
pub(super) fn split(bytes: &[u8]) -> Result<Glb<'_>, String> {
    let length = word(bytes, 8).ok_or("the header is cut off")? as usize;
    if length > bytes.len() {
        return Err(format!("the header says {length} bytes, but the file has {}", bytes.len()));
    }
    // What comes after the end is no part of it.
    let bytes = &bytes[..length];
    let mut glb = Glb { json: &[], bin: None };
    let (mut at, mut number) = (12, 0);
    while at < length {
        let (Some(size), Some(kind)) = (word(bytes, at), word(bytes, at + 4)) else {
            return Err(format!("the chunk header at byte {at} is cut off"));
        };
        let start = at + 8;
        let Some(data) = bytes.get(start..).and_then(|rest| rest.get(..size as usize)) else {
            return Err(format!("the chunk at byte {at} says {size} bytes, but {} follow", length - start));
        };
        match (number, kind) {
            (0, JSON) => glb.json = data,
            (0, _) => return Err(format!("the first chunk is {}, not JSON", kind_name(kind))),
            (1, BIN) => glb.bin = Some(data),
            (_, JSON | BIN) => return Err(format!("chunk {number} is a misplaced {}", kind_name(kind))),
            _ => {}
        }
        at = start + size as usize;
        number += 1;
    }
    if number == 0 { Err("there is no JSON chunk".into()) } else { Ok(glb) }
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
