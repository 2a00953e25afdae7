//! Checks hands that are given as joint angles of a rig.

use std::{f32::consts::PI, sync::Arc};

use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        Digit, DigitAngles, HandPose, Handedness,
        joints::{HandJoints, openxr_from_thesis_frame, thesis_from_openxr_frame},
        rig::{AngleRange, DigitLimits, Rig},
    },
};

use super::{HAND_SCALES, JointedHand, rig_named};
use crate::{
    convention::Convention,
    rigs::{RigHand, StoredRig},
    validate::{Field, factor, holdout::Frames, known, pose, required_handedness},
};

/// How far an angle may be outside its limits, in radians, to be clamped: room for clients that clamp in degrees.
const ANGLE_SLACK: f32 = 1e-3;
const NAMES: [&str; 5] = ["thumb", "index", "middle", "ring", "little"];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::validate) enum AngleBounds {
    /// The limits of the rig; half a turn if it is unknown.
    Rig,
    HalfTurn,
}

#[derive(Clone, Debug)]
pub(in crate::validate) struct PosedHand {
    pub rig: Arc<StoredRig>,
    pub handedness: Handedness,
    /// How many times as large as the rig it is.
    pub scale: f32,
    /// The hand, in the frame that was requested.
    pub pose: HandPose,
}

/// The frame to read a hand in, and the wrist that counts if both are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::validate) enum Place {
    /// In the client's frame, by `client_from_wrist`.
    InClient,
    /// In the object's frame, by `client_from_wrist`.
    NearObject,
    /// In the object's frame, by `object_from_wrist`.
    AtObject,
}

impl PosedHand {
    pub(in crate::validate) fn rig_hand(&self) -> &RigHand {
        self.rig.hand(self.handedness)
    }
}

pub(in crate::validate) fn posed_hand(
    field: Field<'_>,
    sent: &v1::HandPose,
    place: Place,
    bounds: AngleBounds,
    frames: &Frames<'_>,
) -> Option<PosedHand> {
    let rig = rig_named(field.child("rig"), &sent.rig, frames.rigs);
    let handedness = required_handedness(field.child("handedness"), sent.handedness);
    let scale = factor(field.child("scale"), sent.scale, HAND_SCALES);
    let convention = convention_of(field, sent, frames.convention);
    let wrist = wrist(field, sent, place, (convention, frames.client_from_object));
    // Both hands have the same digits and limits, which are checked even if the handedness is missing.
    let hand = rig
        .as_ref()
        .map(|rig| &*rig.hand(handedness.unwrap_or(Handedness::Right)).hand.rig);
    let digits = match (hand, bounds) {
        // Whether they are right depends on the rig.
        (None, AngleBounds::Rig) => None,
        _ => Some(checked_digits(field, sent, hand, bounds)),
    };
    Some(PosedHand {
        rig: rig?,
        handedness: handedness?,
        scale,
        pose: HandPose {
            frame_from_wrist: wrist?,
            digits: digits?,
        },
    })
}

/// The convention of a hand's wrists; if unspecified, that of the request.
pub(in crate::validate) fn convention_of(
    field: Field<'_>,
    sent: &v1::HandPose,
    of_request: Convention,
) -> Convention {
    match known(field.child("convention"), sent.convention) {
        v1::Convention::Unspecified => of_request,
        own => Convention::from_wire(own),
    }
}

/// The wrist that counts, in the requested frame; `None` if there is neither.
fn wrist(
    field: Field<'_>,
    sent: &v1::HandPose,
    place: Place,
    (convention, client_from_object): (Convention, Pose),
) -> Option<Pose> {
    match (sent.client_from_wrist, sent.object_from_wrist) {
        (Some(wrist), other) if place != Place::AtObject || other.is_none() => {
            let wrist = pose(field.child("client_from_wrist"), Some(wrist), convention);
            let wrist = thesis_from_openxr_frame(convention.joint_to_openxr(wrist));
            Some(match place {
                Place::InClient => wrist,
                Place::NearObject | Place::AtObject => client_from_object.inverse() * wrist,
            })
        }
        (_, Some(wrist)) => {
            let wrist = wrist_at_object(field.child("object_from_wrist"), wrist, convention);
            Some(match place {
                Place::InClient => client_from_object * wrist,
                Place::NearObject | Place::AtObject => wrist,
            })
        }
        (_, None) => {
            field.reject("has neither client_from_wrist nor object_from_wrist; one of them is required")
        }
    }
}

