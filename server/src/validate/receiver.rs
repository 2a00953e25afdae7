//! Checks the receiver's body and stance.

use std::ops::RangeInclusive;

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::model::{
    hand::Handedness,
    receiver::{Arm, FOREARM_LENGTH, Stance, UPPER_ARM_LENGTH},
    strategy::Validity,
};

use super::{Field, Violations, known, point, pose};
use crate::convention::Convention;

/// Range of the lengths of upper arm and forearm, in metres: from a small child's to a giant's.
const BONE_LENGTHS: RangeInclusive<f32> = 0.1..=0.6;

/// Range of a standing body's height, in metres.
const HEIGHTS: RangeInclusive<f32> = 0.8..=2.5;

/// Largest distance of the shoulder from the object's origin, in metres. An arm of the longest bones with a hand reaches 1.4 m;
/// what is beyond twice that is not meant.
const FARTHEST_SHOULDER: f32 = 3.0;

/// Lengths as shares of a body's height: the shoulder above the ground, half the distance of the shoulders, upper arm and forearm
/// (R. Drillis and R. Contini, "Body segment parameters", 1966).
const SHOULDER_HEIGHT: f32 = 0.818;
const HALF_SHOULDER_BREADTH: f32 = 0.129;
const UPPER_ARM_SHARE: f32 = 0.186;
const FOREARM_SHARE: f32 = 0.146;

/// Where the arm of either hand may come from, in the client's frame and `OpenXR` axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stances {
    left: Stance,
    right: Stance,
}

impl Stances {
    /// That of one hand.
    pub(crate) fn of(&self, handedness: Handedness) -> Stance {
        match handedness {
            Handedness::Left => self.left,
            Handedness::Right => self.right,
        }
    }

    /// The same for both hands.
    const fn both(stance: Stance) -> Self {
        Self {
            left: stance,
            right: stance,
        }
    }
}

/// The parts of a request that decide what a body may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings {
    /// Axes and units of the request.
    pub(super) convention: Convention,
    /// Origin of the object in the client's frame and `OpenXR` axes; none if the request's is wrong.
    pub(super) object: Option<Vec3>,
    /// Notion of a valid grasp.
    pub(super) validity: Validity,
    /// Whether both hands take the object.
    pub(super) takes_both_hands: bool,
    /// Whether the search chooses the hand.
    pub(super) chooses_hand: bool,
}

/// The stances of a receiver's body or, without one, of what is expected. A wrong body is a receiver who faces the giver.
pub(super) fn stances(
    sent: Option<v1::Receiver>,
    stance: i32,
    surroundings: &Surroundings,
    violations: &mut Violations,
) -> Stances {
    let (field, stance_field) = (Field::root("receiver"), Field::root("receiver_stance"));
    let expected: v1::ReceiverStance = known(stance_field, stance, violations);
    let Some(sent) = sent else {
        return Stances::both(match expected {
            v1::ReceiverStance::Any => Stance::Any,
            v1::ReceiverStance::Unspecified | v1::ReceiverStance::FacingGiver => Stance::Facing,
        });
    };
    if expected == v1::ReceiverStance::Any {
        violations.add(
            stance_field,
            "is RECEIVER_STANCE_ANY with a receiver, whose arm comes from its shoulder; leave one of them out",
        );
    }
    if surroundings.validity == Validity::Thesis {
        violations.add(
            field,
            "is set; VALIDITY_THESIS knows no arms: leave it out or use VALIDITY_PHYSICAL",
        );
    }
    if surroundings.takes_both_hands {
        violations.add(
            field,
            "is set with HANDS_BOTH, whose arms are not checked; leave it out or use HANDS_ONE",
        );
    }
    body(field, sent, surroundings, violations).unwrap_or_default()
}

