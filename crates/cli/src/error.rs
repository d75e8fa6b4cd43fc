//! What ends the program early, as a person wants to read it: what, where, what to do.

use std::fmt;
use std::process::ExitCode;

use firsthit_import::{ErrorKind, ImportError};

/// Exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Done.
    Done = 0,
    /// Loading or rendering failed.
    Failed = 1,
    /// Wrong usage.
    Usage = 2,
    /// Interrupted: the image so far is written.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Why the program cannot go on.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) exit: Exit,
    message: String,
    hint: Option<String>,
}

impl Failure {
    /// Loading or rendering failed.
    pub(crate) fn failed(message: impl fmt::Display) -> Self {
        Self { exit: Exit::Failed, message: message.to_string(), hint: None }
    }

    /// The command line or the configuration file is wrong.
    pub(crate) fn usage(message: impl fmt::Display) -> Self {
        Self { exit: Exit::Usage, message: message.to_string(), hint: None }
    }

    /// What to do about it.
    pub(crate) fn hint(self, hint: impl fmt::Display) -> Self {
        Self { hint: Some(hint.to_string()), ..self }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.message)?;
        self.hint.as_ref().map_or(Ok(()), |hint| write!(f, "\n hint: {hint}"))
    }
}

impl From<ImportError> for Failure {
    fn from(error: ImportError) -> Self {
        let hint = match &error.kind {
            ErrorKind::Io(e) if e.kind() == std::io::ErrorKind::NotFound => Some("is the path right?"),
            ErrorKind::Limit(_) => {
                Some("refused in case it is hostile or broken; --limit-memory SIZE allows more of what files unpack to")
            }
            ErrorKind::Outside(_) => Some(
                "copy that file into the model's folder and name it by a relative path, or trust the model: --allow-outside",
            ),
            _ => None,
        };
        let failure = Self::failed(&error);
        match hint {
            Some(hint) => failure.hint(hint),
            None => failure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_names_file_place_and_cause_and_what_to_do() {
        let error = ImportError::new("a.gltf", "/buffers/0/uri", ErrorKind::Outside("../b.bin".into()));
        let text = Failure::from(error).to_string();
        assert_eq!(
            text,
            "error: a.gltf: /buffers/0/uri: refused to read '../b.bin': it lies outside the model's folder\n \
             hint: copy that file into the model's folder and name it by a relative path, or trust the model: \
             --allow-outside"
        );
    }
}
