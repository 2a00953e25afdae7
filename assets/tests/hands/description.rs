//! Rig descriptions: there and back, and everything that can be wrong with them at once.

use grasp_assets::hands::{HandError, read_rig};
use grasp_synthesis::model::hand::description::{RigDescription, RigViolation};

use crate::all;

#[test]
fn rigs_survive_the_way_through_their_description() {
    for hand in all() {
        let description = RigDescription::of_rig(&hand.rig);
        let text = serde_json::to_string(&description).expect("it is plain data");
        let rig = read_rig(&text).expect("it describes a rig");
        assert_eq!(rig.name, hand.rig.name);
        assert_eq!(rig.handedness, hand.rig.handedness);
        assert_eq!(rig.joint_radii, hand.rig.joint_radii);
        assert_eq!(rig.palm_segments, hand.rig.palm_segments);
        assert_eq!(rig.finger_metacarpals, hand.rig.finger_metacarpals);
        assert_eq!(rig.palm, hand.rig.palm);
        assert!((rig.reach - hand.rig.reach).abs() < 1e-6);
        for (found, expected) in rig.digits.iter().zip(&hand.rig.digits) {
            assert_eq!(found.lengths, expected.lengths);
            assert_eq!(found.diameters, expected.diameters);
            assert_eq!(found.limits, expected.limits);
            assert_eq!(found.yaw_sign, expected.yaw_sign);
            assert_eq!(found.wrist_from_base.position, expected.wrist_from_base.position);
            let turn = found
                .wrist_from_base
                .orientation
                .angle_between(expected.wrist_from_base.orientation);
            assert!(turn < 1e-3);
        }
        // What people read stays as it is on a second way.
        assert_eq!(
            RigDescription::of_rig(&rig).digits.index.limits_degrees,
            description.digits.index.limits_degrees
        );
    }
}

#[test]
fn every_violation_is_named_at_once() {
    let hand = all().next().expect("there are hands");
    let mut wrong = RigDescription::of_rig(&hand.rig);
    wrong.name = " ".to_owned();
    wrong.palm_m[1] = f32::NAN;
    wrong.digits.thumb.base_orientation_xyzw = [0.0; 4];
    wrong.digits.index.lengths_m[2] = 0.0;
    wrong.digits.middle.yaw_sign = 0.5;
    wrong.digits.ring.limits_degrees.base_pitch = [90.0, 0.0];
    wrong.digits.little.diameters_m[0] = f32::INFINITY;
    wrong.finger_metacarpals_m[3][0] = 20.0;
    let wrist = wrong
        .joint_radii_m
        .remove("wrist")
        .expect("the wrist has a radius");
    wrong.joint_radii_m.insert("elbow".to_owned(), wrist);
    let violations = wrong.to_rig().expect_err("it is wrong in ten places");
    let named = |violation: &RigViolation| violation.to_string();
    let messages: Vec<String> = violations.iter().map(named).collect();
    for part in [
        "name is empty",
        "palm_m is NaN",
        "digits.thumb.base_orientation_xyzw has length 0",
        "digits.index.lengths_m[2] is 0",
        "digits.middle.yaw_sign is 0.5",
        "digits.ring.limits_degrees.base_pitch is 90 to 0",
        "digits.little.diameters_m[0] is inf",
        "finger_metacarpals_m[3] is 20",
        "joint_radii_m.elbow names no joint",
        "joint_radii_m.wrist is missing",
    ] {
        assert!(
            messages.iter().any(|message| message.starts_with(part)),
            "nothing says {part}: {messages:#?}"
        );
    }
    assert_eq!(messages.len(), 10, "{messages:#?}");
}

#[test]
fn unknown_fields_are_refused() {
    let hand = all().next().expect("there are hands");
    let text = serde_json::to_string(&RigDescription::of_rig(&hand.rig)).expect("it is plain data");
    let more = text.replacen('{', "{\"tail_m\":1,", 1);
    assert!(matches!(read_rig(&more), Err(HandError::Json(_))));
}
