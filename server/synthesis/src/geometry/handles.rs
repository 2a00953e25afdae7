//! Handles: slender parts with room around them, found from the mesh alone.
//!
//! A part is a handle where the surface around a point inside it faces in all directions across an axis, but not along it, for
//! the breadth of a hand. Spheres as thick as a finger and a palm probe the room around it.

use std::f32::consts::TAU;

use glam::{DVec3, Vec3};

use super::{
    Segment,
    mesh_bvh::MeshBvh,
    surface_samples::{SurfaceSampler, principal_axes, ray_stride},
};
use crate::base::{
    random::AttemptStream,
    stop::{Stop, Stopped},
};

/// Number of surface samples below which a part is sought, and their seed.
const SAMPLES: u64 = 1024;
const SEED: u64 = 0x4841_4e44;

/// Depth below the surface at which a ray starts, in metres, so that it does not hit its own triangle.
const START_DEPTH: f32 = 1e-5;

/// Minimum cosine between a ray through a part and the normals at its ends: 45°.
const MIN_COS: f32 = 0.7;

/// Thickness in metres of parts that fingers can wrap: thinner ones are pinched, thicker ones are not enclosed.
const THICKNESS: [f32; 2] = [0.008, 0.06];

/// Largest number of points that are probed, evenly spread over the surface. Each takes about 10 µs.
const MAX_PROBED: usize = 128;

/// Most containment tests per probe, and the budget of hole edges that all of them together may visit.
const TESTS_PER_PROBE: usize = 2 + 2 * DIRECTIONS;
const MAX_RIM_EDGES: usize = 1 << 21;

/// Rays and tests of a probe, the budget of triangle packs that all of them may visit, and the probes that estimate that cost.
const QUERIES_PER_PROBE: usize = RAYS + TESTS_PER_PROBE + QUERIES;
const MAX_PACKS: usize = 1 << 20;
const ESTIMATED_FROM: usize = 12;

/// Rays from the middle of a part, in all directions, and their length in metres.
const RAYS: usize = 32;
pub(crate) const RAY_LENGTH: f32 = 0.045;

/// Largest mean square of the normals' components along a part, and smallest across its narrower side: 0 and 0.5 for a rod.
const MAX_ALONG: f64 = 0.08;
const MIN_ACROSS: f64 = 0.12;

/// Distance in metres that a part must extend to both sides of the middle: half the breadth of three fingers.
const HALF_LENGTH: f32 = 0.027;

/// Largest offset of a bent part from its axis there, in metres.
const MAX_BEND: f32 = 0.008;

/// Least length in metres of a bent loop, in all and to either side of a place: two fingers in the ear of a cup.
const MIN_BENT: f32 = 0.042;
const MIN_ASIDE: f32 = 0.012;

/// Fewest places on loops for an object to be held by them: a loop is made for hands, a spout is merely slender.
const MIN_LOOPED: usize = 4;

/// Radii in metres of the spheres that probe the room around a part for fingers and for the palm, and their gap from it.
const FINGER_RADIUS: f32 = 0.008;
const PALM_RADIUS: f32 = 0.016;
const GAP: f32 = 0.002;

/// Cosine of the angle between the axes of two places of a straight part, and its extra offset from the axis per metre.
const PARALLEL: f32 = 0.9;
const BOW: f32 = 0.15;

/// Least length of a main handle as a share of the longest one's, and the length in metres beyond which more does not count.
const MAIN_SHARE: f32 = 0.8;
const FULL_LENGTH: f32 = 0.12;

/// Directions around a part in which room is probed.
pub(crate) const DIRECTIONS: usize = 12;

/// Fewest adjacent directions with room for a finger: fingers and thumb reach around a part from both sides of the palm.
const MIN_FREE: u32 = 10;

/// Directions around a handle, as bits: turns about its axis by `TAU / DIRECTIONS`, from its first orthonormal vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sides(u16);

/// A place at which a handle can be wrapped, in the object's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// The middle of its section, in metres.
    pub middle: Vec3,
    /// Unit vector along it.
    pub axis: Vec3,
    /// Mean distance of its skin from the middle, in metres.
    pub radius: f32,
    /// Length of the straight stretch through this place, in metres.
    pub length: f32,
    /// Extent along the axis to either side, in metres.
    half_length: f32,
    /// True if it is straight for the breadth of three fingers.
    is_straight: bool,
    /// True if both ends are attached to the rest of the object, within a hand's breadth.
    pub is_looped: bool,
    /// True if it belongs to a main handle: one of the longest, or a loop.
    pub is_main: bool,
    /// Where the palm has room.
    pub(crate) for_palm: Sides,
}

/// The places at which an object's handles can be wrapped.
#[derive(Clone, Debug, Default)]
pub struct Handles(Vec<Handle>);

