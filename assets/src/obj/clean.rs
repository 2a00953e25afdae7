//! From `tobj`'s result to a welded, checked mesh.

use std::collections::{HashMap, HashSet};

use glam::Vec3;
use grasp_synthesis::geometry::mesh::TriangleMesh;

use super::{
    ObjError,
    scan::{Oddity, Scan},
};

/// A mesh that can be used.
#[derive(Debug)]
pub(super) struct Cleaned {
    pub(super) mesh: TriangleMesh,
    /// For each triangle the index of the face it came from.
    pub(super) faces: Vec<usize>,
    /// For each triangle its index before any were dropped.
    pub(super) places: Vec<u32>,
    pub(super) warnings: Vec<String>,
}

/// Parses what the scan passed on, welds it, drops what has no area, and looks at how the triangles join.
pub(super) fn clean(scan: &Scan, unit_metres: f32) -> Result<Cleaned, Vec<ObjError>> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ..tobj::LoadOptions::default()
    };
    // The scan passes no material library on; should one get through, it is refused rather than opened.
    let refuse = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut scan.plain.as_bytes(), &options, refuse)
        .map_err(|error| vec![ObjError::Unreadable(error)])?;
    // Without groups in its input, tobj returns one model.
    let Some(parsed) = models.into_iter().next().map(|model| model.mesh) else {
        return Err(vec![ObjError::Empty {
            dropped: scan.without_area.count,
        }]);
    };

    let (positions, welded) = weld(&parsed.positions, unit_metres);
    let corners: Vec<[u32; 3]> = parsed
        .indices
        .as_chunks()
        .0
        .iter()
        .map(|triangle| triangle.map(|vertex| welded[vertex as usize]))
        .collect();
    let origins = scan
        .faces
        .iter()
        .enumerate()
        .flat_map(|(face, scanned)| std::iter::repeat_n(face, scanned.corners - 2));

    let mut dropped = Dropped::default();
    let mut seen = HashSet::new();
    let mut triangles = Vec::new();
    let mut faces = Vec::new();
    let mut places = Vec::new();
    // Slivers of three distinct vertices have no area but do close the gap between their neighbours.
    let mut joined = Vec::new();
    for (place, (triangle, face)) in corners.into_iter().zip(origins).enumerate() {
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
                places.push(place as u32);
            } else {
                dropped.without_area.note(line);
            }
        }
    }
    if triangles.is_empty() {
        return Err(vec![ObjError::Empty {
            dropped: scan.without_area.count + dropped.without_area.count,
        }]);
    }

    let mut warnings = dropped.warnings(scan);
    let unused = scan.vertices - parsed.positions.len() / 3;
    if unused > 0 {
        warnings.push(format!("{unused} vertices are not used by any face"));
    }
    if let Some(line) = first_concave_polygon(scan, &parsed) {
        warnings.push(format!(
            "line {line}: a polygon is not convex; its fan of triangles overlaps itself"
        ));
    }
    let joints = Joints::of(&joined, positions.len());
    warnings.extend(joints.warnings());
    let mut mesh = usable(positions, triangles)?;
    if joints.is_closed() && mesh.signed_volume() < 0.0 {
        let turned = mesh.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
        mesh = usable(mesh.positions().to_vec(), turned)?;
        warnings.push("the mesh was inside out; all triangles were turned".to_owned());
    }
    Ok(Cleaned {
        mesh,
        faces,
        places,
        warnings,
    })
}

