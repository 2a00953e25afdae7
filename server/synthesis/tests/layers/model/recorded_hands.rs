//! Skins posed by recorded `WebXR` joints of a headset. Without the recordings, a line says that they are skipped.

use std::{collections::HashMap, fs};

use grasp_synthesis::model::hand::joints::JOINT_NAMES;
use serde::Deserialize;

use crate::prelude::*;

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
