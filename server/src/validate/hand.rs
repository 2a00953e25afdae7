//! Checks hands: joint angles of a rig, and tracked joints.

use glam::Vec3;
use grasp_assets::hands::{self, Hand, RIG_NAMES};
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles, HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT, Joint, index, thesis_from_openxr_frame},
        rig::{AngleRange, DigitRig},
        skin::Skin,
    },
};

use super::{Field, Violations, direction, known, pose, quoted};
use crate::convention::Convention;

/// How far a joint angle may be outside its limits, in radians, before it is rejected rather than clamped: room for the
/// rounding of clients that clamp in degrees.
const ANGLE_SLACK: f32 = 1e-3;

/// Largest distance from a joint to the skin, in metres. Palms of large hands have about 0.03.
const LARGEST_RADIUS: f32 = 0.1;

/// Largest distance from the wrist to any other joint, in metres. The longest hand on record has 0.33.
const LARGEST_REACH: f32 = 0.5;

/// Smallest distance from the wrist to the middle finger's knuckle, in metres.
const SMALLEST_PALM: f32 = 0.01;

/// The rig whose skin is posed on tracked joints.
const TRACKED_HAND_RIG: &str = "adult";

/// The giver's hand, in the client's frame and `OpenXR` axes.
#[derive(Clone, Debug)]
pub(crate) struct GiverHand {
    /// Its joints.
    pub joints: HandJoints,
    /// The skin to pose on them.
    pub skin: &'static Skin,
    /// The field that gave the joints, for the error if they fold the skin.
    pub field: &'static str,
}

/// The giver's hand; none if it is wrong.
pub(super) fn presenting_hand(
    field: Field<'_>,
    hand: v1::PresentingHand,
    convention: Convention,
    violations: &mut Violations,
) -> Option<GiverHand> {
    match hand.form {
        None => {
            violations.add(field, "is empty; it must have angles or joints, or be absent");
            None
        }
        Some(v1::presenting_hand::Form::Angles(angles)) => {
            angled_hand(field.child("angles"), &angles, convention, violations)
        }
        Some(v1::presenting_hand::Form::Joints(joints)) => {
            tracked_hand(field.child("joints"), &joints, convention, violations)
        }
    }
}

/// The receiving hand; by default the right hand of the default rig.
pub(super) fn receiving_hand(
    field: Field<'_>,
    hand: Option<v1::ReceivingHand>,
    default_rig: &str,
    violations: &mut Violations,
) -> Option<&'static Hand> {
    let hand = hand.unwrap_or_default();
    let handedness = match known(field.child("handedness"), hand.handedness, violations) {
        v1::Handedness::Left => Handedness::Left,
        v1::Handedness::Right | v1::Handedness::Unspecified => Handedness::Right,
    };
    let rig = if hand.rig.is_empty() {
        default_rig
    } else {
        &hand.rig
    };
    built_in(field.child("rig"), rig, handedness, violations)
}

/// The same person's other hand.
pub(super) fn other_hand(hand: &Hand) -> Option<&'static Hand> {
    hands::hand(&hand.rig.name, hand.rig.handedness.other())
}

fn built_in(
    field: Field<'_>,
    rig: &str,
    handedness: Handedness,
    violations: &mut Violations,
) -> Option<&'static Hand> {
    let hand = hands::hand(rig, handedness);
    if hand.is_none() {
        violations.add(
            field,
            format_args!(
                "is {}; the built-in rigs are {}",
                quoted(rig),
                RIG_NAMES.join(" and ")
            ),
        );
    }
    hand
}

/// A handedness without a default.
fn required_handedness(field: Field<'_>, value: i32, violations: &mut Violations) -> Option<Handedness> {
    if v1::Handedness::try_from(value) == Ok(v1::Handedness::Unspecified) {
        violations.add(field, "is required: HANDEDNESS_LEFT or HANDEDNESS_RIGHT");
        return None;
    }
    match known(field, value, violations) {
        v1::Handedness::Left => Some(Handedness::Left),
        v1::Handedness::Right => Some(Handedness::Right),
        v1::Handedness::Unspecified => None,
    }
}

