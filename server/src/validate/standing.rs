//! Checks standing grasps.

use grasp_proto::v1;
use grasp_synthesis::{
    model::{
        hand::{
            Digit, DigitAngles, HandPose, Handedness,
            joints::{openxr_from_thesis_frame, thesis_from_openxr_frame},
        },
        strategy::{Strategy, Validity},
    },
    search::standing::{Grace, Standing},
};

use super::{
    Field, FindQuery, Violations,
    hand::{ReceivingHands, checked_digits, hand_scale, required_handedness, rig_named},
    pose, quoted,
};
use crate::{convention::Convention, error::ServiceError, rigs::store::RigStore};

/// Largest difference of a score that may be asked for.
const MOST_BETTER: f32 = 1.0;

/// Deviation of a quaternion's norm from 1 that rounding explains.
const ROUNDED_NORM: f32 = 1e-5;

/// A grasp to hold on to.
#[derive(Clone, Debug)]
pub(crate) struct StandingQuery {
    /// Its hand.
    pub handedness: Handedness,
    /// The grasp, in the object's frame.
    pub grasp: Standing,
    /// The wrist as the client gave it, in its convention.
    pub object_from_wrist: v1::Pose,
}

/// What the rest of a request says that a standing grasp must agree with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked<'a> {
    pub convention: Convention,
    pub searched: (Strategy, Validity),
    pub takes_both_hands: bool,
    pub is_replay: bool,
    /// The hands that may be posed; none if they are wrong.
    pub hands: Option<&'a ReceivingHands>,
    /// Whether either of them may be.
    pub chooses_hand: bool,
}

/// The standing grasp of a request, if it has one.
pub(super) fn standing(
    sent: Option<v1::StandingGrasp>,
    asked: &Asked<'_>,
    rigs: &RigStore,
    violations: &mut Violations,
) -> Option<StandingQuery> {
    let sent = sent?;
    let field = Field::root("standing");
    check_search(field, asked, violations);
    let better_by = sent.better_by.inspect(|value| {
        if !(0.0..=MOST_BETTER).contains(value) {
            violations.add(
                field.child("better_by"),
                format_args!("is {value}; it must be 0 to {MOST_BETTER}, a difference of scores"),
            );
        }
    });
    let Some(hand) = sent.hand else {
        violations.add(
            field.child("hand"),
            "is required: the hand of the grasp to hold on to",
        );
        return None;
    };
    let object_from_wrist = rounded(hand.object_from_wrist);
    let hand = hand_at_object(field.child("hand"), &hand, asked, rigs, violations);
    let present_field = field.child("present");
    let present = sent
        .present
        .map(|present| hand_at_object(present_field, &present, asked, rigs, violations));
    if let (Some((side, _)), Some(Some((present, _)))) = (&hand, &present)
        && side != present
    {
        violations.add(
            present_field.child("handedness"),
            "is not that of standing.hand; it must be the same hand",
        );
    }
    let (handedness, hand) = hand?;
    let present = match present {
        Some(present) => present?.1,
        None => hand,
    };
    Some(StandingQuery {
        handedness,
        grasp: Standing {
            hand,
            present,
            better_by,
            is_committed: sent.committed,
            grace: Grace::default(),
        },
        object_from_wrist,
    })
}

impl FindQuery {
    /// Makes it the same request with a standing grasp, of a hand that it may pose.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] if it is another hand, as after a change of the rig.
    pub(crate) fn hold_on_to(
        &mut self,
        sent: v1::StandingGrasp,
        rigs: &RigStore,
    ) -> Result<(), ServiceError> {
        let hand = self.receiving_hand.clone();
        let hands = ReceivingHands {
            other: self.alternative_hand.clone().unwrap_or_else(|| hand.clone()),
            hand,
        };
        let asked = Asked {
            convention: self.convention,
            searched: (self.strategy, self.validity),
            takes_both_hands: self.other_hand.is_some(),
            is_replay: self.is_replay,
            hands: Some(&hands),
            chooses_hand: self.alternative_hand.is_some(),
        };
        let mut violations = Violations::default();
        self.standing = standing(Some(sent), &asked, rigs, &mut violations);
        violations.finish(())
    }
}

/// Only searches whose grasps can be kept take a standing one.
fn check_search(field: Field<'_>, asked: &Asked<'_>, violations: &mut Violations) {
    if asked.searched != (Strategy::Guided, Validity::Physical) {
        violations.add(
            field,
            "requires VALIDITY_PHYSICAL and STRATEGY_GUIDED; use these or leave it out",
        );
    }
    if asked.takes_both_hands {
        violations.add(field, "is of one hand; use HANDS_ONE or leave it out");
    }
    if asked.is_replay {
        violations.add(
            field,
            "cannot be combined with only_attempt, which runs that attempt; use one of them",
        );
    }
}