fn usable(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<TriangleMesh, Vec<ObjError>> {
    TriangleMesh::new(positions, triangles).map_err(|error| vec![ObjError::Unusable(error)])
}

/// What was left out.
#[derive(Debug, Default)]
struct Dropped {
    without_area: Oddity,
    repeated: Oddity,
}

impl Dropped {
    fn warnings(&self, scan: &Scan) -> Vec<String> {
        [
            (scan.unknown, "lines begin with an unknown word and were not read"),
            (
                scan.without_area,
                "points, lines and faces of less than three corners were dropped",
            ),
            (self.without_area, "triangles without area were dropped"),
            (self.repeated, "triangles that repeat an earlier one were dropped"),
        ]
        .into_iter()
        .filter(|(oddity, _)| oddity.count > 0)
        .map(|(Oddity { count, first_line }, what)| {
            format!("{count} {what}; the first is in line {first_line}")
        })
        .collect()
    }
}

/// Scales positions to metres and merges those that are equal; returns them with each vertex' new index.
fn weld(coordinates: &[f32], unit_metres: f32) -> (Vec<Vec3>, Vec<u32>) {
    let mut known = HashMap::new();
    let mut positions = Vec::new();
    let indices = coordinates
        .as_chunks()
        .0
        .iter()
        .map(|&[x, y, z]: &[f32; 3]| {
            // Adding zero turns −0 into 0, so that equal numbers have equal bits.
            let position = Vec3::new(x, y, z) * unit_metres + Vec3::ZERO;
            *known
                .entry(position.to_array().map(f32::to_bits))
                .or_insert_with(|| {
                    positions.push(position);
                    positions.len() as u32 - 1
                })
        })
        .collect();
    (positions, indices)
}

fn has_repeated_corner([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// The same triangle, begun at its smallest index: equal for equal triangles of equal winding.
fn smallest_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// Whether [`TriangleMesh`] takes it.
fn has_area(positions: &[Vec3], triangle: [u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
    (b - a).cross(c - a).length().is_normal()
}

/// The line of the first polygon with a triangle in its fan that is wound against the others.
fn first_concave_polygon(scan: &Scan, parsed: &tobj::Mesh) -> Option<usize> {
    let position = |vertex: u32| {
        let start = 3 * vertex as usize;
        Vec3::from_slice(&parsed.positions[start..start + 3]).as_dvec3()
    };
    let mut triangles = parsed.indices.as_chunks::<3>().0.iter();
    scan.faces.iter().find_map(|face| {
        let normals: Vec<_> = triangles
            .by_ref()
            .take(face.corners - 2)
            .map(|triangle| {
                let [a, b, c] = triangle.map(position);
                (b - a).cross(c - a)
            })
            .collect();
        let mean: glam::DVec3 = normals.iter().sum();
        normals
            .iter()
            .any(|normal| normal.dot(mean) < 0.0)
            .then_some(face.line)
    })
}

/// How triangles join at their edges.
#[derive(Debug)]
struct Joints {
    /// Edges of one triangle.
    open: usize,
    /// Edges of two triangles that run along them in the same direction.
    inconsistent: usize,
    /// Edges of more than two triangles.
    crowded: usize,
    /// Edges that are not passed as often in one direction as in the other.
    unbalanced: usize,
    /// Sets of triangles that share no vertex.
    components: usize,
}

impl Joints {
    fn of(triangles: &[[u32; 3]], vertices: usize) -> Self {
        let mut edges: Vec<([u32; 2], i32)> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(from, to)| ([from.min(to), from.max(to)], if from < to { 1 } else { -1 }))
            .collect();
        edges.sort_unstable();
        let mut joints = Self {
            open: 0,
            inconsistent: 0,
            crowded: 0,
            unbalanced: 0,
            components: components(triangles, vertices),
        };
        for passes in edges.chunk_by(|(first, _), (second, _)| first == second) {
            let balance: i32 = passes.iter().map(|(_, direction)| direction).sum();
            match passes.len() {
                1 => joints.open += 1,
                2 if balance != 0 => joints.inconsistent += 1,
                2 => {}
                _ => joints.crowded += 1,
            }
            joints.unbalanced += usize::from(balance != 0);
        }
        joints
    }

    /// Whether the surface has an inside.
    fn is_closed(&self) -> bool {
        self.unbalanced == 0
    }

    fn warnings(&self) -> impl Iterator<Item = String> {
        [
            (
                self.open,
                0,
                "edges are open: the surface has holes and its volume is a guess",
            ),
            (
                self.inconsistent,
                0,
                "edges join triangles that face opposite sides: the winding is inconsistent",
            ),
            (self.crowded, 0, "edges join more than two triangles"),
            (self.components, 1, "separate parts share no vertex"),
        ]
        .into_iter()
        .filter(|(count, usual, _)| count > usual)
        .map(|(count, _, what)| format!("{count} {what}"))
    }
}

/// How many sets of triangles there are that share no vertex, by union-find with path halving.
fn components(triangles: &[[u32; 3]], vertices: usize) -> usize {
    fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
        while parents[vertex as usize] != vertex {
            let above = parents[parents[vertex as usize] as usize];
            parents[vertex as usize] = above;
            vertex = above;
        }
        vertex
    }
    let mut parents: Vec<u32> = (0..vertices as u32).collect();
    for &[a, b, c] in triangles {
        let first = root(&mut parents, a);
        for other in [b, c] {
            let other = root(&mut parents, other);
            parents[other as usize] = first;
        }
    }
    let mut roots: Vec<u32> = triangles
        .iter()
        .map(|triangle| root(&mut parents, triangle[0]))
        .collect();
    roots.sort_unstable();
    roots.dedup();
    roots.len()
}