fn angled_hand(
    field: Field<'_>,
    angles: &v1::HandAngles,
    convention: Convention,
    violations: &mut Violations,
) -> Option<GiverHand> {
    let handedness = required_handedness(field.child("handedness"), angles.handedness, violations);
    // Both hands have the same limits, which are checked even if the handedness is missing.
    let hand = built_in(
        field.child("rig"),
        &angles.rig,
        handedness.unwrap_or(Handedness::Right),
        violations,
    );
    let client_from_wrist = pose(
        field.child("client_from_wrist"),
        angles.client_from_wrist,
        convention.metres_per_unit(),
        violations,
    );
    let digits_field = field.child("digits");
    if angles.digits.len() != 5 {
        violations.add(
            digits_field,
            format_args!("has {} digits; it must have 5, thumb first", angles.digits.len()),
        );
    }
    let hand = hand?;
    let mut digits = [DigitAngles::default(); 5];
    for (place, (digit, sent)) in digits.iter_mut().zip(&angles.digits).enumerate() {
        *digit = digit_angles(digits_field.at(place), sent, &hand.rig.digits[place], violations);
    }
    handedness?;
    let pose = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(convention.joint_to_openxr(client_from_wrist)),
        digits,
    };
    Some(GiverHand {
        joints: HandJoints::of_pose(&hand.rig, &pose),
        skin: &hand.skin,
        field: "presenting_hand.angles",
    })
}

fn digit_angles(
    field: Field<'_>,
    sent: &v1::DigitAngles,
    rig: &DigitRig,
    violations: &mut Violations,
) -> DigitAngles {
    let limits = &rig.limits;
    let mut checked = |name, angle: f32, range: AngleRange| {
        if !range.contains(angle, ANGLE_SLACK) {
            violations.add(
                field.child(name),
                format_args!("is {angle} rad; the rig allows {} to {}", range.min, range.max),
            );
            return range.min;
        }
        angle.clamp(range.min, range.max)
    };
    let base_yaw = checked("base_yaw", sent.base_yaw, limits.base_yaw);
    let base_pitch = checked("base_pitch", sent.base_pitch, limits.base_pitch);
    let second_pitch = checked("second_pitch", sent.second_pitch, limits.second_pitch);
    let third_pitch = match sent.third_pitch {
        Some(angle) => checked("third_pitch", angle, limits.third_pitch),
        None => (DigitAngles::THIRD_PITCH_SHARE * second_pitch)
            .clamp(limits.third_pitch.min, limits.third_pitch.max),
    };
    DigitAngles {
        base_yaw,
        base_pitch,
        second_pitch,
        third_pitch,
    }
}

fn tracked_hand(
    field: Field<'_>,
    hand: &v1::HandJoints,
    convention: Convention,
    violations: &mut Violations,
) -> Option<GiverHand> {
    let before = violations.len();
    let handedness = required_handedness(field.child("handedness"), hand.handedness, violations);
    let set_field = field.child("joint_set");
    let set = known(set_field, hand.joint_set, violations);
    let expected = match set {
        v1::JointSet::Openxr26 => Some(JOINT_COUNT),
        v1::JointSet::Webxr25 => Some(JOINT_COUNT - 1),
        v1::JointSet::Unspecified => None,
    };
    if hand.joint_set == v1::JointSet::Unspecified as i32 {
        violations.add(
            set_field,
            "is required: JOINT_SET_OPENXR_26 or JOINT_SET_WEBXR_25",
        );
    }
    let joints_field = field.child("joints");
    if expected.is_some_and(|count| count != hand.joints.len()) || hand.joints.len() > JOINT_COUNT {
        violations.add(
            joints_field,
            format!(
                "has {} joints; {} needs {}",
                hand.joints.len(),
                set.as_str_name(),
                expected.map_or("26 or 25".to_owned(), |count| count.to_string()),
            ),
        );
        return None;
    }
    let nowhere = Joint {
        pose: Pose::IDENTITY,
        radius: 0.0,
    };
    let mut joints = [nowhere; JOINT_COUNT];
    for (place, sent) in hand.joints.iter().enumerate() {
        let joint = joint_pose(joints_field.at(place), sent, convention, violations);
        match set {
            v1::JointSet::Openxr26 => joints[convention.joint_at(place)] = joint,
            // Without the palm, every convention has OpenXR's order.
            v1::JointSet::Webxr25 => joints[place + 1] = joint,
            v1::JointSet::Unspecified => {}
        }
    }
    let (Some(handedness), Some(_)) = (handedness, expected) else {
        return None;
    };
    if violations.len() > before {
        // Distances between replaced joints would be meaningless.
        return None;
    }
    if set == v1::JointSet::Webxr25 {
        joints[index::PALM] = synthesised_palm(&joints);
    }
    proportions(joints_field, &joints, violations);
    Some(GiverHand {
        joints: HandJoints { handedness, joints },
        skin: &built_in(field, TRACKED_HAND_RIG, handedness, violations)?.skin,
        field: "presenting_hand.joints",
    })
}

