//! Splits the polygons of a mesh from a file, welds it, checks it and makes the repairs that are certain.

use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};

use glam::{DVec3, Vec3};
use grasp_synthesis::{
    base::stop::{Stop, Stopped},
    geometry::mesh::TriangleMesh,
};

use crate::{
    Import, ImportedMesh,
    edges::{Doubles, components, note_odd},
    error::{ImportError, Violations},
    polygon::{MAX_CLIPPED_CORNERS, Split, split},
    raw::{ODDITIES, Occurrences, Oddity, Places, RawFace, RawMesh},
    winding::face_outward,
};

/// Faces split between two checks whether to stop.
const FACES_PER_CHECK: usize = 256;

/// Splits polygons, welds, drops degenerate and repeated triangles, turns those that face the wrong way, and notes how they join.
pub(crate) fn repair(
    mut raw: RawMesh,
    import: Import,
    origin_in_file: DVec3,
    stop: Stop<'_>,
) -> Result<ImportedMesh, Violations> {
    let mut corners = split_faces(&mut raw, stop)?;
    let (positions, welded) = weld(std::mem::take(&mut raw.positions), import, stop)?;
    for corner in &mut corners {
        *corner = welded[*corner as usize];
    }
    let triangles = corners.as_chunks_mut::<3>().0;
    split_alike(&raw, &welded, triangles);
    drop(welded);
    raw.corners = Vec::new();
    stop.check()?;

    // Slivers with three distinct vertices have no area but still close the gap between their neighbours.
    let are_degenerate = triangles.iter().map(|&[a, b, c]| a == b || b == c || c == a);
    let is_dropped: Vec<bool> = are_degenerate.collect();
    let oddities = &mut raw.oddities;
    chosen(0.., &is_dropped).for_each(|triangle| oddities.note(Oddity::NoArea, triangle));
    let mut doubles = Doubles::of(triangles, positions.len(), is_dropped, oddities, stop)?;
    face_outward(&positions, triangles, &mut doubles.uses, oddities, stop)?;
    stop.check()?;
    let is_single: Vec<bool> = doubles.is_dropped.iter().map(|is_dropped| !is_dropped).collect();
    note_odd(&doubles.uses, oddities);
    drop(doubles);
    let parts = components(chosen(triangles.iter().copied(), &is_single), positions.len());
    let mut is_kept = vec![false; triangles.len()];
    for triangle in chosen(0.., &is_single) {
        is_kept[triangle] = has_area(&positions, triangles[triangle]);
        if !is_kept[triangle] {
            oddities.note(Oddity::NoArea, triangle);
        }
    }
    if !is_kept.contains(&true) {
        return Err(raw.empty().into());
    }

    let singles = is_single.iter().filter(|is_single| **is_single).count();
    let warnings = warnings(&raw, singles, parts);
    let kept = is_kept.iter().filter(|is_kept| **is_kept).count();
    let mut indices_in_file = Vec::with_capacity(kept);
    indices_in_file.extend(chosen(raw.faces.by_triangle(), &is_kept).map(|face| face.triangle));
    let mut of_mesh = Vec::with_capacity(kept);
    of_mesh.extend(chosen(triangles.iter().copied(), &is_kept));
    drop(corners);
    let names = raw.faces.by_triangle().map(|face| face.names as usize);
    let groups = raw.names.groups(chosen(names, &is_kept));
    let mesh = TriangleMesh::new(positions, of_mesh).map_err(ImportError::from)?;
    Ok(ImportedMesh {
        mesh,
        origin_in_file,
        triangles_in_file: raw.triangles,
        groups,
        indices_in_file,
        warnings,
    })
}

fn chosen<T>(items: impl Iterator<Item = T>, is_chosen: &[bool]) -> impl Iterator<Item = T> {
    let paired = items.zip(is_chosen);
    paired.filter(|(_, is_chosen)| **is_chosen).map(|(item, _)| item)
}

/// One warning of each oddity of a mesh, after those of its reader. It has `singles` triangles once, in `parts` connected parts.
fn warnings(raw: &RawMesh, singles: usize, parts: usize) -> Vec<String> {
    let is_whole = raw.oddities.of(Oddity::InsideOut).count == singles;
    let mut warnings = raw.warnings.clone();
    for (oddity, what) in ODDITIES {
        if oddity == Oddity::OpenEdge {
            let whole = is_whole.then(|| "the mesh was inside out; all triangles were turned".to_owned());
            let unused = Some(raw.unused_vertices).filter(|&count| count > 0);
            warnings.extend(whole);
            warnings.extend(unused.map(|count| format!("{count} vertices are not used by any face")));
        }
        let Occurrences { count, mut first } = raw.oddities.of(oddity);
        if count == 0 || oddity == Oddity::InsideOut && is_whole {
            continue;
        }
        if oddity > Oddity::FewCorners {
            let mut faces = raw.faces.by_triangle();
            first = faces.nth(first).map_or(0, |face| face.place as usize);
        }
        let before = match raw.places {
            _ if oddity < Oddity::OpenEdge => "",
            Places::Lines => "at the face ",
            _ => "at ",
        };
        let place = raw.places.named(first);
        warnings.push(format!("{count} {what}; the first is {before}{place}"));
    }
    if parts > 1 {
        warnings.push(format!("{parts} parts are disconnected: they share no vertex"));
    }
    warnings
}

