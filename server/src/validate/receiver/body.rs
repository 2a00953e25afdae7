//! Checks the receiver's body.

use std::ops::RangeInclusive;

use glam::Vec3;
use grasp_proto::v1::{self, receiver::Body};
use grasp_synthesis::model::{
    hand::Handedness,
    holdout::{Arm, FOREARM_LENGTH, Stance, UPPER_ARM_LENGTH},
    requirements::Reach,
    strategy::Validity,
};

use crate::{
    convention::Convention,
    validate::{FARTHEST, Field, point, pose},
};

/// Range of the lengths of upper arm and forearm, in metres: from a small child's to a giant's.
const BONE_LENGTHS: RangeInclusive<f32> = 0.1..=0.6;

/// Range of a standing body's height, in metres.
const HEIGHTS: RangeInclusive<f32> = 0.8..=2.5;

/// Largest distance of the shoulder from the object's origin, in metres: twice the reach of an arm of the longest bones.
const MAX_SHOULDER_DISTANCE: f32 = 3.0;

/// Lengths as shares of a body's height: the shoulder above the ground, half the distance of the shoulders, upper arm and forearm
/// (R. Drillis and R. Contini, "Body segment parameters", 1966).
const SHOULDER_HEIGHT: f32 = 0.818;
const HALF_SHOULDER_BREADTH: f32 = 0.129;
const UPPER_ARM_SHARE: f32 = 0.186;
const FOREARM_SHARE: f32 = 0.146;

/// Where the arm of either hand may come from, in the client's frame and `OpenXR` axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stances {
    left: Side,
    right: Side,
}

/// The arm of one hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Side {
    stance: Stance,
    /// How far the wrist may be from the shoulder; `None` if as far as the arm reaches.
    reach: Option<Reach>,
}

impl Stances {
    /// That of one hand.
    pub(crate) fn of(&self, handedness: Handedness) -> Stance {
        self.side(handedness).stance
    }

    /// How far one hand may be from its shoulder.
    pub(crate) fn reach(&self, handedness: Handedness) -> Option<Reach> {
        self.side(handedness).reach
    }

    fn side(&self, handedness: Handedness) -> &Side {
        match handedness {
            Handedness::Left => &self.left,
            Handedness::Right => &self.right,
        }
    }

    /// The same for both hands.
    const fn both(stance: Stance, reach: Option<Reach>) -> Self {
        let side = Side { stance, reach };
        Self {
            left: side,
            right: side,
        }
    }
}

/// The parts of a request that decide what a body may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings {
    /// Axes and units of the request.
    pub(super) convention: Convention,
    /// Origin of the object in the client's frame and `OpenXR` axes; `None` if the request's is wrong.
    pub(super) object: Option<Vec3>,
    /// Notion of a valid grasp.
    pub(super) validity: Validity,
    /// Whether both hands take the object.
    pub(super) takes_both_hands: bool,
    /// Whether the search chooses the hand.
    pub(super) chooses_hand: bool,
}

/// The stances of a receiver. A wrong body is a receiver who faces the giver.
pub(super) fn stances(field: Field<'_>, sent: &v1::Receiver, surroundings: &Surroundings) -> Stances {
    body(field, sent, surroundings).unwrap_or_default()
}

/// Lengths of a body, in metres.
#[derive(Clone, Copy, Debug)]
struct Lengths {
    upper_arm: Option<f32>,
    forearm: Option<f32>,
    max_reach: Option<f32>,
}

impl Lengths {
    /// The arm from a shoulder, of a body of this height, and how far it may reach.
    fn side(&self, shoulder: Vec3, height: Option<f32>) -> Side {
        let share = |share: f32| height.map(|height| height * share);
        Side {
            stance: Stance::At(Arm {
                shoulder,
                upper_arm: self
                    .upper_arm
                    .or(share(UPPER_ARM_SHARE))
                    .unwrap_or(UPPER_ARM_LENGTH),
                forearm: self.forearm.or(share(FOREARM_SHARE)).unwrap_or(FOREARM_LENGTH),
            }),
            reach: self.reach(shoulder),
        }
    }

    fn reach(&self, shoulder: Vec3) -> Option<Reach> {
        self.max_reach.map(|distance| Reach { shoulder, distance })
    }
}