fn joint_pose(
    field: Field<'_>,
    sent: &v1::JointPose,
    convention: Convention,
    violations: &mut Violations,
) -> Joint {
    let unit = convention.metres_per_unit();
    let pose_field = field.child("client_from_joint");
    if sent.client_from_joint.is_none() {
        violations.add(pose_field, "is absent; every joint must have a pose");
    }
    let radius = convention.length_to_openxr(sent.radius);
    if !(radius > 0.0 && radius <= LARGEST_RADIUS) {
        violations.add(
            field.child("radius"),
            format_args!(
                "is {}; it must be more than 0 and at most {}",
                sent.radius,
                convention.length_from_openxr(LARGEST_RADIUS)
            ),
        );
    }
    Joint {
        pose: convention.joint_to_openxr(pose(pose_field, sent.client_from_joint, unit, violations)),
        radius,
    }
}

/// The palm joint, which `WebXR` lacks: in the middle of the middle finger's metacarpal, with its axes and radius.
fn synthesised_palm(joints: &[Joint; JOINT_COUNT]) -> Joint {
    let metacarpal = joints[index::FIRST_OF_DIGIT[2]];
    let proximal = joints[index::FIRST_OF_DIGIT[2] + 1];
    Joint {
        pose: Pose {
            position: (metacarpal.pose.position + proximal.pose.position) * 0.5,
            orientation: metacarpal.pose.orientation,
        },
        radius: metacarpal.radius,
    }
}

/// Checks that the joints are as far apart as those of a hand.
fn proportions(field: Field<'_>, joints: &[Joint; JOINT_COUNT], violations: &mut Violations) {
    let wrist = joints[index::WRIST].pose.position;
    let from_wrist = |joint: &Joint| joint.pose.position.distance(wrist);
    let farthest = joints.iter().map(from_wrist).fold(0.0, f32::max);
    if farthest > LARGEST_REACH {
        violations.add(
            field,
            format_args!("reach {farthest} m from the wrist; the limit is {LARGEST_REACH} m"),
        );
    }
    let knuckle = from_wrist(&joints[index::FIRST_OF_DIGIT[2] + 1]);
    if knuckle < SMALLEST_PALM {
        violations.add(
            field,
            format_args!(
                "have the middle finger's proximal joint {knuckle} m from the wrist; it must be at least \
                 {SMALLEST_PALM} m"
            ),
        );
    }
}

