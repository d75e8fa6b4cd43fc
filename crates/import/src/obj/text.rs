//! The text of OBJ and MTL files: encodings, logical lines, words and numbers.

use std::borrow::Cow;

/// The text in UTF-8, without its byte order mark. Without a mark the bytes are left as they are.
pub(super) fn to_utf8(bytes: Vec<u8>) -> Vec<u8> {
    let utf16 = |rest: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = rest.chunks_exact(2).map(|b| unit([b[0], b[1]]));
        char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect::<String>().into_bytes()
    };
    match bytes.as_slice() {
        [0xef, 0xbb, 0xbf, rest @ ..] => rest.to_vec(),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ => bytes,
    }
}

/// A name or path: UTF-8, or else Latin-1, in which every byte is a character.
pub(super) fn name(bytes: &[u8]) -> Cow<'_, str> {
    let bytes = bytes.trim_ascii();
    match std::str::from_utf8(bytes) {
        Ok(s) => Cow::Borrowed(s),
        Err(_) => Cow::Owned(bytes.iter().map(|&b| char::from(b)).collect()),
    }
}

/// Logical lines: ended by LF, CR LF or CR, and joined where a line ends in a backslash.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    /// Number of the next physical line.
    next: u32,
    joined: Vec<u8>,
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { rest: text, next: 1, joined: Vec::new() }
    }

    /// The next line and the number of its first physical line, from 1.
    pub(super) fn next(&mut self) -> Option<(u32, &[u8])> {
        if self.rest.is_empty() {
            return None;
        }
        let number = self.next;
        let line = self.physical();
        if !continues(line) {
            return Some((number, line));
        }
        self.joined.clear();
        self.joined.extend_from_slice(&line[..line.len() - 1]);
        while !self.rest.is_empty() {
            let line = self.physical();
            self.joined.push(b' ');
            if !continues(line) {
                self.joined.extend_from_slice(line);
                break;
            }
            self.joined.extend_from_slice(&line[..line.len() - 1]);
        }
        Some((number, &self.joined))
    }

    fn physical(&mut self) -> &'a [u8] {
        let end = self.rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = match rest {
            [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
            [] => rest,
        };
        self.next = self.next.saturating_add(1);
        line
    }
}

fn continues(line: &[u8]) -> bool {
    line.last() == Some(&b'\\')
}

/// The first word of a line and what follows it.
pub(super) fn split_keyword(line: &[u8]) -> (&[u8], &[u8]) {
    let line = line.trim_ascii_start();
    line.split_at(line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len()))
}

/// Words between white space, up to a comment. A `#` inside a word starts none: names such as `Material#25` exist.
pub(super) fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).take_while(|w| w[0] != b'#')
}

/// A number, perhaps not a finite one. The C library of Windows writes those as `1.#INF` or `-1.#IND`.
pub(crate) fn number(word: &[u8]) -> Option<f64> {
    match std::str::from_utf8(word).ok()?.parse() {
        Ok(x) => Some(x),
        Err(_) if word.windows(2).any(|w| w == b".#") => Some(f64::NAN),
        Err(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &[u8]) -> Vec<(u32, String)> {
        let mut lines = Lines::new(text);
        let mut out = Vec::new();
        while let Some((n, line)) = lines.next() {
            out.push((n, name(line).into_owned()));
        }
        out
    }

    #[test]
    fn every_line_ending_counts() {
        let expected: Vec<_> = [(1, "a"), (2, ""), (3, "b")].map(|(n, s)| (n, s.to_owned())).to_vec();
        for text in ["a\n\nb", "a\r\n\r\nb\r\n", "a\r\rb\r"] {
            assert_eq!(lines(text.as_bytes()), expected);
        }
    }

    #[test]
    fn continued_lines_are_one_line_with_the_first_number() {
        let expected: Vec<_> = [(1, "f 1  2  3"), (4, "g")].map(|(n, s)| (n, s.to_owned())).to_vec();
        assert_eq!(lines(b"f 1 \\\n2 \\\r\n3\ng"), expected);
        assert_eq!(lines(b"f 1 2\\"), [(1, "f 1 2".to_owned())]);
    }

    #[test]
    fn text_in_utf16_is_read() {
        let mut le = vec![0xff, 0xfe];
        le.extend("v 1\u{e9}\n".encode_utf16().flat_map(u16::to_le_bytes));
        let mut be = vec![0xfe, 0xff];
        be.extend("v 1\u{e9}\n".encode_utf16().flat_map(u16::to_be_bytes));
        for bytes in [le, be, b"\xef\xbb\xbfv 1\xc3\xa9\n".to_vec()] {
            assert_eq!(to_utf8(bytes), "v 1\u{e9}\n".as_bytes());
        }
        assert_eq!(name(b" caf\xe9 "), "caf\u{e9}", "Latin-1");
    }

    #[test]
    fn numbers_of_all_dialects() {
        for (text, x) in [("1", 1.0), ("-.5", -0.5), ("+2.", 2.0), ("1e3", 1000.0), ("1E-3", 0.001)] {
            assert_eq!(number(text.as_bytes()), Some(x));
        }
        for text in ["nan", "-nan", "inf", "-inf", "1.#INF", "-1.#IND", "1.#QNAN", "1e999"] {
            assert!(number(text.as_bytes()).is_some_and(|x| !x.is_finite()), "{text}");
        }
        for text in ["", "x", "1,5", "1/2", "--1"] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn a_comment_ends_the_words() {
        let w: Vec<_> = words(b" 1\t2#3  # 4 5").collect();
        assert_eq!(w, [&b"1"[..], b"2#3"]);
    }
}
