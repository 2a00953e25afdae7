//! Reads Wavefront OBJ text into a mesh.
//!
//! The text may come from anyone. A first pass (`scan`) goes over its lines, enforces the limits, names every
//! violation with its line, and passes on only vertices and faces, in plain form, to the parser `tobj`. That keeps
//! memory proportional to the text, keeps `tobj` away from the file system and from input that it panics on, and
//! keeps the triangles in the file's order, because `tobj` sees neither groups nor materials to sort them by. What
//! `tobj` returns is then welded and checked (`clean`).

mod clean;
mod lines;
mod scan;

use grasp_synthesis::geometry::mesh::{MeshError, TriangleMesh};

use clean::Cleaned;
use scan::Scan;

/// How many violations are listed before the rest is only counted.
const LISTED_ERRORS: usize = 16;

/// How far from the origin a vertex may be, in metres. No object that a hand can hold needs more; beyond it the unit
/// is surely wrong, and products of coordinates lose their precision.
pub const MAX_COORDINATE_METRES: f32 = 1000.0;

/// Names that one `g` line may give. Every face belongs to all of them, so they bound the memory for groups.
pub const MAX_NAMES_IN_A_LINE: usize = 16;

/// What is read at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjLimits {
    /// Bytes of text.
    pub bytes: usize,
    /// Vertices.
    pub vertices: usize,
    /// Triangles after polygons were split into fans.
    pub triangles: usize,
}

/// A mesh with the names that its parts had in the file.
#[derive(Clone, Debug)]
pub struct ObjMesh {
    /// Vertices (welded, in order of first use) and triangles (in file order, polygons as fans from their first
    /// corner); scaled to metres.
    pub mesh: TriangleMesh,
    /// For every triangle its place in the file, counted from 0 after polygons were split and before triangles were
    /// dropped; ascending. It tells which triangles somebody means who counts those of the file.
    pub places: Vec<u32>,
    /// How many triangles the file has, with those that were dropped.
    pub places_in_file: usize,
    /// For every group (`g`), object (`o`) and material (`usemtl`) name: its triangles, ascending. Sorted by name.
    pub groups: Vec<(String, Vec<u32>)>,
    /// What was odd but could be used: dropped triangles without area, unused vertices, open edges, …
    pub warnings: Vec<String>,
}

/// Why OBJ text was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObjError {
    /// The unit cannot be used.
    #[error("a unit of {0} m is of no use; it must be finite and more than 0")]
    Unit(f32),
    /// There is too much text.
    #[error("the text has {bytes} bytes; at most {limit} are read")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// What is allowed.
        limit: usize,
    },
    /// There are too many vertices.
    #[error("line {line}: the mesh has more than {limit} vertices")]
    TooManyVertices {
        /// The first line too many, counted from 1.
        line: usize,
        /// What is allowed.
        limit: usize,
    },
    /// There are too many triangles.
    #[error("line {line}: the mesh has more than {limit} triangles")]
    TooManyTriangles {
        /// The first line too many, counted from 1.
        line: usize,
        /// What is allowed.
        limit: usize,
    },
    /// A vertex has too few or too many numbers.
    #[error(
        "line {line}: a vertex has {found} numbers; it must have 3, 4 with a weight, 6 or 7 with a colour"
    )]
    NumberCount {
        /// The line, counted from 1.
        line: usize,
        /// How many there are.
        found: usize,
    },
    /// A coordinate is not a number.
    #[error("line {line}: {text:?} is not a number")]
    NotANumber {
        /// The line, counted from 1.
        line: usize,
        /// What is there.
        text: String,
    },
    /// A coordinate is NaN or infinite, or a vertex' weight makes it so.
    #[error("line {line}: {text:?} is not finite or makes the vertex infinite")]
    NotFinite {
        /// The line, counted from 1.
        line: usize,
        /// What is there.
        text: String,
    },
    /// A vertex is far from everything.
    #[error(
        "line {line}: a coordinate is {metres} m from the origin; it must be at most {MAX_COORDINATE_METRES} m, \
         is the unit right?"
    )]
    TooFar {
        /// The line, counted from 1.
        line: usize,
        /// The largest coordinate.
        metres: f32,
    },
    /// A face names a vertex in no known way.
    #[error(
        "line {line}: {text:?} names no vertex; it must be an index, or up to three indices with / between them"
    )]
    NotAnIndex {
        /// The line, counted from 1.
        line: usize,
        /// What is there.
        text: String,
    },
    /// A face names a vertex that does not exist.
    #[error(
        "line {line}: vertex {index} does not exist; {vertices} are known, counted from 1 or backward from -1"
    )]
    IndexOutOfRange {
        /// The line, counted from 1.
        line: usize,
        /// The index as written.
        index: i64,
        /// How many vertices there are; for a negative index, how many there are before the line.
        vertices: usize,
    },
    /// A line gives too many names.
    #[error("line {line}: {found} group names; at most {MAX_NAMES_IN_A_LINE} are read")]
    TooManyNames {
        /// The line, counted from 1.
        line: usize,
        /// How many there are.
        found: usize,
    },
    /// Nothing to touch.
    #[error("the mesh has no triangles; {dropped} points, lines and faces without area do not count")]
    Empty {
        /// How many there were that have no area.
        dropped: usize,
    },
    /// The parser refused what the scan let pass.
    #[error("the mesh cannot be parsed")]
    Unreadable(#[source] tobj::LoadError),
    /// The mesh that remains cannot be used.
    #[error("the mesh cannot be used")]
    Unusable(#[source] MeshError),
    /// The list is too long.
    #[error("and {0} more violations")]
    More(usize),
}

/// Reads OBJ text; `unit_metres` is the length of one unit.
///
/// Polygons become fans. Vertices of equal position are welded; colours, normals and texture coordinates are not
/// read, and no material file is opened. A closed mesh that is inside out is turned, with a warning.
///
/// # Errors
/// Everything that is wrong with it; see [`ObjError`]. After 16 violations the rest is only counted.
pub fn read_obj(text: &[u8], unit_metres: f32, limits: ObjLimits) -> Result<ObjMesh, Vec<ObjError>> {
    if !(unit_metres.is_finite() && unit_metres > 0.0) {
        return Err(vec![ObjError::Unit(unit_metres)]);
    }
    if text.len() > limits.bytes {
        return Err(vec![ObjError::TooLong {
            bytes: text.len(),
            limit: limits.bytes,
        }]);
    }
    let scan = Scan::of(text, unit_metres, limits)?;
    let Cleaned {
        mesh,
        faces,
        places,
        warnings,
    } = clean::clean(&scan, unit_metres)?;
    Ok(ObjMesh {
        mesh,
        places,
        places_in_file: scan.triangles,
        groups: scan.groups(&faces),
        warnings,
    })
}

/// A bounded list of violations.
#[derive(Debug, Default)]
struct Violations {
    listed: Vec<ObjError>,
    more: usize,
}

impl Violations {
    fn push(&mut self, error: ObjError) {
        if self.listed.len() < LISTED_ERRORS {
            self.listed.push(error);
        } else {
            self.more += 1;
        }
    }

    fn into_result(mut self) -> Result<(), Vec<ObjError>> {
        if self.more > 0 {
            self.listed.push(ObjError::More(self.more));
        }
        if self.listed.is_empty() {
            Ok(())
        } else {
            Err(self.listed)
        }
    }
}
