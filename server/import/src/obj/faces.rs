//! Splits the faces of a parsed mesh into triangles.

use glam::Vec3;

use super::{
    error::{ObjError, Violations},
    scan::{Occurrences, Scan},
};
use crate::polygon::{Split, split};

/// The triangles of all faces.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    /// Their corners as vertices of the parsed mesh, in the file's order.
    pub(super) corners: Vec<[u32; 3]>,
    /// Polygons that intersect themselves.
    pub(super) overlapping: Occurrences,
}

/// Splits every face; one of n corners becomes n - 2 triangles.
pub(super) fn triangles(scan: &Scan, parsed: &tobj::Mesh) -> Result<Triangles, Vec<ObjError>> {
    let mut triangles = Triangles {
        corners: Vec::with_capacity(scan.triangles),
        ..Triangles::default()
    };
    let mut violations = Violations::default();
    let mut rest = parsed.indices.as_slice();
    let (mut positions, mut places) = (Vec::new(), Vec::new());
    for face in &scan.faces {
        let (corners, others) = rest.split_at(face.corners);
        rest = others;
        if let &[a, b, c] = corners {
            triangles.corners.push([a, b, c]);
            continue;
        }
        positions.clear();
        positions.extend(corners.iter().map(|&vertex| {
            let start = 3 * vertex as usize;
            Vec3::from_slice(&parsed.positions[start..start + 3]).as_dvec3()
        }));
        places.clear();
        match split(&positions, &mut places) {
            Split::Exact => {}
            Split::Overlapping => triangles.overlapping.note(face.line),
            Split::TooManyCorners => violations.push(ObjError::TooManyCorners {
                line: face.line,
                corners: face.corners,
            }),
        }
        let vertices = places.iter().map(|triangle| triangle.map(|place| corners[place]));
        triangles.corners.extend(vertices);
    }
    violations.into_result()?;
    Ok(triangles)
}