impl Handles {
    /// Probes the parts of a surface that are as thick as a handle, without the triangles for which `is_forbidden` returns
    /// true; takes about a millisecond.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(
        surface: &MeshBvh,
        stop: Stop<'_>,
        is_forbidden: impl Fn(u32) -> bool,
    ) -> Result<Self, Stopped> {
        let middles = middles(surface, stop, is_forbidden)?;
        let most = (MAX_RIM_EDGES / (TESTS_PER_PROBE * surface.rim_edges()).max(1)).clamp(1, MAX_PROBED);
        let most = most.min(affordable(surface, &middles));
        let stride = middles.len().div_ceil(most).max(1);
        let mut handles: Vec<Handle> = Vec::new();
        for middle in middles.into_iter().step_by(stride) {
            stop.check()?;
            handles.extend(Handle::probe(surface, middle));
        }
        let length_at = |at: &Handle| {
            let in_line = handles.iter().filter_map(|other| other.along(at));
            let (low, high) = in_line.fold((0.0_f32, 0.0_f32), |(low, high), along| {
                (low.min(along), high.max(along))
            });
            if at.is_straight {
                high - low + 2.0 * HALF_LENGTH
            } else {
                0.0
            }
        };
        let lengths: Vec<f32> = handles.iter().map(length_at).collect();
        for (handle, length) in handles.iter_mut().zip(lengths) {
            handle.length = handle.length.max(length);
        }
        let looped = handles.iter().filter(|handle| handle.is_looped).count();
        let counts = |handle: &Handle| handle.is_looped || looped < MIN_LOOPED;
        let lengths = handles.iter().filter(|&handle| counts(handle));
        let longest = lengths.map(|handle| handle.length).fold(0.0, f32::max);
        for handle in &mut handles {
            let is_long = handle.length >= MAIN_SHARE * longest.min(FULL_LENGTH);
            handle.is_main = counts(handle) && is_long;
        }
        Ok(Self(handles))
    }

    /// The places, in the order of the surface's triangles.
    pub fn places(&self) -> &[Handle] {
        &self.0
    }

    /// The places on the longest handles.
    pub fn main(&self) -> impl Iterator<Item = &Handle> {
        self.0.iter().filter(|handle| handle.is_main)
    }

    /// True if a point of the surface is on one of the longest handles.
    pub fn contain(&self, point: Vec3) -> bool {
        self.main().any(|handle| handle.contains(point))
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.0.as_slice())
    }
}

/// Number of places that can be probed in bounded time: all, unless thousands of triangles overlap along every ray.
fn affordable(surface: &MeshBvh, middles: &[Vec3]) -> usize {
    let step = middles.len().div_ceil(ESTIMATED_FROM).max(1);
    let rays = middles.iter().step_by(step).zip(Vec3::AXES.into_iter().cycle());
    let packs: usize = rays
        .clone()
        .map(|(&middle, axis)| surface.packs_along(Segment::new(middle, middle + axis * RAY_LENGTH)))
        .sum();
    let per_probe = QUERIES_PER_PROBE * packs / rays.count().max(1);
    (MAX_PACKS / per_probe.max(1)).max(1)
}

impl Handle {
    /// The handle around a point inside an object, if there is one.
    fn probe(surface: &MeshBvh, inside: Vec3) -> Option<Self> {
        let axis = axis_of_part(surface, inside)?;
        let goes_on = |offset: f32| {
            let point = inside + axis * offset;
            surface.contains(point) || surface.closest_point_within(point, MAX_BEND).is_some()
        };
        let is_straight = goes_on(HALF_LENGTH) && goes_on(-HALF_LENGTH);
        let skin = |from: Vec3, outward: Vec3| {
            let hit = surface.first_hit(Segment::new(from, from + outward * RAY_LENGTH));
            hit.map(|hit| hit.position)
        };
        let outward: [Vec3; DIRECTIONS] = std::array::from_fn(|turn| around(axis, turn as f32));
        let mut middle = Vec3::ZERO;
        for outward in outward {
            middle += skin(inside, outward)? / DIRECTIONS as f32;
        }
        let (mut for_fingers, mut for_palm) = (Sides::default(), Sides::default());
        for (turn, outward) in outward.into_iter().enumerate() {
            let skin = skin(middle, outward)?;
            let has_room = |radius: f32| {
                let centre = skin + outward * (radius + GAP);
                surface.closest_point_within(centre, radius).is_none() && !surface.contains(centre)
            };
            if has_room(FINGER_RADIUS) {
                for_fingers.add(turn);
            }
            if has_room(PALM_RADIUS) {
                for_palm.add(turn);
            }
        }
        let radius = outward.iter().filter_map(|&outward| skin(middle, outward));
        let radius = radius.map(|skin| skin.distance(middle)).sum::<f32>() / DIRECTIONS as f32;
        let courses = [axis, -axis].map(|direction| walk(surface, middle, direction, radius));
        let is_looped = courses.iter().all(|course| course.is_attached);
        let lengths = courses.map(|course| course.length);
        let length: f32 = lengths.iter().sum();
        let has_room_aside = lengths.iter().all(|&length| length >= MIN_ASIDE);
        let is_bent = is_looped && has_room_aside && length >= MIN_BENT;
        if !(is_straight || is_bent) {
            return None;
        }
        let can_be_wrapped = for_fingers.longest_run() >= MIN_FREE && for_palm != Sides::default();
        can_be_wrapped.then_some(Self {
            middle,
            axis,
            radius,
            length: if is_straight { 2.0 * HALF_LENGTH } else { length },
            half_length: if is_straight {
                HALF_LENGTH
            } else {
                lengths.into_iter().fold(HALF_LENGTH, f32::min)
            },
            is_straight,
            is_looped,
            is_main: true,
            for_palm,
        })
    }

