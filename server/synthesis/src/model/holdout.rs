//! Holdouts: an object, how it hangs in the world, and the giver's hand.

use std::sync::Arc;

use glam::Vec3;

use super::{
    hand::{joints::HandJoints, skin::Skin},
    object::GraspObject,
};
use crate::{
    base::pose::Pose,
    geometry::{
        mesh::{MeshError, TriangleMesh},
        mesh_bvh::MeshBvh,
    },
};

/// The giver's hand, posed, in the object's frame.
#[derive(Clone, Debug)]
pub struct PresentingHand {
    /// Its joints.
    pub joints: HandJoints,
    /// Its posed skin and search structure; none where grasps are judged by solids alone, as under `PHYSICAL` validity.
    pub surface: Option<MeshBvh>,
    /// The middle of its palm's skin.
    pub palm: Vec3,
}

/// What is held out to the receiver, in the object's frame.
#[derive(Clone, Debug)]
pub struct Holdout {
    /// The object.
    pub object: Arc<GraspObject>,
    /// The giver's hand; none for an object that floats freely.
    pub presenting_hand: Option<PresentingHand>,
    /// Against gravity: a unit vector.
    pub up: Vec3,
}

/// Why a presenting hand was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PresentingHandError {
    /// The joints collapse the skin.
    #[error("the joint poses fold the skin into triangles without area")]
    Collapsed,
    /// A joint is not a number, or so far away that the skin is not.
    #[error(
        "the joint poses put vertex {vertex} of the skin at infinity; they must be finite and near the object"
    )]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The skin itself is broken.
    #[error("the skin is not a mesh: {0}")]
    Skin(MeshError),
}

/// Why a holdout was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HoldoutError {
    /// Up is not a direction.
    #[error("up is {0}; it must be a unit vector")]
    Up(Vec3),
}

impl Holdout {
    /// An object held out, with everything in its own frame; `up` points against gravity.
    ///
    /// # Errors
    /// `up` is not a unit vector.
    pub fn new(
        object: Arc<GraspObject>,
        presenting_hand: Option<PresentingHand>,
        up: Vec3,
    ) -> Result<Self, HoldoutError> {
        if !up.is_normalized() {
            return Err(HoldoutError::Up(up));
        }
        Ok(Self {
            object,
            presenting_hand,
            up,
        })
    }
}

impl PresentingHand {
    /// Poses a skin on joints that are given in the object's frame. Triangles that the pose collapses are left out.
    ///
    /// # Errors
    /// The joints collapse the whole skin or are not finite.
    pub fn new(skin: &Skin, joints: HandJoints) -> Result<Self, PresentingHandError> {
        let mesh =
            TriangleMesh::without_degenerates(skin.posed(&joints), &skin.triangles).map_err(|error| {
                match error {
                    MeshError::Empty => PresentingHandError::Collapsed,
                    MeshError::NotFinite { vertex } => PresentingHandError::NotFinite { vertex },
                    broken @ (MeshError::IndexOutOfRange { .. } | MeshError::Degenerate { .. }) => {
                        PresentingHandError::Skin(broken)
                    }
                }
            })?;
        Ok(Self {
            palm: joints.palm_skin(),
            joints,
            surface: Some(MeshBvh::build_quick(mesh)),
        })
    }

    /// A hand without skin, for `PHYSICAL` validity: its solids follow its joints, which are given in the object's frame
    /// and are finite. A thousandth of the work.
    pub fn of_joints(joints: HandJoints) -> Self {
        Self {
            palm: joints.palm_skin(),
            joints,
            surface: None,
        }
    }

    /// The same for joints in another frame.
    ///
    /// # Errors
    /// The joints collapse the whole skin or are not finite.
    pub fn in_frame(
        skin: &Skin,
        joints: &HandJoints,
        object_from_frame: Pose,
    ) -> Result<Self, PresentingHandError> {
        Self::new(skin, joints.transformed(object_from_frame))
    }
}
