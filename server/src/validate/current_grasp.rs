//! Checks `CurrentGrasp`.

use std::ops::RangeInclusive;

use glam::Quat;
use grasp_proto::v1;
use grasp_synthesis::{
    model::hand::{Handedness, joints::openxr_from_thesis_frame},
    search::current::{CurrentGrasp, Grace},
};

use super::{
    Field, FindQuery, Violations, check_within,
    hand::{AngleBounds, Place, PosedHand, posed_hand},
    holdout::Frames,
    quoted,
};
use crate::{
    error::ServiceError,
    rigs::{RigHand, resource_name, store::RigStore},
    wire::wire_pose,
};

/// Differences of scores that may be required.
pub(super) const SCORE_GAINS: RangeInclusive<f32> = 0.0..=1.0;

/// Deviation of a quaternion's norm from 1 that rounding explains.
const ROUNDED_NORM: f32 = 1e-5;

#[derive(Clone, Debug)]
pub(crate) struct CurrentGraspQuery {
    pub handedness: Handedness,
    /// The grasp, in the object's frame.
    pub grasp: CurrentGrasp,
    /// The wrist in the answer's convention, as sent if it was in that.
    pub object_from_wrist: v1::Pose,
}

/// The rest of a request, as far as a current grasp must agree with it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Context<'a> {
    pub frames: Frames<'a>,
    pub receiving_hand: Option<&'a RigHand>,
    pub chooses_hand: bool,
}

pub(super) fn current_grasp(
    field: Field<'_>,
    sent: Option<v1::CurrentGrasp>,
    context: &Context<'_>,
) -> Option<CurrentGraspQuery> {
    let sent = sent?;
    if let Some(gain) = sent.min_score_gain {
        check_within(field.child("min_score_gain"), gain, SCORE_GAINS);
    }
    let grasp_field = field.child("grasp");
    let Some(sent_grasp) = &sent.grasp else {
        return grasp_field.reject("is required: the grasp to hold on to");
    };
    let frames = &context.frames;
    let read = |field, sent: &v1::HandPose, place| {
        let hand = posed_hand(field, sent, place, AngleBounds::Rig, frames)?;
        if let Some(receiving) = context.receiving_hand {
            check_is(field, &hand, receiving, context.chooses_hand);
        }
        Some(hand)
    };
    let grasp = read(grasp_field, sent_grasp, Place::AtObject);
    let hand_field = field.child("hand");
    let hand = sent.hand.map(|sent| read(hand_field, &sent, Place::NearObject));
    if let (Some(grasp), Some(Some(hand))) = (&grasp, &hand)
        && grasp.handedness != hand.handedness
    {
        hand_field
            .child("handedness")
            .add("is not that of current.grasp; it must be the same hand");
    }
    let grasp = grasp?;
    let present = match hand {
        Some(hand) => hand?.pose,
        None => grasp.pose,
    };
    Some(CurrentGraspQuery {
        handedness: grasp.handedness,
        object_from_wrist: answered_wrist(sent_grasp, &grasp, frames),
        grasp: CurrentGrasp {
            hand: grasp.pose,
            present,
            min_score_gain: sent.min_score_gain,
            is_committed: sent.committed,
            grace: Grace::default(),
        },
    })
}

impl FindQuery {
    pub(crate) fn hold_on_to(&mut self, sent: v1::CurrentGrasp, rigs: &RigStore) -> Result<(), ServiceError> {
        let context = Context {
            frames: Frames::of_query(self, rigs),
            receiving_hand: Some(&self.receiving_hand),
            chooses_hand: self.alternative_hand.is_some(),
        };
        let violations = Violations::default();
        let field = violations.field("current");
        self.current = current_grasp(field, Some(sent), &context);
        violations.finish(())
    }
}

/// Checks that a hand is the receiving one or, if that may be chosen, the other one of its rig.
pub(super) fn check_is(field: Field<'_>, hand: &PosedHand, receiving: &RigHand, chooses_hand: bool) {
    let rig = &receiving.hand.rig;
    let theirs = &hand.rig_hand().hand.rig;
    if theirs.name != rig.name {
        let [theirs, rig] = [theirs, rig].map(|rig| quoted(&resource_name(rig)));
        field
            .child("rig")
            .add(format_args!("is {theirs}; it must be {rig}, the receiver's"));
    }
    let hundredths = |scale: f32| (100.0 * scale).round();
    field.child("scale").check(
        hundredths(hand.scale) == hundredths(receiving.scale),
        format_args!(
            "is {}; it must be {}, the receiver's",
            hand.scale, receiving.scale
        ),
    );
    let text = "is the other hand than receiver.handedness; it must be the same, or that be unspecified";
    field
        .child("handedness")
        .check(chooses_hand || hand.handedness == rig.handedness, text);
}

/// The wrist of a kept grasp, in the answer's convention: a round trip of conversions would move it a little with every request.
fn answered_wrist(sent: &v1::HandPose, grasp: &PosedHand, frames: &Frames<'_>) -> v1::Pose {
    let as_answered = [0, frames.convention.to_wire().into()];
    match sent.object_from_wrist {
        Some(given) if as_answered.contains(&sent.convention) => rounded(given),
        _ => {
            let wrist = openxr_from_thesis_frame(grasp.pose.frame_from_wrist);
            wire_pose(frames.convention.joint_at_object_from_openxr(wrist))
        }
    }
}

/// A wrist as it is answered: unchanged if it is a rigid transform up to rounding.
fn rounded(sent: v1::Pose) -> v1::Pose {
    let mut turn = sent.orientation.map_or(Quat::IDENTITY, Quat::from);
    let norm = turn.length();
    if (norm - 1.0).abs() > ROUNDED_NORM {
        turn /= norm.max(f32::MIN_POSITIVE);
    }
    v1::Pose {
        position: Some(sent.position.unwrap_or_default()),
        orientation: Some(turn.into()),
    }
}
