//! Splits the faces of a mesh into triangles.

use glam::DVec3;
use grasp_synthesis::base::stop::Stop;

use crate::{
    error::{ImportError, Violations},
    polygon::{Split, split},
    raw::{Occurrences, Place, RawMesh},
    stoppable::stopped,
};

/// Faces split between two checks whether to stop.
const FACES_PER_CHECK: usize = 256;

/// The triangles of all faces.
#[derive(Debug, Default)]
pub(crate) struct Triangles {
    /// Their corners as vertices of the mesh, in the file's order.
    pub(crate) corners: Vec<[u32; 3]>,
    /// Polygons that intersect themselves.
    pub(crate) overlapping: Occurrences,
}

/// Splits every face; one of n corners becomes n - 2 triangles.
pub(crate) fn triangles(raw: &RawMesh, stop: Stop<'_>) -> Result<Triangles, Vec<ImportError>> {
    let mut triangles = Triangles {
        corners: Vec::with_capacity(raw.triangle_count()),
        ..Triangles::default()
    };
    let mut violations = Violations::default();
    let mut rest = raw.corners.as_slice();
    let (mut positions, mut places) = (Vec::new(), Vec::new());
    for (number, face) in raw.faces.iter().enumerate() {
        stop.check_every(FACES_PER_CHECK, number).map_err(stopped)?;
        let (corners, others) = rest.split_at(face.corners);
        rest = others;
        if let &[a, b, c] = corners {
            triangles.corners.push([a, b, c]);
            continue;
        }
        positions.clear();
        positions.extend(corners.iter().map(|&vertex| {
            let start = 3 * vertex as usize;
            DVec3::from_slice(&raw.coordinates[start..start + 3])
        }));
        places.clear();
        match split(&positions, &mut places, stop).map_err(stopped)? {
            Split::Exact => {}
            Split::Overlapping => triangles.overlapping.note(face.place),
            Split::TooManyCorners => violations.push(ImportError::TooManyCorners {
                place: Place(raw.places, face.place).to_string(),
                corners: face.corners,
            }),
        }
        let vertices = places.iter().map(|triangle| triangle.map(|place| corners[place]));
        triangles.corners.extend(vertices);
    }
    violations.into_result()?;
    Ok(triangles)
}
