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
    /// Their corners as vertices of the mesh, three by three, in the file's order.
    pub(crate) corners: Vec<u32>,
    /// Polygons that intersect themselves.
    pub(crate) overlapping: Occurrences,
}

/// Splits every face; one of n corners becomes n - 2 triangles. Takes the corners of a mesh that has triangles only.
pub(crate) fn triangles(raw: &mut RawMesh, stop: Stop<'_>) -> Result<Triangles, Vec<ImportError>> {
    if raw.faces.are_triangles() {
        return Ok(Triangles {
            corners: std::mem::take(&mut raw.corners),
            ..Triangles::default()
        });
    }
    let mut triangles = Triangles {
        corners: Vec::with_capacity(3 * raw.faces.triangles()),
        ..Triangles::default()
    };
    let mut violations = Violations::default();
    let mut rest = raw.corners.as_slice();
    let (mut positions, mut places) = (Vec::new(), Vec::new());
    for (number, face) in raw.faces.iter().enumerate() {
        stop.check_every(FACES_PER_CHECK, number).map_err(stopped)?;
        let (corners, others) = rest.split_at(face.corners);
        rest = others;
        if corners.len() == 3 {
            triangles.corners.extend(corners);
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
        let vertices = places.iter().flatten().map(|&place| corners[place]);
        triangles.corners.extend(vertices);
    }
    violations.into_result()?;
    Ok(triangles)
}
