//! Rigs fitted to tracked and recorded hands.

use crate::prelude::*;
use grasp_synthesis::model::hand::{
    joints::JOINT_NAMES,
    kinematics::{farthest_joint, fitted},
};
use serde::Deserialize;
use std::{collections::HashMap, fs};

fn any_pose(rig: &Rig, random: &mut Random) -> HandPose {
    hand_pose(
        Pose::new(
            random.direction() * 0.5,
            Quat::from_axis_angle(random.direction(), random.between(0.0, 3.0)),
        ),
        random.angles(rig),
    )
}

#[test]
fn a_rig_posed_like_its_own_joints_is_where_they_are() {
    let mut random = Random::new(4);
    for hand in all_hands() {
        for _ in 0..50 {
            let pose = any_pose(&hand.rig, &mut random);
            let joints = HandJoints::of_pose(&hand.rig, &pose);
            let fit = fitted(&hand.rig, &joints);
            let farthest = farthest_joint(&hand.rig, &fit, &joints);
            assert!(
                farthest < 2e-4,
                "{} {:?}: {farthest} m",
                hand.rig.name,
                hand.rig.handedness
            );
            for (digit, limits) in fit.digits.iter().zip(hand.rig.digits.map(|digit| digit.limits)) {
                assert_eq!(*digit, limits.clamped(*digit));
            }
        }
    }
}

#[test]
fn no_angles_within_limits_come_nearer_than_the_fit() {
    let mut random = Random::new(6);
    let rig = right();
    for _ in 0..30 {
        let pose = any_pose(rig, &mut random);
        let mut joints = HandJoints::of_pose(rig, &pose);
        // Joints that no pose of the rig has: another size, and noise.
        for joint in &mut joints.joints {
            joint.pose.position = pose.frame_from_wrist.position
                + (joint.pose.position - pose.frame_from_wrist.position) * 1.07
                + random.direction() * 0.004;
        }
        joints.joints[index::WRIST].pose.position = pose.frame_from_wrist.position;
        let fit = fitted(rig, &joints);
        let squares = |pose: &HandPose, digit: Digit| {
            let posed = HandJoints::of_pose(rig, pose);
            let tip = index::TIP_OF_DIGIT[digit.index()];
            let square = |joint: usize| {
                let apart = posed.joints[joint].pose.position - joints.joints[joint].pose.position;
                apart.length_squared()
            };
            (tip - 2..=tip).map(square).sum::<f32>()
        };
        for digit in Digit::ALL {
            let best = squares(&fit, digit);
            for _ in 0..300 {
                let mut other = fit;
                let angles = &mut other.digits[digit.index()];
                let scale = if random.index(2) == 0 { 0.02 } else { 0.5 };
                angles.base_yaw += random.between(-scale, scale);
                angles.base_pitch += random.between(-scale, scale);
                angles.second_pitch += random.between(-scale, scale);
                angles.third_pitch += random.between(-scale, scale);
                *angles = rig.digit(digit).limits.clamped(*angles);
                let squares = squares(&other, digit);
                assert!(squares > best - 1e-7, "{digit:?}: {squares} < {best}");
            }
        }
    }
}

#[test]
fn fingers_that_the_rig_lacks_do_not_count() {
    let mut random = Random::new(9);
    let whole = right();
    let three = adult_with(&[Digit::Index, Digit::Middle], whole.handedness);
    let pose = any_pose(whole, &mut random);
    let joints = HandJoints::of_pose(whole, &pose);
    let fit = fitted(&three, &joints);
    assert!(farthest_joint(&three, &fit, &joints) < 2e-4);
    assert_eq!(
        fit.digits[Digit::Little.index()],
        three.stretched()[Digit::Little.index()]
    );
}

#[derive(Deserialize)]
struct Recording {
    poses: Vec<RecordedPose>,
}

#[derive(Deserialize)]
struct RecordedPose {
    name: String,
    handedness: Handedness,
    joints: HashMap<String, RecordedJoint>,
}

#[derive(Deserialize)]
struct RecordedJoint {
    position: Vec3,
    orientation_xyzw: Quat,
}

/// The recordings of a file; none, and a message, if it is not there.
fn recordings(file: &str) -> Vec<RecordedPose> {
    let path = data::folder("poses").join(file);
    let Ok(text) = fs::read_to_string(&path) else {
        println!("skipped: {} is not there", path.display());
        return Vec::new();
    };
    let recording: Recording = serde_json::from_str(&text).expect("the recordings are well-formed");
    recording.poses
}

/// The recording as joints, with the radii of the adult's rig: recordings have none.
fn joints_of(pose: &RecordedPose) -> HandJoints {
    let rig = &built_in_hand("adult", pose.handedness).rig;
    let pose_of = |i: usize| {
        let recorded = &pose.joints[JOINT_NAMES[i]];
        Pose::new(recorded.position, recorded.orientation_xyzw.normalize())
    };
    let joints = std::array::from_fn(|i| {
        let middle = pose_of(index::FIRST_OF_DIGIT[2]);
        let knuckle = pose_of(index::FIRST_OF_DIGIT[2] + 1).position;
        let pose = match i {
            index::PALM => Pose::new(middle.position.midpoint(knuckle), middle.orientation),
            _ => pose_of(i),
        };
        Joint {
            pose,
            radius: rig.joint_radii[i],
        }
    });
    HandJoints {
        handedness: pose.handedness,
        joints,
    }
}

#[test]
fn recorded_poses_give_sound_skins() {
    for file in ["handy-work_poses.json", "godot_xr_tools_poses.json"] {
        for pose in recordings(file) {
            let joints = joints_of(&pose);
            for rig in ["adult", "thesis"] {
                let skin = &built_in_hand(rig, pose.handedness).skin;
                let positions = skin.posed(&joints);
                let name = format!("{} {:?} on {rig}", pose.name, pose.handedness);
                assert!(positions.iter().all(|p| p.is_finite()), "{name} is not finite");
                let mesh = TriangleMesh::new(positions.clone(), skin.triangles.clone());
                let mesh = mesh.unwrap_or_else(|error| panic!("{name}: {error}"));
                assert!(mesh.aabb().extents().max_element() < 0.3, "{name} has spikes");
                for triangle in 0..mesh.triangles().len() {
                    let [a, b, c] = mesh.corners(triangle);
                    assert!((b - a).cross(c - a).length() > 1e-10, "{name}: no area at {a}");
                    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                    assert!(longest < 0.045, "{name} has an edge of {longest} m at {a}");
                }
                let volume = mesh.signed_volume();
                assert!((2.5e-4..6.5e-4).contains(&volume), "{name} holds {volume} m³");
                // The fingertips are where the headset tracked them.
                for tip in index::TIP_OF_DIGIT {
                    let nearest = positions
                        .iter()
                        .map(|p| p.distance(joints.joints[tip].pose.position))
                        .fold(f32::INFINITY, f32::min);
                    assert!(nearest < 0.006, "{name}: skin {nearest} m from joint {tip}");
                }
            }
        }
    }
}
