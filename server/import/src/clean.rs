//! Splits the polygons of a mesh from a file, welds it, checks it and repairs what is certain.

use glam::DVec3;
use grasp_synthesis::{base::stop::Stop, geometry::mesh::TriangleMesh};

use crate::{
    Import, ImportedMesh,
    doubles::Doubles,
    edges::Edges,
    error::ImportError,
    faces::triangles,
    polygon_twins::split_alike,
    raw::{Occurrences, Place, RawMesh},
    stoppable::stopped,
    weld::{has_area, has_repeated_corner, weld},
    winding::{Turned, repair},
};

/// Splits polygons, welds, drops degenerate and repeated triangles, turns those that face the wrong way, and checks how they
/// join.
pub(crate) fn clean(
    mut raw: RawMesh,
    import: Import,
    origin_in_file: DVec3,
    stop: Stop<'_>,
) -> Result<ImportedMesh, Vec<ImportError>> {
    let mut split = triangles(&mut raw, stop)?;
    let (positions, welded) = weld(raw.positions(), import, stop).map_err(stopped)?;
    raw.coordinates = Vec::new();
    for corner in &mut split.corners {
        *corner = welded[*corner as usize];
    }
    let triangles = split.corners.as_chunks_mut::<3>().0;
    split_alike(&raw, &welded, triangles);
    drop(welded);
    raw.corners = Vec::new();
    stop.check().map_err(stopped)?;

    // Slivers with three distinct vertices have no area but still close the gap between their neighbours.
    let is_dropped: Vec<bool> = triangles
        .iter()
        .map(|&triangle| has_repeated_corner(triangle))
        .collect();
    let mut without_area = Occurrences::default();
    for face in chosen(raw.faces.by_triangle(), &is_dropped) {
        without_area.note(face.place);
    }
    let place_of = |triangle: usize| Place(raw.places, raw.faces.of_triangle(triangle).place);
    let mut doubles = Doubles::of(triangles, is_dropped, stop).map_err(stopped)?;
    let turned = repair(&positions, triangles, &mut doubles.uses, stop).map_err(stopped)?;
    stop.check().map_err(stopped)?;
    let is_single = |&(triangle, _): &(usize, _)| !doubles.is_dropped[triangle];
    let single = triangles.iter().copied().enumerate().filter(is_single);
    let edges = Edges::of(&doubles.uses, single.map(|(_, corners)| corners), positions.len());
    doubles.uses = Vec::new();
    let mut is_kept = vec![false; triangles.len()];
    for triangle in (0..triangles.len()).filter(|&triangle| !doubles.is_dropped[triangle]) {
        is_kept[triangle] = has_area(&positions, triangles[triangle]);
        if !is_kept[triangle] {
            without_area.note_least(place_of(triangle).1);
        }
    }
    if !is_kept.contains(&true) {
        return Err(vec![ImportError::Empty {
            dropped: raw.without_area.count + without_area.count,
            unknown: raw.unknown.count,
        }]);
    }

    let mut warnings = raw.warnings.clone();
    warnings.extend(of_faces(&raw, without_area, split.overlapping));
    warnings.extend(of_triangles(&doubles, &turned, place_of));
    if raw.unused_vertices > 0 {
        let unused = raw.unused_vertices;
        warnings.push(format!("{unused} vertices are not used by any face"));
    }
    warnings.extend(edges.warnings(place_of));
    let kept = is_kept.iter().filter(|is_kept| **is_kept).count();
    let mut indices_in_file = Vec::with_capacity(kept);
    indices_in_file.extend(chosen(0.., &is_kept));
    let mut of_mesh = Vec::with_capacity(kept);
    of_mesh.extend(chosen(triangles.iter().copied(), &is_kept));
    drop(split.corners);
    let names = raw.faces.by_triangle().map(|face| face.names);
    let groups = raw.names.groups(chosen(names, &is_kept));
    let mesh = TriangleMesh::new(positions, of_mesh).map_err(|error| vec![ImportError::Unusable(error)])?;
    Ok(ImportedMesh {
        mesh,
        origin_in_file,
        triangles_in_file: raw.faces.triangles(),
        groups,
        indices_in_file,
        warnings,
    })
}

fn chosen<T>(items: impl Iterator<Item = T>, is_chosen: &[bool]) -> impl Iterator<Item = T> {
    let paired = items.zip(is_chosen);
    paired.filter(|(_, is_chosen)| **is_chosen).map(|(item, _)| item)
}

/// Warnings of what is wrong with faces as the file has them.
fn of_faces(
    raw: &RawMesh,
    without_area: Occurrences,
    overlapping: Occurrences,
) -> impl Iterator<Item = String> {
    [
        (
            raw.unknown,
            "lines start with an unknown keyword and were ignored",
        ),
        (
            raw.without_area,
            "points, lines and faces with fewer than three corners were dropped",
        ),
        (without_area, "triangles without area were dropped"),
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

/// Warnings of triangles that were dropped or turned.
fn of_triangles(
    doubles: &Doubles,
    turned: &Turned,
    place_of: impl Fn(usize) -> Place,
) -> impl Iterator<Item = String> {
    let kept = doubles.is_dropped.iter().filter(|is_dropped| !*is_dropped);
    let is_whole = turned.inside_out.count == kept.count();
    let some_inside_out = if is_whole {
        Occurrences::default()
    } else {
        turned.inside_out
    };
    [
        (doubles.repeated, "triangles that repeat an earlier one were dropped"),
        (
            doubles.two_sided,
            "triangles that repeat an earlier one with the opposite winding were dropped: of faces with two sides, one was kept",
        ),
        (
            doubles.undecided,
            "triangles that repeat an earlier one with the opposite winding were kept: the rest of the surface is closed without \
             either",
        ),
        (
            turned.disagreeing,
            "triangles faced the opposite way of the rest of their part and were turned",
        ),
        (some_inside_out, "triangles of parts that were inside out were turned"),
    ]
    .into_iter()
    .filter(|(oddity, _)| oddity.count > 0)
    .map(move |(Occurrences { count, first }, what)| {
        format!("{count} {what}; the first is {}", place_of(first))
    })
    .chain(is_whole.then(|| "the mesh was inside out; all triangles were turned".to_owned()))
}
