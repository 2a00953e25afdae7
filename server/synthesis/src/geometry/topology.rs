//! How the triangles of a mesh connect, and whether its volume contains a point, by the generalised winding number at the cost of
//! one ray.
//!
//! The winding number of a point (A. Jacobson, L. Kavan, O. Sorkine-Hornung: Robust Inside-Outside Segmentation using
//! Generalized Winding Numbers, 2013) is the number of times the surface encloses it, a fraction where the surface has
//! holes. For a closed surface it is the number of times that a ray from the point leaves the surface minus the number
//! of times that it enters: overlapping parts add up and cavities cancel. Holes are closed by cones from one apex over
//! their rims: the ray counts mesh and cones, and the solid angles of the cones are subtracted (section 4.1 there).
//! Only the rims cost extra, and the result equals the sum of solid angles over all triangles. Sheets enclose nothing
//! and are left out.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::{
    Segment,
    boxes::Aabb,
    crossing::{self, ExactCrossing, ExactQuery},
    mesh::TriangleMesh,
    wide_bvh::WideBvh,
};
use crate::base::stop::{Stop, Stopped};

/// Points whose winding number exceeds this in magnitude, which ignores the mesh's orientation, are inside.
const INSIDE: f64 = 0.5;

/// Directions of the rays, tried in turn until no edge is grazed: away from axes and diagonals, which modelled edges follow.
const DIRECTIONS: [Vec3; 4] = [
    Vec3::new(0.858_314_5, 0.393_482_4, 0.329_470_7),
    Vec3::new(-0.314_159_3, 0.876_129_6, -0.365_632_5),
    Vec3::new(0.271_828_2, -0.445_761_3, 0.852_895_3),
    Vec3::new(-0.607_143_9, -0.231_764_5, -0.760_050_3),
];

/// A triangle of the cone that closes a hole.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cap {
    corners: [Vec3; 3],
    /// Its multiplicity, signed.
    count: f64,
}

/// Data of the containment test in addition to the hierarchy.
#[derive(Clone, Debug)]
pub(super) struct Containment {
    /// One for each edge of the holes' rims, in proportion to which each test takes time.
    pub(super) caps: Vec<Cap>,
    /// One flag per triangle: true if it belongs to a sheet. Empty without sheets.
    is_sheet: Vec<bool>,
    /// Length of the rays, in metres: enough to leave the box of mesh and cones from any point in it.
    ray_length: f32,
}

impl Containment {
    /// Finds the rims of a mesh's holes and closes them; O(n).
    pub(super) fn of(mesh: &TriangleMesh, aabb: &Aabb, stop: Stop<'_>) -> Result<Self, Stopped> {
        let mut boundary = boundary_chain(mesh);
        let is_sheet = if boundary.is_empty() {
            Vec::new()
        } else {
            sheets(mesh, stop, |point| winding_number(mesh, point, |_| true))?
        };
        if !is_sheet.is_empty() {
            let volumes = mesh.submesh(|triangle| !is_sheet[triangle]);
            boundary = volumes.map_or_else(Vec::new, |volumes| boundary_chain(&volumes));
        }
        // An apex inside the box keeps the cones inside.
        let apex = aabb.centre();
        let caps = boundary
            .into_iter()
            .map(|([from, to], count)| Cap {
                // Traverses the rim backward, as a neighbouring triangle would.
                corners: [to, from, apex],
                count: f64::from(count),
            })
            .collect();
        Ok(Self {
            caps,
            is_sheet,
            ray_length: 2.0 * aabb.diagonal(),
        })
    }

    /// True if the volume contains the point, which must lie inside the mesh's box.
    pub(super) fn contains(&self, bvh: &WideBvh, mesh: &TriangleMesh, point: Vec3) -> bool {
        let winding = DIRECTIONS
            .iter()
            .find_map(|&direction| self.winding_along(bvh, mesh, point, direction))
            .unwrap_or_else(|| winding_number(mesh, point, |triangle| !self.is_sheet(triangle)));
        winding.abs() > INSIDE
    }

