//! Sharp edges and points of a mesh, which nobody touches if they can help it.
//!
//! Blades of scanned and of rounded models end in a face or a curve a millimetre thick. They are found by the wedge behind the
//! end: two faces at a small angle, between which the part grows thicker.

use std::collections::{HashMap, HashSet};

use glam::{IVec3, Vec3};

use super::{
    Segment,
    boxes::Aabb,
    mesh::TriangleMesh,
    mesh_bvh::MeshBvh,
    surface_samples::{SurfaceSampler, ray_stride},
    topology::{DisjointSets, EdgeUse, sorted_edges},
};
use crate::base::{
    random::AttemptStream,
    stop::{Stop, Stopped},
};

/// Cosine of the angle between outward normals below which an edge is sharp: the faces enclose less than 30°.
const SHARP_COS: f32 = -0.866;

/// Least length of an edge in metres: shorter ones are flaws of a mesh.
const MIN_LENGTH: f32 = 0.01;

/// Largest sum of the angles at a vertex, in radians, that makes it a point: that of a cone with half an angle of 20° at its tip.
const POINT_ANGLES: f32 = 2.15;

/// Least length in metres of the edges at a point: shorter ones are a spike of the mesh.
const POINT_DEPTH: f32 = 0.003;

/// Edge of the grid cells in metres: a contact in a cell with a sharp feature, or next to such a cell, touches it.
const CELL: f32 = 0.002;

/// Largest number of cells that are kept, against meshes that are all edges.
const MAX_CELLS: usize = 1 << 16;

/// Largest number of steps along features: half a kilometre of edges.
const MAX_STEPS: usize = 1 << 18;

/// Where a mesh is sharp.
#[derive(Clone, Debug, Default)]
pub struct SharpFeatures {
    cells: HashSet<IVec3>,
}

impl SharpFeatures {
    /// Finds the sharp edges and points of a surface; O(n log n).
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(surface: &MeshBvh, stop: Stop<'_>) -> Result<Self, Stopped> {
        let mesh = surface.mesh();
        let mut sharp = Self::default();
        let edges = sorted_edges(mesh);
        let sharp_edges: Vec<[u32; 2]> = edges
            .chunk_by(|a, b| a.ends == b.ends)
            .filter(|users| is_sharp(mesh, users))
            .map(|users| users[0].ends)
            .collect();
        let at = |vertex: u32| mesh.positions()[vertex as usize];
        // Only chains of some length cut.
        let mut chains = DisjointSets::new(mesh.positions().len());
        for &[a, b] in &sharp_edges {
            chains.join(a, b);
        }
        let mut lengths: HashMap<u32, f32> = HashMap::new();
        for &[a, b] in &sharp_edges {
            *lengths.entry(chains.root(a)).or_default() += at(a).distance(at(b));
        }
        let mut marked = Marked::default();
        for &[a, b] in &sharp_edges {
            if lengths
                .get(&chains.root(a))
                .is_some_and(|&length| length >= MIN_LENGTH)
            {
                stop.check()?;
                sharp.add(at(a), at(b), &mut marked);
            }
        }
        stop.check()?;
        for point in points(mesh, &edges).into_iter().chain(worn_edges(surface, stop)?) {
            sharp.add(point, point, &mut marked);
        }
        Ok(sharp)
    }

    /// True if nothing is sharp.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// True if a point is within about two millimetres of a sharp edge or point.
    pub fn are_near(&self, point: Vec3) -> bool {
        self.cells.contains(&cell_of(point))
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        self.cells.capacity() * (size_of::<IVec3>() + 1)
    }

