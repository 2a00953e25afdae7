//! Splits the polygons of a mesh from a file, welds it and checks it.

use std::collections::HashSet;

use glam::Vec3;
use grasp_synthesis::geometry::mesh::TriangleMesh;

use crate::{
    Import, ImportedMesh,
    edges::Edges,
    error::ImportError,
    faces::triangles,
    raw::{Occurrences, Place, RawMesh},
    weld::{has_area, has_repeated_corner, smallest_first, weld},
};

/// Splits polygons, welds, drops degenerate and repeated triangles, and checks how the rest join.
pub(crate) fn clean(raw: &RawMesh, import: Import) -> Result<ImportedMesh, Vec<ImportError>> {
    let split = triangles(raw)?;
    let (positions, welded) = weld(&raw.coordinates, import);
    let corners = split
        .corners
        .iter()
        .map(|triangle| triangle.map(|vertex| welded[vertex as usize]));
    let origins = raw
        .faces
        .iter()
        .enumerate()
        .flat_map(|(face, read)| std::iter::repeat_n(face, read.corners - 2));

    let mut dropped = Dropped::default();
    let mut seen = HashSet::new();
    let mut triangles = Vec::new();
    let mut faces = Vec::new();
    let mut indices_in_file = Vec::new();
    // Slivers with three distinct vertices have no area but still close the gap between their neighbours.
    let mut joined = Vec::new();
    for (index, (triangle, face)) in corners.zip(origins).enumerate() {
        let place = raw.faces[face].place;
        if has_repeated_corner(triangle) {
            dropped.without_area.note(place);
        } else if !seen.insert(smallest_first(triangle)) {
            dropped.repeated.note(place);
        } else {
            joined.push(triangle);
            if has_area(&positions, triangle) {
                triangles.push(triangle);
                faces.push(face);
                indices_in_file.push(index as u32);
            } else {
                dropped.without_area.note(place);
            }
        }
    }
    if triangles.is_empty() {
        return Err(vec![ImportError::Empty {
            dropped: raw.without_area.count + dropped.without_area.count,
            unknown: raw.unknown.count,
        }]);
    }

    let mut warnings = raw.warnings.clone();
    warnings.extend(dropped.warnings(raw, split.overlapping));
    if raw.unused_vertices > 0 {
        let unused = raw.unused_vertices;
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
    Ok(ImportedMesh {
        mesh,
        triangles_in_file: raw.triangle_count(),
        groups: raw.names.groups(faces.iter().map(|&face| raw.faces[face].names)),
        indices_in_file,
        warnings,
    })
}

fn usable(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<TriangleMesh, Vec<ImportError>> {
    TriangleMesh::new(positions, triangles).map_err(|error| vec![ImportError::Unusable(error)])
}

/// Triangles that were dropped.
#[derive(Debug, Default)]
struct Dropped {
    without_area: Occurrences,
    repeated: Occurrences,
}

impl Dropped {
    fn warnings(&self, raw: &RawMesh, overlapping: Occurrences) -> impl Iterator<Item = String> {
        [
            (
                raw.unknown,
                "lines start with an unknown keyword and were ignored",
            ),
            (
                raw.without_area,
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
        .map(|(Occurrences { count, first }, what)| {
            format!("{count} {what}; the first is {}", Place(raw.places, first))
        })
    }
}
