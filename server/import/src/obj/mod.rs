//! Reads Wavefront OBJ text.
//!
//! A first pass (`scan`) enforces the limits, reports every violation with its line, and rewrites vertices and faces in
//! plain form for the parser `tobj`. That keeps memory proportional to the text, keeps `tobj` away from the file system
//! and from input on which it panics, and preserves the order of triangles: `tobj` sees neither the groups nor the
//! materials by which it would sort them. The faces of the parsed mesh are then split into triangles (`faces`), and the
//! mesh is welded and checked (`clean`). Bytes that are not OBJ text are named for what they are (`foreign`).

mod clean;
mod encoding;
mod error;
mod faces;
mod foreign;
mod lines;
mod scan;
mod seven_numbers;

use grasp_synthesis::geometry::mesh::TriangleMesh;

use crate::limits::MeshLimits;
use clean::Cleaned;
use encoding::{Decoded, decode};
pub use error::ObjError;
use foreign::foreign;
use scan::Scan;

/// Largest number of names on one `g` line. Each face belongs to all of them, so this bounds the memory for groups.
pub const MAX_NAMES_PER_LINE: usize = 16;

/// A mesh and the names of its parts.
#[derive(Clone, Debug)]
pub struct ObjMesh {
    /// Vertices (welded, in order of first use) and triangles (in the file's order, n - 2 for a polygon of n corners; the
    /// fan from its first corner if that one sees all others), scaled to metres.
    pub mesh: TriangleMesh,
    /// For each triangle, its index in the file, counted from 0 after polygons are split and before triangles are
    /// dropped; ascending.
    pub indices_in_file: Vec<u32>,
    /// Number of triangles in the file, dropped ones included.
    pub triangles_in_file: usize,
    /// The triangles of each group (`g`), object (`o`) and material (`usemtl`), ascending; sorted by name.
    pub groups: Vec<(String, Vec<u32>)>,
    /// Defects that do not prevent use: dropped triangles, unused vertices, open edges and the like.
    pub warnings: Vec<String>,
}

/// Reads OBJ text; `unit_metres` is the length of one unit.
///
/// The text may be UTF-8 or UTF-16. Polygons are split into triangles that cover them once; only one that intersects
/// itself becomes a fan that overlaps, with a warning. Vertices at equal positions are welded; colours, normals and
/// texture coordinates are ignored, and no material file is opened. A closed mesh that is inside out is flipped, with a
/// warning.
///
/// # Errors
/// Every violation; see [`ObjError`]. Beyond 16 they are only counted.
pub fn read_obj(text: &[u8], unit_metres: f32, limits: MeshLimits) -> Result<ObjMesh, Vec<ObjError>> {
    if !(unit_metres.is_finite() && unit_metres > 0.0) {
        return Err(vec![ObjError::Unit(unit_metres)]);
    }
    if text.len() > limits.bytes {
        return Err(vec![ObjError::TooLong {
            bytes: text.len(),
            limit: limits.bytes,
        }]);
    }
    let Decoded {
        text: decoded,
        warning,
    } = decode(text);
    let mut mesh = read_text(&decoded, unit_metres, limits)
        .map_err(|errors| foreign(text, &decoded).map_or(errors, |error| vec![error]))?;
    mesh.warnings.extend(warning);
    Ok(mesh)
}

fn read_text(text: &[u8], unit_metres: f32, limits: MeshLimits) -> Result<ObjMesh, Vec<ObjError>> {
    let scan = Scan::of(text, unit_metres, limits)?;
    let Cleaned {
        mesh,
        faces,
        indices_in_file,
        warnings,
    } = clean::clean(&scan, unit_metres)?;
    Ok(ObjMesh {
        mesh,
        indices_in_file,
        triangles_in_file: scan.triangles,
        groups: scan.groups(&faces),
        warnings,
    })
}