    /// Marks the cells along a line and those next to them.
    fn add(&mut self, start: Vec3, end: Vec3, marked: &mut Marked) {
        let steps = (start.distance(end) / CELL).ceil().clamp(1.0, MAX_CELLS as f32) as usize;
        for step in 0..=steps {
            if self.cells.len() >= MAX_CELLS || marked.steps >= MAX_STEPS {
                return;
            }
            marked.steps += 1;
            let cell = cell_of(start.lerp(end, step as f32 / steps as f32));
            if !marked.cells.insert(cell) {
                continue;
            }
            for x in -1..=1 {
                for y in -1..=1 {
                    for z in -1..=1 {
                        if self.cells.len() < MAX_CELLS {
                            self.cells.insert(cell + IVec3::new(x, y, z));
                        }
                    }
                }
            }
        }
    }
}

/// The cells on features so far: overlapping features mark a cell once.
#[derive(Default)]
struct Marked {
    cells: HashSet<IVec3>,
    steps: usize,
}

fn cell_of(point: Vec3) -> IVec3 {
    (point / CELL).floor().as_ivec3()
}

/// True if two faces meet in an edge that sticks out and encloses a small angle.
fn is_sharp(mesh: &TriangleMesh, users: &[EdgeUse]) -> bool {
    let [a, b] = users else { return false };
    let [first, second] = [a, b].map(|user| mesh.normal(user.triangle as usize));
    if first.dot(second) > SHARP_COS {
        return false;
    }
    // The far corner of the other face is below an edge that sticks out, and above one that is a groove.
    let [start, _] = a.ends.map(|vertex| mesh.positions()[vertex as usize]);
    let far = mesh.corners(b.triangle as usize).into_iter();
    far.map(|corner| (corner - start).dot(first)).sum::<f32>() <= 0.0
}

/// The vertices whose faces meet in a narrow cone.
fn points(mesh: &TriangleMesh, edges: &[EdgeUse]) -> Vec<Vec3> {
    let mut angles: HashMap<u32, (f32, f32)> = HashMap::new();
    for users in edges.chunk_by(|a, b| a.ends == b.ends) {
        let [a, b] = users[0].ends;
        let [start, end] = [a, b].map(|vertex| mesh.positions()[vertex as usize]);
        for vertex in [a, b] {
            let (_, longest) = angles.entry(vertex).or_default();
            *longest = longest.max(start.distance(end));
        }
    }
    for user in edges {
        // Each triangle adds its angle to both ends of each of its three edges, so twice.
        let [a, b, c] = mesh.corners(user.triangle as usize);
        for vertex in user.ends {
            let position = mesh.positions()[vertex as usize];
            let others: Vec<Vec3> = [a, b, c]
                .into_iter()
                .filter(|&corner| corner != position)
                .collect();
            if let ([first, second], Some(entry)) = (&others[..], angles.get_mut(&vertex)) {
                entry.0 += 0.5 * (*first - position).angle_between(*second - position);
            }
        }
    }
    let mut found: Vec<u32> = angles
        .iter()
        .filter(|(_, (angle, longest))| *angle > 0.0 && *angle <= POINT_ANGLES && *longest >= POINT_DEPTH)
        .map(|(&vertex, _)| vertex)
        .collect();
    found.sort_unstable();
    found
        .into_iter()
        .map(|vertex| mesh.positions()[vertex as usize])
        .collect()
}

/// Number of surface samples at which a wedge is sought, and their seed.
const SAMPLES: u64 = 2048;
const SEED: u64 = 0x5745_4447;

/// Largest thickness in metres of a probed part, and of an end that cuts.
const THIN: f32 = 0.003;
const BLUNT: f32 = 0.0015;

/// Angle between the faces of a wedge, in radians: 5° to 30°. The sides of a card are parallel.
const ANGLES: [f32; 2] = [0.087, 0.524];

/// Distance from a point to the end of its wedge, in metres: nearer ones may be on the end's rounding.
const TO_END: [f32; 2] = [0.001, 0.008];

/// Distance in metres behind a point at which the wedge must be thicker, by the smallest angle or more.
const BEHIND: f32 = 0.003;

/// Largest distance in metres between neighbouring points of the same edge.
const NEIGHBOURS: f32 = 0.005;

/// Depth below the surface at which a ray starts, in metres, so that it does not hit its own triangle.
const START_DEPTH: f32 = 1e-5;

