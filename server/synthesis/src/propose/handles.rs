//! Handles: slender parts with room around them, and hands that wrap them from the palm.
//!
//! A part is a handle where the surface around a point inside it faces all ways but two: along those it goes on for the
//! breadth of a hand. Spheres of a finger's and of a palm's thickness find the room around it. So grips, stems, necks and
//! bows are all found alike, whatever the rest of the object looks like.

use std::f32::consts::TAU;

use glam::{DVec3, Mat3, Quat, Vec3};

use super::{
    proposal::{PALM_START_HEIGHT, ProposalContext, palm_shape},
    surface_pairs::SurfacePairs,
};
use crate::{
    base::{pose::Pose, random::AttemptStream},
    geometry::{Segment, mesh_bvh::MeshBvh, principal_axes::principal_axes},
    model::{hand::Digit, object::GraspObject},
    physical::shape::{HandShape, Proposal},
};

/// Thickness in metres of what fingers can wrap: thinner parts are pinched, thicker ones are not enclosed.
const THICKNESS: [f32; 2] = [0.008, 0.06];

/// Largest number of surface pairs that are probed, evenly spread over the surface. Each takes about 10 µs.
const MAX_PROBED: usize = 96;

/// Rays from the middle of a part, in all directions, and their length in metres.
const RAYS: usize = 32;
const RAY_LENGTH: f32 = 0.045;

/// Largest mean square of the normals' components along a part, and smallest across its narrower side: 0 and 0.5 for a rod, 0
/// and 0 for a plate.
const MAX_ALONG: f64 = 0.08;
const MIN_ACROSS: f64 = 0.12;

/// Distance in metres from the middle at which a part has to go on to both sides: half the breadth of three fingers.
const HALF_LENGTH: f32 = 0.027;

/// By how much a bent part may be off its axis there, in metres.
const MAX_BEND: f32 = 0.008;

/// Radii in metres of the spheres that probe the room around a part for fingers and for the palm, and their gap from it.
const FINGER_RADIUS: f32 = 0.008;
const PALM_RADIUS: f32 = 0.016;
const GAP: f32 = 0.002;

/// Directions around a part in which room is probed.
const DIRECTIONS: usize = 12;

/// Fewest directions side by side with room for a finger: fingers and thumb come round a part from both sides of the palm.
const MIN_FREE: u32 = 10;

/// Handles drawn per hand; the one nearest to the centre of mass is wrapped.
const COMPARED: usize = 2;

/// Largest number of hands tried until palm and forearm fit.
const MAX_HANDS: usize = 24;

/// Range of the angle in radians by which the end of a handle at the thumb's side points toward the fingers: power grips lie
/// obliquely in the palm.
const SKEW: [f32; 2] = [0.05, 0.75];

/// Range of the place in the palm at which it meets a handle, in metres from the palm's centre: across, and toward the
/// fingers.
const PALM_OFFSETS: [[f32; 2]; 2] = [[-0.01, 0.01], [0.012, 0.038]];

/// Yaw of the thumb as a share of its range: of a hand around a wire, more per metre of the handle's radius, and the spread.
/// A thumb that is lifted further passes thin handles by.
const THUMB_YAW: [f32; 3] = [0.1, 20.0, 0.2];

/// Range of how far thumb and fingers are closed before, as shares of their range. A thumb that is less so meets what is next
/// to the handle.
const PRESHAPE: [[f32; 2]; 2] = [[0.15, 0.45], [0.0, 0.3]];

/// Directions around a handle, as bits: turns about its axis by `TAU / DIRECTIONS`, from its first orthonormal vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sides(u16);

/// A place at which a handle can be wrapped, in the object's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// The middle of its section, in metres.
    pub middle: Vec3,
    /// Unit vector along it.
    pub axis: Vec3,
    /// Where the palm has room.
    for_palm: Sides,
}

/// The places at which an object's handles can be wrapped.
#[derive(Clone, Debug, Default)]
pub struct Handles(Vec<Handle>);

impl Handles {
    /// Probes the parts of an object that are as thick as a handle; takes about a millisecond.
    pub fn of(object: &GraspObject, pairs: &SurfacePairs) -> Self {
        let thick = |thickness: f32| (THICKNESS[0]..=THICKNESS[1]).contains(&thickness);
        let candidates = || pairs.pairs().iter().filter(|pair| thick(pair.thickness));
        let stride = candidates().count().div_ceil(MAX_PROBED).max(1);
        let probed = candidates()
            .step_by(stride)
            .filter_map(|pair| Handle::probe(&object.surface, pair.middle()));
        Self(probed.collect())
    }

