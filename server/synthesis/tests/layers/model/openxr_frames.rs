//! The conversion to `OpenXR` joints, and left hands as mirror images of right ones.

use grasp_synthesis::model::hand::joints::thesis_from_openxr_frame;

use crate::prelude::*;

#[test]
fn openxr_frames_round_trip() {
    let mut random = Random::new(2);
    for _ in 0..1000 {
        let pose = random.pose();
        let back = thesis_from_openxr_frame(openxr_from_thesis_frame(pose));
        assert_eq!(back.position, pose.position);
        assert!(back.orientation.dot(pose.orientation).abs() > 1.0 - 1e-6);
    }
}

#[test]
fn openxr_axes_follow_the_specification() {
    for hand in all_hands() {
        let rig = &hand.rig;
        let frame = Pose::new(
            Vec3::new(0.3, 1.2, -0.4),
            Quat::from_xyzw(0.2, -0.5, 0.1, 0.8).normalize(),
        );
        let joints = HandJoints::of_pose(rig, &hand_pose(frame, rig.stretched()));
        let to_thumb = (joints.joints[index::FIRST_OF_DIGIT[1]].pose.position
            - joints.joints[index::FIRST_OF_DIGIT[4]].pose.position)
            .normalize_or_zero();
        let palmar = frame.transform_vector(Vec3::Z);
        // By the right-hand rule, +X points to the thumb on the left hand and to the little finger on the right.
        let side = -thumb_side(rig.handedness);
        for digit in 0..5 {
            let first = index::FIRST_OF_DIGIT[digit];
            let tip = index::TIP_OF_DIGIT[digit];
            for joint in first..tip {
                let pose = joints.joints[joint].pose;
                let to_next = (joints.joints[joint + 1].pose.position - pose.position).normalize_or_zero();
                let forward = pose.transform_vector(Vec3::NEG_Z);
                assert!(forward.dot(to_next) > 0.9999, "-Z of joint {joint}");
                if digit > 0 {
                    let up = pose.transform_vector(Vec3::Y);
                    assert!(up.dot(palmar) < -0.95, "+Y of joint {joint} leaves by the back");
                    let across = pose.transform_vector(Vec3::X);
                    assert!(across.dot(to_thumb) * side > 0.9, "+X of joint {joint}");
                }
            }
        }
        let palm = joints.joints[index::PALM].pose;
        assert!((palm.transform_vector(Vec3::NEG_Y)).dot(palmar) > 0.99);
        // H lies one radius off the palm joint, at the rig's palm point.
        assert!(joints.palm_skin().distance(frame.transform_point(rig.palm)) < 1e-5);
    }
}

#[test]
fn left_hands_mirror_right_hands() {
    let mut random = Random::new(3);
    let flip = |v: Vec3| v * Vec3::new(-1.0, 1.0, 1.0);
    for name in ["thesis", "adult"] {
        let (left, right) = (
            built_in_hand(name, Handedness::Left),
            built_in_hand(name, Handedness::Right),
        );
        for _ in 0..100 {
            let digits = random.angles(&right.rig);
            let wrist = random.pose();
            let of_right = HandJoints::of_pose(&right.rig, &hand_pose(wrist, digits));
            let of_left = HandJoints::of_pose(&left.rig, &hand_pose(wrist.mirrored_x(), digits));
            for (l, r) in of_left.joints.iter().zip(&of_right.joints) {
                assert!(l.pose.position.distance(flip(r.pose.position)) < 1e-5);
                // Mirroring takes each axis to its image; in a right-handed frame, x then points the other way.
                for (axis, sign) in [(Vec3::X, -1.0), (Vec3::Y, 1.0), (Vec3::Z, 1.0)] {
                    let image = flip(r.pose.transform_vector(axis)) * sign;
                    assert!(l.pose.transform_vector(axis).distance(image) < 1e-4);
                }
                assert_eq!(l.radius, r.radius);
            }
            let (skin_of_left, skin_of_right) = (left.skin.posed(&of_left), right.skin.posed(&of_right));
            for (l, r) in skin_of_left.iter().zip(&skin_of_right) {
                assert!(l.distance(flip(*r)) < 2e-5, "{l} is not the image of {r}");
            }
        }
        for (l, r) in left.rig.palm_segments.iter().zip(&right.rig.palm_segments) {
            assert!(l.start.distance(flip(r.start)) < 1e-6 && l.end.distance(flip(r.end)) < 1e-6);
        }
    }
}
