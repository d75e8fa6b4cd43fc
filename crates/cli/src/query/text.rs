//! Lines of text, each with the numbers of a row.

use std::collections::BTreeMap;

use serde_json::value::RawValue;

use super::source::Columns;

/// How a line is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Notation {
    /// Numbers with commas between.
    Csv,
    /// A JSON array of numbers, or an object with the names of the columns.
    Json,
}

impl Notation {
    /// Whether there is nothing on the line.
    pub(super) fn is_empty(self, line: &str) -> bool {
        let line = line.trim();
        line.is_empty() || self == Self::Csv && line.starts_with('#')
    }

    /// The row of a line; what was left out has its default. The error says which text is wrong, and why.
    pub(super) fn parse<const N: usize>(self, line: &str, columns: &Columns<N>) -> Result<[f64; N], String> {
        match self {
            Self::Csv => numbers(line.split(','), columns),
            Self::Json if line.trim_start().starts_with('{') => object(line, columns),
            Self::Json => {
                let values: Vec<&RawValue> = serde_json::from_str(line).map_err(|e| wrong(line, &e))?;
                numbers(values.into_iter().map(RawValue::get), columns)
            }
        }
    }
}

/// Whether a line is that of the names; an error if it is neither that nor may be a row.
pub(super) fn is_header<const N: usize>(line: &str, columns: &Columns<N>) -> Result<bool, String> {
    let mut fields = line.split(',').map(str::trim);
    if fields.clone().next().is_some_and(|first| first.parse::<f64>().is_ok()) {
        return Ok(false);
    }
    let mut names = columns.names.iter();
    let count = fields.clone().count();
    let same = fields.all(|f| names.next().is_some_and(|n| f.eq_ignore_ascii_case(n)));
    if same && columns.takes(count) {
        return Ok(true);
    }
    Err(format!("'{}' is neither a row of numbers nor the names {}", shortened(line), columns.in_words()))
}

fn numbers<'a, const N: usize>(texts: impl Iterator<Item = &'a str>, columns: &Columns<N>) -> Result<[f64; N], String> {
    let mut row = columns.defaults;
    let mut count = 0;
    for text in texts {
        if let Some(slot) = row.get_mut(count) {
            *slot = number(text, count, columns)?;
        }
        count += 1;
    }
    columns.check(count)?;
    Ok(row)
}

fn object<const N: usize>(line: &str, columns: &Columns<N>) -> Result<[f64; N], String> {
    let values: BTreeMap<String, &RawValue> = serde_json::from_str(line).map_err(|e| wrong(line, &e))?;
    if let Some(key) = values.keys().find(|key| !columns.names.contains(&key.as_str())) {
        return Err(format!("'{}' is none of the names {}", shortened(key), columns.in_words()));
    }
    let mut row = columns.defaults;
    for (i, slot) in row.iter_mut().enumerate() {
        let name = columns.names[i];
        match values.get(name) {
            Some(value) => *slot = number(value.get(), i, columns)?,
            None if i < columns.least => return Err(format!("there is no '{name}'")),
            None => {}
        }
    }
    Ok(row)
}

/// The number of column `i`. JSON's null is what is left out.
fn number<const N: usize>(text: &str, i: usize, columns: &Columns<N>) -> Result<f64, String> {
    let text = text.trim();
    if i >= columns.least && text == "null" {
        return Ok(columns.defaults[i]);
    }
    text.parse().map_err(|_| format!("'{}' is not a number (column {})", shortened(text), columns.names[i]))
}

fn wrong(line: &str, error: &serde_json::Error) -> String {
    format!("'{}' is not a JSON array of numbers or an object: {error}", shortened(line))
}

/// So much of a text as fits into a message.
pub(super) fn shortened(text: &str) -> String {
    const MOST: usize = 60;
    let text = text.trim();
    if text.chars().count() <= MOST { text.into() } else { text.chars().take(MOST).collect::<String>() + "..." }
}

#[cfg(test)]
mod tests {
    use super::super::RAYS;
    use super::*;

    const INF: f64 = f64::INFINITY;

    #[test]
    fn rows_in_every_notation() {
        for (line, row) in [
            ("1,2,3,4,5,6", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0, INF]),
            (" 1 , -2e3 ,3,4,5,.5, -1 , inf\r", [1.0, -2e3, 3.0, 4.0, 5.0, 0.5, -1.0, INF]),
            ("0.1,0.2,0.30000000000000004,1e-320,5,6,7,8", [0.1, 0.2, 0.1 + 0.2, 1e-320, 5.0, 6.0, 7.0, 8.0]),
        ] {
            assert_eq!(Notation::Csv.parse(line, &RAYS), Ok(row), "{line}");
        }
        let row = [1.0, 2.0, 0.1 + 0.2, 4.0, 5.0, 6.0, 0.0, 9.0];
        for line in [
            "[1, 2, 0.30000000000000004, 4, 5, 6, null, 9]",
            r#" {"dx":4,"dy":5,"dz":6,"ox":1,"oy":2,"oz":0.30000000000000004,"t_max":9} "#,
        ] {
            assert_eq!(Notation::Json.parse(line, &RAYS), Ok(row), "{line}");
        }
    }

    #[test]
    fn bad_rows_are_told_by_their_text() {
        for (notation, line, words) in [
            (Notation::Csv, "1,2,3,x,5,6", "'x' is not a number (column dx)"),
            (Notation::Csv, "1,2,3,,5,6", "'' is not a number (column dx)"),
            (Notation::Csv, "1,2,3,4,5", "5 numbers; a ray has 6 or 8"),
            (Notation::Csv, "1,2,3,4,5,6,7", "7 numbers"),
            (Notation::Csv, "1,2,3,4,5,6,7,8,9", "9 numbers"),
            (Notation::Csv, "1 2 3 4 5 6", "'1 2 3 4 5 6' is not a number (column ox)"),
            (Notation::Json, "[1,2,3,4,5,\"6\"]", "'\"6\"' is not a number (column dz)"),
            (Notation::Json, "[null,2,3,4,5,6]", "'null' is not a number (column ox)"),
            (Notation::Json, "[1,2,3,4,5,6", "not a JSON array"),
            (Notation::Json, "{\"ox\":1}", "there is no 'oy'"),
            (Notation::Json, "{\"x\":1}", "'x' is none of the names ox,oy,oz,dx,dy,dz[,t_min,t_max]"),
        ] {
            let error = notation.parse(line, &RAYS).unwrap_err();
            assert!(error.contains(words), "{line}: {error}");
        }
    }

    #[test]
    fn names_may_come_first() {
        assert_eq!(is_header("OX, oy,oz,dx,dy,dz", &RAYS), Ok(true));
        assert_eq!(is_header("ox,oy,oz,dx,dy,dz,t_min,t_max\r", &RAYS), Ok(true));
        assert_eq!(is_header("1,2,3", &RAYS), Ok(false));
        for line in ["dx,dy,dz,ox,oy,oz", "ox,oy,oz", "ox,oy,oz,dx,dy,dz,t_min", "hello"] {
            assert!(is_header(line, &RAYS).unwrap_err().contains("neither"), "{line}");
        }
    }
}
