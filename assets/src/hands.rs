//! The built-in hands: rig and skin of `thesis` and `adult`, left and right; and the reader for skins.

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

/// Parses the embedded files. The generator writes them and the tests read them, so they are valid in any build that
/// passed.
fn built_in(json: &str, glb: &[u8]) -> Hand {
    let rig = read_rig(json).expect("an embedded rig is valid");
    let skin = read_skin(glb, &rig).expect("an embedded skin is valid");
    Hand {
        rig: PreparedRig::new(rig),
        skin: Arc::new(skin),
    }
}

/// Why a rig or a skin was rejected.
#[derive(Debug, thiserror::Error)]
pub enum HandError {
    /// The description is not JSON of the right form.
    #[error("the rig description cannot be read: {0}")]
    Json(#[from] serde_json::Error),
    /// The description breaks a rule for rigs.
    #[error("the rig description is invalid: {}", .0.join("; "))]
    Rig(Vec<String>),
    /// The file is not glTF.
    #[error("the skin cannot be read: {0}")]
    Gltf(#[from] gltf::Error),
    /// The file lacks a part of a skinned hand.
    #[error("the skin has no {0}")]
    Missing(&'static str),
    /// A joint of the hand is not among the skin's joints.
    #[error("the skin has no joint named {0}")]
    MissingJoint(&'static str),
    /// A vertex attribute has the wrong number of rows, or an index is out of range.
    #[error("the skin's {0} do not fit its positions or joints")]
    Mismatch(&'static str),
}

/// A rig from its description.
///
/// # Errors
/// The text is not a rig description, or it is invalid: the error then lists all violations.
pub fn read_rig(json: &str) -> Result<Rig, HandError> {
    serde_json::from_str::<RigDescription>(json)?
        .to_rig()
        .map_err(HandError::Rig)
}

/// Reads the skin of a rig from a GLB file with `WebXR` joint names and converts it to the thesis' wrist frame. The joints
/// may come in any order; joints with other names are ignored. The radii are the rig's.
///
/// # Errors
/// The file is not a GLB with one skinned mesh, or a joint is missing.
pub fn read_skin(glb: &[u8], rig: &Rig) -> Result<Skin, HandError> {
    let file = gltf::Gltf::from_slice(glb)?;
    let blob = file.blob.as_deref().ok_or(HandError::Missing("binary chunk"))?;
    let (mesh, skin) = file
        .nodes()
        .find_map(|node| node.mesh().zip(node.skin()))
        .ok_or(HandError::Missing("skinned mesh"))?;
    let primitive = mesh.primitives().next().ok_or(HandError::Missing("triangles"))?;
    let reader = primitive.reader(|_| Some(blob));
    let positions: Vec<Vec3> = reader
        .read_positions()
        .ok_or(HandError::Missing("positions"))?
        .map(Vec3::from)
        .collect();
    let corners: Vec<u32> = reader
        .read_indices()
        .ok_or(HandError::Missing("triangle indices"))?
        .into_u32()
        .collect();
    let file_joints: Vec<[u16; 4]> = reader
        .read_joints(0)
        .ok_or(HandError::Missing("joint indices"))?
        .into_u16()
        .collect();
    let weights: Vec<[f32; 4]> = reader
        .read_weights(0)
        .ok_or(HandError::Missing("weights"))?
        .into_f32()
        .collect();
    let inverse_binds: Vec<Mat4> = skin
        .reader(|_| Some(blob))
        .read_inverse_bind_matrices()
        .ok_or(HandError::Missing("inverse bind matrices"))?
        .map(|columns| Mat4::from_cols_array_2d(&columns))
        .collect();

    // Maps the file's joint order to OpenXR's by name.
    let openxr_index: Vec<Option<usize>> = skin
        .joints()
        .map(|joint| {
            let name = joint.name()?;
            JOINT_NAMES.iter().position(|&known| known == name)
        })
        .collect();
    let bind = bind_joints(rig, &openxr_index, &inverse_binds)?;

    if corners.iter().any(|&v| v as usize >= positions.len()) || !corners.len().is_multiple_of(3) {
        return Err(HandError::Mismatch("triangle indices"));
    }
    if weights.len() != positions.len() || file_joints.len() != positions.len() {
        return Err(HandError::Mismatch("weights"));
    }
    let joint_indices = file_joints
        .iter()
        .zip(&weights)
        .map(|(joints, weights)| vertex_joints(*joints, *weights, &openxr_index))
        .collect::<Result<_, _>>()?;
    // The file uses the OpenXR frame of the wrist; the skin uses the thesis' frame at the same place.
    let wrist_from_file = openxr_from_thesis_frame(Pose::IDENTITY) * wrist_in_file(&bind).inverse();
    Ok(Skin {
        positions: positions
            .into_iter()
            .map(|p| wrist_from_file.transform_point(p))
            .collect(),
        triangles: corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        joint_indices,
        weights,
        bind: bind.transformed(wrist_from_file),
    })
}

fn wrist_in_file(bind: &HandJoints) -> Pose {
    bind.joints[index::WRIST].pose
}

/// The `OpenXR` indices of a vertex's joints; the index of a joint without weight is ignored.
fn vertex_joints(
    joints: [u16; 4],
    weights: [f32; 4],
    openxr_index: &[Option<usize>],
) -> Result<[u8; 4], HandError> {
    let mut found = [0; 4];
    for i in 0..4 {
        if weights[i] > 0.0 {
            let joint = openxr_index.get(usize::from(joints[i])).copied().flatten();
            found[i] = joint.ok_or(HandError::Mismatch("joint indices"))? as u8;
        }
    }
    Ok(found)
}

/// The joints in the bind pose, in the file's frame. The file has no palm joint, which is the centre of the middle
/// metacarpal.
fn bind_joints(
    rig: &Rig,
    openxr_index: &[Option<usize>],
    inverse_binds: &[Mat4],
) -> Result<HandJoints, HandError> {
    let mut poses: [Option<Pose>; JOINT_COUNT] = [None; JOINT_COUNT];
    for (joint, inverse_bind) in openxr_index.iter().zip(inverse_binds) {
        if let Some(joint) = *joint {
            let bind = Affine3A::from_mat4(inverse_bind.inverse());
            let (_, orientation, position) = bind.to_scale_rotation_translation();
            poses[joint] = Some(Pose {
                position,
                orientation: orientation.normalize(),
            });
        }
    }
    let middle = index::FIRST_OF_DIGIT[2];
    if let (Some(metacarpal), Some(knuckle)) = (poses[middle], poses[middle + 1]) {
        poses[index::PALM] = Some(Pose {
            position: metacarpal.position.midpoint(knuckle.position),
            orientation: metacarpal.orientation,
        });
    }
    let mut joints = [Joint {
        pose: Pose::IDENTITY,
        radius: 0.0,
    }; JOINT_COUNT];
    for (i, joint) in joints.iter_mut().enumerate() {
        *joint = Joint {
            pose: poses[i].ok_or(HandError::MissingJoint(JOINT_NAMES[i]))?,
            radius: rig.joint_radii[i],
        };
    }
    Ok(HandJoints {
        handedness: rig.handedness,
        joints,
    })
}
