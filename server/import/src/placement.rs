//! Where the origin of a mesh is in its file.

use glam::DVec3;

use crate::{Import, raw::RawMesh};

/// Largest distance of the centre of a mesh's box from the file's origin, in metres, at which the file's origin is kept. Beyond,
/// steps of single precision exceed a micrometre, and distances computed from such coordinates lose what fingers can feel.
const KEPT_ORIGIN_METRES: f64 = 10.0;

/// True if a mesh whose box has this centre, in metres from the file's origin, keeps that origin.
pub fn keeps_origin(centre: DVec3) -> bool {
    centre.length() <= KEPT_ORIGIN_METRES
}

/// Moves a mesh that is far from the file's origin to the centre of its box; returns where its origin is in the file.
pub(crate) fn recentre(raw: &mut RawMesh, import: Import) -> DVec3 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &corner in &raw.corners {
        let start = 3 * corner as usize;
        let position = DVec3::from_slice(&raw.coordinates[start..start + 3]);
        low = low.min(position);
        high = high.max(position);
    }
    let centre = low.midpoint(high);
    let moved = import.metres_from_file(centre);
    // Without faces, there is no centre.
    if !moved.is_finite() || keeps_origin(moved) {
        return DVec3::ZERO;
    }
    for position in raw.coordinates.as_chunks_mut::<3>().0 {
        *position = (DVec3::from_array(*position) - centre).to_array();
    }
    let [x, y, z] = centre.to_array();
    raw.warnings.push(format!(
        "the mesh is {:.3} m from the file's origin: the object's origin is the centre of the mesh's box, about ({x:.3}, {y:.3}, \
         {z:.3}) in the file",
        moved.length()
    ));
    centre
}