/// The arms of a body; none if it is wrong.
fn body(
    field: Field<'_>,
    sent: v1::Receiver,
    surroundings: &Surroundings,
    violations: &mut Violations,
) -> Option<Stances> {
    use v1::receiver::Body;
    let convention = surroundings.convention;
    let before = violations.len();
    let mut bone = |name, sent: Option<f32>| {
        sent.and_then(|sent| length(field.child(name), sent, BONE_LENGTHS, convention, violations))
    };
    let upper_arm = bone("upper_arm_length", sent.upper_arm_length);
    let forearm = bone("forearm_length", sent.forearm_length);
    let arm = |shoulder, height: Option<f32>| {
        Stance::At(Arm {
            shoulder,
            upper_arm: upper_arm
                .or(height.map(|height| height * UPPER_ARM_SHARE))
                .unwrap_or(UPPER_ARM_LENGTH),
            forearm: forearm
                .or(height.map(|height| height * FOREARM_SHARE))
                .unwrap_or(FOREARM_LENGTH),
        })
    };
    let stances = match sent.body {
        None => {
            violations.add(field, "has no body; it must have client_shoulder or standing");
            return None;
        }
        Some(Body::ClientShoulder(sent)) => {
            let field = field.child("client_shoulder");
            let before = violations.len();
            let shoulder = point(field, sent, convention.metres_per_unit(), violations);
            let shoulder = convention.point_to_openxr(shoulder);
            if violations.len() == before {
                check_distance(field, &[shoulder], surroundings, violations);
            }
            if surroundings.chooses_hand {
                violations.add(
                    Field::root("receiving_hand").child("handedness"),
                    "is unspecified with receiver.client_shoulder, which is one side's; name the side or use receiver.standing",
                );
            }
            Stances::both(arm(shoulder, None))
        }
        Some(Body::Standing(sent)) => {
            let field = field.child("standing");
            let root = pose(
                field.child("client_from_root"),
                sent.client_from_root,
                convention.metres_per_unit(),
                violations,
            );
            let client_from_root = convention.pose_to_openxr(root);
            let height = length(
                field.child("height"),
                sent.height,
                HEIGHTS,
                convention,
                violations,
            )?;
            let [left, right] = [-1.0, 1.0].map(|side| {
                client_from_root
                    .transform_point(height * Vec3::new(side * HALF_SHOULDER_BREADTH, SHOULDER_HEIGHT, 0.0))
            });
            if violations.len() == before {
                check_distance(field, &[left, right], surroundings, violations);
            }
            Stances {
                left: arm(left, Some(height)),
                right: arm(right, Some(height)),
            }
        }
    };
    (violations.len() == before).then_some(stances)
}

/// A length in metres; none if it is out of its range, which is in metres, too.
fn length(
    field: Field<'_>,
    sent: f32,
    range: RangeInclusive<f32>,
    convention: Convention,
    violations: &mut Violations,
) -> Option<f32> {
    let metres = convention.length_to_openxr(sent);
    if range.contains(&metres) {
        return Some(metres);
    }
    let [least, most] = [*range.start(), *range.end()];
    let [shown_least, shown_most] = [least, most].map(|bound| convention.length_from_openxr(bound));
    violations.add(
        field,
        format_args!("is {sent}; it must be {shown_least} to {shown_most} ({least} to {most} m)"),
    );
    None
}

/// Checks that one of the shoulders, in `OpenXR` axes, is near the object.
fn check_distance(
    field: Field<'_>,
    shoulders: &[Vec3],
    surroundings: &Surroundings,
    violations: &mut Violations,
) {
    let Some(object) = surroundings.object else { return };
    let distances = shoulders.iter().map(|shoulder| shoulder.distance(object));
    let nearest = distances.fold(f32::INFINITY, f32::min);
    if nearest > FARTHEST_SHOULDER {
        let [shown, most] =
            [nearest, FARTHEST_SHOULDER].map(|metres| surroundings.convention.length_from_openxr(metres));
        violations.add(
            field,
            format_args!(
                "puts the shoulder {shown} from the object's origin; it must be within {most} ({FARTHEST_SHOULDER} m)"
            ),
        );
    }
}

#[cfg(test)]
mod tests;