    /// The winding number, counted along a ray; `None` if the ray grazes an edge.
    fn winding_along(&self, bvh: &WideBvh, mesh: &TriangleMesh, point: Vec3, direction: Vec3) -> Option<f64> {
        let ray = Segment::new(point, point + direction * self.ray_length);
        let mut crossings = Some(0.0);
        crossing::visit_all(bvh, mesh, ray, |triangle, outcome| {
            if self.is_sheet(triangle as usize) {
                return true;
            }
            crossings = crossings.zip(signed(outcome)).map(|(sum, sign)| sum + sign);
            crossings.is_some()
        });
        let mut winding = crossings?;
        if !self.caps.is_empty() {
            let exact = ExactQuery::new(ray);
            for cap in &self.caps {
                let crossed = signed(exact.test(cap.corners))?;
                winding += cap.count * (crossed - solid_angle_share(cap.corners, point));
            }
        }
        Some(winding)
    }

    /// Memory use in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.caps.as_slice()) + size_of_val(self.is_sheet.as_slice())
    }

    /// True if the triangle belongs to a sheet.
    pub(super) fn is_sheet(&self, triangle: usize) -> bool {
        self.is_sheet.get(triangle).is_some_and(|&is_sheet| is_sheet)
    }
}

/// +1 for leaving the volume, -1 for entering, 0 for a miss, `None` for a graze.
fn signed(outcome: ExactCrossing) -> Option<f64> {
    match outcome {
        ExactCrossing::Miss => Some(0.0),
        ExactCrossing::Hit(crossing) => Some(if crossing.leaves { 1.0 } else { -1.0 }),
        ExactCrossing::Graze(_) => None,
    }
}

/// The generalised winding number by its definition, from the solid angles of the triangles that `counts` accepts; O(n).
fn winding_number(mesh: &TriangleMesh, point: Vec3, counts: impl Fn(usize) -> bool) -> f64 {
    (0..mesh.triangles().len())
        .filter(|&triangle| counts(triangle))
        .map(|triangle| solid_angle_share(mesh.corners(triangle), point))
        .sum()
}

/// The signed solid angle of a triangle as a share of the sphere, positive seen from the back (van Oosterom and Strackee, 1983).
fn solid_angle_share(corners: [Vec3; 3], point: Vec3) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - point.as_dvec3());
    let (la, lb, lc) = (DVec3::length(a), DVec3::length(b), DVec3::length(c));
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    numerator.atan2(denominator) / std::f64::consts::TAU
}

/// Largest mean [`enclosure`] of a sheet: halfway between a flat sheet and the face of a solid.
const MAX_SHEET_ENCLOSURE: f64 = 0.75;

/// Bound on the queries of winding numbers, each in time proportional to the mesh.
const MAX_QUERIES: usize = 64;

/// Bound on the triangles that all those queries visit together, beyond [`MIN_QUERIES`].
const MAX_VISITS: usize = MAX_QUERIES * 8_000;

/// Queries that even the largest meshes get.
const MIN_QUERIES: usize = 8;

/// Minimum length of a sheet's summed area vectors as a share of its area: 0 for a closed surface, 0.5 for a hemisphere.
const MIN_SHEET_FLATNESS: f64 = 0.6;

/// Counts of a mesh's parts and of its irregular edges. Vertices at equal positions count as one, so that texture
/// seams are not holes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    /// Number of connected parts.
    pub components: usize,
    /// Edges of exactly one triangle: the rims of holes.
    pub boundary_edges: usize,
    /// Edges of more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges that two triangles traverse in the same direction: one of the two is inside out.
    pub miswound_edges: usize,
}

impl Topology {
    /// True if every edge has at least two triangles.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// True if neighbouring triangles agree on which side is outside.
    pub fn is_consistently_wound(&self) -> bool {
        self.miswound_edges == 0
    }

