//! Values of the JSON as types: errors say where the value stands, what it is, and what glTF wants there, in the words
//! of JSON.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;
use serde_path_to_error::Segment;

use crate::ImportError;

/// Parses text; an error tells line and column, and what stands there.
pub(super) fn parse(file: &Path, text: &[u8]) -> Result<Value, ImportError> {
    serde_json::from_slice(text).map_err(|e| {
        if text.iter().all(u8::is_ascii_whitespace) {
            return ImportError::invalid(file, "", "is empty; expected JSON");
        }
        let (line, column) = (e.line(), e.column());
        let message = e.to_string();
        let message = message.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&message);
        let found = text.split(|&b| b == b'\n').nth(line.saturating_sub(1)).map_or("", |l| word_at(l, column));
        let found = if found.is_empty() { String::new() } else { format!(": found '{found}'") };
        ImportError::invalid(file, format!("line {line} column {column}"), format!("not JSON: {message}{found}"))
    })
}

/// The word of a line that ends in, or before, a column (counted from 1), shortened; empty if it is no plain text.
fn word_at(line: &[u8], column: usize) -> &str {
    const MOST: usize = 32;
    let part = |b: &u8| b.is_ascii_alphanumeric() || b"+-._".contains(b);
    let end = column.min(line.len());
    // Numbers are told of once they are read.
    let end = if end > 0 && !part(&line[end - 1]) && end >= 2 && part(&line[end - 2]) { end - 1 } else { end };
    let start = line[..end].iter().rposition(|b| !part(b)).map_or(0, |at| at + 1).min(end.saturating_sub(1));
    let length = line[start..].iter().position(|b| !part(b)).unwrap_or(line.len() - start).clamp(1, MOST);
    let word = line.get(start..(start + length).min(line.len())).unwrap_or_default();
    std::str::from_utf8(word).ok().filter(|w| w.chars().all(|c| c.is_ascii_graphic())).unwrap_or("")
}

/// Reads a value as a type; an error tells where in the value it is.
pub(super) fn typed<'de, T: Deserialize<'de>>(file: &Path, pointer: &str, value: &'de Value) -> Result<T, ImportError> {
    serde_path_to_error::deserialize(value).map_err(|e| {
        let mut place = pointer.to_owned();
        for segment in e.path() {
            match segment {
                Segment::Seq { index } => place += &format!("/{index}"),
                Segment::Map { key } | Segment::Enum { variant: key } => place += &format!("/{}", escaped(key)),
                Segment::Unknown => {}
            }
        }
        ImportError::invalid(file, place, in_words_of_json(&e.into_inner().to_string()))
    })
}

/// A key as a part of a JSON pointer.
fn escaped(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
}

/// What the model's reader says in the words of Rust.
fn in_words_of_json(message: &str) -> String {
    let found = message.replace("invalid type: map,", "invalid type: object,");
    let found = found.replace("invalid type: sequence,", "invalid type: array,");
    let Some((found, expected)) = found.rsplit_once(", expected ") else { return found };
    let plain = match expected {
        "index into child of root" => "the number of an element",
        "a sequence" => "an array",
        "a map" => "an object",
        "f32" | "f64" => "a number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number from 0",
        "a boolean" => "true or false",
        other if other.starts_with("struct ") => "an object",
        other => other,
    };
    format!("{found}, expected {plain}")
}

/// What holds one object in glTF wherever it stands.
const OBJECTS: &[&str] = &[
    "asset",
    "attributes",
    "baseColorTexture",
    "emissiveTexture",
    "metallicRoughnessTexture",
    "normalTexture",
    "occlusionTexture",
    "orthographic",
    "pbrMetallicRoughness",
    "perspective",
    "sparse",
];

/// The lists of the document.
const LISTS: &[&str] = &[
    "accessors",
    "buffers",
    "bufferViews",
    "cameras",
    "images",
    "materials",
    "meshes",
    "nodes",
    "samplers",
    "scenes",
    "skins",
    "textures",
];

