//! The one error of the runtime: who must act, where, what is wrong, and what would be valid.

use std::fmt;
use std::path::{Path, PathBuf};

/// Who can put it right; decides the exit code of the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The user's input is wrong (exit code 2).
    UserInput,
    /// The work failed although the input was valid (exit code 1).
    Failed,
}

/// A message for the user of the command.
#[derive(Clone, Debug)]
pub struct Error {
    /// Who can put it right.
    pub kind: Kind,
    /// The file that is at fault.
    pub file: Option<PathBuf>,
    /// The node, accessor, extension or field in it.
    pub what: Option<String>,
    /// What is wrong, with the offending value.
    pub message: String,
    /// What would be valid.
    pub help: Option<String>,
}

/// Result of everything in the runtime that can fail.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// The user's input is wrong.
    pub fn input(message: impl Into<String>) -> Self {
        Self::new(Kind::UserInput, message.into())
    }

    /// The work failed.
    pub fn failed(message: impl Into<String>) -> Self {
        Self::new(Kind::Failed, message.into())
    }

    fn new(kind: Kind, message: String) -> Self {
        Self { kind, file: None, what: None, message, help: None }
    }

    /// Names the file at fault, unless a more precise one is already named.
    #[must_use]
    pub fn in_file(mut self, path: impl AsRef<Path>) -> Self {
        self.file.get_or_insert_with(|| path.as_ref().to_path_buf());
        self
    }

    /// Names the place inside the file; an enclosing place goes in front of a place named before.
    #[must_use]
    pub fn at(mut self, what: impl fmt::Display) -> Self {
        self.what = Some(match self.what {
            Some(inner) => format!("{what}, {inner}"),
            None => what.to_string(),
        });
        self
    }

    /// Says what would be valid.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Exit code of the command: 2 for wrong input, 1 for failed work.
    pub fn exit_code(&self) -> u8 {
        match self.kind {
            Kind::UserInput => 2,
            Kind::Failed => 1,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}: ", file.display())?;
        }
        if let Some(what) = &self.what {
            write!(f, "{what}: ")?;
        }
        f.write_str(&self.message)?;
        match &self.help {
            Some(help) => write!(f, "\n  help: {help}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_names_file_place_value_and_remedy() {
        let error = Error::input("count 7 exceeds the buffer view of 12 bytes")
            .at("accessor 3")
            .at("mesh \"box\"")
            .in_file("a.glb")
            .in_file("outer.toml")
            .help("at most 1");
        assert_eq!(
            error.to_string(),
            "a.glb: mesh \"box\", accessor 3: count 7 exceeds the buffer view of 12 bytes\n  help: at most 1"
        );
        assert_eq!((error.exit_code(), Error::failed("x").exit_code()), (2, 1));
    }
}
