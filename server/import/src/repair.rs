//! Splits the polygons of a mesh from a file, welds it, checks it and repairs what is certain.

use std::{collections::HashMap, fmt};

use glam::{DVec3, Vec3};
use grasp_synthesis::{
    base::stop::{Stop, Stopped},
    geometry::mesh::TriangleMesh,
};

use crate::{
    Import, ImportedMesh,
    edges::{Doubles, Edges, components},
    error::{ImportError, Violations},
    polygon::{MAX_CLIPPED_CORNERS, Split, split},
    raw::{Occurrences, Place, Places, RawMesh},
    winding::{TurnedTriangles, face_outward},
};

/// Faces split between two checks whether to stop.
const FACES_PER_CHECK: usize = 256;

/// Vertices welded between two checks whether to stop.
const VERTICES_PER_CHECK: usize = 4096;

/// Splits polygons, welds, drops degenerate and repeated triangles, turns those that face the wrong way, and checks how they
/// join.
pub(crate) fn repair(
    mut raw: RawMesh,
    import: Import,
    origin_in_file: DVec3,
    stop: Stop<'_>,
) -> Result<ImportedMesh, Violations> {
    let mut overlapping = Occurrences::default();
    let mut corners = split_faces(&mut raw, &mut overlapping, stop)?;
    let (positions, welded) = weld(&raw.positions, import, stop)?;
    raw.positions = Vec::new();
    for corner in &mut corners {
        *corner = welded[*corner as usize];
    }
    let triangles = corners.as_chunks_mut::<3>().0;
    split_alike(&raw, &welded, triangles);
    drop(welded);
    raw.corners = Vec::new();
    stop.check()?;

    // Slivers with three distinct vertices have no area but still close the gap between their neighbours.
    let is_dropped: Vec<bool> = triangles
        .iter()
        .map(|&[a, b, c]| a == b || b == c || c == a)
        .collect();
    let mut without_area = Occurrences::default();
    for face in chosen(raw.faces.by_triangle(), &is_dropped) {
        without_area.note(face.place);
    }
    let place_of = |triangle: usize| raw.faces.of_triangle(triangle).place;
    let mut doubles = Doubles::of(triangles, is_dropped, stop)?;
    let turned = face_outward(&positions, triangles, &mut doubles.uses, stop)?;
    stop.check()?;
    let is_single: Vec<bool> = doubles.is_dropped.iter().map(|is_dropped| !is_dropped).collect();
    let edges = Edges::of(&doubles.uses);
    doubles.uses = Vec::new();
    let parts = components(chosen(triangles.iter().copied(), &is_single), positions.len());
    let mut is_kept = vec![false; triangles.len()];
    for triangle in chosen(0.., &is_single) {
        is_kept[triangle] = has_area(&positions, triangles[triangle]);
        if !is_kept[triangle] {
            without_area.note(place_of(triangle));
        }
    }
    if !is_kept.contains(&true) {
        return Err(raw.empty(without_area.count).into());
    }

    let findings = Findings {
        without_area,
        overlapping,
        doubles,
        turned,
        edges,
        parts,
    };
    let warnings = findings.warnings(&raw);
    let kept = is_kept.iter().filter(|is_kept| **is_kept).count();
    let mut indices_in_file = Vec::with_capacity(kept);
    indices_in_file.extend(chosen(0.., &is_kept));
    let mut of_mesh = Vec::with_capacity(kept);
    of_mesh.extend(chosen(triangles.iter().copied(), &is_kept));
    drop(corners);
    let names = raw.faces.by_triangle().map(|face| face.names);
    let groups = raw.names.groups(chosen(names, &is_kept));
    let mesh = TriangleMesh::new(positions, of_mesh).map_err(ImportError::from)?;
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

/// What is odd about a mesh beside the notes of its reader.
struct Findings {
    /// Triangles of the file without area.
    without_area: Occurrences,
    /// Polygons that intersect themselves.
    overlapping: Occurrences,
    doubles: Doubles,
    turned: TurnedTriangles,
    edges: Edges,
    /// Number of connected parts.
    parts: usize,
}

impl Findings {
    /// One warning of each kind, after those of the reader.
    fn warnings(&self, raw: &RawMesh) -> Vec<String> {
        let (doubles, turned, edges) = (&self.doubles, &self.turned, &self.edges);
        let place_of = |triangle: usize| raw.faces.of_triangle(triangle).place;
        let mut warnings = raw.warnings.clone();
        let of_place = |first| Place(raw.places, first);
        tell(
            &mut warnings,
            &[
                (
                    raw.unknown,
                    "lines start with an unknown keyword and were ignored",
                ),
                (
                    raw.without_area,
                    "points, lines and faces with fewer than three corners were dropped",
                ),
                (self.without_area, "triangles without area were dropped"),
                (
                    self.overlapping,
                    "polygons intersect themselves; their fans of triangles overlap",
                ),
            ],
            of_place,
        );
        let singles = doubles
            .is_dropped
            .iter()
            .filter(|is_dropped| !**is_dropped)
            .count();
        let is_whole = turned.inside_out.count == singles;
        let some_inside_out = if is_whole {
            Occurrences::default()
        } else {
            turned.inside_out
        };
        tell(
            &mut warnings,
            &[
                (
                    doubles.repeated,
                    "triangles that repeat an earlier one were dropped",
                ),
                (
                    doubles.two_sided,
                    "triangles that repeat an earlier one with the opposite winding were dropped: of faces with two sides, one was kept",
                ),
                (
                    doubles.undecided,
                    "triangles that repeat an earlier one with the opposite winding were kept: the rest of the surface is closed \
                     without either",
                ),
                (
                    turned.disagreeing,
                    "triangles faced the opposite way of the rest of their part and were turned",
                ),
                (
                    some_inside_out,
                    "triangles of parts that were inside out were turned",
                ),
            ],
            |first| of_place(place_of(first)),
        );
        if is_whole {
            warnings.push("the mesh was inside out; all triangles were turned".to_owned());
        }
        if raw.unused_vertices > 0 {
            let unused = raw.unused_vertices;
            warnings.push(format!("{unused} vertices are not used by any face"));
        }
        tell(
            &mut warnings,
            &[
                (
                    edges.open,
                    "edges are open: the surface has holes and its volume is an estimate",
                ),
                (
                    edges.inconsistent,
                    "edges join triangles that face opposite ways: the winding is inconsistent",
                ),
                (edges.crowded, "edges join more than two triangles"),
            ],
            |first| {
                let face = if raw.places == Places::Lines {
                    "the face "
                } else {
                    ""
                };
                format!("at {face}{}", of_place(place_of(first)))
            },
        );
        if self.parts > 1 {
            let parts = self.parts;
            warnings.push(format!("{parts} parts are disconnected: they share no vertex"));
        }
        warnings
    }
}

/// Adds a warning of each kind of oddity that occurred.
fn tell<P: fmt::Display>(
    warnings: &mut Vec<String>,
    oddities: &[(Occurrences, &str)],
    place: impl Fn(usize) -> P,
) {
    for (Occurrences { count, first }, what) in oddities.iter().filter(|(oddity, _)| oddity.count > 0) {
        warnings.push(format!("{count} {what}; the first is {}", place(*first)));
    }
}

/// Splits every face; one of n corners becomes n - 2 triangles, given by their corners in the file's order. Takes the corners of
/// a mesh that has triangles only.
fn split_faces(
    raw: &mut RawMesh,
    overlapping: &mut Occurrences,
    stop: Stop<'_>,
) -> Result<Vec<u32>, Violations> {
    if raw.faces.are_triangles() {
        return Ok(std::mem::take(&mut raw.corners));
    }
    let mut triangles = Vec::with_capacity(3 * raw.faces.triangles());
    let mut violations = Violations::default();
    let mut rest = raw.corners.as_slice();
    let (mut positions, mut places) = (Vec::new(), Vec::new());
    for (number, face) in raw.faces.iter().enumerate() {
        stop.check_every(FACES_PER_CHECK, number)?;
        let (corners, others) = rest.split_at(face.corners);
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
            Split::Overlapping => overlapping.note(face.place),
            Split::TooManyCorners => {
                let what = format!(
                    "a polygon that is not convex has {} corners; at most {MAX_CLIPPED_CORNERS} are allowed, split it into triangles",
                    face.corners
                );
                violations.add(Place(raw.places, face.place).to_string(), what);
            }
        }
        triangles.extend(places.iter().flatten().map(|&place| corners[place]));
    }
    violations.into_result()?;
    Ok(triangles)
}

