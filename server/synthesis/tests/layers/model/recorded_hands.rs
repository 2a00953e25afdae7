//! Skins posed by recorded `WebXR` joints of a headset. Without the recordings, a line says that they are skipped.

use std::fs;

use glam::{Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        Handedness,
        joints::{HandJoints, JOINT_NAMES, Joint, index},
    },
};
use serde::Deserialize;

use crate::fixtures::{data, hands::built_in_hand};

#[derive(Deserialize)]
struct Recording {
    poses: Vec<RecordedPose>,
}

#[derive(Deserialize)]
struct RecordedPose {
    name: String,
    handedness: Handedness,
    joints: std::collections::BTreeMap<String, RecordedJoint>,
}

#[derive(Deserialize)]
struct RecordedJoint {
    position: [f32; 3],
    orientation_xyzw: [f32; 4],
}

/// The recordings of a file, if it is there.
fn recordings(file: &str) -> Option<Vec<RecordedPose>> {
    let path = data::folder("poses").join(file);
    let Ok(text) = fs::read_to_string(&path) else {
        println!("skipped: {} is not there", path.display());
        return None;
    };
    let recording: Recording = serde_json::from_str(&text).expect("the recordings are well-formed");
    Some(recording.poses)
}

/// The recording as joints, with the radii of the adult's rig: recordings have none.
fn joints_of(pose: &RecordedPose) -> HandJoints {
    let rig = &built_in_hand("adult", pose.handedness).rig;
    let mut joints: [Joint; 26] = std::array::from_fn(|i| {
        let recorded = pose
            .joints
            .get(JOINT_NAMES[i.max(1)])
            .expect("all 25 joints are recorded");
        Joint {
            pose: Pose::new(
                Vec3::from(recorded.position),
                Quat::from_array(recorded.orientation_xyzw).normalize(),
            ),
            radius: rig.joint_radii[i],
        }
    });
    let middle = index::FIRST_OF_DIGIT[2];
    let between = joints[middle]
        .pose
        .position
        .midpoint(joints[middle + 1].pose.position);
    joints[index::PALM].pose = Pose {
        position: between,
        ..joints[middle].pose
    };
    HandJoints {
        handedness: pose.handedness,
        joints,
    }
}

#[test]
fn recorded_poses_give_sound_skins() {
    for file in ["handy-work_poses.json", "godot_xr_tools_poses.json"] {
        for pose in recordings(file).into_iter().flatten() {
            let joints = joints_of(&pose);
            for rig in ["adult", "thesis"] {
                let skin = &built_in_hand(rig, pose.handedness).skin;
                let positions = skin.posed(&joints);
                let name = format!("{} {:?} on {rig}", pose.name, pose.handedness);
                assert!(positions.iter().all(|p| p.is_finite()), "{name} is not finite");
                let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                for p in &positions {
                    (low, high) = (low.min(*p), high.max(*p));
                }
                assert!((high - low).max_element() < 0.3, "{name} has spikes");
                let mut volume = 0.0;
                for &triangle in &skin.triangles {
                    let [a, b, c] = triangle.map(|v| positions[v as usize]);
                    let doubled_area = (b - a).cross(c - a).length();
                    assert!(doubled_area > 1e-10, "{name} has a triangle without area at {a}");
                    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                    assert!(longest < 0.045, "{name} has an edge of {longest} m at {a}");
                    volume += a.dot(b.cross(c)) / 6.0;
                }
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