/// Refuses arrays where objects belong, which the typed model would take for their values in some order.
///
/// # Errors
/// The first of them.
pub(super) fn check_objects(file: &Path, root: &Value) -> Result<(), ImportError> {
    for (key, list) in LISTS.iter().filter_map(|&key| Some((key, root.get(key)?))) {
        for (i, element) in list.as_array().into_iter().flatten().enumerate() {
            let place = format!("/{key}/{i}");
            if element.is_array() {
                return Err(an_array(file, place));
            }
            below(file, &place, element)?;
        }
    }
    Ok(())
}

fn below(file: &Path, place: &str, value: &Value) -> Result<(), ImportError> {
    for (key, value) in value.as_object().into_iter().flatten() {
        // These may hold anything.
        if key == "extras" || key == "extensions" {
            continue;
        }
        let place = format!("{place}/{}", escaped(key));
        if value.is_array() && OBJECTS.contains(&key.as_str()) {
            return Err(an_array(file, place));
        }
        for (i, element) in value.as_array().into_iter().flatten().enumerate() {
            if element.is_object() {
                below(file, &format!("{place}/{i}"), element)?;
            }
        }
        below(file, &place, value)?;
    }
    Ok(())
}

fn an_array(file: &Path, place: String) -> ImportError {
    ImportError::invalid(file, place, "invalid type: array, expected an object")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_json_has_its_line_and_its_word() {
        let error = |text: &str| parse(Path::new("a.gltf"), text.as_bytes()).unwrap_err().to_string();
        assert_eq!(error(" \n"), "a.gltf: is empty; expected JSON");
        assert_eq!(
            error("{\n  \"x\": 1e400\n}"),
            "a.gltf: line 2 column 12: not JSON: number out of range: found '1e400'"
        );
        assert_eq!(
            error("{\"x\": [1e400, 2]}"),
            "a.gltf: line 1 column 12: not JSON: number out of range: found '1e400'"
        );
        assert_eq!(error("{asset: 1}"), "a.gltf: line 1 column 2: not JSON: key must be a string: found 'asset'");
        assert_eq!(error("{\"a\": ?}"), "a.gltf: line 1 column 7: not JSON: expected value: found '?'");
        assert_eq!(error("{\"a\": "), "a.gltf: line 1 column 6: not JSON: EOF while parsing a value");
        // Any bytes, cut anywhere.
        for text in ["{\"ä\": \u{fffd}❤}", "\u{1}", "[\"\\q\"]", "{}}", "{\"a\"\n\n"] {
            for end in 0..=text.len() {
                drop(parse(Path::new(""), &text.as_bytes()[..end]));
            }
        }
    }

    #[test]
    fn wrong_types_are_said_in_words_of_json() {
        for (rust, json) in [
            ("invalid type: map, expected a sequence", "invalid type: object, expected an array"),
            (
                "invalid type: string \"x, expected f32\", expected index into child of root",
                "invalid type: string \"x, expected f32\", expected the number of an element",
            ),
            ("invalid type: integer `-1`, expected u32", "invalid type: integer `-1`, expected a whole number from 0"),
            ("invalid type: string \"m\", expected struct Material", "invalid type: string \"m\", expected an object"),
            ("missing field `count`", "missing field `count`"),
        ] {
            assert_eq!(in_words_of_json(rust), json);
        }
    }

    #[test]
    fn arrays_are_no_objects() {
        let error = |text: &str| check_objects(Path::new("a"), &serde_json::from_str(text).unwrap()).unwrap_err();
        assert_eq!(error(r#"{"buffers": [["byteLength"]]}"#).place, "/buffers/0");
        let material = r#"{"materials": [{}, {"pbrMetallicRoughness": [[1, 0, 0, 1]]}]}"#;
        assert_eq!(error(material).place, "/materials/1/pbrMetallicRoughness");
        let nested = r#"{"meshes": [{"primitives": [{"attributes": []}]}]}"#;
        assert_eq!(error(nested).place, "/meshes/0/primitives/0/attributes");
        // What may hold anything.
        let free = r#"{"extras": [[1]], "nodes": [{"extras": {"sparse": [1]}, "extensions": {"x": {"asset": []}}}]}"#;
        assert!(check_objects(Path::new("a"), &serde_json::from_str(free).unwrap()).is_ok());
    }
}