/// Scales positions to metres, turns +Y up, rounds to single precision and merges equal ones; returns them with the new index of
/// each vertex.
fn weld(positions: &[DVec3], import: Import, stop: Stop<'_>) -> Result<(Vec<Vec3>, Vec<u32>), Stopped> {
    let mut known = HashMap::new();
    let mut welded = Vec::new();
    let mut indices = Vec::with_capacity(positions.len());
    for (number, &position) in positions.iter().enumerate() {
        stop.check_every(VERTICES_PER_CHECK, number)?;
        // Adding zero turns −0 into 0, so that equal numbers have equal bits.
        let position = import.metres_from_file(position).as_vec3() + Vec3::ZERO;
        indices.push(
            *known
                .entry(position.to_array().map(f32::to_bits))
                .or_insert_with(|| {
                    welded.push(position);
                    welded.len() as u32 - 1
                }),
        );
    }
    Ok((welded, indices))
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
    corners: usize,
    /// Where its corners begin among those of all faces, and its triangles among all triangles.
    first_corner: usize,
    first_triangle: usize,
}

/// Gives polygons that repeat an earlier one, from any corner and in either winding, the triangles of that one: only then do they
/// match. `welded` has the vertex of each of the file's, and `triangles` those of all faces, welded.
fn split_alike(raw: &RawMesh, welded: &[u32], triangles: &mut [[u32; 3]]) {
    let mut polygons = Vec::new();
    let (mut first_corner, mut first_triangle) = (0, 0);
    for face in raw.faces.iter() {
        let corners = face.corners;
        if corners > 3 {
            let vertices = raw.corners[first_corner..first_corner + corners].iter();
            let hashes = vertices.map(|&vertex| scattered(welded[vertex as usize]));
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
        let corners = &raw.corners[polygon.first_corner..][..polygon.corners];
        corners.iter().map(|&vertex| welded[vertex as usize])
    };
    for alike in polygons.chunk_by(|a, b| (a.hash, a.corners) == (b.hash, b.corners)) {
        let (first, count) = (&alike[0], alike[0].corners);
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
                    let [a, b, c] = triangles[first.first_triangle + offset];
                    triangles[other.first_triangle + offset] = if is_same { [a, b, c] } else { [a, c, b] };
                }
            }
        }
    }
}

/// A number whose bits all depend on a vertex: the finaliser of `SplitMix64`.
fn scattered(vertex: u32) -> u64 {
    let number = u64::from(vertex) + 0x9e37_79b9_7f4a_7c15;
    let number = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let number = (number ^ (number >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    number ^ (number >> 31)
}
