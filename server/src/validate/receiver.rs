//! Checks `Receiver`: whose hands take the object, and where their arms come from.

use std::{borrow::Cow, ops::RangeInclusive};

use glam::Vec3;
use grasp_proto::v1::{self, receiver::Body};
use grasp_synthesis::model::{
    hand::{Digit, Handedness},
    holdout::{Arm, FOREARM_LENGTH, Stance, UPPER_ARM_LENGTH},
    requirements::Reach,
    strategy::Validity,
};

use super::{
    FARTHEST, Field, check_positive, factor,
    hand::{HAND_SCALES, rig_named},
    handedness, point, pose,
};
use crate::{
    convention::Convention,
    rigs::{COLLECTION, RigHand, name_of, store::RigStore},
};

/// The receiving hand's rig under THESIS validity: that of chapter 5.
const THESIS_RIG: &str = "rigs/thesis";

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

/// Where the arm of either hand may come from, left first, in the client's frame and `OpenXR` axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stances([Side; 2]);

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Side {
    stance: Stance,
    /// How far the wrist may be from the shoulder; `None` if as far as the arm reaches.
    reach: Option<Reach>,
}

impl Stances {
    pub(crate) fn of(&self, handedness: Handedness) -> Stance {
        self.0[usize::from(handedness == Handedness::Right)].stance
    }

    pub(crate) fn reach(&self, handedness: Handedness) -> Option<Reach> {
        self.0[usize::from(handedness == Handedness::Right)].reach
    }
}

/// The parts of a request that a receiver must agree with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings {
    pub convention: Convention,
    /// Origin of the object in the client's frame and `OpenXR` axes; `None` if the request's is wrong.
    pub object: Option<Vec3>,
    pub validity: Validity,
}

pub(super) fn chooses_hand(sent: &v1::Receiver, validity: Validity) -> bool {
    sent.handedness == 0 && !sent.both_hands && validity == Validity::Physical
}

/// The hand to pose and the same person's other hand, right first unless the request names the left. THESIS validity defaults to
/// the rig of chapter 5.
pub(super) fn receiving_hands(
    field: Field<'_>,
    sent: &v1::Receiver,
    validity: Validity,
    (default_rig, rigs): (&str, &RigStore),
) -> Option<[RigHand; 2]> {
    let handedness = handedness(field.child("handedness"), sent.handedness).unwrap_or(Handedness::Right);
    let name = match (sent.rig.as_str(), validity) {
        ("", Validity::Thesis) => Cow::Borrowed(THESIS_RIG),
        ("", Validity::Physical) if default_rig.starts_with(COLLECTION) => Cow::Borrowed(default_rig),
        ("", Validity::Physical) => Cow::Owned(name_of(default_rig)),
        (named, _) => Cow::Borrowed(named),
    };
    let scale = factor(field.child("scale"), sent.scale, HAND_SCALES);
    let hundredths = (100.0 * scale).round() as u16;
    let rig_field = field.child("rig");
    let rig = rig_named(rig_field, &name, rigs)?;
    let has = |digit: Digit| rig.hand(handedness).hand.rig.has(digit);
    let text = "has fewer than five digits, which thesis_validity poses; leave that out or use another rig";
    rig_field.check(
        validity == Validity::Physical || Digit::ALL.into_iter().all(has),
        text,
    );
    let sized = |side| match hundredths {
        100 => rig.hand(side).clone(),
        _ => rigs.scaled(rig.hand(side), hundredths),
    };
    Some([handedness, handedness.other()].map(sized))
}