    /// Counts the edges of a mesh; O(n log n).
    pub fn of(mesh: &TriangleMesh) -> Self {
        let edges = sorted_edges(mesh);
        let parts = connected_parts(mesh, &edges);
        let mut topology = Self {
            components: 0,
            boundary_edges: 0,
            non_manifold_edges: 0,
            miswound_edges: 0,
        };
        for users in edges.chunk_by(|a, b| a.ends == b.ends) {
            match users {
                [_] => topology.boundary_edges += 1,
                [a, b] => topology.miswound_edges += usize::from(a.reversed == b.reversed),
                _ => topology.non_manifold_edges += 1,
            }
        }
        topology.components = parts.count();
        topology
    }
}

/// Flags of triangles that belong to a sheet, a nearly flat connected part that is no face of a solid: a card, a leaf, a sail.
/// Empty without sheets. `winding` gives the winding number of the whole mesh at a point.
fn sheets(mesh: &TriangleMesh, stop: Stop<'_>, winding: impl Fn(Vec3) -> f64) -> Result<Vec<bool>, Stopped> {
    let mut parts = connected_parts(mesh, &sorted_edges(mesh));
    let triangles = mesh.triangles().len();
    let mut sums = vec![(DVec3::ZERO, 0.0_f64); triangles];
    let mut members: Vec<Vec<(f64, usize)>> = vec![Vec::new(); triangles];
    for triangle in 0..triangles {
        let [a, b, c] = mesh.corners(triangle).map(Vec3::as_dvec3);
        let area = (b - a).cross(c - a);
        let part = parts.root(triangle as u32) as usize;
        sums[part].0 += area;
        sums[part].1 += area.length();
        members[part].push((area.length(), triangle));
    }
    let mut flat: Vec<usize> = (0..triangles)
        .filter(|&part| {
            let (vector, size) = sums[part];
            size > 0.0 && vector.length() > MIN_SHEET_FLATNESS * size
        })
        .collect();
    if flat.is_empty() {
        return Ok(Vec::new());
    }
    // The largest parts decide for all, since a plant may have thousands of leaves.
    flat.sort_by(|&a, &b| sums[b].1.total_cmp(&sums[a].1));
    let most = MAX_QUERIES.min((MAX_VISITS / triangles).max(MIN_QUERIES));
    let queries = (most / flat.len()).max(1);
    let mut is_sheet = vec![false; triangles];
    let mut area_of_sheets = [0.0, 0.0];
    for (place, &part) in flat.iter().enumerate() {
        let is_open = if place < most {
            members[part].sort_by(|a, b| b.0.total_cmp(&a.0));
            let largest = &members[part][..queries.min(members[part].len())];
            let mut enclosed = 0.0;
            for &(_, triangle) in largest {
                stop.check()?;
                enclosed += enclosure(mesh, triangle, &winding);
            }
            let is_open = enclosed < MAX_SHEET_ENCLOSURE * largest.len() as f64;
            area_of_sheets[usize::from(is_open)] += sums[part].1;
            is_open
        } else {
            area_of_sheets[1] > area_of_sheets[0]
        };
        for &(_, triangle) in &members[part] {
            is_sheet[triangle] = is_open;
        }
    }
    Ok(if is_sheet.contains(&true) {
        is_sheet
    } else {
        Vec::new()
    })
}

/// The larger magnitude of the winding numbers on both sides of a triangle: 1 for a face of a solid, 0.5 for a flat sheet.
fn enclosure(mesh: &TriangleMesh, triangle: usize, winding: impl Fn(Vec3) -> f64) -> f64 {
    /// Distance from the triangle, as a share of the square root of its area: its own edges are far away in comparison.
    const NEAR: f32 = 1e-3;
    let [a, b, c] = mesh.corners(triangle);
    let middle = (a + b + c) / 3.0;
    let away = mesh.normal(triangle) * (NEAR * (b - a).cross(c - a).length().sqrt());
    winding(middle - away).abs().max(winding(middle + away).abs())
}