    /// The places, in the order of the surface's triangles.
    pub fn places(&self) -> &[Handle] {
        &self.0
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.0.as_slice())
    }

    /// Places a hand with a handle across its palm. Returns `None` if there is no handle, or no drawn hand fits.
    pub fn propose(&self, context: &ProposalContext<'_>, stream: &mut AttemptStream) -> Option<Proposal> {
        if self.0.is_empty() {
            return None;
        }
        let centre_of_mass = context.object.centre_of_mass;
        (0..MAX_HANDS).find_map(|_| {
            let drawn = (0..COMPARED).map(|_| &self.0[stream.below(self.0.len())]);
            let lever = |handle: &&Handle| handle.middle.distance_squared(centre_of_mass);
            let handle = drawn.min_by(|a, b| lever(a).total_cmp(&lever(b)))?;
            let (touching, radius) = handle.in_palm(context, stream)?;
            if !context.palm_fits(touching) {
                return None;
            }
            let above = touching.transform_vector(Vec3::Z) * PALM_START_HEIGHT;
            let [least, per_radius, spread] = THUMB_YAW;
            let thumb_yaw = least + per_radius * radius + stream.between(-spread, spread);
            Some(Proposal {
                object_from_wrist: Pose::new(touching.position - above, touching.orientation),
                shape: HandShape {
                    thumb_yaw: thumb_yaw.clamp(0.0, 1.0),
                    preshape: PRESHAPE.map(|[min, max]| stream.between(min, max)),
                    ..palm_shape(stream)
                },
                advance: 2.0 * PALM_START_HEIGHT,
            })
        })
    }
}

impl Handle {
    /// The handle around a point inside an object, if there is one.
    fn probe(surface: &MeshBvh, inside: Vec3) -> Option<Self> {
        let axis = axis_of_part(surface, inside)?;
        let goes_on = |offset: f32| {
            let point = inside + axis * offset;
            surface.contains(point) || surface.closest_point_within(point, MAX_BEND).is_some()
        };
        if !(goes_on(HALF_LENGTH) && goes_on(-HALF_LENGTH)) {
            return None;
        }
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
        let can_be_wrapped = for_fingers.longest_run() >= MIN_FREE && for_palm != Sides::default();
        can_be_wrapped.then_some(Self {
            middle,
            axis,
            for_palm,
        })
    }

    /// The wrist's pose with the palm on the handle from a direction with room, the fingers across it, and the handle's radius
    /// there, in metres.
    fn in_palm(&self, context: &ProposalContext<'_>, stream: &mut AttemptStream) -> Option<(Pose, f32)> {
        let turn = stream.unit() * DIRECTIONS as f32;
        if !self.for_palm.contains(turn.round() as usize) {
            return None;
        }
        let outward = around(self.axis, turn);
        let ray = Segment::new(self.middle, self.middle + outward * RAY_LENGTH);
        let skin = context.object.surface.first_hit(ray)?.position;
        let z = -outward;
        // In the wrist's frame, the handle runs toward the thumb and, obliquely, toward the fingers.
        let skew = stream.between(SKEW[0], SKEW[1]);
        let base = |digit| context.rig.digit(digit).wrist_from_base.position;
        let thumb_side = (base(Digit::Index) - base(Digit::Little)).x.signum();
        let in_hand = Vec3::new(thumb_side * skew.cos(), skew.sin(), 0.0);
        let along = if stream.unit() < 0.5 {
            self.axis
        } else {
            -self.axis
        };
        let axes = |along: Vec3, z: Vec3| Mat3::from_cols(along, z.cross(along), z);
        let rotation = axes(along, z) * axes(in_hand, Vec3::Z).transpose();
        let orientation = Quat::from_mat3(&rotation).normalize();
        let [across, forward] = PALM_OFFSETS.map(|[min, max]| stream.between(min, max));
        let contact = context.rig.palm + Vec3::new(across, forward, 0.0);
        let touching = Pose::new(skin - orientation * contact, orientation);
        Some((touching, skin.distance(self.middle)))
    }
}

impl Sides {
    fn add(&mut self, turn: usize) {
        self.0 |= 1 << turn;
    }

    fn contains(self, turn: usize) -> bool {
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
fn around(axis: Vec3, turn: f32) -> Vec3 {
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