/// The direction against gravity, in `OpenXR` axes: a unit vector.
pub(super) fn up(
    field: Field<'_>,
    up: Option<v1::Vector3>,
    convention: Convention,
    violations: &mut Violations,
) -> Vec3 {
    up.and_then(|up| direction(field, up, violations)).map_or_else(
        || convention.up_in_openxr(),
        |up| convention.direction_to_openxr(up),
    )
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::answer::wire_pose;

    const FIELD: Field<'static> = Field::root("presenting_hand");

    /// A bent hand, as `OpenXR` joints.
    fn joints_of_a_rig(handedness: Handedness) -> HandJoints {
        let hand = hands::hand("adult", handedness).expect("the rig is built in");
        let mut digits = hand.rig.stretched();
        for digit in &mut digits[1..] {
            *digit = DigitAngles::coupled(0.05, 0.4, 0.6);
        }
        let pose = HandPose {
            frame_from_wrist: Pose::new(Vec3::new(0.4, 1.1, -0.3), Quat::from_rotation_y(0.7)),
            digits,
        };
        HandJoints::of_pose(&hand.rig, &pose)
    }

    /// The joints as a client with the convention sends them.
    fn sent(joints: &HandJoints, convention: Convention, set: v1::JointSet) -> v1::PresentingHand {
        let places = match set {
            v1::JointSet::Webxr25 => 1..JOINT_COUNT,
            _ => 0..JOINT_COUNT,
        };
        let handedness = match joints.handedness {
            Handedness::Left => v1::Handedness::Left,
            Handedness::Right => v1::Handedness::Right,
        };
        let joint_of = |place| match set {
            v1::JointSet::Webxr25 => place,
            _ => convention.joint_at(place),
        };
        let hand = v1::HandJoints {
            handedness: handedness.into(),
            joint_set: set.into(),
            joints: places
                .map(|place| joints.joints[joint_of(place)])
                .map(|joint| v1::JointPose {
                    client_from_joint: Some(wire_pose(convention.joint_from_openxr(joint.pose))),
                    radius: convention.length_from_openxr(joint.radius),
                })
                .collect(),
        };
        v1::PresentingHand {
            form: Some(v1::presenting_hand::Form::Joints(hand)),
        }
    }

    #[test]
    fn reads_joints_in_every_convention_and_set() {
        for convention in [
            Convention::OpenXr,
            Convention::Unity,
            Convention::Unreal,
            Convention::Godot,
        ] {
            for set in [v1::JointSet::Openxr26, v1::JointSet::Webxr25] {
                for handedness in [Handedness::Left, Handedness::Right] {
                    let expected = joints_of_a_rig(handedness);
                    let mut violations = Violations::default();
                    let hand = presenting_hand(
                        FIELD,
                        sent(&expected, convention, set),
                        convention,
                        &mut violations,
                    );
                    assert!(violations.is_empty(), "{violations:?}");
                    let read = hand.expect("the hand is valid").joints;
                    assert_eq!(read.handedness, handedness);
                    for (joint, (read, expected)) in read.joints.iter().zip(&expected.joints).enumerate() {
                        let context = format!("{convention:?} {set:?} {joint}: {read:?} {expected:?}");
                        assert!(
                            read.pose.position.distance(expected.pose.position) < 1e-5,
                            "{context}"
                        );
                        assert!(
                            read.pose.orientation.dot(expected.pose.orientation).abs() > 1.0 - 1e-5,
                            "{context}"
                        );
                        // WebXR's set does not contain the palm's radius.
                        if joint != index::PALM || set == v1::JointSet::Openxr26 {
                            assert!((read.radius - expected.radius).abs() < 1e-6, "{context}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn clamps_angles_within_the_slack_and_couples_absent_ones() {
        let hand = hands::hand("thesis", Handedness::Right).expect("the rig is built in");
        let rig = &hand.rig.digits[1];
        let limit = rig.limits.second_pitch.max;
        let angles = v1::DigitAngles {
            base_yaw: 0.0,
            base_pitch: 0.1,
            second_pitch: limit + 0.5 * ANGLE_SLACK,
            third_pitch: None,
        };
        let mut violations = Violations::default();
        let read = digit_angles(FIELD, &angles, rig, &mut violations);
        assert!(violations.is_empty());
        assert_eq!(read.second_pitch, limit);
        let coupled = (limit * 2.0 / 3.0).min(rig.limits.third_pitch.max);
        assert!((read.third_pitch - coupled).abs() < 1e-6);
        let over = v1::DigitAngles {
            second_pitch: limit + 2.0 * ANGLE_SLACK,
            ..angles
        };
        digit_angles(FIELD, &over, rig, &mut violations);
        assert_eq!(violations.len(), 1);
    }
}
