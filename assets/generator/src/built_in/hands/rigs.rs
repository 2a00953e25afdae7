//! Files of rigs, the limits of Table 4.1 and the reach of the built-in hands.

use grasp_assets::hands::{HandError, read_rig};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{HandPose, Handedness, description::RigDescription, kinematics::hand_frames},
};

use super::{all, built_in};

#[test]
fn rigs_round_trip_through_their_files() {
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
        // A second round trip does not change the limits in degrees.
        assert_eq!(
            RigDescription::of_rig(&rig).digits.index.limits_degrees,
            description.digits.index.limits_degrees
        );
    }
}

#[test]
fn rig_files_with_unknown_fields_are_rejected() {
    let hand = all().next().expect("there are hands");
    let text = serde_json::to_string(&RigDescription::of_rig(&hand.rig)).expect("it is plain data");
    let more = text.replacen('{', "{\"tail_m\":1,", 1);
    assert!(matches!(read_rig(&more), Err(HandError::Json(_))));
}

#[test]
fn thesis_limits_match_table_4_1() {
    for side in [Handedness::Left, Handedness::Right] {
        let rig = &built_in("thesis", side).rig;
        for (i, digit) in rig.digits.iter().enumerate() {
            let expected = if i == 0 {
                [[0.0, 45.0], [0.0, 60.0], [-45.0, 45.0]]
            } else {
                [[-5.0, 5.0], [0.0, 90.0], [0.0, 90.0]]
            };
            let limits = digit.limits;
            for (range, [min, max]) in [limits.base_yaw, limits.base_pitch, limits.second_pitch]
                .into_iter()
                .zip(expected)
            {
                assert!((range.min.to_degrees() - min).abs() < 1e-4, "digit {i}");
                assert!((range.max.to_degrees() - max).abs() < 1e-4, "digit {i}");
            }
            // The third joint follows the second by two thirds.
            for (third, second) in [
                (limits.third_pitch.min, limits.second_pitch.min),
                (limits.third_pitch.max, limits.second_pitch.max),
            ] {
                assert!((third - second * 2.0 / 3.0).abs() < 1e-6, "digit {i}");
            }
        }
    }
}

#[test]
fn the_stretched_middle_finger_has_the_rigs_reach() {
    for (name, reach) in [("thesis", 0.22), ("adult", 0.19)] {
        for side in [Handedness::Left, Handedness::Right] {
            let rig = &built_in(name, side).rig;
            let frames = hand_frames(
                rig,
                &HandPose {
                    frame_from_wrist: Pose::IDENTITY,
                    digits: rig.stretched(),
                },
            );
            // The middle finger's limits contain zero, so it is straight.
            let tip = frames.digits[2].tip;
            assert!((tip.length() - rig.reach).abs() < 1e-6);
            let tolerance = if name == "thesis" { 1e-6 } else { 1e-3 };
            assert!(
                (rig.reach - reach).abs() < tolerance,
                "{name} reaches {}",
                rig.reach
            );
            assert!(tip.y > 0.999 * tip.length(), "the fingers stretch along +y");
        }
    }
}
