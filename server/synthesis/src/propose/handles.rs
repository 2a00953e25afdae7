//! Hands that wrap a handle ([`crate::geometry::handles`]) from the palm, and hands that hook their fingers below a part by which
//! an object may hang. Such a part is thin, above the centre of mass, with room for a finger below and free ways up on both sides
//! of it, and extends to the other two. Spheres of about a finger's thickness probe for that.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Mat3, Quat, Vec3};

use super::{
    opposition::drawn_set,
    proposal::{PALM_START_HEIGHT, ProposalContext, palm_shape},
    surface_pairs::{SurfacePair, SurfacePairs},
};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        stop::{Stop, Stopped},
    },
    geometry::{
        Segment,
        handles::{DIRECTIONS, Handle, RAY_LENGTH, around},
        mesh_bvh::MeshBvh,
    },
    model::{
        hand::{Digit, DigitAngles, kinematics::digit_frames, rig::Rig},
        object::GraspObject,
    },
    physical::{
        barriers::Barriers,
        hanging::MAX_SWING,
        shape::{HandShape, Proposal},
        solids::link_radii,
    },
};

/// Handles or places to hang by that are drawn per hand; the handle nearest to the centre of mass is wrapped, and the hand hooks in
/// where the load swings least. With more, a tilted handle is mostly tried at its end.
const COMPARED: usize = 2;

/// Breadth of a finger, in metres: the length of handle that each finger takes.
const FINGER_BREADTH: f32 = 0.02;

/// Largest number of hands tried until palm and forearm fit.
const MAX_WRAPPING_HANDS: usize = 64;

/// Range of the angle in radians by which the end of a handle at the thumb's side points toward the fingers: power grips lie
/// obliquely in the palm.
const SKEW: [f32; 2] = [0.05, 0.75];

/// Range of the place in the palm at which it meets a handle, in metres from the palm's centre: across, and toward the fingers.
const PALM_OFFSETS: [[f32; 2]; 2] = [[-0.01, 0.01], [0.012, 0.038]];

/// Yaw of the thumb as a share of its range: of a hand around a wire, more per metre of the handle's radius, and the spread.
const THUMB_YAW: [f32; 3] = [0.1, 20.0, 0.2];

/// Range of how far thumb and fingers are closed at the start, as shares of their range.
const PRESHAPE: [[f32; 2]; 2] = [[0.15, 0.45], [0.0, 0.3]];

