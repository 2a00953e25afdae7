//! Flesh of the palm as solids attached to the bones, and the palm as the joints' radii describe it.
//!
//! The values are a least-squares fit of the solids' union to the skin of the built-in rig `adult` in three poses:
//! stretched, relaxed, and thumb opposing the fingers. 95 % of the back lies within 1.3 mm of the fitted solids, of
//! the palmar side within 1.8 mm (2.2 mm when thumb and fingers bend). For other hands they scale with the hand.

use std::array::from_fn;

use Anchor::{Between, Thumb, Wrist};
use glam::{Mat3, Vec3};

use super::TaperedCapsule;
use crate::{
    base::pose::Pose,
    model::hand::{
        Handedness,
        joints::{HandJoints, index, thesis_from_openxr_frame},
        rig::{EndChange, FLESH_SOLIDS, PalmFlesh, Rig},
    },
};

/// Solids of the palm that do not move with a digit: over the four metacarpals, between them, the ball of the little
/// finger, and the two sides of the carpus.
pub const PALM_SOLIDS: usize = 10;

/// Solids that move with the thumb's metacarpal: the ball of the thumb, its root in the palm, and the web to the index finger.
pub(crate) const THENAR_SOLIDS: usize = FLESH_SOLIDS - PALM_SOLIDS;

/// Distance from wrist to middle knuckle of the fitted hand, in metres.
const FITTED_SIZE: f32 = 0.097_674;

/// Metres per millimetre.
const MILLIMETRE: f32 = 1e-3;

/// Indices of the ends of the fingers' metacarpals, in the order of [`joint_of_end`].
const INDEX_BASE: usize = 0;
const INDEX_KNUCKLE: usize = 1;
const MIDDLE_BASE: usize = 2;
const MIDDLE_KNUCKLE: usize = 3;
const RING_BASE: usize = 4;
const RING_KNUCKLE: usize = 5;
const LITTLE_BASE: usize = 6;
const LITTLE_KNUCKLE: usize = 7;

/// The point of the skeleton that an end of a solid is attached to.
#[derive(Clone, Copy, Debug)]
enum Anchor {
    /// The wrist, in the frame of the palm.
    Wrist,
    /// A point between two ends of metacarpals, at a share of their distance, in the frame of the palm.
    Between(usize, usize, f32),
    /// The thumb's base, in the frame of its metacarpal.
    Thumb,
}

/// The end of a metacarpal.
const fn at(end: usize) -> Anchor {
    Between(end, end, 0.5)
}

/// The middle between two ends of metacarpals.
const fn amid(a: usize, b: usize) -> Anchor {
    Between(a, b, 0.5)
}

/// An end of a solid: its anchor, its offset from there in millimetres, and its radius in millimetres.
///
/// In the palm's frame, x points to the thumb's side, y to the knuckles and z out of the palm. In the thumb's, y
/// points along the metacarpal and z to the pad; x completes a right-handed frame on the right hand, a left-handed
/// one on the left.
type End = (Anchor, [f32; 3], f32);

/// The palm, see [`PALM_SOLIDS`].
#[rustfmt::skip]
const PALM: [[End; 2]; PALM_SOLIDS] = [
    [(at(INDEX_BASE), [0.0, 0.0, 1.9], 11.9), (at(INDEX_KNUCKLE), [0.0, 0.0, 1.1], 12.3)],
    [(at(MIDDLE_BASE), [0.0, 0.0, -0.1], 15.2), (at(MIDDLE_KNUCKLE), [0.0, 2.7, 2.4], 11.4)],
    [(at(RING_BASE), [0.0, 0.0, 1.8], 11.6), (at(RING_KNUCKLE), [0.0, -0.2, 1.2], 12.2)],
    [(at(LITTLE_BASE), [0.0, 0.0, 1.9], 12.5), (at(LITTLE_KNUCKLE), [0.0, -1.3, 1.0], 11.3)],
    [(amid(INDEX_BASE, MIDDLE_BASE), [0.0, 0.0, -1.0], 13.4), (amid(INDEX_KNUCKLE, MIDDLE_KNUCKLE), [0.0, -0.6, 1.7], 10.6)],
    [(amid(MIDDLE_BASE, RING_BASE), [0.0, 0.0, 0.9], 15.7), (amid(MIDDLE_KNUCKLE, RING_KNUCKLE), [0.0, 1.0, 1.5], 10.3)],
    [(amid(RING_BASE, LITTLE_BASE), [0.0, 0.0, 0.6], 17.1), (amid(RING_KNUCKLE, LITTLE_KNUCKLE), [0.0, 0.2, 1.8], 9.7)],
    [(Wrist, [-17.5, 14.7, 2.5], 16.1), (Wrist, [-31.9, 54.3, 4.2], 14.7)],
    [(Wrist, [5.0, -10.4, -0.3], 18.9), (Wrist, [12.5, 37.9, 1.5], 14.4)],
    [(Wrist, [-12.7, -4.5, -1.0], 16.9), (Wrist, [-8.1, 28.7, 2.5], 18.0)],
];

