//! Parses the scanned text with `tobj`, then splits polygons, welds and checks the mesh.

use std::collections::HashSet;

use glam::Vec3;
use grasp_synthesis::geometry::mesh::TriangleMesh;

use super::{
    ObjError,
    faces::triangles,
    scan::{Occurrences, Scan},
};
use crate::{
    edges::Edges,
    weld::{has_area, has_repeated_corner, smallest_first, weld},
};

/// A mesh that can be used.
#[derive(Debug)]
pub(super) struct Cleaned {
    pub(super) mesh: TriangleMesh,
    /// For each triangle, the index of its face.
    pub(super) faces: Vec<usize>,
    /// For each triangle, its index before any were dropped.
    pub(super) indices_in_file: Vec<u32>,
    pub(super) warnings: Vec<String>,
}

/// Parses the scanned text, welds it, drops degenerate and repeated triangles, and checks how the rest join.
pub(super) fn clean(scan: &Scan, unit_metres: f32) -> Result<Cleaned, Vec<ObjError>> {
    // tobj would split every polygon into a fan, convex or not.
    let options = tobj::LoadOptions::default();
    // The scan drops references to material libraries; if one got through, it would be rejected, not opened.
    let reject = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut scan.plain.as_bytes(), &options, reject)
        .map_err(|error| vec![ObjError::Unreadable(error)])?;
    // Without groups in its input, tobj returns one model.
    let Some(parsed) = models.into_iter().next().map(|model| model.mesh) else {
        return Err(vec![scan.empty(0)]);
    };

    let split = triangles(scan, &parsed)?;
    let (positions, welded) = weld(&parsed.positions, unit_metres);
    let corners = split
        .corners
        .iter()
        .map(|triangle| triangle.map(|vertex| welded[vertex as usize]));
    let origins = scan
        .faces
        .iter()
        .enumerate()
        .flat_map(|(face, scanned)| std::iter::repeat_n(face, scanned.corners - 2));

    let mut dropped = Dropped::default();
    let mut seen = HashSet::new();
    let mut triangles = Vec::new();
    let mut faces = Vec::new();
    let mut indices_in_file = Vec::new();
    // Slivers with three distinct vertices have no area but still close the gap between their neighbours.
    let mut joined = Vec::new();
    for (index, (triangle, face)) in corners.zip(origins).enumerate() {
        let line = scan.faces[face].line;
        if has_repeated_corner(triangle) {
            dropped.without_area.note(line);
        } else if !seen.insert(smallest_first(triangle)) {
            dropped.repeated.note(line);
        } else {
            joined.push(triangle);
            if has_area(&positions, triangle) {
                triangles.push(triangle);
                faces.push(face);
                indices_in_file.push(index as u32);
            } else {
                dropped.without_area.note(line);
            }
        }
    }
    if triangles.is_empty() {
        return Err(vec![scan.empty(dropped.without_area.count)]);
    }

    let mut warnings = scan.warnings.clone();
    warnings.extend(dropped.warnings(scan, split.overlapping));
    let unused = scan.vertices - parsed.positions.len() / 3;
    if unused > 0 {
        warnings.push(format!("{unused} vertices are not used by any face"));
    }
    let edges = Edges::of(&joined, positions.len());
    warnings.extend(edges.warnings());
    let mut mesh = usable(positions, triangles)?;
    if edges.is_closed() && mesh.signed_volume() < 0.0 {
        let turned = mesh.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
        mesh = usable(mesh.positions().to_vec(), turned)?;
        warnings.push("the mesh was inside out; all triangles were turned".to_owned());
    }
    Ok(Cleaned {
        mesh,
        faces,
        indices_in_file,
        warnings,
    })
}

fn usable(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<TriangleMesh, Vec<ObjError>> {
    TriangleMesh::new(positions, triangles).map_err(|error| vec![ObjError::Unusable(error)])
}

/// Triangles that were dropped.
#[derive(Debug, Default)]
struct Dropped {
    without_area: Occurrences,
    repeated: Occurrences,
}

impl Dropped {
    fn warnings(&self, scan: &Scan, overlapping: Occurrences) -> impl Iterator<Item = String> {
        [
            (
                scan.unknown,
                "lines start with an unknown keyword and were ignored",
            ),
            (
                scan.without_area,
                "points, lines and faces with fewer than three corners were dropped",
            ),
            (self.without_area, "triangles without area were dropped"),
            (self.repeated, "triangles that repeat an earlier one were dropped"),
            (
                overlapping,
                "polygons intersect themselves; their fans of triangles overlap",
            ),
        ]
        .into_iter()
        .filter(|(oddity, _)| oddity.count > 0)
        .map(|(Occurrences { count, first_line }, what)| {
            format!("{count} {what}; the first is on line {first_line}")
        })
    }
}
