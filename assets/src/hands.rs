//! The built-in hands: rig and skin of `thesis` and `adult`, left and right.

use std::sync::{Arc, LazyLock};

use glam::{Affine3A, Mat4, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        Handedness,
        description::RigDescription,
        joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, Joint, Skin, index, openxr_from_thesis_frame},
        rig::Rig,
    },
    propose::prepared::PreparedRig,
};

/// The names of the built-in rigs.
pub const RIG_NAMES: [&str; 2] = ["thesis", "adult"];

/// A rig with its skin. Two are equal if their rigs are.
#[derive(Clone, Debug)]
pub struct Hand {
    /// Bones, limits, widths and collision segments.
    pub rig: PreparedRig,
    /// The skin in the wrist frame, bound to the 26 joints of a relaxed, slightly spread hand.
    pub skin: Arc<Skin>,
}

impl PartialEq for Hand {
    fn eq(&self, other: &Self) -> bool {
        self.rig == other.rig
    }
}

impl Eq for Hand {}

/// The built-in hands, in the order of [`FILES`].
static HANDS: LazyLock<[Arc<Hand>; 4]> =
    LazyLock::new(|| FILES.map(|(json, glb)| Arc::new(built_in(json, glb))));

/// A built-in hand; parsed on first use.
pub fn hand(rig: &str, handedness: Handedness) -> Option<&'static Arc<Hand>> {
    place(rig, handedness).map(|place| &HANDS[place])
}

/// True if a hand makes the same grips as one that is built in.
pub fn is_built_in(hand: &Hand) -> bool {
    HANDS.iter().any(|built_in| **built_in == *hand)
}

/// A built-in hand as a GLB file with `WebXR` joint names, in the `OpenXR` frame of the wrist.
pub fn glb(rig: &str, handedness: Handedness) -> Option<&'static [u8]> {
    place(rig, handedness).map(|place| FILES[place].1)
}

/// The place of a built-in hand in [`FILES`].
fn place(rig: &str, handedness: Handedness) -> Option<usize> {
    HANDS
        .iter()
        .position(|hand| hand.rig.name == rig && hand.rig.handedness == handedness)
}

/// The embedded files: description and GLB.
const FILES: [(&str, &[u8]); 4] = [
    (
        include_str!("../hands/thesis_left.json"),
        include_bytes!("../hands/thesis_left.glb"),
    ),
    (
        include_str!("../hands/thesis_right.json"),
        include_bytes!("../hands/thesis_right.glb"),
    ),
    (
        include_str!("../hands/adult_left.json"),
        include_bytes!("../hands/adult_left.glb"),
    ),
    (
        include_str!("../hands/adult_right.json"),
        include_bytes!("../hands/adult_right.glb"),
    ),
];

/// Parses embedded files. They are part of the program, so an error in them is a bug.
fn built_in(json: &str, glb: &[u8]) -> Hand {
    let description: RigDescription = serde_json::from_str(json).expect("an embedded rig is a description");
    let rig = description.to_rig();
    let skin = read_skin(glb, &rig).expect("an embedded skin is complete");
    Hand {
        rig: PreparedRig::new(rig),
        skin: Arc::new(skin),
    }
}

/// The skin of a rig from a GLB file with `WebXR` joint names, in the thesis' wrist frame. The radii are the rig's. `None` if a part
/// of a skinned hand is missing.
fn read_skin(glb: &[u8], rig: &Rig) -> Option<Skin> {
    let file = gltf::Gltf::from_slice(glb).ok()?;
    let blob = file.blob.as_deref()?;
    let (mesh, skin) = file.nodes().find_map(|node| node.mesh().zip(node.skin()))?;
    let primitive = mesh.primitives().next()?;
    let reader = primitive.reader(|_| Some(blob));
    let corners: Vec<u32> = reader.read_indices()?.into_u32().collect();
    let weights: Vec<[f32; 4]> = reader.read_weights(0)?.into_f32().collect();
    let inverse_binds = skin.reader(|_| Some(blob)).read_inverse_bind_matrices()?;

    // Maps the file's joint order to OpenXR's by name.
    let joints = skin.joints().map(|joint| {
        let name = joint.name()?;
        JOINT_NAMES.iter().position(|&known| known == name)
    });
    let openxr_index: Vec<usize> = joints.collect::<Option<_>>()?;
    let bind = bind_joints(rig, &openxr_index, inverse_binds)?;
    let joint_indices = reader
        .read_joints(0)?
        .into_u16()
        .zip(&weights)
        .map(|(joints, weights)| {
            // The index of a joint without weight means nothing.
            std::array::from_fn(|i| {
                if weights[i] > 0.0 {
                    openxr_index[usize::from(joints[i])] as u8
                } else {
                    0
                }
            })
        });
    // The file uses the OpenXR frame of the wrist; the skin uses the thesis' frame at the same place.
    let file_from_wrist = bind.joints[index::WRIST].pose;
    let wrist_from_file = openxr_from_thesis_frame(Pose::IDENTITY) * file_from_wrist.inverse();
    let positions = reader.read_positions()?.map(Vec3::from);
    Some(Skin {
        positions: positions.map(|p| wrist_from_file.transform_point(p)).collect(),
        triangles: corners.as_chunks().0.to_vec(),
        joint_indices: joint_indices.collect(),
        weights,
        bind: bind.transformed(wrist_from_file),
    })
}

/// The joints in the bind pose, in the file's frame. The file has no palm joint, which is the centre of the middle
/// metacarpal.
fn bind_joints(
    rig: &Rig,
    openxr_index: &[usize],
    inverse_binds: impl Iterator<Item = [[f32; 4]; 4]>,
) -> Option<HandJoints> {
    let mut poses: [Option<Pose>; JOINT_COUNT] = [None; JOINT_COUNT];
    for (&joint, inverse_bind) in openxr_index.iter().zip(inverse_binds) {
        let bind = Affine3A::from_mat4(Mat4::from_cols_array_2d(&inverse_bind).inverse());
        let (_, orientation, position) = bind.to_scale_rotation_translation();
        poses[joint] = Some(Pose {
            position,
            orientation: orientation.normalize(),
        });
    }
    let middle = index::FIRST_OF_DIGIT[2];
    let mut palm = poses[middle]?;
    palm.position = palm.position.midpoint(poses[middle + 1]?.position);
    poses[index::PALM] = Some(palm);
    let joints = poses.into_iter().zip(rig.joint_radii);
    let joints: Option<Vec<Joint>> = joints
        .map(|(pose, radius)| Some(Joint { pose: pose?, radius }))
        .collect();
    Some(HandJoints {
        handedness: rig.handedness,
        joints: joints?.try_into().ok()?,
    })
}