/// The ball of the thumb and the web, see [`THENAR_SOLIDS`].
#[rustfmt::skip]
const THENAR: [[End; 2]; THENAR_SOLIDS] = [
    [(Wrist, [13.9, 38.3, 14.3], 17.0), (Thumb, [1.1, 46.1, -1.7], 13.2)],
    [(Thumb, [-1.0, -6.7, 4.9], 16.1), (Thumb, [1.8, 24.8, 4.6], 15.5)],
    [(Thumb, [-11.0, 45.3, 3.6], 3.2), (Between(INDEX_BASE, INDEX_KNUCKLE, 0.69), [0.0; 3], 5.6)],
    [(Thumb, [1.0, 18.2, 0.7], 14.0), (Between(INDEX_BASE, INDEX_KNUCKLE, 0.75), [0.0; 3], 3.2)],
];

/// The bones that carry the flesh, with the frames and the scale that place solids on them, in the frame of the hand's pose.
pub(super) struct Skeleton<'a> {
    wrist: Vec3,
    metacarpal_ends: [Vec3; METACARPAL_ENDS],
    thumb_base: Vec3,
    flesh: Option<&'a PalmFlesh>,
    frame_from_palm: Mat3,
    frame_from_thumb: Mat3,
    /// Metres per millimetre of the fitted hand.
    millimetre: f32,
}

impl<'a> Skeleton<'a> {
    /// The skeleton of tracked joints.
    pub(super) fn of_joints(joints: &HandJoints) -> Self {
        let at = |joint: usize| joints.joints[joint].pose.position;
        let thumb = index::FIRST_OF_DIGIT[0];
        let thumb_frame = thesis_from_openxr_frame(joints.joints[thumb].pose);
        Self::new(
            joints.handedness,
            at(index::WRIST),
            from_fn(|end| at(joint_of_end(end))),
            [at(thumb), at(thumb + 1)],
            thumb_frame.transform_vector(Vec3::Z),
        )
    }

    /// The skeleton of a rig with a given wrist pose and given joints of the digits, with its own flesh if that is known.
    /// `thumb_pad` is the direction that the palmar side of the thumb's metacarpal faces.
    pub(super) fn of_rig(
        rig: &'a Rig,
        frame_from_wrist: Pose,
        digits: &[[Vec3; 4]; 5],
        thumb_pad: Vec3,
    ) -> Self {
        let end_at = |end: usize| match end % 2 {
            0 => frame_from_wrist.transform_point(rig.finger_metacarpals[end / 2]),
            _ => digits[end / 2 + 1][0],
        };
        let [thumb_base, second, ..] = digits[0];
        Self {
            flesh: rig.palm_flesh.as_deref(),
            ..Self::new(
                rig.handedness,
                frame_from_wrist.position,
                from_fn(end_at),
                [thumb_base, second],
                thumb_pad,
            )
        }
    }