/// A wrist in the object's frame, in thesis axes.
pub(in crate::validate) fn wrist_at_object(field: Field<'_>, sent: v1::Pose, convention: Convention) -> Pose {
    let wrist = pose(field, Some(sent), convention);
    let mut object_from_wrist = thesis_from_openxr_frame(convention.joint_at_object_to_openxr(wrist));
    // Of an orientation's two quaternions, keep the sign that the answer repeats: the other would seem to jump.
    let answered = convention.joint_at_object_from_openxr(openxr_from_thesis_frame(object_from_wrist));
    if answered.orientation.dot(wrist.orientation) < 0.0 {
        object_from_wrist.orientation = -object_from_wrist.orientation;
    }
    object_from_wrist
}

pub(super) fn jointed_hand(
    field: Field<'_>,
    sent: &v1::HandPose,
    frames: &Frames<'_>,
) -> Option<JointedHand> {
    let posed = posed_hand(field, sent, Place::InClient, AngleBounds::Rig, frames)?;
    let hand = &posed.rig_hand().hand;
    Some(JointedHand {
        joints: HandJoints::of_pose(&hand.rig.scaled(posed.scale), &posed.pose),
        skin: Arc::clone(&hand.skin),
        field: "holdout.presenting_hand.pose",
        warnings: Vec::new(),
    })
}

/// The digits of the hand at `field`, thumb first. Digits that the rig has are required; others are ignored, and taken as
/// stretched. With an unknown rig, none is required.
pub(in crate::validate) fn checked_digits(
    field: Field<'_>,
    sent: &v1::HandPose,
    rig: Option<&Rig>,
    bounds: AngleBounds,
) -> [DigitAngles; 5] {
    let mut digits = [DigitAngles::default(); 5];
    for (digit, sent) in Digit::ALL.into_iter().zip(sent.digits()) {
        if rig.is_some_and(|rig| !rig.has(digit)) {
            continue;
        }
        let field = field.child(NAMES[digit.index()]);
        let limits = rig.map(|rig| &rig.digit(digit).limits);
        match sent {
            Some(sent) => digits[digit.index()] = digit_angles(field, sent, limits, bounds),
            None if rig.is_some() => field.add("is required; {} is the stretched digit"),
            None => {}
        }
    }
    digits
}