/// Places a hand with a handle across its palm. Returns `None` if there is no handle, or no drawn hand fits.
pub fn wrap_handle(context: &ProposalContext<'_>, stream: &mut AttemptStream) -> Option<Proposal> {
    let handles = context.object.handles().places();
    if handles.is_empty() {
        return None;
    }
    let centre_of_mass = context.object.centre_of_mass;
    (0..MAX_WRAPPING_HANDS).find_map(|_| {
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

/// The digits of a hand of five that close on a handle: fewer on one with room for few, as in a cup's ear.
fn closing_on(handle: &Handle, stream: &mut AttemptStream) -> [bool; 5] {
    let room = (handle.length / FINGER_BREADTH) as usize;
    let fingers = if room >= 4 {
        4
    } else {
        (room + stream.below(2)).clamp(2, 4)
    };
    std::array::from_fn(|digit| digit <= fingers)
}

/// The wrist's pose with the palm on the handle from a direction with room, the fingers across it, and the handle's radius there,
/// in metres.
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

/// Largest thickness in metres of a part that fingers hook around: their tips do not reach past a thicker one.
const MAX_THICKNESS: f32 = 0.045;

/// Largest number of thin parts that are probed, the highest first, as handles are. Each takes up to 50 µs.
const MAX_PROBED: usize = 64;

/// Radius of a finger as it is probed for, in metres. A larger one misses narrow handles.
const FINGER_RADIUS: f32 = 0.007;

/// Step in metres in which the room below a part is probed, and how often it is halved there: to a fifth of a millimetre.
const STEP: f32 = 0.003;
const HALVINGS: usize = 4;

/// Directions probed around the vertical, over half a turn.
const SIDES: usize = 12;

/// Distance to the side at which the ways up are probed, in metres beyond [`FINGER_RADIUS`] and half the part's thickness.
const SIDE_GAP: f32 = 0.006;

/// Heights above the probed finger at which the ways up have to be free, in metres.
const SIDE_HEIGHTS: [f32; 2] = [0.0, 0.015];

/// Distance in metres from a place at which its part has to go on to both sides: half the breadth of two fingers.
const HALF_LENGTH: f32 = 0.014;

/// Largest rise of a part over [`HALF_LENGTH`] that is probed, in metres.
const MAX_RISE: f32 = HALF_LENGTH;

/// Largest slope of a part that is probed, as a sine: 35°. The load slips along a steeper one.
const MAX_SLOPE: f32 = 0.57;

/// By how much the ends of a part for four fingers may be off the line along it, in metres: fingers of one hand reach about as
/// deep.
const MAX_SAG: f32 = 0.01;

/// Largest number of hands tried until palm and forearm fit.
const MAX_HOOKED_HANDS: usize = 12;

/// Ranges of the first and the second joint's flexion before the fingers close, in radians.
const KNUCKLE_FLEXION: [f32; 2] = [0.35, 1.0];
const MIDDLE_FLEXION: [f32; 2] = [0.7, 1.25];

/// Largest share, of the way from the second joint to the third, at which a hook lifts.
const MAX_SHARE_ALONG: f32 = 0.45;

/// Range of the angle in radians by which the hook turns about the bar, fingertips up.
const TILT: [f32; 2] = [0.0, 0.45];

/// Range of the gap in metres between the lifting links and the part before they close.
const GAP: [f32; 2] = [0.0, 0.003];

/// The fingers that hook, with the shares of hands where a part offers room for all; elsewhere, only two do.
const FINGER_SETS: [([bool; 5], f32); 3] = [
    ([false, true, true, true, true], 0.6),
    ([false, true, true, true, false], 0.25),
    ([false, true, true, false, false], 0.15),
];

/// A place by which an object may hang, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HangingPlace {
    /// The highest point that a finger below the part touches, in metres.
    pub underside: Vec3,
    /// Unit vector along the part.
    pub along: Vec3,
    /// Thickness of the part, in metres.
    pub thickness: f32,
    /// True if the part goes on for the breadth of four fingers.
    pub is_broad: bool,
    /// Angle by which the load swings until its centre of mass is below, in radians.
    pub swing: f32,
}

/// The places by which an object hangs under one direction of gravity.
#[derive(Clone, Debug, Default)]
pub struct HangingPlaces {
    /// The places, in no particular order.
    pub places: Vec<HangingPlace>,
    /// Unit vector against gravity, in the object's frame.
    up: Vec3,
}

/// Fingers bent to a hook, in the wrist's frame.
struct Hook {
    shape: HandShape,
    /// Middle of the points where the second links lift, at the height of the deepest, in metres: the other fingers close less.
    middle: Vec3,
    /// From the outermost lifting finger to the innermost, and the direction in which they lift: orthogonal unit vectors.
    along: Vec3,
    lift: Vec3,
}

impl HangingPlaces {
    /// Probes the thin parts above the centre of mass; takes up to some milliseconds, and microseconds where there are none.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(object: &GraspObject, pairs: &SurfacePairs, up: Vec3, stop: Stop<'_>) -> Result<Self, Stopped> {
        let swing = |point: Vec3| (point - object.centre_of_mass).angle_between(up);
        let mut thin: Vec<&SurfacePair> = pairs
            .pairs
            .iter()
            .filter(|pair| pair.thickness <= MAX_THICKNESS && swing(pair.middle()) <= MAX_SWING)
            .collect();
        thin.sort_by(|a, b| b.middle().dot(up).total_cmp(&a.middle().dot(up)));
        let mut places = Vec::new();
        for pair in thin.into_iter().take(MAX_PROBED) {
            stop.check()?;
            let place = probe(&object.surface, pair, up).map(|place| HangingPlace {
                swing: swing(place.underside),
                ..place
            });
            places.extend(place.filter(|place| place.swing <= MAX_SWING));
        }
        Ok(Self { places, up })
    }

    /// Places a hooked hand whose palm and forearm satisfy `fits`. Returns `None` if there is nothing to hang by, or no drawn
    /// hand fits.
    pub fn propose(
        &self,
        rig: &Rig,
        barriers: Barriers<'_>,
        fits: impl Fn(Pose) -> bool,
        stream: &mut AttemptStream,
    ) -> Option<Proposal> {
        if self.places.is_empty() {
            return None;
        }
        (0..MAX_HOOKED_HANDS).find_map(|_| {
            let drawn = (0..COMPARED).map(|_| &self.places[stream.below(self.places.len())]);
            let place = drawn.min_by(|a, b| a.swing.total_cmp(&b.swing))?;
            if barriers.certainly_cover(place.underside, FINGER_RADIUS, 0.0) {
                return None;
            }
            let hook = Hook::draw(rig, place, stream);
            let object_from_wrist = self.hooked_in(place, &hook, stream);
            fits(object_from_wrist).then_some(Proposal {
                object_from_wrist,
                shape: hook.shape,
                advance: 0.0,
            })
        })
    }

    /// The wrist's pose with the hook below a place, the palm on either side of it.
    fn hooked_in(&self, place: &HangingPlace, hook: &Hook, stream: &mut AttemptStream) -> Pose {
        let along = if stream.unit() < 0.5 {
            place.along
        } else {
            -place.along
        };
        let tilt = Quat::from_axis_angle(along, stream.between(TILT[0], TILT[1]));
        let lift = tilt * self.up.reject_from_normalized(along).normalize_or(self.up);
        let axes = |along: Vec3, lift: Vec3| Mat3::from_cols(along, lift, along.cross(lift));
        let rotation = axes(along, lift) * axes(hook.along, hook.lift).transpose();
        let orientation = Quat::from_mat3(&rotation).normalize();
        let gap = stream.between(GAP[0], GAP[1]);
        Pose::new(
            place.underside - lift * gap - orientation * hook.middle,
            orientation,
        )
    }
}

impl Hook {
    fn draw(rig: &Rig, place: &HangingPlace, stream: &mut AttemptStream) -> Self {
        let height = if place.is_broad { stream.unit() } else { 1.0 };
        let closing = rig.own_digits(drawn_set(FINGER_SETS, height));
        let knuckle = stream.between(KNUCKLE_FLEXION[0], KNUCKLE_FLEXION[1]);
        let second = stream.between(MIDDLE_FLEXION[0], MIDDLE_FLEXION[1]);
        let mut shape = HandShape {
            thumb_yaw: stream.between(0.1, 0.5),
            spread: 0.3 * stream.unit(),
            bend_ratios: [1.0, second / knuckle],
            closing,
            preshape: [0.0; 2],
            tucks: false,
        };
        shape.preshape[1] = shape.flexing(rig, Digit::Middle).closure_at(knuckle);
        let share = MAX_SHARE_ALONG * stream.unit();
        let hooked =
            |&finger: &Digit| lifting_point(rig, finger, &shape, [knuckle, second], place.thickness, share);
        let fingers = &Digit::ALL[1..];
        let points: Vec<(Vec3, Vec3)> = fingers
            .iter()
            .filter(|finger| closing[finger.index()])
            .map(hooked)
            .collect();
        let middle = points.iter().map(|(point, _)| *point).sum::<Vec3>() / points.len() as f32;
        let along = (points[0].0 - points[points.len() - 1].0).normalize_or(Vec3::X);
        let lifts: Vec3 = points.iter().map(|(_, lift)| *lift).sum();
        let lift = lifts.reject_from_normalized(along).normalize_or(Vec3::Z);
        let heights = points.iter().map(|(point, _)| (point - middle).dot(lift));
        Self {
            shape,
            middle: middle + lift * heights.fold(f32::INFINITY, f32::min),
            along,
            lift,
        }
    }
}

/// A point on the skin of a finger's second link, and the direction its pad faces, in the wrist's frame.
fn lifting_point(
    rig: &Rig,
    finger: Digit,
    shape: &HandShape,
    [knuckle, second]: [f32; 2],
    thickness: f32,
    share: f32,
) -> (Vec3, Vec3) {
    let digit = rig.digit(finger);
    let angles = DigitAngles::coupled(shape.flexing(rig, finger).base_yaw, knuckle, second);
    let link = digit_frames(digit, Pose::IDENTITY, angles).links[1];
    let radii = link_radii(rig, finger);
    let length = digit.lengths[1];
    // Tangent to both links' skin: the axes meet at the joint, turned by its flexion.
    let closest = ((0.5 * thickness + radii[1]) * (0.5 * second).tan()).min(length);
    let along = closest + (length - closest) * share;
    let radius = radii[1] + (radii[2] - radii[1]) * along / length;
    (
        link.transform_point(Vec3::new(0.0, along, radius)),
        link.transform_vector(Vec3::Z),
    )
}

/// The place on a thin part by which an object may hang; its swing is left 0.
fn probe(surface: &MeshBvh, pair: &SurfacePair, up: Vec3) -> Option<HangingPlace> {
    let finger = finger_below(surface, pair.middle(), MAX_THICKNESS + FINGER_RADIUS, up)?;
    let (a, b) = up.any_orthonormal_pair();
    let reach = FINGER_RADIUS.mul_add(2.0, 0.5 * pair.thickness) + SIDE_GAP;
    let is_open = |turn: usize| {
        let (sin, cos) = (PI * turn as f32 / SIDES as f32).sin_cos();
        let side = a * cos + b * sin;
        [reach, -reach].iter().all(|&reach| {
            SIDE_HEIGHTS
                .iter()
                .all(|&height| is_free(surface, finger + side * reach + up * height))
        })
    };
    let open: [bool; SIDES] = std::array::from_fn(is_open);
    let across = middle_of_longest_run(&open)?;
    let turn = PI * across / SIDES as f32 + FRAC_PI_2;
    let level = a * turn.cos() + b * turn.sin();
    // The part goes on to both sides: below it, a finger finds its underside at a similar height.
    let depth = 2.0 * (MAX_RISE + FINGER_RADIUS) + pair.thickness;
    let below = |offset: f32| {
        let above = finger + level * offset + up * (MAX_RISE + FINGER_RADIUS);
        finger_below(surface, above, depth, up)
    };
    let along = (below(HALF_LENGTH)? - below(-HALF_LENGTH)?).normalize_or(level);
    let goes_on = |offset: f32| {
        below(offset).is_some_and(|end| (end - finger).reject_from_normalized(along).length() <= MAX_SAG)
    };
    (along.dot(up).abs() <= MAX_SLOPE).then(|| HangingPlace {
        underside: finger + up * FINGER_RADIUS,
        along,
        thickness: pair.thickness,
        swing: 0.0,
        is_broad: goes_on(2.0 * HALF_LENGTH) && goes_on(-2.0 * HALF_LENGTH),
    })
}

/// The highest free point for a finger under the part below `start`, within `depth` metres.
fn finger_below(surface: &MeshBvh, start: Vec3, depth: f32, up: Vec3) -> Option<Vec3> {
    let at = |depth: f32| start - up * depth;
    let mut steps = (0..=(depth / STEP) as usize).map(|step| STEP * step as f32);
    let first = steps.find(|&depth| !is_free(surface, at(depth)))?;
    let mut free = steps.find(|&depth| is_free(surface, at(depth)))?;
    let mut blocked = (free - STEP).max(first);
    for _ in 0..HALVINGS {
        let between = 0.5 * (blocked + free);
        if is_free(surface, at(between)) {
            free = between;
        } else {
            blocked = between;
        }
    }
    Some(at(free))
}

/// True if a sphere of [`FINGER_RADIUS`] is clear of surface and volume.
fn is_free(surface: &MeshBvh, centre: Vec3) -> bool {
    surface.closest_point_within(centre, FINGER_RADIUS).is_none() && !surface.contains(centre)
}

/// The middle of the longest run of open directions, in steps around half a turn; `None` if all or none are open.
fn middle_of_longest_run(open: &[bool; SIDES]) -> Option<f32> {
    let closed = open.iter().position(|open| !open)?;
    let (mut best, mut length) = ((0, 0.0), 0);
    for step in 1..=SIDES {
        if open[(closed + step) % SIDES] {
            length += 1;
            if length > best.0 {
                best = (length, (closed + step) as f32 - 0.5 * (length - 1) as f32);
            }
        } else {
            length = 0;
        }
    }
    (best.0 > 0).then_some(best.1)
}
