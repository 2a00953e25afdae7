//! Validation of rig descriptions.

use grasp_synthesis::model::hand::description::{RigDescription, RigViolation};

use crate::prelude::*;

#[test]
fn reports_every_violation_of_a_description_at_once() {
    let mut wrong = RigDescription::of_rig(right());
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
            "no message contains {part:?}: {messages:#?}"
        );
    }
    assert_eq!(messages.len(), 10, "{messages:#?}");
}