fn digit_angles(
    field: Field<'_>,
    sent: &v1::DigitAngles,
    limits: Option<&DigitLimits>,
    bounds: AngleBounds,
) -> DigitAngles {
    let checked = |name, angle: f32, range: fn(&DigitLimits) -> AngleRange| {
        match limits.filter(|_| bounds == AngleBounds::Rig).map(range) {
            Some(range) if range.contains(angle, ANGLE_SLACK) => angle.clamp(range.min, range.max),
            Some(AngleRange { min, max }) => {
                field
                    .child(name)
                    .add(format_args!("is {angle} rad; the rig allows {min} to {max}"));
                min
            }
            None if angle.abs() <= PI => angle,
            // Beyond half a turn, it is a mistake of units. NaN comes here, too: the comparison is false for it.
            None => {
                field.child(name).add(format_args!(
                    "is {angle} rad; it must be within half a turn, {PI} rad"
                ));
                0.0
            }
        }
    };
    let coupled = DigitAngles::coupled(
        checked("base_yaw", sent.base_yaw, |limits| limits.base_yaw),
        checked("base_pitch", sent.base_pitch, |limits| limits.base_pitch),
        checked("second_pitch", sent.second_pitch, |limits| limits.second_pitch),
    );
    let third_pitch = match sent.third_pitch {
        Some(angle) => checked("third_pitch", angle, |limits| limits.third_pitch),
        None => {
            limits
                .map_or(coupled, |limits| limits.clamped(coupled))
                .third_pitch
        }
    };
    DigitAngles {
        third_pitch,
        ..coupled
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};
    use grasp_assets::hands;

    use super::*;
    use crate::{
        rigs::store::RigStore,
        validate::fixtures::{CONVENTIONS, read_at, stretched_hand},
        wire::wire_pose,
    };

    fn somewhere(place: f32) -> Pose {
        Pose::new(
            Vec3::new(0.3, 0.2 * place, -0.4),
            Quat::from_euler(glam::EulerRot::XYZ, 0.3 * place, -1.1, 2.0),
        )
    }

    #[test]
    fn one_wrist_counts_in_the_messages_own_convention() {
        let rigs = RigStore::new(1, None);
        let (client_from_object, [in_client, at_object]) = (somewhere(1.0), [2.0, 3.0].map(somewhere));
        // Conventions of the request and of the hand, by default the request's.
        let named = |one: Convention| CONVENTIONS.map(|other| (one, other.to_wire(), other));
        let unnamed = CONVENTIONS.map(|one| (one, v1::Convention::Unspecified, one));
        for (of_request, own, convention) in CONVENTIONS.into_iter().flat_map(named).chain(unnamed) {
            let frames = Frames {
                convention: of_request,
                client_from_object,
                rigs: &rigs,
            };
            let both = v1::HandPose {
                client_from_wrist: Some(wire_pose(convention.joint_from_openxr(in_client))),
                object_from_wrist: Some(wire_pose(convention.joint_at_object_from_openxr(at_object))),
                convention: own.into(),
                ..stretched_hand(v1::Handedness::Left)
            };
            let (mut only_client, mut only_object) = (both.clone(), both.clone());
            only_client.object_from_wrist = None;
            only_object.client_from_wrist = None;
            let object_from_client = client_from_object.inverse();
            for (sent, near, grasp) in [
                (&both, in_client, at_object),
                (&only_client, in_client, object_from_client * in_client),
                (&only_object, client_from_object * at_object, at_object),
            ] {
                for (place, expected) in [
                    (Place::InClient, near),
                    (Place::NearObject, object_from_client * near),
                    (Place::AtObject, grasp),
                ] {
                    let (hand, blamed) = read_at("hand", |field| {
                        posed_hand(field, sent, place, AngleBounds::Rig, &frames)
                    });
                    let wrist = hand.expect("it is right").pose.frame_from_wrist;
                    let wrist = openxr_from_thesis_frame(wrist);
                    let is_same = wrist.position.distance(expected.position) < 1e-5
                        && wrist.orientation.dot(expected.orientation).abs() > 1.0 - 1e-5;
                    assert!(is_same && blamed.is_empty(), "{of_request:?} {own:?} {place:?}");
                }
            }
        }
    }

    #[test]
    fn clamps_angles_within_the_slack_and_couples_absent_ones() {
        let hand = hands::hand("thesis", Handedness::Right).expect("the rig is built in");
        let limits = &hand.rig.digits[1].limits;
        let limit = limits.second_pitch.max;
        let angles = v1::DigitAngles {
            base_yaw: 0.0,
            base_pitch: 0.1,
            second_pitch: limit + 0.5 * ANGLE_SLACK,
            third_pitch: None,
        };
        let read = |angles: &v1::DigitAngles, bounds| {
            read_at("hand", |field| digit_angles(field, angles, Some(limits), bounds))
        };
        let (within, blamed) = read(&angles, AngleBounds::Rig);
        assert!(blamed.is_empty());
        assert_eq!(within.second_pitch, limit);
        let coupled = (limit * 2.0 / 3.0).min(limits.third_pitch.max);
        assert!((within.third_pitch - coupled).abs() < 1e-6);
        let over = v1::DigitAngles {
            second_pitch: limit + 2.0 * ANGLE_SLACK,
            ..angles
        };
        assert_eq!(read(&over, AngleBounds::Rig).1, ["hand.second_pitch"]);
        // Bounds of half a turn leave them unchanged.
        let (unbounded, blamed) = read(&over, AngleBounds::HalfTurn);
        assert!(blamed.is_empty());
        assert_eq!(unbounded.second_pitch, over.second_pitch);
    }

    #[test]
    fn requires_the_digits_of_a_known_rig() {
        let hand = hands::hand("adult", Handedness::Right).expect("the rig is built in");
        let sent = v1::HandPose {
            index: Some(v1::DigitAngles::default()),
            ring: Some(v1::DigitAngles {
                base_yaw: f32::NAN,
                ..Default::default()
            }),
            ..Default::default()
        };
        let of_rig = ["hand.thumb", "hand.middle", "hand.ring.base_yaw", "hand.little"];
        for (rig, expected) in [(Some(&*hand.rig), &of_rig[..]), (None, &of_rig[2..3])] {
            let read = |field: Field<'_>| checked_digits(field, &sent, rig, AngleBounds::Rig);
            assert_eq!(read_at("hand", read).1, expected);
        }
    }
}
