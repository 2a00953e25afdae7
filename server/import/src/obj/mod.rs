//! Reads Wavefront OBJ text.
//!
//! A first pass (`scan`) enforces the limits, reports every violation with its line, and rewrites vertices and faces in
//! plain form for the parser `tobj`. That keeps memory proportional to the text, keeps `tobj` away from the file system
//! and from input on which it panics, and preserves the order of triangles: `tobj` sees neither the groups nor the
//! materials by which it would sort them, but pieces of the text in turn.

mod encoding;
pub(crate) mod lines;
mod scan;

use crate::stoppable::Stoppable;
use crate::{
    error::ImportError,
    foreign::foreign,
    limits::MeshLimits,
    raw::{Places, RawMesh},
};
use encoding::decode;
use grasp_synthesis::base::stop::Stop;
use scan::Scan;

/// Largest number of names on one `g` line. Each face belongs to all of them, so this bounds the memory for groups.
pub const MAX_NAMES_PER_LINE: usize = 16;

/// Reads OBJ text, in UTF-8 or UTF-16; `unit_metres` is the length of one unit.
///
/// Colours, normals and texture coordinates are ignored, and no material file is opened.
pub(crate) fn read(
    bytes: &[u8],
    unit_metres: f32,
    limits: MeshLimits,
    stop: Stop<'_>,
) -> Result<RawMesh, Vec<ImportError>> {
    let (text, warning) = decode(bytes);
    let mut raw = read_text(&text, unit_metres, limits, stop)
        .map_err(|errors| foreign(bytes, &text).map_or(errors, |error| vec![error]))?;
    raw.warnings.extend(warning);
    Ok(raw)
}

fn read_text(
    text: &[u8],
    unit_metres: f32,
    limits: MeshLimits,
    stop: Stop<'_>,
) -> Result<RawMesh, Vec<ImportError>> {
    let mut scan = Scan::of(text, unit_metres, limits, stop)?;
    let plain = std::mem::take(&mut scan.plain);
    // tobj would split every polygon into a fan, convex or not.
    let options = tobj::LoadOptions::default();
    // The scan drops references to material libraries; if one got through, it would be rejected, not opened.
    let reject = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut Stoppable::new(plain.as_bytes(), stop), &options, reject)
        .map_err(|error| vec![ImportError::Unreadable(error)])?;
    drop(plain);
    if scan.faces.is_empty() {
        return Err(vec![ImportError::Empty {
            dropped: scan.without_area.count,
            unknown: scan.unknown.count,
        }]);
    }
    let (mut coordinates, mut corners) = (Vec::new(), Vec::new());
    let sum = |of: fn(&tobj::Mesh) -> usize| models.iter().map(|model| of(&model.mesh)).sum();
    coordinates.reserve_exact(sum(|mesh| mesh.positions.len()));
    corners.reserve_exact(sum(|mesh| mesh.indices.len()));
    // Pieces have vertices of their own; those that they share are welded later.
    for tobj::Model { mesh, .. } in models {
        let first = (coordinates.len() / 3) as u32;
        coordinates.extend(mesh.positions);
        corners.extend(mesh.indices.iter().map(|index| first + index));
    }
    Ok(RawMesh {
        unused_vertices: scan.unused_vertices,
        coordinates,
        corners,
        faces: scan.faces,
        names: scan.names,
        places: Places::Lines,
        without_area: scan.without_area,
        unknown: scan.unknown,
        warnings: scan.warnings,
    })
}