/// The arms of a body, or the stance without one; `None` if it is wrong.
pub(super) fn stances(field: Field<'_>, sent: &v1::Receiver, surroundings: Surroundings) -> Option<Stances> {
    let convention = surroundings.convention;
    let before = field.violations().len();
    let is_right = || field.violations().len() == before;
    let bone = |name, sent: Option<f32>| length(field.child(name), sent?, BONE_LENGTHS, convention);
    let upper_arm = bone("upper_arm_length", sent.upper_arm_length);
    let forearm = bone("forearm_length", sent.forearm_length);
    let farthest = convention.length_from_openxr(FARTHEST);
    let is_reach = |&reach: &f32| check_positive(field.child("max_reach"), reach, farthest);
    let max_reach = sent.max_reach.filter(is_reach);
    // The arm from a shoulder, of a body of this height.
    let side = |shoulder: Vec3, height: Option<f32>| {
        let share = |share: f32| height.map(|height| height * share);
        Side {
            stance: Stance::At(Arm {
                shoulder,
                upper_arm: upper_arm.or(share(UPPER_ARM_SHARE)).unwrap_or(UPPER_ARM_LENGTH),
                forearm: forearm.or(share(FOREARM_SHARE)).unwrap_or(FOREARM_LENGTH),
            }),
            reach: max_reach.map(|reach| Reach {
                shoulder,
                distance: convention.length_to_openxr(reach),
            }),
        }
    };
    let sides = match sent.body {
        None | Some(Body::Anywhere(_)) => {
            let text = "is set without a shoulder to reach from; add client_shoulder or client_from_root";
            field.child("max_reach").check(sent.max_reach.is_none(), text);
            let is_anywhere = sent.body == Some(Body::Anywhere(true));
            let stance = if is_anywhere { Stance::Any } else { Stance::Facing };
            [Side { stance, reach: None }; 2]
        }
        Some(Body::ClientShoulder(shoulder)) => {
            let shoulder_field = field.child("client_shoulder");
            let shoulder = point(shoulder_field, shoulder, convention);
            let mut side = side(shoulder, None);
            if sent.max_reach.is_some() && sent.upper_arm_length.is_none() && sent.forearm_length.is_none() {
                side.stance = Stance::Facing;
            } else {
                if is_right() {
                    check_distance(shoulder_field, &[shoulder], surroundings);
                }
                check_may_have_arm(shoulder_field, sent, surroundings);
                field.child("handedness").check(
                    !chooses_hand(sent, surroundings.validity),
                    "is unspecified with client_shoulder, which is one side's; name the side or use client_from_root",
                );
            }
            [side; 2]
        }
        Some(Body::ClientFromRoot(root)) => {
            let root_field = field.child("client_from_root");
            let client_from_root = convention.pose_to_openxr(pose(root_field, Some(root), convention));
            check_may_have_arm(root_field, sent, surroundings);
            let height = length(field.child("height"), sent.height, HEIGHTS, convention)?;
            let shoulders = [-1.0, 1.0].map(|side| {
                client_from_root
                    .transform_point(height * Vec3::new(side * HALF_SHOULDER_BREADTH, SHOULDER_HEIGHT, 0.0))
            });
            if is_right() {
                check_distance(root_field, &shoulders, surroundings);
            }
            shoulders.map(|shoulder| side(shoulder, Some(height)))
        }
    };
    is_right().then_some(Stances(sides))
}

/// Where both hands take the object, and under THESIS validity, there are no arms.
fn check_may_have_arm(field: Field<'_>, sent: &v1::Receiver, surroundings: Surroundings) {
    let is_thesis = surroundings.validity == Validity::Thesis;
    for (is_set, with) in [
        (is_thesis, "thesis_validity, which knows no arms"),
        (sent.both_hands, "both_hands, whose arms are not checked"),
    ] {
        let text = format_args!(
            "is set with {with}; leave one of them out, or give client_shoulder, max_reach and no lengths"
        );
        field.check(!is_set, text);
    }
}

/// A length in metres; `None` if it is out of its range, which is in metres, too.
fn length(field: Field<'_>, sent: f32, range: RangeInclusive<f32>, convention: Convention) -> Option<f32> {
    let metres = convention.length_to_openxr(sent);
    let (least, most) = (*range.start(), *range.end());
    let [shown_least, shown_most] = [least, most].map(|bound| convention.length_from_openxr(bound));
    let text = format_args!("is {sent}; it must be {shown_least} to {shown_most} ({least} to {most} m)");
    field.check(range.contains(&metres), text).then_some(metres)
}

