//! Worn edges: ends of thin wedges that cut although no two triangles of the mesh meet sharply there.
//!
//! Blades of scanned and of rounded models end in a face or a curve a millimetre thick. They are found by what is behind the
//! end: two faces at a small angle, between which the part grows thicker.

use glam::Vec3;

use super::{
    Segment,
    mesh_bvh::MeshBvh,
    surface_samples::{SurfaceSampler, ray_stride},
    topology::DisjointSets,
};
use crate::base::{
    random::AttemptStream,
    stop::{Stop, Stopped},
};

/// Points of the surface at which a wedge is sought, and the seed by which they are drawn.
const SAMPLES: u64 = 2048;
const SEED: u64 = 0x5745_4447;

/// Thickness in metres up to which a part is probed, and that of its end up to which it cuts.
const THIN: f32 = 0.003;
const BLUNT: f32 = 0.0015;

/// Angle between the faces of a wedge, in radians: 5° to 30°. The sides of a card are parallel.
const ANGLES: [f32; 2] = [0.087, 0.524];

/// Distance from a point to the end of its wedge, in metres: nearer ones may be on the end's rounding.
const TO_END: [f32; 2] = [0.001, 0.008];

/// How far behind a point the wedge has to be thicker, in metres, as if its faces met at no less than the smallest angle.
const BEHIND: f32 = 0.003;

/// Least length of an edge in metres, and largest distance between neighbouring points of the same one.
const MIN_LENGTH: f32 = 0.01;
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
///
/// # Errors
/// [`Stopped`].
pub(super) fn worn_edges(surface: &MeshBvh, stop: Stop<'_>) -> Result<Vec<Vec3>, Stopped> {
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

/// Thickness along a direction, in metres, of the part around a point inside it; `None` if it is more than twice as thick as a
/// blade.
fn thickness_around(surface: &MeshBvh, inside: Vec3, along: Vec3) -> Option<f32> {
    let skin = |along: Vec3| {
        let hit = surface.first_hit(Segment::new(inside, inside + along * 2.0 * THIN))?;
        Some(hit.distance)
    };
    Some(skin(along)? + skin(-along)?)
}

/// Those of some points that form edges of some length.
fn of_long_edges(points: &[Vec3]) -> Vec<Vec3> {
    let mut edges = DisjointSets::new(points.len());
    for (a, &point) in points.iter().enumerate() {
        for (b, other) in points.iter().enumerate().skip(a + 1) {
            if point.distance_squared(*other) <= NEIGHBOURS * NEIGHBOURS {
                edges.join(a as u32, b as u32);
            }
        }
    }
    let roots: Vec<u32> = (0..points.len() as u32).map(|point| edges.root(point)).collect();
    let is_long = |root: u32| {
        let of_edge = || points.iter().zip(&roots).filter(move |(_, of)| **of == root);
        let low = of_edge().fold(Vec3::INFINITY, |low, (point, _)| low.min(*point));
        let high = of_edge().fold(Vec3::NEG_INFINITY, |high, (point, _)| high.max(*point));
        low.distance(high) >= MIN_LENGTH
    };
    let mut long: Vec<u32> = roots.clone();
    long.sort_unstable();
    long.dedup();
    long.retain(|&root| is_long(root));
    let on_long = points
        .iter()
        .zip(&roots)
        .filter(|(_, root)| long.binary_search(root).is_ok());
    on_long.map(|(point, _)| *point).collect()
}