/// The triangles' edges, with vertices at equal positions as one, in the order of their ends.
pub(super) fn sorted_edges(mesh: &TriangleMesh) -> Vec<EdgeUse> {
    let vertices = weld(mesh.positions());
    let mut edges = Vec::with_capacity(3 * mesh.triangles().len());
    for (triangle, corners) in mesh.triangles().iter().enumerate() {
        let [a, b, c] = corners.map(|corner| vertices[corner as usize]);
        edges.extend([[a, b], [b, c], [c, a]].map(|[from, to]| EdgeUse {
            ends: [from.min(to), from.max(to)],
            triangle: triangle as u32,
            reversed: from > to,
        }));
    }
    edges.sort_unstable();
    edges
}

/// The triangles joined across their edges.
fn connected_parts(mesh: &TriangleMesh, edges: &[EdgeUse]) -> DisjointSets {
    let mut parts = DisjointSets::new(mesh.triangles().len());
    for users in edges.chunk_by(|a, b| a.ends == b.ends) {
        for pair in users.windows(2) {
            parts.join(pair[0].triangle, pair[1].triangle);
        }
    }
    parts
}

/// One triangle's use of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct EdgeUse {
    /// The vertices, the lower index first.
    pub(super) ends: [u32; 2],
    pub(super) triangle: u32,
    /// True if the triangle traverses the edge from the higher index to the lower.
    reversed: bool,
}

/// The boundary of a mesh as directed edges, each with its uses by triangles minus those backward; empty for a closed mesh.
fn boundary_chain(mesh: &TriangleMesh) -> Vec<([Vec3; 2], i32)> {
    // The common case, closed even without welding, is much cheaper to detect.
    if is_closed_by_index(mesh.triangles()) {
        return Vec::new();
    }
    let at = |vertex: u32| mesh.positions()[vertex as usize];
    sorted_edges(mesh)
        .chunk_by(|a, b| a.ends == b.ends)
        .filter_map(|users| {
            let [from, to] = users[0].ends;
            let count: i32 = users.iter().map(|user| if user.reversed { -1 } else { 1 }).sum();
            (from != to && count != 0).then(|| ([at(from), at(to)], count))
        })
        .collect()
}

/// True if triangles use every edge equally often in both directions, by a sum of signed edge hashes.
fn is_closed_by_index(triangles: &[[u32; 3]]) -> bool {
    let mut sum = 0_u64;
    for &[a, b, c] in triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let edge = mix(u64::from(from.min(to)) << 32 | u64::from(from.max(to)));
            let signed = if from < to { edge } else { edge.wrapping_neg() };
            sum = sum.wrapping_add(signed);
        }
    }
    sum == 0
}

/// A hash in which every bit depends on every input bit: the finaliser of `SplitMix64` (S. Vigna, after D. Stafford).
fn mix(number: u64) -> u64 {
    let number = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let number = (number ^ (number >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    number ^ (number >> 31)
}

/// For each vertex, the first vertex at exactly the same position.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    let mut first = HashMap::with_capacity(positions.len());
    positions
        .iter()
        .enumerate()
        .map(|(index, &position)| {
            // Adding zero turns -0 into +0.
            let key = (position + Vec3::ZERO).to_array().map(f32::to_bits);
            *first.entry(key).or_insert(index as u32)
        })
        .collect()
}

/// Disjoint sets (union-find with path halving).
pub(super) struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    pub(super) fn new(count: usize) -> Self {
        Self {
            parents: (0..count as u32).collect(),
        }
    }

    pub(super) fn root(&mut self, mut item: u32) -> u32 {
        while self.parents[item as usize] != item {
            let grandparent = self.parents[self.parents[item as usize] as usize];
            self.parents[item as usize] = grandparent;
            item = grandparent;
        }
        item
    }

    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.parents[high as usize] = low;
    }

    fn count(&self) -> usize {
        self.parents
            .iter()
            .enumerate()
            .filter(|&(item, &parent)| item == parent as usize)
            .count()
    }
}