/// The part below a face.
struct Section {
    /// The normal of the face opposite it.
    opposite: Vec3,
    middle: Vec3,
    thickness: f32,
}

/// Points on worn edges that are at least a centimetre long; takes some milliseconds.
fn worn_edges(surface: &MeshBvh, stop: Stop<'_>) -> Result<Vec<Vec3>, Stopped> {
    let sampler = SurfaceSampler::new(surface.mesh(), |_| true);
    let mut ends = Vec::new();
    let stride = ray_stride(surface, &sampler, SAMPLES, SEED, THIN);
    for sample in (0..SAMPLES).step_by(stride) {
        stop.check()?;
        let mut stream = AttemptStream::new(SEED, sample);
        let sampled = sampler.sample(sample, SAMPLES, &mut stream);
        ends.extend(sampled.and_then(|(triangle, position)| end_of_wedge(surface, triangle, position)));
    }
    Ok(of_long_edges(&ends))
}

/// The end of the wedge with a face at this point, if there is one.
fn end_of_wedge(surface: &MeshBvh, triangle: usize, position: Vec3) -> Option<Vec3> {
    let normal = surface.mesh().normal(triangle);
    let here = section(surface, normal, position)?;
    let angle = normal.angle_between(-here.opposite);
    if !(ANGLES[0]..=ANGLES[1]).contains(&angle) {
        return None;
    }
    // Both faces of a wedge look toward its end.
    let ahead = (normal + here.opposite).try_normalize()?;
    let end = surface.first_hit(Segment::new(here.middle, here.middle + ahead * TO_END[1]))?;
    let growth = 2.0 * (0.5 * angle).tan();
    if end.distance < TO_END[0] || here.thickness - end.distance * growth > BLUNT {
        return None;
    }
    let behind = here.middle - ahead * BEHIND;
    let thickness_behind = thickness_around(surface, behind, normal)?;
    let least_growth = 2.0 * (0.5 * ANGLES[0]).tan() * BEHIND;
    (thickness_behind >= here.thickness + least_growth).then_some(end.position)
}

/// The part below a point of the surface, if it is thin.
fn section(surface: &MeshBvh, normal: Vec3, position: Vec3) -> Option<Section> {
    let start = position - normal * START_DEPTH;
    let exit = surface.first_hit(Segment::new(start, start - normal * THIN))?;
    Some(Section {
        opposite: surface.mesh().normal(exit.triangle as usize),
        middle: start.midpoint(exit.position),
        thickness: exit.distance,
    })
}

/// Thickness of the part around a point inside it, in metres; `None` beyond twice that of a blade.
fn thickness_around(surface: &MeshBvh, inside: Vec3, along: Vec3) -> Option<f32> {
    let skin = |along: Vec3| {
        let hit = surface.first_hit(Segment::new(inside, inside + along * 2.0 * THIN))?;
        Some(hit.distance)
    };
    Some(skin(along)? + skin(-along)?)
}

/// The points that form edges of some length.
fn of_long_edges(points: &[Vec3]) -> Vec<Vec3> {
    let mut edges = DisjointSets::new(points.len());
    for (a, &point) in points.iter().enumerate() {
        for (b, other) in points.iter().enumerate().skip(a + 1) {
            if point.distance_squared(*other) <= NEIGHBOURS * NEIGHBOURS {
                edges.join(a as u32, b as u32);
            }
        }
    }
    let mut boxes: HashMap<u32, Aabb> = HashMap::new();
    for (place, &point) in points.iter().enumerate() {
        let aabb = boxes.entry(edges.root(place as u32)).or_insert(Aabb::EMPTY);
        *aabb = aabb.including(point);
    }
    let mut is_on_long = |place: usize| boxes[&edges.root(place as u32)].diagonal() >= MIN_LENGTH;
    let places = (0..points.len()).filter(|&place| is_on_long(place));
    places.map(|place| points[place]).collect()
}
