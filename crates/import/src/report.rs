//! What was read only in part: warnings are data, not log lines.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

use crate::AnimationInfo;

/// Something in a file that could not be honoured, though reading went on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file.
    pub file: PathBuf,
    /// Where in the file, as in [`crate::ImportError`]; may be empty.
    pub place: String,
    /// What is wrong and what was done about it.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.file.display())?;
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)
    }
}

/// How far an extension of a format is honoured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Everything it says.
    Full,
    /// Some of what it says.
    Partial,
    /// Nothing, and nothing in the picture changes by it.
    Ignored,
    /// Nothing, though it would matter.
    Unsupported,
}

impl Support {
    /// The word used in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Partial => "partial",
            Self::Ignored => "ignored",
            Self::Unsupported => "unsupported",
        }
    }
}

/// An extension that a file names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExtensionUse {
    /// Its name.
    pub name: String,
    /// Whether the file cannot do without it.
    pub required: bool,
    /// How far it is honoured.
    pub support: Support,
    /// One line about what is done with it.
    pub note: &'static str,
}

/// What came up while reading.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The first warnings, in the order of the file (at most 100 of them).
    pub warnings: Vec<Warning>,
    /// How many more there were.
    pub more_warnings: u64,
    /// The files that were read, by their canonical paths: the one that was opened and all that it led to. Whoever
    /// writes a file can make sure that it is none of them.
    pub files: BTreeSet<PathBuf>,
    /// The extensions that the file names.
    pub extensions: Vec<ExtensionUse>,
    /// Names of the file's variants: the same shapes in other materials.
    pub variants: Vec<String>,
    /// The file's animations.
    pub animations: Vec<AnimationInfo>,
    /// Names of the scenes of the file (glTF's `scenes`).
    pub scenes: Vec<String>,
    /// Triangles after instancing over *every* node of every scene in the file, also those that are not shown.
    pub triangles_all_scenes: u64,
}

impl Report {
    /// Notes a warning. Of what is longer than can be read, the middle is left out: files may have names of any length.
    pub fn warn(&mut self, file: impl AsRef<Path>, place: impl Into<String>, message: impl Into<String>) {
        const KEPT: usize = 100;
        if self.warnings.len() < KEPT {
            let file = file.as_ref().to_owned();
            self.warnings.push(Warning { file, place: readable(place.into()), message: readable(message.into()) });
        } else {
            self.more_warnings += 1;
        }
    }

    /// Notes a file that is read. One that is not there is not.
    pub(crate) fn reads(&mut self, file: &Path) {
        self.files.extend(file.canonicalize());
    }

    /// Takes over what another file's reading brought up, but for the triangles: how many there are depends on how often
    /// its content is placed.
    pub fn absorb(&mut self, other: Self) {
        for w in other.warnings {
            self.warn(w.file, w.place, w.message);
        }
        self.more_warnings += other.more_warnings;
        self.files.extend(other.files);
        for e in other.extensions {
            if !self.extensions.iter().any(|x| x.name == e.name) {
                self.extensions.push(e);
            }
        }
        self.animations.extend(other.animations);
    }
}

/// At most some hundred characters of a text: its two ends.
fn readable(text: String) -> String {
    const END: usize = 256;
    let (head, tail) = (text.char_indices().nth(END), text.char_indices().rev().nth(END - 1));
    match (head, tail) {
        (Some((head, _)), Some((tail, _))) if head < tail => format!("{} ... {}", &text[..head], &text[tail..]),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_words_lose_their_middle() {
        let said = |text: &str| readable(text.into());
        assert_eq!(said("as it is"), "as it is");
        assert_eq!(said(&"\u{fc}".repeat(512)), "\u{fc}".repeat(512));
        let long = format!("{}{}{}", "a".repeat(256), "x".repeat(9000), "\u{fc}".repeat(256));
        assert_eq!(said(&long), format!("{} ... {}", "a".repeat(256), "\u{fc}".repeat(256)));
    }
}