/// Splits every face of n corners into n - 2 triangles; takes the corners of a mesh that has triangles only.
fn split_faces(raw: &mut RawMesh, stop: Stop<'_>) -> Result<Vec<u32>, Violations> {
    raw.corners.shrink_to_fit();
    if raw.faces.are_triangles() {
        return Ok(std::mem::take(&mut raw.corners));
    }
    let mut triangles = Vec::with_capacity(3 * raw.triangles);
    let mut violations = Violations::default();
    let mut rest = raw.corners.as_slice();
    let (mut positions, mut places) = (Vec::new(), Vec::new());
    for (number, face) in raw.faces.iter().enumerate() {
        stop.check_every(FACES_PER_CHECK, number)?;
        let (corners, others) = rest.split_at(face.corners as usize);
        rest = others;
        if corners.len() == 3 {
            triangles.extend(corners);
            continue;
        }
        positions.clear();
        positions.extend(corners.iter().map(|&vertex| raw.positions[vertex as usize]));
        places.clear();
        match split(&positions, &mut places, stop)? {
            Split::Exact => {}
            Split::Overlapping => raw.oddities.note(Oddity::Overlapping, triangles.len() / 3),
            Split::TooManyCorners => {
                let what = format!(
                    "a polygon that is not convex has {} corners; at most {MAX_CLIPPED_CORNERS} are allowed, split it into triangles",
                    face.corners
                );
                violations.add(raw.places.named(face.place as usize), what);
            }
        }
        triangles.extend(places.iter().flatten().map(|&place| corners[place]));
    }
    violations.into_result()?;
    Ok(triangles)
}

/// Positions in metres with +Y up, in single precision and each once, and the new index of each vertex. Sorted, because a hash map
/// would take three times the memory.
fn weld(positions: Vec<DVec3>, import: Import, stop: Stop<'_>) -> Result<(Vec<Vec3>, Vec<u32>), Stopped> {
    // Adding zero turns −0 into 0, so that equal numbers have equal bits.
    let in_metres = |&position| import.metres_from_file(position).as_vec3() + Vec3::ZERO;
    let mut all: Vec<Vec3> = positions.iter().map(in_metres).collect();
    drop(positions);
    stop.check()?;
    let bits = |vertex: u32| all[vertex as usize].to_array().map(f32::to_bits);
    let mut sorted: Vec<u32> = (0..all.len() as u32).collect();
    sorted.sort_unstable_by_key(|&vertex| (bits(vertex), vertex));
    stop.check()?;
    // First the vertex that each one equals.
    let mut indices = vec![0; all.len()];
    for equal in sorted.chunk_by(|&a, &b| bits(a) == bits(b)) {
        for &vertex in equal {
            indices[vertex as usize] = equal[0];
        }
    }
    drop(sorted);
    let mut count = 0;
    for vertex in 0..all.len() {
        let first = indices[vertex] as usize;
        indices[vertex] = if first == vertex {
            all[count] = all[vertex];
            count += 1;
            count as u32 - 1
        } else {
            indices[first]
        };
    }
    all.truncate(count);
    all.shrink_to_fit();
    Ok((all, indices))
}

/// Whether [`TriangleMesh`] accepts the triangle.
fn has_area(positions: &[Vec3], triangle: [u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
    (b - a).cross(c - a).length().is_normal()
}

/// A polygon of more than three corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Polygon {
    /// Equal for equal corners in any order.
    hash: u64,
    corners: u32,
    /// Where its corners begin among those of all faces, and its triangles among all triangles.
    first_corner: u32,
    first_triangle: u32,
}

/// Gives polygons that repeat an earlier one, from any corner and in either winding, the triangles of that one: only then do they
/// match. `welded` has the vertex of each of the file's, and `triangles` those of all faces, welded.
fn split_alike(raw: &RawMesh, welded: &[u32], triangles: &mut [[u32; 3]]) {
    let hasher = BuildHasherDefault::<DefaultHasher>::new();
    let is_polygon = |face: &RawFace| face.corners > 3;
    let mut polygons = Vec::with_capacity(raw.faces.iter().filter(is_polygon).count());
    let (mut first_corner, mut first_triangle) = (0, 0);
    for face in raw.faces.iter() {
        let corners = face.corners;
        if is_polygon(&face) {
            let vertices = raw.corners[first_corner as usize..][..corners as usize].iter();
            let hashes = vertices.map(|&vertex| hasher.hash_one(welded[vertex as usize]));
            polygons.push(Polygon {
                hash: hashes.fold(0, u64::wrapping_add),
                corners,
                first_corner,
                first_triangle,
            });
        }
        first_corner += corners;
        first_triangle += corners - 2;
    }
    polygons.sort_unstable();
    let cycle = |polygon: &Polygon| {
        let corners = &raw.corners[polygon.first_corner as usize..][..polygon.corners as usize];
        corners.iter().map(|&vertex| welded[vertex as usize])
    };
    for alike in polygons.chunk_by(|a, b| (a.hash, a.corners) == (b.hash, b.corners)) {
        let (first, count) = (&alike[0], alike[0].corners as usize);
        for other in &alike[1..] {
            let start = cycle(first).next();
            let Some(start) = cycle(other).position(|corner| Some(corner) == start) else {
                continue;
            };
            let forward = cycle(other).cycle().skip(start).take(count);
            let backward = cycle(other).rev().cycle().skip(count - 1 - start).take(count);
            let is_same = cycle(first).eq(forward);
            if is_same || cycle(first).eq(backward) {
                for offset in 0..count - 2 {
                    let [a, b, c] = triangles[first.first_triangle as usize + offset];
                    triangles[other.first_triangle as usize + offset] =
                        if is_same { [a, b, c] } else { [a, c, b] };
                }
            }
        }
    }
}
