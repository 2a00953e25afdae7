//! Why a file is rejected.

use grasp_synthesis::{base::stop::Stopped, geometry::mesh::MeshError};

use crate::parts::quoted;

/// Violations listed before the rest is only counted; bounds the size of the answer.
const LISTED_ERRORS: usize = 16;

/// Why a file was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// Something is wrong with a part of the file.
    #[error("{place}: {what}")]
    At {
        /// The part of the file.
        place: String,
        /// Why it is wrong, and a correct alternative.
        what: String,
    },
    /// Something is wrong with the file as a whole.
    #[error("{0}")]
    Whole(String),
    /// A part that is to be read is none of the file.
    #[error("is {}, {what}", quoted(.name))]
    NoSuchPart {
        /// Its place among those that are to be read.
        place: usize,
        /// Its name.
        name: String,
        /// Which there are.
        what: String,
    },
    /// The resulting mesh cannot be used.
    #[error("the mesh cannot be used")]
    Unusable(#[from] MeshError),
    /// The reader was stopped.
    #[error("the mesh was not read to its end")]
    Stopped,
    /// Violations beyond those listed.
    #[error("and {0} more violations")]
    More(usize),
}

impl ImportError {
    /// An error at a place of a file.
    pub(crate) fn at(place: impl Into<String>, what: impl Into<String>) -> Self {
        Self::At {
            place: place.into(),
            what: what.into(),
        }
    }

    /// An error on a line of a text, counted from 1.
    pub(crate) fn on_line(line: usize, what: impl Into<String>) -> Self {
        Self::at(format!("line {line}"), what)
    }
}

impl From<Stopped> for ImportError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

/// Fails with [`ImportError::Whole`] if a file or mesh has more of something than a limit.
pub(crate) fn check_count(place: &str, what: &str, found: u64, limit: usize) -> Result<(), ImportError> {
    if found > limit as u64 {
        let what = format!("{place} has {found} {what}; at most {limit} are allowed");
        return Err(ImportError::Whole(what));
    }
    Ok(())
}

/// A bounded list of violations.
#[derive(Debug, Default)]
pub(crate) struct Violations {
    listed: Vec<ImportError>,
    more: usize,
}

impl Violations {
    pub(crate) fn push(&mut self, error: ImportError) {
        if self.listed.len() < LISTED_ERRORS {
            self.listed.push(error);
        } else {
            self.more += 1;
        }
    }

    /// Adds an error at a place of a file.
    pub(crate) fn add(&mut self, place: impl Into<String>, what: impl Into<String>) {
        self.push(ImportError::at(place, what));
    }

    /// Number of violations.
    pub(crate) fn len(&self) -> usize {
        self.listed.len() + self.more
    }

    /// Fails if there is a violation.
    pub(crate) fn into_result(self) -> Result<(), Self> {
        if self.len() == 0 { Ok(()) } else { Err(self) }
    }
}

impl From<Violations> for Vec<ImportError> {
    fn from(Violations { mut listed, more }: Violations) -> Self {
        if more > 0 {
            listed.push(ImportError::More(more));
        }
        listed
    }
}

impl From<ImportError> for Vec<ImportError> {
    fn from(error: ImportError) -> Self {
        vec![error]
    }
}

impl<E: Into<ImportError>> From<E> for Violations {
    fn from(error: E) -> Self {
        Self {
            listed: vec![error.into()],
            more: 0,
        }
    }
}
