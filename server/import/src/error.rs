//! Why a file is rejected.

use grasp_synthesis::geometry::mesh::MeshError;

use crate::{
    limits::MAX_COORDINATE_METRES, obj::MAX_NAMES_PER_LINE, parts::quoted, polygon::MAX_CLIPPED_CORNERS,
};

/// Violations listed before the rest is only counted; bounds the size of the answer.
const LISTED_ERRORS: usize = 16;

/// Why a file was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The unit is not a length.
    #[error("a unit of {0} m cannot be used; it must be finite and more than 0")]
    Unit(f32),
    /// The file is too long.
    #[error("the file has {bytes} bytes; at most {limit} are allowed")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
    /// There are too many vertices.
    #[error("line {line}: the mesh has more than {limit} vertices")]
    TooManyVertices {
        /// The line that exceeds the limit, counted from 1.
        line: usize,
        /// The limit.
        limit: usize,
    },
    /// There are too many triangles.
    #[error("line {line}: the mesh has more than {limit} triangles")]
    TooManyTriangles {
        /// The line that exceeds the limit, counted from 1.
        line: usize,
        /// The limit.
        limit: usize,
    },
    /// A vertex has too few or too many numbers.
    #[error(
        "line {line}: a vertex has {found} numbers; it must have 3, 4 with a weight, 6 with a colour, or 7 with a colour and \
         its alpha or a weight"
    )]
    NumberCount {
        /// The line, counted from 1.
        line: usize,
        /// Their number.
        found: usize,
    },
    /// A coordinate is not a number.
    #[error("line {line}: {text:?} is not a number")]
    NotANumber {
        /// The line, counted from 1.
        line: usize,
        /// The text found instead.
        text: String,
    },
    /// A coordinate is NaN or infinite, or the vertex's weight makes it so.
    #[error("line {line}: {text:?} is not finite or makes the vertex infinite")]
    NotFinite {
        /// The line, counted from 1.
        line: usize,
        /// The text found instead.
        text: String,
    },
    /// A vertex is too far from the origin.
    #[error(
        "line {line}: a coordinate is {metres} m from the origin; it must be at most {MAX_COORDINATE_METRES} m, \
         is the unit right?"
    )]
    TooFar {
        /// The line, counted from 1.
        line: usize,
        /// The largest coordinate.
        metres: f64,
    },
    /// A corner of a face is not a vertex reference.
    #[error(
        "line {line}: {text:?} is not a vertex reference; it must be an index, or up to three indices separated by /"
    )]
    NotAnIndex {
        /// The line, counted from 1.
        line: usize,
        /// The text found instead.
        text: String,
    },
    /// A face refers to a vertex that does not exist.
    #[error(
        "line {line}: vertex {index} does not exist; {vertices} are known, counted from 1 or backward from -1"
    )]
    IndexOutOfRange {
        /// The line, counted from 1.
        line: usize,
        /// The index as written.
        index: i64,
        /// The number of vertices; for a negative index, of those before the line.
        vertices: usize,
    },
    /// A line has too many group names.
    #[error("line {line}: {found} group names; at most {MAX_NAMES_PER_LINE} are allowed")]
    TooManyNames {
        /// The line, counted from 1.
        line: usize,
        /// Their number.
        found: usize,
    },
    /// A polygon that is not convex has too many corners.
    #[error(
        "{place}: a polygon that is not convex has {corners} corners; at most {MAX_CLIPPED_CORNERS} are allowed, \
         split it into triangles"
    )]
    TooManyCorners {
        /// Where it is.
        place: String,
        /// Their number.
        corners: usize,
    },
    /// There is no statement at all.
    #[error(
        "the file is empty or has only blank lines and comments; a mesh is required as GLB, glTF, OBJ, PLY or STL"
    )]
    Blank,
    /// The bytes are no mesh of a format that can be read.
    #[error("{}; this looks like {looks_like}", statements_of(*.statements, *.lines))]
    NotAMesh {
        /// Number of lines that are neither blank nor comments.
        lines: usize,
        /// How many of them start with a word of OBJ.
        statements: usize,
        /// What the bytes probably are, and what to do about it.
        looks_like: &'static str,
    },
    /// No triangle is left.
    #[error(
        "the mesh has no triangles; {dropped} points, lines and faces without area and {unknown} lines with an unknown \
         keyword were ignored"
    )]
    Empty {
        /// Number of points, lines and faces without area.
        dropped: usize,
        /// Number of lines that start with an unknown keyword.
        unknown: usize,
    },
    /// The parser rejected what the scan accepted.
    #[error("the mesh cannot be parsed")]
    Unreadable(#[source] tobj::LoadError),
    /// There are too many vertices or triangles.
    #[error("the mesh has {found} {what}; at most {limit} are allowed")]
    TooMany {
        /// What is counted.
        what: &'static str,
        /// How many there are.
        found: u64,
        /// The limit.
        limit: usize,
    },
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
    /// Something else is wrong with a file.
    #[error("{place}: {what}")]
    At {
        /// The part of the file.
        place: String,
        /// What is wrong with it, and what would be right.
        what: String,
    },
    /// The resulting mesh cannot be used.
    #[error("the mesh cannot be used")]
    Unusable(#[source] MeshError),
    /// The reader was stopped.
    #[error("the mesh was not read to its end")]
    Stopped,
    /// Violations beyond those listed.
    #[error("and {0} more violations")]
    More(usize),
}

fn statements_of(statements: usize, lines: usize) -> String {
    if statements == 0 {
        format!("none of the {lines} lines begins with a word of OBJ (v, f, ...)")
    } else {
        format!("words of OBJ (v, f, ...) begin only {statements} of the {lines} lines")
    }
}

impl ImportError {
    /// An error at a place of a file.
    pub(crate) fn at(place: impl Into<String>, what: impl Into<String>) -> Self {
        Self::At {
            place: place.into(),
            what: what.into(),
        }
    }
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

    /// Number of violations.
    pub(crate) fn len(&self) -> usize {
        self.listed.len() + self.more
    }

    pub(crate) fn into_errors(mut self) -> Vec<ImportError> {
        if self.more > 0 {
            self.listed.push(ImportError::More(self.more));
        }
        self.listed
    }

    pub(crate) fn into_result(self) -> Result<(), Vec<ImportError>> {
        match self.into_errors() {
            none if none.is_empty() => Ok(()),
            errors => Err(errors),
        }
    }
}