/// A hand in the object's frame, with its side; none if it is wrong.
fn hand_at_object(
    field: Field<'_>,
    sent: &v1::HandAtObject,
    asked: &Asked<'_>,
    rigs: &RigStore,
    violations: &mut Violations,
) -> Option<(Handedness, HandPose)> {
    let handedness = required_handedness(field.child("handedness"), sent.handedness, violations);
    let scale = hand_scale(field.child("hand_scale"), sent.hand_scale, violations);
    let wrist = pose(
        field.child("object_from_wrist"),
        sent.object_from_wrist,
        asked.convention.metres_per_unit(),
        violations,
    );
    // Both hands have the same limits, which are checked even if the handedness is missing.
    let stored = rig_named(field.child("rig"), &sent.rig, rigs, violations)?;
    let rig = &stored.hand(handedness.unwrap_or(Handedness::Right)).hand.rig;
    let limits = rig.digits.map(|digit| digit.limits);
    let is_missing = |place: usize| Digit::ALL.get(place).is_some_and(|&digit| !rig.has(digit));
    let sent_digits: Vec<v1::DigitAngles> = (0..)
        .zip(&sent.digits)
        .map(|(place, sent)| {
            if is_missing(place) {
                wire_angles(&rig.stretched()[place])
            } else {
                *sent
            }
        })
        .collect();
    let mut digits = checked_digits(field.child("digits"), &sent_digits, &limits, violations);
    for digit in Digit::ALL.into_iter().filter(|&digit| !rig.has(digit)) {
        digits[digit.index()] = DigitAngles::default();
    }
    if let Some(asked_hands) = asked.hands {
        check_is_asked(
            field,
            sent,
            (handedness, scale),
            asked_hands,
            asked.chooses_hand,
            violations,
        );
    }
    let mut frame_from_wrist = thesis_from_openxr_frame(asked.convention.joint_at_object_to_openxr(wrist));
    // Of the two quaternions of an orientation, the one that is answered with the given sign: others would seem to jump.
    let answered = asked
        .convention
        .joint_at_object_from_openxr(openxr_from_thesis_frame(frame_from_wrist));
    if answered.orientation.dot(wrist.orientation) < 0.0 {
        frame_from_wrist.orientation = -frame_from_wrist.orientation;
    }
    Some((
        handedness?,
        HandPose {
            frame_from_wrist,
            digits,
        },
    ))
}

fn wire_angles(angles: &DigitAngles) -> v1::DigitAngles {
    v1::DigitAngles {
        base_yaw: angles.base_yaw,
        base_pitch: angles.base_pitch,
        second_pitch: angles.second_pitch,
        third_pitch: Some(angles.third_pitch),
    }
}

/// The hand must be one that the request may pose.
fn check_is_asked(
    field: Field<'_>,
    sent: &v1::HandAtObject,
    (handedness, scale): (Option<Handedness>, f32),
    hands: &ReceivingHands,
    chooses_hand: bool,
    violations: &mut Violations,
) {
    let receiving = &hands.hand;
    let rig = &receiving.hand.rig;
    if sent.rig != rig.name {
        violations.add(
            field.child("rig"),
            format_args!(
                "is {}; it must be {}, the rig of receiving_hand",
                quoted(&sent.rig),
                quoted(&rig.name)
            ),
        );
    }
    let hundredths = |scale: f32| (100.0 * scale).round();
    if hundredths(scale) != hundredths(receiving.scale) {
        violations.add(
            field.child("hand_scale"),
            format_args!("is {scale}; it must be {}, as of receiving_hand", receiving.scale),
        );
    }
    if !chooses_hand && handedness.is_some_and(|side| side != rig.handedness) {
        violations.add(
            field.child("handedness"),
            "is the other hand than receiving_hand.handedness; it must be the same, or that be unspecified",
        );
    }
}

/// A wrist as it is given back: unchanged if it is a rigid transform up to rounding.
fn rounded(sent: Option<v1::Pose>) -> v1::Pose {
    let v1::Pose {
        position,
        orientation,
    } = sent.unwrap_or_default();
    let orientation = orientation.map(|q| {
        let norm = [q.x, q.y, q.z, q.w].map(|x| x * x).iter().sum::<f32>().sqrt();
        if (norm - 1.0).abs() <= ROUNDED_NORM {
            return q;
        }
        let scaled = |x: f32| x / norm.max(f32::MIN_POSITIVE);
        v1::Quaternion {
            x: scaled(q.x),
            y: scaled(q.y),
            z: scaled(q.z),
            w: scaled(q.w),
        }
    });
    let upright = v1::Quaternion {
        w: 1.0,
        ..Default::default()
    };
    v1::Pose {
        position: Some(position.unwrap_or_default()),
        orientation: Some(orientation.unwrap_or(upright)),
    }
}