    /// How far this place is along the axis of another one, in metres, if both are of the same straight part.
    fn along(&self, other: &Self) -> Option<f32> {
        let offset = self.middle - other.middle;
        let along = offset.dot(other.axis);
        let is_in_line = self.axis.dot(other.axis).abs() >= PARALLEL
            && (offset - other.axis * along).length() <= MAX_BEND + BOW * along.abs();
        is_in_line.then_some(along)
    }

    /// True if a point of the surface belongs to the handle where it was probed.
    pub fn contains(&self, point: Vec3) -> bool {
        let offset = point - self.middle;
        let along = offset.dot(self.axis);
        along.abs() <= self.half_length
            && (offset - self.axis * along).length() <= WITHIN * self.radius + SLACK
    }
}

/// Largest distance of a handle's points from its axis: a multiple of the mean radius plus a margin in metres.
const WITHIN: f32 = 1.3;
const SLACK: f32 = 0.004;

/// Points inside the parts of a surface that are as thick as a handle, in the order of its triangles.
fn middles(
    surface: &MeshBvh,
    stop: Stop<'_>,
    is_forbidden: impl Fn(u32) -> bool,
) -> Result<Vec<Vec3>, Stopped> {
    let mesh = surface.mesh();
    let sampler = SurfaceSampler::new(mesh, |triangle| !is_forbidden(triangle));
    let middle = |sample| {
        let mut stream = AttemptStream::new(SEED, sample);
        let (triangle, position) = sampler.sample(sample, SAMPLES, &mut stream)?;
        let inward = -mesh.normal(triangle);
        let start = position + inward * START_DEPTH;
        let exit = surface.first_hit(Segment::new(start, start + inward * THICKNESS[1]))?;
        let faces_away = mesh.normal(exit.triangle as usize).dot(inward) >= MIN_COS;
        let is_thick = exit.distance >= THICKNESS[0] && !is_forbidden(exit.triangle) && faces_away;
        is_thick.then(|| start.midpoint(exit.position))
    };
    let mut middles = Vec::new();
    let stride = ray_stride(surface, &sampler, SAMPLES, SEED, THICKNESS[1]);
    for sample in (0..SAMPLES).step_by(stride) {
        stop.check()?;
        middles.extend(middle(sample));
    }
    Ok(middles)
}

impl Sides {
    fn add(&mut self, turn: usize) {
        self.0 |= 1 << turn;
    }

    pub(crate) fn contains(self, turn: usize) -> bool {
        self.0 >> (turn % DIRECTIONS) & 1 == 1
    }

    /// The largest number of directions side by side.
    fn longest_run(self) -> u32 {
        let run = |start: usize| (start..start + DIRECTIONS).take_while(|&turn| self.contains(turn));
        let runs = (0..DIRECTIONS).map(|start| run(start).count() as u32);
        runs.max().unwrap_or(0)
    }
}

/// The unit vector along the slender part around a point, as its normals show; `None` if the part is not slender.
fn axis_of_part(surface: &MeshBvh, inside: Vec3) -> Option<Vec3> {
    let normal = |ray: usize| {
        let hit = surface.first_hit(Segment::new(inside, inside + direction(ray) * RAY_LENGTH))?;
        Some(surface.mesh().normal(hit.triangle as usize).as_dvec3())
    };
    // With its opposite, each normal counts about the origin.
    let normals: Vec<DVec3> = (0..RAYS)
        .filter_map(normal)
        .flat_map(|normal| [normal, -normal])
        .collect();
    if normals.len() < RAYS / 2 {
        return None;
    }
    let axes = principal_axes(&normals);
    let mut squares = [0, 1, 2].map(|axis| {
        let axis = axes.col(axis);
        let sum: f64 = normals.iter().map(|normal| normal.dot(axis).powi(2)).sum();
        (sum / normals.len() as f64, axis)
    });
    squares.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let [(along, axis), (across, _), _] = squares;
    (along <= MAX_ALONG && across >= MIN_ACROSS).then(|| axis.as_vec3().normalize_or(Vec3::Y))
}