    /// The frames follow joint positions, because trackers measure positions better than orientations.
    fn new(
        handedness: Handedness,
        wrist: Vec3,
        metacarpal_ends: [Vec3; METACARPAL_ENDS],
        [thumb_base, second]: [Vec3; 2],
        thumb_pad: Vec3,
    ) -> Self {
        let [index_knuckle, middle_knuckle, little_knuckle] =
            [INDEX_KNUCKLE, MIDDLE_KNUCKLE, LITTLE_KNUCKLE].map(|end| metacarpal_ends[end]);
        let side = handedness.thumb_side();
        let up = middle_knuckle - wrist;
        let y = up.normalize_or(Vec3::Y);
        let x = (index_knuckle - little_knuckle)
            .reject_from_normalized(y)
            .normalize_or(Vec3::X * side);
        let thumb_y = (second - thumb_base).normalize_or(Vec3::Y);
        let thumb_z = thumb_pad.reject_from_normalized(thumb_y).normalize_or(Vec3::Z);
        Self {
            wrist,
            metacarpal_ends,
            thumb_base,
            flesh: None,
            frame_from_palm: Mat3::from_cols(x, y, x.cross(y) * side),
            frame_from_thumb: Mat3::from_cols(thumb_y.cross(thumb_z) * side, thumb_y, thumb_z),
            millimetre: MILLIMETRE * up.length() / FITTED_SIZE,
        }
    }

    /// The palm's solids.
    pub(super) fn palm(&self) -> [TaperedCapsule; PALM_SOLIDS] {
        self.solids(&PALM, 0)
    }

    /// The solids that move with the thumb.
    pub(super) fn thenar(&self) -> [TaperedCapsule; THENAR_SOLIDS] {
        self.solids(&THENAR, PALM_SOLIDS)
    }

    /// Solids with these ends, of which the first has an index in [`PalmFlesh`].
    fn solids<const N: usize>(&self, ends: &[[End; 2]; N], first: usize) -> [TaperedCapsule; N] {
        let mut solids = [TaperedCapsule::default(); N];
        for (solid, ends) in solids.iter_mut().zip(ends) {
            *solid = self.solid(*ends);
        }
        if let Some(PalmFlesh(changes)) = self.flesh {
            for (solid, ends) in solids.iter_mut().zip(&changes[first..]) {
                *solid = self.changed(solid, *ends);
            }
        }
        solids
    }

    fn changed(&self, solid: &TaperedCapsule, [start, end]: [EndChange; 2]) -> TaperedCapsule {
        let out_of_palm = self.frame_from_palm.z_axis;
        TaperedCapsule::new(
            solid.start + start.offset * out_of_palm,
            solid.end + end.offset * out_of_palm,
            solid.start_radius + start.radius,
            solid.end_radius + end.radius,
        )
    }

    fn solid(&self, [start, end]: [End; 2]) -> TaperedCapsule {
        TaperedCapsule::new(
            self.place(&start),
            self.place(&end),
            start.2 * self.millimetre,
            end.2 * self.millimetre,
        )
    }

    fn place(&self, &(anchor, offset, _): &End) -> Vec3 {
        let offset = Vec3::from(offset) * self.millimetre;
        match anchor {
            Wrist => self.wrist + self.frame_from_palm * offset,
            Between(a, b, share) => {
                let [a, b] = [a, b].map(|end| self.metacarpal_ends[end]);
                a.lerp(b, share) + self.frame_from_palm * offset
            }
            Thumb => self.thumb_base + self.frame_from_thumb * offset,
        }
    }
}

/// The palm's fitted solids, those along and between the metacarpals at least as thick as the joints' radii: an
/// owner's tracked hand may be thicker than one fitted to another hand's skin.
pub(super) fn palm_as_tracked(
    palm: &[TaperedCapsule; PALM_SOLIDS],
    tracked: &TrackedPalm,
) -> [TaperedCapsule; PALM_SOLIDS] {
    let mut solids = *palm;
    for (solid, ends) in solids.iter_mut().zip(&PALM) {
        let (start, start_radius) = widened(ends[0].0, solid.start, solid.start_radius, tracked);
        let (end, end_radius) = widened(ends[1].0, solid.end, solid.end_radius, tracked);
        *solid = TaperedCapsule::new(start, end, start_radius, end_radius);
    }
    solids
}

/// The smallest sphere around a fitted one and the tracked one at its anchor.
#[inline]
fn widened(anchor: Anchor, place: Vec3, radius: f32, tracked: &TrackedPalm) -> (Vec3, f32) {
    let Between(a, b, share) = anchor else {
        return (place, radius);
    };
    let (tracked_place, tracked_radius) = tracked.between(a, b, share);
    TaperedCapsule::new(place, tracked_place, radius, tracked_radius).bounding_sphere()
}

