//! Hands that wrap a handle ([`crate::geometry::handles`]) from the palm.

use glam::{Mat3, Quat, Vec3};

use super::proposal::{PALM_START_HEIGHT, ProposalContext, palm_shape};
use crate::{
    base::{pose::Pose, random::AttemptStream},
    geometry::{
        Segment,
        handles::{DIRECTIONS, Handle, RAY_LENGTH, around},
    },
    model::hand::Digit,
    physical::shape::{HandShape, Proposal},
};

/// Handles drawn per hand; the one nearest to the centre of mass is wrapped.
const COMPARED: usize = 2;

/// Breadth of a finger, in metres: so much of a handle each needs.
const FINGER_BREADTH: f32 = 0.02;

/// Largest number of hands tried until palm and forearm fit.
const MAX_HANDS: usize = 64;

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

/// Places a hand with a handle across its palm. Returns `None` if there is no handle, or no drawn hand fits.
pub fn wrap_handle(context: &ProposalContext<'_>, stream: &mut AttemptStream) -> Option<Proposal> {
    let handles = context.object.handles().places();
    if handles.is_empty() {
        return None;
    }
    let centre_of_mass = context.object.centre_of_mass;
    (0..MAX_HANDS).find_map(|_| {
        let drawn = (0..COMPARED).map(|_| &handles[stream.below(handles.len())]);
        let lever = |handle: &&Handle| handle.middle.distance_squared(centre_of_mass);
        let handle = drawn.min_by(|a, b| lever(a).total_cmp(&lever(b)))?;
        let (touching, radius) = in_palm(handle, context, stream)?;
        let wish = context.object.wish_near(handle.middle, RAY_LENGTH);
        if !context.is_wanted(wish, stream) {
            return None;
        }
        if !context.is_chosen(touching, stream) || !context.palm_fits(touching) {
            return None;
        }
        let above = touching.transform_vector(Vec3::Z) * PALM_START_HEIGHT;
        let [least, per_radius, spread] = THUMB_YAW;
        let thumb_yaw = least + per_radius * radius + stream.between(-spread, spread);
        Some(Proposal {
            object_from_wrist: Pose::new(touching.position - above, touching.orientation),
            shape: HandShape {
                closing: context.rig.own_digits(closing_on(handle, stream)),
                thumb_yaw: thumb_yaw.clamp(0.0, 1.0),
                preshape: PRESHAPE.map(|[min, max]| stream.between(min, max)),
                ..palm_shape(context.rig, stream)
            },
            advance: 2.0 * PALM_START_HEIGHT,
        })
    })
}

/// The digits of a hand of five that close on a handle: fewer on one with room for few, as in a cup's ear. There, some hands leave out one finger
/// more, and the others rest outside.
fn closing_on(handle: &Handle, stream: &mut AttemptStream) -> [bool; 5] {
    let room = (handle.length / FINGER_BREADTH) as usize;
    let fingers = if room >= 4 {
        4
    } else {
        (room + stream.below(2)).clamp(2, 4)
    };
    std::array::from_fn(|digit| digit <= fingers)
}

/// The wrist's pose with the palm on the handle from a direction with room, the fingers across it, and the handle's radius
/// there, in metres.
fn in_palm(
    handle: &Handle,
    context: &ProposalContext<'_>,
    stream: &mut AttemptStream,
) -> Option<(Pose, f32)> {
    let turn = stream.unit() * DIRECTIONS as f32;
    if !handle.for_palm.contains(turn.round() as usize) {
        return None;
    }
    let outward = around(handle.axis, turn);
    let ray = Segment::new(handle.middle, handle.middle + outward * RAY_LENGTH);
    let skin = context.object.surface.first_hit(ray)?.position;
    let z = -outward;
    // In the wrist's frame, the handle runs toward the thumb and, obliquely, toward the fingers.
    let skew = stream.between(SKEW[0], SKEW[1]);
    let base = |digit| context.rig.digit(digit).wrist_from_base.position;
    let thumb_side = (base(Digit::Index) - base(Digit::Little)).x.signum();
    let in_hand = Vec3::new(thumb_side * skew.cos(), skew.sin(), 0.0);
    let along = if stream.unit() < 0.5 {
        handle.axis
    } else {
        -handle.axis
    };
    let axes = |along: Vec3, z: Vec3| Mat3::from_cols(along, z.cross(along), z);
    let rotation = axes(along, z) * axes(in_hand, Vec3::Z).transpose();
    let orientation = Quat::from_mat3(&rotation).normalize();
    let [across, forward] = PALM_OFFSETS.map(|[min, max]| stream.between(min, max));
    let contact = context.rig.palm + Vec3::new(across, forward, 0.0);
    let touching = Pose::new(skin - orientation * contact, orientation);
    Some((touching, skin.distance(handle.middle)))
}
