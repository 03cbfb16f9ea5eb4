//! What can be wrong with a file, said so that it can be put right: the file, the place in it, what was found, what to do.

use std::{fmt, path::PathBuf};
use thiserror::Error;

/// A file that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}: {flaw}", path.display())]
pub struct ReadError {
    /// The file as the user named it.
    pub path: PathBuf,
    /// What is wrong in it.
    pub flaw: Flaw,
}

/// One thing that is wrong in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flaw {
    /// Where it is.
    pub place: Place,
    /// Which kind of fault it is.
    pub fault: Fault,
    /// What was found there.
    pub found: String,
    /// What to do about it.
    pub remedy: String,
}

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line of a text file, counted from 1.
    Line(u64),
    /// A byte of a binary file, counted from 0 (after decompression).
    Byte(u64),
    /// An element by its kind and number, counted from 0.
    Element {
        /// "point", "triangle", "voxel", "label".
        kind: &'static str,
        /// Its number.
        index: u64,
    },
}

/// The kinds of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The file cannot be opened or read.
    Unreadable,
    /// There is nothing in it.
    Empty,
    /// Its content is none of the formats that are read.
    UnknownFormat,
    /// Its name says one format and its content another.
    WrongExtension,
    /// It ends before what its header promises.
    Truncated,
    /// It asks for more memory than allowed.
    TooLarge,
    /// Its header is broken or contradicts itself.
    Header,
    /// A number is missing, malformed, not finite or out of bounds.
    Number,
    /// An index points at nothing.
    Index,
    /// It is a valid file of a kind that is not read.
    Unsupported,
    /// Its points do not make a solid or a surface.
    Degenerate,
    /// The label asked for is not there, or no label is.
    Label,
}

impl Flaw {
    /// A flaw at any place.
    pub fn new(place: Place, fault: Fault, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            place,
            fault,
            found: found.into(),
            remedy: remedy.into(),
        }
    }

    /// A flaw of the whole file.
    pub fn file(fault: Fault, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(Place::File, fault, found, remedy)
    }

    /// A file that stops before the end that its header promises.
    pub fn truncated(place: Place, found: impl Into<String>) -> Self {
        Self::new(
            place,
            Fault::Truncated,
            found,
            "the file is cut short or its header is wrong: export or copy it again",
        )
    }

    /// The same flaw in a named file.
    pub fn in_file(self, path: impl Into<PathBuf>) -> ReadError {
        ReadError {
            path: path.into(),
            flaw: self,
        }
    }
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}; {}", self.place, self.found, self.remedy)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::File => Ok(()),
            Place::Line(n) => write!(f, "line {n}: "),
            Place::Byte(n) => write!(f, "byte {n}: "),
            Place::Element { kind, index } => write!(f, "{kind} {index}: "),
        }
    }
}

/// File content as it may be shown in a message: printable, short, in backquotes.
pub(crate) fn quote(bytes: &[u8]) -> String {
    const SHOWN: usize = 40;
    let text: String = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * SHOWN)])
        .chars()
        .take(SHOWN)
        .map(|c| if c.is_control() { '\u{b7}' } else { c })
        .collect();
    let more = if bytes.len() > text.len() { "..." } else { "" };
    format!("`{text}{more}`")
}