/// The arms of a body, or what is expected without one; `None` if it is wrong.
fn body(field: Field<'_>, sent: &v1::Receiver, surroundings: &Surroundings) -> Option<Stances> {
    let convention = surroundings.convention;
    let before = field.violations().len();
    let lengths = lengths(field, sent, convention);
    let stances = match sent.body {
        None | Some(Body::Anywhere(_)) => {
            if sent.max_reach.is_some() {
                field
                    .child("max_reach")
                    .add("is set without a shoulder to reach from; add client_shoulder or client_from_root");
            }
            let is_anywhere = sent.body == Some(Body::Anywhere(true));
            Stances::both(if is_anywhere { Stance::Any } else { Stance::Facing }, None)
        }
        Some(Body::ClientShoulder(shoulder)) => {
            let field_of_shoulder = field.child("client_shoulder");
            let has_arm =
                sent.max_reach.is_none() || sent.upper_arm_length.is_some() || sent.forearm_length.is_some();
            let shoulder = point(field_of_shoulder, shoulder, convention);
            if has_arm {
                if field.violations().len() == before {
                    check_distance(field_of_shoulder, &[shoulder], surroundings);
                }
                check_may_have_arm(field_of_shoulder, surroundings);
                if surroundings.chooses_hand {
                    field.child("handedness").add(
                        "is unspecified with client_shoulder, which is one side's; name the side or use client_from_root",
                    );
                }
                let side = lengths.side(shoulder, None);
                Stances::both(side.stance, side.reach)
            } else {
                Stances::both(Stance::Facing, lengths.reach(shoulder))
            }
        }
        Some(Body::ClientFromRoot(root)) => {
            let field_of_root = field.child("client_from_root");
            let root = pose(field_of_root, Some(root), convention);
            let client_from_root = convention.pose_to_openxr(root);
            check_may_have_arm(field_of_root, surroundings);
            let height = length(field.child("height"), sent.height, HEIGHTS, convention)?;
            let shoulders = [-1.0, 1.0].map(|side| {
                client_from_root
                    .transform_point(height * Vec3::new(side * HALF_SHOULDER_BREADTH, SHOULDER_HEIGHT, 0.0))
            });
            if field.violations().len() == before {
                check_distance(field_of_root, &shoulders, surroundings);
            }
            let [left, right] = shoulders.map(|shoulder| lengths.side(shoulder, Some(height)));
            Stances { left, right }
        }
    };
    (field.violations().len() == before).then_some(stances)
}

/// Where both hands take the object, and under THESIS validity, there are no arms.
fn check_may_have_arm(field: Field<'_>, surroundings: &Surroundings) {
    if surroundings.validity == Validity::Thesis {
        field.add(
            "is set with thesis_validity, which knows no arms; leave one of them out, or give client_shoulder, max_reach and no lengths",
        );
    }
    if surroundings.takes_both_hands {
        field.add(
            "is set with both_hands, whose arms are not checked; leave one of them out, or give client_shoulder, max_reach and no lengths",
        );
    }
}

/// The lengths that a request gives, without those that are wrong.
fn lengths(field: Field<'_>, sent: &v1::Receiver, convention: Convention) -> Lengths {
    let bone = |name, sent: Option<f32>| {
        sent.and_then(|sent| length(field.child(name), sent, BONE_LENGTHS, convention))
    };
    Lengths {
        upper_arm: bone("upper_arm_length", sent.upper_arm_length),
        forearm: bone("forearm_length", sent.forearm_length),
        max_reach: sent
            .max_reach
            .and_then(|sent| reach(field.child("max_reach"), sent, convention)),
    }
}

/// A reach in metres; `None` if it is wrong.
fn reach(field: Field<'_>, sent: f32, convention: Convention) -> Option<f32> {
    let farthest = convention.length_from_openxr(FARTHEST);
    if sent > 0.0 && sent <= farthest {
        return Some(convention.length_to_openxr(sent));
    }
    field.reject(format_args!(
        "is {sent}; it must be more than 0 and at most {farthest} (1 km)"
    ))
}

/// A length in metres; `None` if it is out of its range, which is in metres, too.
fn length(field: Field<'_>, sent: f32, range: RangeInclusive<f32>, convention: Convention) -> Option<f32> {
    let metres = convention.length_to_openxr(sent);
    if range.contains(&metres) {
        return Some(metres);
    }
    let [least, most] = [*range.start(), *range.end()];
    let [shown_least, shown_most] = [least, most].map(|bound| convention.length_from_openxr(bound));
    field.reject(format_args!(
        "is {sent}; it must be {shown_least} to {shown_most} ({least} to {most} m)"
    ))
}

/// Checks that one of the shoulders, in `OpenXR` axes, is near the object.
fn check_distance(field: Field<'_>, shoulders: &[Vec3], surroundings: &Surroundings) {
    let Some(object) = surroundings.object else { return };
    let distances = shoulders.iter().map(|shoulder| shoulder.distance(object));
    let nearest = distances.fold(f32::INFINITY, f32::min);
    if nearest > MAX_SHOULDER_DISTANCE {
        let [shown, most] =
            [nearest, MAX_SHOULDER_DISTANCE].map(|metres| surroundings.convention.length_from_openxr(metres));
        field.add(format_args!(
                "puts the shoulder {shown} from the object's origin; it must be within {most} ({MAX_SHOULDER_DISTANCE} m)"
            ));
    }
}

#[cfg(test)]
mod tests;