/// A unit vector at right angles to an axis, after so many of the [`DIRECTIONS`].
pub(crate) fn around(axis: Vec3, turn: f32) -> Vec3 {
    let (a, b) = axis.any_orthonormal_pair();
    let (sin, cos) = (TAU * turn / DIRECTIONS as f32).sin_cos();
    a * cos + b * sin
}

/// One of [`RAYS`] evenly spread directions (spherical Fibonacci lattice; R. Swinbank, R. J. Purser: Fibonacci grids, 2006).
fn direction(ray: usize) -> Vec3 {
    const GOLDEN_ANGLE: f32 = 2.399_963_2;
    let height = 1.0 - (2.0 * ray as f32 + 1.0) / RAYS as f32;
    let radius = (1.0 - height * height).sqrt();
    let (sin, cos) = (GOLDEN_ANGLE * ray as f32).sin_cos();
    Vec3::new(radius * cos, height, radius * sin)
}

/// Length of a step along the part, in metres, and the largest number of steps to either side: half the breadth of a hand.
const STEP: f32 = 0.008;
const MAX_STEPS: usize = 7;

/// Directions around the part in which its skin is found at each step.
const SIDES: usize = 4;

/// Queries of the surface by both walks of a course, at most.
const QUERIES: usize = 2 * (MAX_STEPS * (SIDES + 1) + SIDES);

/// Smallest cosine of the turn between two steps: 40°, as in the ear of a small cup.
const MIN_TURN_COS: f32 = 0.77;

/// Largest thickness of a part relative to its start: beyond it lies the rest of the object.
const MAX_GROWTH: f32 = 1.7;

/// Test for an attached end: distance of the probes from the end, their range, both in radii, and the fewest that hit.
const ASIDE: f32 = 2.5;
const NEAR: f32 = 1.5;
const ATTACHED_SIDES: usize = 3;

/// Length of a part to one side of a place, in metres, and whether it meets the rest of the object there.
#[derive(Clone, Copy, Debug)]
struct Course {
    length: f32,
    is_attached: bool,
}

/// Follows the part in one direction: its length, and whether it is attached there.
fn walk(surface: &MeshBvh, middle: Vec3, direction: Vec3, radius: f32) -> Course {
    let (mut at, mut direction) = (middle, direction);
    let mut length = 0.0;
    let attached_after = |length| Course {
        length,
        is_attached: true,
    };
    for _ in 0..MAX_STEPS {
        let ahead = at + direction * STEP;
        if let Some(hit) = surface.first_hit(Segment::new(at, ahead)) {
            return Course {
                length: length + hit.distance,
                is_attached: is_attached_at(surface, hit.position, direction, radius),
            };
        }
        let Some(next) = middle_at(surface, ahead, direction, MAX_GROWTH * radius) else {
            return attached_after(length + STEP);
        };
        let way = next - at;
        let turned = way.normalize_or(direction);
        if turned.dot(direction) < MIN_TURN_COS {
            return attached_after(length);
        }
        length += way.length();
        (at, direction) = (next, turned);
    }
    Course {
        length,
        is_attached: false,
    }
}

/// The middle of the part's section; `None` if its skin is farther than `most` metres on a side.
fn middle_at(surface: &MeshBvh, inside: Vec3, direction: Vec3, most: f32) -> Option<Vec3> {
    let mut skins = Vec3::ZERO;
    for aside in sides(direction) {
        let ray = Segment::new(inside, inside + aside * RAY_LENGTH);
        skins += surface.first_hit(ray)?.position / SIDES as f32;
    }
    let radii = sides(direction).map(|aside| {
        let ray = Segment::new(skins, skins + aside * RAY_LENGTH);
        surface.first_hit(ray).map_or(RAY_LENGTH, |hit| hit.distance)
    });
    let mean = radii.into_iter().sum::<f32>() / SIDES as f32;
    (mean <= most).then_some(skins)
}

/// True if the rest of the object is around the end of a part.
fn is_attached_at(surface: &MeshBvh, end: Vec3, direction: Vec3, radius: f32) -> bool {
    let near = sides(direction).map(|aside| {
        let beside = end + aside * (ASIDE * radius);
        surface.closest_point_within(beside, NEAR * radius).is_some()
    });
    near.into_iter().filter(|&is_near| is_near).count() >= ATTACHED_SIDES
}

/// Unit vectors at right angles to a direction.
fn sides(direction: Vec3) -> [Vec3; SIDES] {
    let (a, b) = direction.any_orthonormal_pair();
    [a, b, -a, -b]
}