/// Checks that one of the shoulders, in `OpenXR` axes, is near the object.
fn check_distance(field: Field<'_>, shoulders: &[Vec3], surroundings: Surroundings) {
    let Some(object) = surroundings.object else { return };
    let distances = shoulders.iter().map(|shoulder| shoulder.distance(object));
    let nearest = distances.fold(f32::INFINITY, f32::min);
    let [shown, most] =
        [nearest, MAX_SHOULDER_DISTANCE].map(|metres| surroundings.convention.length_from_openxr(metres));
    field.check(
        nearest <= MAX_SHOULDER_DISTANCE,
        format_args!(
            "puts the shoulder {shown} from the object's origin; it must be within {most} ({MAX_SHOULDER_DISTANCE} m)"
        ),
    );
}

#[cfg(test)]
mod tests {
    use glam::{Mat3, Quat};
    use grasp_synthesis::base::pose::Pose;

    use super::*;
    use crate::{
        validate::fixtures::{CONVENTIONS, read_at},
        wire::wire_pose,
    };

    const SIDES: [Handedness; 2] = [Handedness::Left, Handedness::Right];

    fn surroundings(convention: Convention) -> Surroundings {
        Surroundings {
            convention,
            object: Some(Vec3::new(0.1, 1.0, -0.4)),
            validity: Validity::Physical,
        }
    }

    fn read(sent: &v1::Receiver, surroundings: Surroundings) -> Stances {
        let (stances, blamed) = read_at("receiver", |field| stances(field, sent, surroundings));
        assert!(blamed.is_empty(), "{blamed:?} of {sent:?}");
        stances.expect("it is right")
    }

    fn arms(stances: &Stances) -> [Arm; 2] {
        SIDES.map(|side| match stances.of(side) {
            Stance::At(arm) => arm,
            other => panic!("{other:?} is no arm"),
        })
    }

    fn with_shoulder(shoulder: Vec3) -> v1::Receiver {
        v1::Receiver {
            handedness: v1::Handedness::Right.into(),
            ..v1::Receiver::with_shoulder(shoulder)
        }
    }

    fn standing(client_from_root: Pose, height: f32) -> v1::Receiver {
        v1::Receiver::standing(wire_pose(client_from_root), height)
    }

