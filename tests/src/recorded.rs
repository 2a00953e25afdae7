//! Meshes and hand poses from third parties, used in place and never copied.
//!
//! They are in the folder that `GRASP_TEST_DATA` names, or else in `../shared/data` next to the repository. Tests that
//! need them print that they are skipped when they are absent.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glam::{Quat, Vec3};
use grasp_import::{Import, MeshLimits, read_mesh};
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        hand::{
            Handedness,
            joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, Joint, index},
        },
        object::GraspObject,
    },
};
use serde::Deserialize;

/// The folder of the recorded data, if it exists.
pub fn data_folder() -> Option<PathBuf> {
    let folder = std::env::var_os("GRASP_TEST_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    folder.join("poses").is_dir().then_some(folder)
}

/// The folder of the recorded data; prints that `test` is skipped if it is absent.
pub fn data_folder_or_skip(test: &str) -> Option<PathBuf> {
    let folder = data_folder();
    if folder.is_none() {
        eprintln!("SKIPPED {test}: no recorded data (set GRASP_TEST_DATA to their folder)");
    }
    folder
}

/// An object from OBJ text in metres, with its mesh as the server reads it and its centre of mass at the origin, which
/// is enough to place givers. `mass` is in kilograms.
pub fn object_of(obj: &[u8], mass: f32) -> GraspObject {
    let limits = MeshLimits {
        bytes: 1 << 24,
        vertices: 1 << 20,
        triangles: 1 << 20,
    };
    let read = read_mesh(obj, Import::METRES, limits).expect("the mesh can be read");
    GraspObject::new(read.mesh, mass, Vec3::ZERO, None, &[]).expect("the object is sound")
}

/// A hand pose, recorded from a person or made by an artist.
#[derive(Clone, Debug)]
pub struct RecordedPose {
    /// Its name in the source.
    pub name: String,
    /// Its joints in the wrist's `OpenXR` frame; the palm joint is derived.
    pub joints: HandJoints,
}

#[derive(Deserialize)]
struct PoseFile {
    poses: Vec<PoseEntry>,
}

#[derive(Deserialize)]
struct PoseEntry {
    name: String,
    handedness: Handedness,
    joints: BTreeMap<String, JointEntry>,
}

#[derive(Deserialize)]
struct JointEntry {
    position: Vec3,
    orientation_xyzw: Quat,
}

/// All poses of a file such as `poses/handy-work_poses.json`. The files have no radii; `radii` provides them, in metres and
/// `OpenXR` order.
pub fn read_poses(file: &Path, radii: &[f32; JOINT_COUNT]) -> Vec<RecordedPose> {
    let text = std::fs::read_to_string(file).expect("the pose file can be read");
    let file: PoseFile = serde_json::from_str(&text).expect("the pose file has the documented form");
    file.poses
        .iter()
        .map(|entry| recorded_pose(entry, radii))
        .collect()
}

fn recorded_pose(entry: &PoseEntry, radii: &[f32; JOINT_COUNT]) -> RecordedPose {
    let joint = |i: usize| {
        let recorded = &entry.joints[JOINT_NAMES[i]];
        Joint {
            pose: Pose::new(recorded.position, recorded.orientation_xyzw.normalize()),
            radius: radii[i],
        }
    };
    let metacarpal = joint(index::FIRST_OF_DIGIT[2]);
    let knuckle = joint(index::FIRST_OF_DIGIT[2] + 1);
    let palm = Joint {
        pose: Pose::new(
            metacarpal.pose.position.midpoint(knuckle.pose.position),
            metacarpal.pose.orientation,
        ),
        radius: radii[index::PALM],
    };
    RecordedPose {
        name: entry.name.clone(),
        joints: HandJoints {
            handedness: entry.handedness,
            joints: std::array::from_fn(|i| if i == index::PALM { palm } else { joint(i) }),
        },
    }
}
