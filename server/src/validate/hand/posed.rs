//! Checks hands that are given as joint angles of a rig.

use std::sync::Arc;

use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        HandPose, Handedness,
        joints::{HandJoints, openxr_from_thesis_frame, thesis_from_openxr_frame},
    },
};

use super::{
    JointedHand,
    digits::{AngleBounds, checked_digits},
    hand_scale, rig_named,
};
use crate::{
    convention::Convention,
    rigs::{RigHand, StoredRig},
    validate::{Field, frames::Frames, known, pose, required_handedness},
};

/// A posed hand of a rig.
#[derive(Clone, Debug)]
pub(in crate::validate) struct PosedHand {
    pub rig: Arc<StoredRig>,
    pub handedness: Handedness,
    /// How many times as large as the rig it is.
    pub scale: f32,
    /// The hand, in the frame that was requested.
    pub pose: HandPose,
}

/// Where a hand is wanted, and which of its wrists counts if both are given.
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
    /// The hand of the rig.
    pub(in crate::validate) fn rig_hand(&self) -> &RigHand {
        self.rig.hand(self.handedness)
    }
}

/// A hand; `None` if it is wrong.
pub(in crate::validate) fn posed_hand(
    field: Field<'_>,
    sent: &v1::HandPose,
    place: Place,
    bounds: AngleBounds,
    frames: &Frames<'_>,
) -> Option<PosedHand> {
    let rig = rig_named(field.child("rig"), &sent.rig, frames.rigs);
    let handedness = required_handedness(field.child("handedness"), sent.handedness);
    let scale = hand_scale(field.child("scale"), sent.scale);
    let convention = convention_of(field, sent, frames.convention);
    let client_from_object = frames.client_from_object;
    let wrist = match wrist(field, sent, place, convention) {
        Some(Wrist::InClient(pose)) if place != Place::InClient => Some(client_from_object.inverse() * pose),
        Some(Wrist::AtObject(pose)) if place == Place::InClient => Some(client_from_object * pose),
        Some(Wrist::InClient(pose) | Wrist::AtObject(pose)) => Some(pose),
        None => None,
    };
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

/// The convention of a hand's wrists; unspecified, that of what it is in.
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

/// A wrist in one of the frames that it can be in.
enum Wrist {
    InClient(Pose),
    AtObject(Pose),
}

/// The wrist of a hand that counts; `None` if there is neither.
fn wrist(field: Field<'_>, sent: &v1::HandPose, place: Place, convention: Convention) -> Option<Wrist> {
    match (sent.client_from_wrist, sent.object_from_wrist) {
        (Some(wrist), other) if place != Place::AtObject || other.is_none() => {
            let wrist = pose(field.child("client_from_wrist"), Some(wrist), convention);
            let wrist = thesis_from_openxr_frame(convention.joint_to_openxr(wrist));
            Some(Wrist::InClient(wrist))
        }
        (_, Some(wrist)) => {
            let wrist = wrist_at_object(field.child("object_from_wrist"), wrist, convention);
            Some(Wrist::AtObject(wrist))
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
    // Of the two quaternions of an orientation, the one that is answered with the given sign: others would seem to jump.
    let answered = convention.joint_at_object_from_openxr(openxr_from_thesis_frame(object_from_wrist));
    if answered.orientation.dot(wrist.orientation) < 0.0 {
        object_from_wrist.orientation = -object_from_wrist.orientation;
    }
    object_from_wrist
}

/// The giver's hand or another one to keep clear of, in the client's frame; `None` if it is wrong.
pub(super) fn angled_hand(field: Field<'_>, sent: &v1::HandPose, frames: &Frames<'_>) -> Option<JointedHand> {
    let posed = posed_hand(field, sent, Place::InClient, AngleBounds::Rig, frames)?;
    let hand = &posed.rig_hand().hand;
    Some(JointedHand {
        joints: HandJoints::of_pose(&hand.rig.scaled(posed.scale), &posed.pose),
        skin: Arc::clone(&hand.skin),
        field: "holdout.presenting_hand.pose",
        warnings: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::validate::{
        hand::fixtures::stretched_hand,
        testing::{CONVENTIONS, read_at},
    };
    use crate::{rigs::store::RigStore, wire::wire_pose};

    fn somewhere(place: f32) -> Pose {
        Pose::new(
            Vec3::new(0.3, 0.2 * place, -0.4),
            Quat::from_euler(glam::EulerRot::XYZ, 0.3 * place, -1.1, 2.0),
        )
    }

    fn assert_same(a: Pose, b: Pose, context: &str) {
        assert!(a.position.distance(b.position) < 1e-5, "{context}: {a:?} {b:?}");
        assert!(
            a.orientation.dot(b.orientation).abs() > 1.0 - 1e-5,
            "{context}: {a:?} {b:?}"
        );
    }

    #[test]
    fn one_wrist_counts_in_the_messages_own_convention() {
        let rigs = RigStore::new(1, None);
        let (client_from_object, [in_client, at_object]) = (somewhere(1.0), [2.0, 3.0].map(somewhere));
        // Those of the request, and of the hand; the request's if it has none.
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
            let only_client = v1::HandPose {
                object_from_wrist: None,
                ..both.clone()
            };
            let only_object = v1::HandPose {
                client_from_wrist: None,
                ..both.clone()
            };
            for (sent, near, grasp) in [
                (&both, in_client, at_object),
                (&only_client, in_client, client_from_object.inverse() * in_client),
                (&only_object, client_from_object * at_object, at_object),
            ] {
                let is_at = |(hand, blamed): (Option<PosedHand>, Vec<String>), expected: Pose| {
                    assert!(blamed.is_empty(), "{blamed:?}");
                    let wrist = hand.expect("it is right").pose.frame_from_wrist;
                    let context = format!("{of_request:?} {own:?}");
                    assert_same(openxr_from_thesis_frame(wrist), expected, &context);
                };
                let read = |place| {
                    read_at("hand", |field| {
                        posed_hand(field, sent, place, AngleBounds::Rig, &frames)
                    })
                };
                is_at(read(Place::InClient), near);
                is_at(read(Place::NearObject), client_from_object.inverse() * near);
                is_at(read(Place::AtObject), grasp);
            }
        }
    }
}