/// Ends of the fingers' metacarpals: base and knuckle of each, from index to little finger.
pub(super) const METACARPAL_ENDS: usize = 8;

/// Indices of the wrist and of the thumb's base in [`TrackedPalm::joints`].
const WRIST: usize = METACARPAL_ENDS;
const THUMB: usize = WRIST + 1;

/// Bones by their joints: metacarpals, lines between neighbouring bases and knuckles, and from the wrist to all bases.
#[rustfmt::skip]
const BONES: [[usize; 2]; 15] = [
    [0, 1], [2, 3], [4, 5], [6, 7],
    [0, 2], [2, 4], [4, 6],
    [1, 3], [3, 5], [5, 7],
    [WRIST, 0], [WRIST, 2], [WRIST, 4], [WRIST, 6], [WRIST, THUMB],
];

/// Number of the last of [`BONES`], which [`TrackedPalm::around_metacarpals`] returns.
pub(super) const AROUND_METACARPALS: usize = 8;

/// The joints that are fixed in the palm, each with its distance to the skin.
#[derive(Clone, Copy, Debug)]
pub struct TrackedPalm {
    /// Position and radius in metres of each finger's metacarpal base and knuckle, the wrist, and the thumb's base.
    joints: [(Vec3, f32); THUMB + 1],
}

impl TrackedPalm {
    /// The palm of tracked joints, in their frame.
    pub fn of_joints(joints: &HandJoints) -> Self {
        Self {
            joints: from_fn(|place| {
                let joint = joints.joints[openxr_joint(place)];
                (joint.pose.position, joint.radius)
            }),
        }
    }

    /// The palm of a rig's hand, which does not depend on its digits.
    pub fn of_rig(rig: &Rig, frame_from_wrist: Pose) -> Self {
        let in_wrist = |place: usize| match place {
            WRIST => Vec3::ZERO,
            THUMB => rig.digits[0].wrist_from_base.position,
            end if end.is_multiple_of(2) => rig.finger_metacarpals[end / 2],
            end => rig.digits[end / 2 + 1].wrist_from_base.position,
        };
        Self {
            joints: from_fn(|place| {
                (
                    frame_from_wrist.transform_point(in_wrist(place)),
                    rig.joint_radii[openxr_joint(place)],
                )
            }),
        }
    }

    /// Position and radius at a share of the distance between two ends of metacarpals.
    pub(super) fn between(&self, a: usize, b: usize, share: f32) -> (Vec3, f32) {
        let [(a, a_radius), (b, b_radius)] = [self.joints[a], self.joints[b]];
        (a.lerp(b, share), a_radius + (b_radius - a_radius) * share)
    }

    /// The palm behind the metacarpals and between their heads: from knuckle to knuckle, and from the wrist to the bases.
    pub(super) fn around_metacarpals(&self) -> [TaperedCapsule; AROUND_METACARPALS] {
        let bones = &BONES[BONES.len() - AROUND_METACARPALS..];
        let mut solids = [TaperedCapsule::default(); AROUND_METACARPALS];
        for (solid, bone) in solids.iter_mut().zip(bones) {
            *solid = self.capsule(*bone);
        }
        solids
    }

    /// Unsigned distance of a point from the tracked skin in metres: around the metacarpals, between neighbours
    /// across knuckles and bases, and from the wrist to all bases, the thumb's included.
    pub fn distance_to_skin(&self, point: Vec3) -> f32 {
        BONES
            .into_iter()
            .map(|bone| self.capsule(bone).signed_distance(point))
            .fold(f32::INFINITY, f32::min)
            .abs()
    }

    fn capsule(&self, [a, b]: [usize; 2]) -> TaperedCapsule {
        let [(start, start_radius), (end, end_radius)] = [self.joints[a], self.joints[b]];
        TaperedCapsule::new(start, end, start_radius, end_radius)
    }
}

/// The `OpenXR` joint at the end of a metacarpal.
pub(super) fn joint_of_end(end: usize) -> usize {
    index::FIRST_OF_DIGIT[end / 2 + 1] + end % 2
}

/// The `OpenXR` joint of one of [`TrackedPalm::joints`].
fn openxr_joint(place: usize) -> usize {
    match place {
        WRIST => index::WRIST,
        THUMB => index::FIRST_OF_DIGIT[0],
        end => joint_of_end(end),
    }
}
