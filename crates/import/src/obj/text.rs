//! The text of OBJ and MTL files: encodings, logical lines, words and numbers.

use std::borrow::Cow;

use crate::ImportError;
use crate::files::Input;

/// A file in blocks of whole logical lines, so that not all of its text is held at once.
pub(super) struct Blocks<'a> {
    input: Input<'a>,
    buffer: Vec<u8>,
    /// What of the buffer the last block was.
    used: usize,
    ended: bool,
}

/// About so many bytes are held at once: they stay in the processor's cache.
const BLOCK: usize = 1 << 18;

impl<'a> Blocks<'a> {
    /// The text is brought into UTF-8, without its byte order mark.
    ///
    /// # Errors
    /// As for [`Blocks::next`].
    pub(super) fn new(mut input: Input<'a>) -> Result<Self, ImportError> {
        let mut buffer = Vec::new();
        let mut ended = !input.read(BLOCK, &mut buffer)?;
        if matches!(buffer.as_slice(), [0xfe, 0xff, ..] | [0xff, 0xfe, ..]) {
            // Rare enough to be held as a whole.
            while input.read(buffer.len(), &mut buffer)? {}
            ended = true;
        }
        Ok(Self { input, buffer: to_utf8(buffer), used: 0, ended })
    }

    /// The next lines; `None` at the end.
    ///
    /// # Errors
    /// If the file cannot be read or is too large.
    pub(super) fn next(&mut self) -> Result<Option<&[u8]>, ImportError> {
        self.buffer.drain(..self.used);
        self.used = if self.ended { self.buffer.len() } else { end_of_lines(&self.buffer) };
        while self.used == 0 && !self.ended {
            // A longer and longer line is not searched again and again for its end.
            self.ended = !self.input.read(self.buffer.len().max(BLOCK), &mut self.buffer)?;
            self.used = if self.ended { self.buffer.len() } else { end_of_lines(&self.buffer) };
        }
        Ok((self.used > 0).then(|| &self.buffer[..self.used]))
    }
}

/// Where the last logical line ends that is whole for certain.
fn end_of_lines(text: &[u8]) -> usize {
    let mut end = text.len();
    while let Some(at) = text[..end].iter().rposition(|&b| b == b'\n' || b == b'\r') {
        let before = match &text[..at] {
            [before @ .., b'\r'] if text[at] == b'\n' => before,
            before => before,
        };
        // After a CR at the end an LF may follow.
        if !continues(before) && (text[at] == b'\n' || at + 1 < text.len()) {
            return at + 1;
        }
        end = at;
    }
    0
}

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
    /// The lines of a text that begins with line number `first`.
    pub(super) fn new(text: &'a [u8], first: u32) -> Self {
        Self { rest: text, next: first, joined: Vec::new() }
    }

    /// The number of the next physical line.
    pub(super) fn number(&self) -> u32 {
        self.next
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

/// The number that a text begins with, if it is written plainly, and what follows it. White space or the end does.
///
/// Below 2^53 the digits are exact as f64, as are the powers of ten to 10^22: their quotient is the nearest to the number
/// (Clinger, "How to read floating point numbers accurately", 1990). It is the same as [`number`] gives, sooner.
#[inline]
pub(super) fn plain_number(text: &[u8]) -> Option<(f64, &[u8])> {
    const MOST: u64 = 1 << 53;
    const POWERS: [f64; 23] = [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19,
        1e20, 1e21, 1e22,
    ];
    let (negative, digits) = match text {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, text),
    };
    let (mut mantissa, mut count, mut point) = (0_u64, 0, None);
    let mut at = 0;
    while let Some(&byte) = digits.get(at) {
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            count += 1;
        } else if byte == b'.' && point.is_none() {
            point = Some(count);
        } else if byte.is_ascii_whitespace() {
            break;
        } else {
            return None;
        }
        at += 1;
    }
    // 19 digits do not overflow.
    if !(1..=19).contains(&count) || mantissa > MOST {
        return None;
    }
    let value = mantissa as f64 / POWERS[point.map_or(0, |before| count - before)];
    Some((if negative { -value } else { value }, &digits[at..]))
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
        let mut lines = Lines::new(text, 1);
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
    fn plain_numbers_are_the_nearest() {
        let texts = [
            "0",
            "-0",
            "7",
            "1.",
            ".5",
            "-.5",
            "0.1",
            "0.032027",
            "-0.0503644",
            "123456789.123",
            "9007199254740992",
            "9007199254740993",
            "0.1234567890123456",
            "12345678901234567890",
            "0.0000000000000000001",
            "1.5e3",
            "+2",
            ".",
            "-",
            "",
            "1.2.3",
            "nan",
            "1x",
            "179.99999999999997",
            "3.4028235",
            "0000000000000000000001",
        ];
        for text in texts {
            let Some((value, rest)) = plain_number(text.as_bytes()) else { continue };
            let nearest = text.parse::<f64>().map(f64::to_bits);
            assert_eq!((Ok(value.to_bits()), rest), (nearest, &b""[..]), "{text}");
        }
        assert_eq!(plain_number(b"-0.25\t7"), Some((-0.25, &b"\t7"[..])));
        assert!(plain_number(b"0.1234567890123456").is_some_and(|(x, _)| x == 0.1234567890123456));
    }

    proptest::proptest! {
        #[test]
        fn plain_numbers_are_what_the_standard_library_reads(text in "-?[0-9]{0,12}(\\.[0-9]{0,12})?") {
            if let Some((value, _)) = plain_number(text.as_bytes()) {
                proptest::prop_assert_eq!(Ok(value.to_bits()), text.parse::<f64>().map(f64::to_bits));
            }
        }

        /// Cut anywhere, the lines are the same.
        #[test]
        fn blocks_are_whole_lines(text in "[a\\\\\r\n ]{0,40}", at in 0..40_usize) {
            let text = text.as_bytes();
            let end = end_of_lines(&text[..at.min(text.len())]);
            let mut joined = lines(&text[..end]);
            let first = joined.len();
            let mut rest = Lines::new(&text[end..], 1);
            while let Some((n, line)) = rest.next() {
                joined.push((n, name(line).into_owned()));
            }
            let whole: Vec<_> = lines(text).into_iter().map(|(_, line)| line).collect();
            proptest::prop_assert_eq!(whole, joined.into_iter().map(|(_, line)| line).collect::<Vec<_>>(), "{}", first);
        }
    }

    #[test]
    fn a_comment_ends_the_words() {
        let w: Vec<_> = words(b" 1\t2#3  # 4 5").collect();
        assert_eq!(w, [&b"1"[..], b"2#3"]);
    }
}
