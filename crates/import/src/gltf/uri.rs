//! Data URIs (RFC 2397): base64 (RFC 4648) or percent escapes.

use crate::files::percent_escape;

/// What a URI says.
pub(super) enum Uri<'a> {
    /// Data in the URI itself.
    Data(Vec<u8>),
    /// The name of a file.
    File(&'a str),
}

/// Takes a URI apart; data are decoded.
///
/// # Errors
/// If the data of a data URI cannot be decoded.
pub(super) fn parse(uri: &str) -> Result<Uri<'_>, String> {
    let Some(rest) = uri.strip_prefix("data:") else { return Ok(Uri::File(uri)) };
    let (kind, data) = rest.split_once(',').ok_or("a data URI without a comma")?;
    let data = if kind.ends_with(";base64") { base64(data.as_bytes())? } else { percent(data.as_bytes())? };
    Ok(Uri::Data(data))
}

/// Undoes percent escapes.
fn percent(text: &[u8]) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text;
    while let [first, tail @ ..] = rest {
        let (byte, after) = match first {
            b'%' => percent_escape(rest).ok_or("a '%' in a data URI that is not followed by two hexadecimal digits")?,
            _ => (*first, tail),
        };
        bytes.push(byte);
        rest = after;
    }
    Ok(bytes)
}

/// Decodes base64 strictly: no white space, whole quads, padding only at the end. Bits that padding cuts off are not
/// looked at.
fn base64(text: &[u8]) -> Result<Vec<u8>, String> {
    let data = match text {
        [data @ .., b'=', b'='] | [data @ .., b'='] => data,
        data => data,
    };
    // Exporters that leave the padding out are understood; a lone last character means nothing.
    if data.len() % 4 == 1 || (data.len() < text.len() && !text.len().is_multiple_of(4)) {
        return Err(format!("base64 of {} characters is cut off", text.len()));
    }
    let mut bytes = Vec::with_capacity(data.len() / 4 * 3 + 2);
    for (i, quad) in data.chunks(4).enumerate() {
        let mut bits = 0_u32;
        for (k, &c) in quad.iter().enumerate() {
            let six = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return Err(format!("byte {c:#04x} at {} is not base64", 4 * i + k)),
            };
            bits |= u32::from(six) << (18 - 6 * k);
        }
        bytes.extend(&bits.to_be_bytes()[1..quad.len()]);
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_agrees_with_the_vectors_of_rfc_4648() {
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy", "foobar"),
            ("Zm9vYg", "foob"),
        ] {
            assert_eq!(base64(text.as_bytes()).unwrap(), bytes.as_bytes(), "{text}");
        }
        assert_eq!(base64(b"+/+/").unwrap(), [0xfb, 0xff, 0xbf]);
    }

    #[test]
    fn what_is_no_base64_is_an_error() {
        for text in ["Z", "Zg=", "Zm9v=", "Zm=v", "Zm 9v", "Zm9v\n", "Zm-_", "===="] {
            assert!(base64(text.as_bytes()).is_err(), "{text:?}");
        }
    }

    #[test]
    fn data_uris_are_told_from_files() {
        assert!(matches!(parse("a%20b.bin"), Ok(Uri::File("a%20b.bin"))));
        assert!(matches!(parse("data:application/octet-stream;base64,Zm9v"), Ok(Uri::Data(d)) if d == b"foo"));
        assert!(matches!(parse("data:text/plain,a%20%fF"), Ok(Uri::Data(d)) if d == b"a \xff"));
        assert!(parse("data:,%").is_err() && parse("data:,%4").is_err() && parse("data:,%é").is_err());
        assert!(parse("data:,%+1").is_err(), "a sign is no digit");
        assert!(parse("data:;base64").is_err());
    }
}