    #[test]
    fn a_body_means_the_same_in_every_convention() {
        let shoulder = Vec3::new(0.3, 1.4, -0.9);
        // Two steps in front of the object, turned by 30° about the vertical.
        let root = Pose::new(Vec3::new(0.2, 0.1, -1.0), Quat::from_rotation_y(0.5));
        let standing_shoulders = [-1.0, 1.0].map(|side| {
            let beside = Mat3::from_rotation_y(0.5) * Vec3::new(side * 0.129 * 1.8, 0.0, 0.0);
            Vec3::new(0.2, 0.1 + 0.818 * 1.8, -1.0) + beside
        });
        for convention in CONVENTIONS {
            let unit = convention.length_from_openxr(1.0);
            let given = v1::Receiver {
                upper_arm_length: Some(0.28 * unit),
                forearm_length: Some(0.24 * unit),
                ..with_shoulder(convention.point_from_openxr(shoulder))
            };
            let standing = standing(convention.pose_from_openxr(root), 1.8 * unit);
            for (sent, shoulders, lengths) in [
                (given, [shoulder; 2], [0.28, 0.24]),
                (standing, standing_shoulders, [0.186 * 1.8, 0.146 * 1.8]),
            ] {
                let read = arms(&read(&sent, surroundings(convention)));
                for (arm, expected) in read.into_iter().zip(shoulders) {
                    let off = [arm.upper_arm - lengths[0], arm.forearm - lengths[1]].map(f32::abs);
                    let is_there = arm.shoulder.distance(expected) < 1e-5;
                    assert!(
                        is_there && off[0].max(off[1]) < 1e-6,
                        "{convention:?}: {arm:?} {expected}"
                    );
                }
            }
            let sent = v1::Receiver {
                max_reach: Some(0.7 * unit),
                ..with_shoulder(convention.point_from_openxr(shoulder))
            };
            let stances = read(&sent, surroundings(convention));
            for side in SIDES {
                let reach = stances.reach(side).expect("a reach was sent");
                assert!(reach.shoulder.distance(shoulder) < 1e-6 && (reach.distance - 0.7).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn without_a_shoulder_the_receiver_faces_the_giver_or_is_anywhere() {
        let mut sent = v1::Receiver::default();
        for (anywhere, expected) in [
            (None, Stance::Facing),
            (Some(false), Stance::Facing),
            (Some(true), Stance::Any),
        ] {
            sent.body = anywhere.map(Body::Anywhere);
            let stances = read(&sent, surroundings(Convention::OpenXr));
            let read = SIDES.map(|side| (stances.of(side), stances.reach(side)));
            assert_eq!(read, [(expected, None); 2]);
        }
    }

    #[test]
    fn an_arm_may_have_a_reach_around_its_own_shoulder() {
        let mut near = with_shoulder(Vec3::new(0.1, 1.2, 0.0));
        near.forearm_length = Some(0.25);
        for mut sent in [near, standing(Pose::IDENTITY, 1.7)] {
            let without = read(&sent, surroundings(Convention::OpenXr));
            sent.max_reach = Some(0.4);
            let with = read(&sent, surroundings(Convention::OpenXr));
            assert_eq!(arms(&with), arms(&without));
            for (side, Arm { shoulder, .. }) in SIDES.into_iter().zip(arms(&with)) {
                let distance = 0.4;
                let reach = Some(Reach { shoulder, distance });
                assert_eq!((without.reach(side), with.reach(side)), (None, reach));
            }
        }
    }

    #[test]
    fn a_body_excludes_unsupported_fields() {
        let around = surroundings(Convention::OpenXr);
        let (mut thesis, mut lost) = (around, around);
        thesis.validity = Validity::Thesis;
        lost.object = None;
        let blamed = |sent: &v1::Receiver, around| read_at("", |field| stances(field, sent, around)).1;
        let near = with_shoulder(Vec3::new(0.1, 1.2, 0.0));
        let arm = arms(&read(&near, around))[0];
        assert_eq!((arm.upper_arm, arm.forearm), (UPPER_ARM_LENGTH, FOREARM_LENGTH));
        let mut only_reach = near.clone();
        only_reach.max_reach = Some(0.7);
        assert_eq!(read(&only_reach, around).of(Handedness::Left), Stance::Facing);
        // With lengths, there is an arm, whatever its reach.
        let mut reaching = only_reach.clone();
        reaching.upper_arm_length = Some(0.3);
        for (mut sent, field) in [
            (near, Some(".client_shoulder")),
            (reaching, Some(".client_shoulder")),
            (standing(Pose::IDENTITY, 1.7), Some(".client_from_root")),
            (only_reach, None),
        ] {
            assert_eq!(blamed(&sent, thesis), field.as_slice());
            sent.both_hands = true;
            assert_eq!(blamed(&sent, around), field.as_slice());
            (sent.both_hands, sent.handedness) = (false, 0);
            let is_of_one_side = field == Some(".client_shoulder");
            assert_eq!(blamed(&sent, around) == [".handedness"], is_of_one_side);
        }
        // A wrong pose of the object is not blamed on the body.
        let far = with_shoulder(Vec3::splat(99.0));
        assert_eq!((blamed(&far, lost).len(), blamed(&far, around).len()), (0, 1));
    }

    #[test]
    fn bounds_are_in_the_clients_unit() {
        for (sent, text) in [
            (
                standing(Pose::IDENTITY, 1.8),
                "is 1.8; it must be 80 to 250 (0.8 to 2.5 m)",
            ),
            (with_shoulder(Vec3::splat(500.0)), "it must be within 300 (3 m)"),
        ] {
            let violations = crate::validate::Violations::default();
            stances(
                violations.field("receiver"),
                &sent,
                surroundings(Convention::Unreal),
            );
            assert!(violations.take_listed()[0].description.ends_with(text));
        }
    }
}
