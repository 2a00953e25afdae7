//! Holdouts: an object held out to the receiver, the up direction, the giver's hand, and what else is near.

use std::sync::Arc;

use glam::Vec3;

use super::{
    hand::{
        joints::{HandJoints, index},
        mesh::HandMesh,
        skin::Skin,
    },
    object::GraspObject,
    obstacle::Obstacle,
    receiver::Stance,
};
use crate::{
    base::pose::Pose,
    geometry::{
        mesh::{MeshError, TriangleMesh},
        mesh_bvh::MeshBvh,
    },
};

/// Another person's hand, posed, in the object's frame.
#[derive(Clone, Debug)]
pub enum HandShape {
    /// Its joints.
    Joints(Box<HandJoints>),
    /// Its mesh.
    Mesh(Arc<HandMesh>),
}

/// The giver's hand, posed, in the object's frame.
#[derive(Clone, Debug)]
pub struct PresentingHand {
    /// Its shape.
    pub shape: HandShape,
    /// The posed skin of joints, with search structure; none under `PHYSICAL` validity, which uses the hand's solids alone.
    pub skin: Option<MeshBvh>,
    /// The centre of the palm's skin, in metres.
    pub palm: Vec3,
}

/// An object held out to the receiver, in the object's frame.
#[derive(Clone, Debug)]
pub struct Holdout {
    /// The object.
    pub object: Arc<GraspObject>,
    /// The giver's hand; `None` for an object that floats freely.
    pub presenting_hand: Option<PresentingHand>,
    /// Further hands to keep clear of. `THESIS` validity knows the presenting hand only.
    pub other_hands: Vec<HandShape>,
    /// Obstacles to keep clear of. `THESIS` validity knows none.
    pub obstacles: Vec<Obstacle>,
    /// Where the receiver's arm may come from. `THESIS` validity does not ask.
    pub stance: Stance,
    /// The direction against gravity, a unit vector.
    pub up: Vec3,
}

/// Why a presenting hand was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PresentingHandError {
    /// The joints collapse every triangle of the skin.
    #[error("the joint poses fold the skin into triangles without area")]
    Collapsed,
    /// A joint is not finite, or so far away that the skin is not.
    #[error(
        "the joint poses put vertex {vertex} of the skin at infinity; they must be finite and near the object"
    )]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The skin itself is invalid.
    #[error("the skin is not a mesh: {0}")]
    Skin(MeshError),
}

/// Why a holdout was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HoldoutError {
    /// Up is not a unit vector.
    #[error("up is {0}; it must be a unit vector")]
    Up(Vec3),
}

impl Holdout {
    /// A holdout with everything in the object's frame, without further hands or obstacles, to a receiver who faces the giver;
    /// `up` points against gravity.
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
            other_hands: Vec::new(),
            obstacles: Vec::new(),
            stance: Stance::default(),
            up,
        })
    }
}

impl HandShape {
    /// The wrist's `OpenXR` joint frame, if it is known.
    pub fn wrist(&self) -> Option<Pose> {
        match self {
            Self::Joints(joints) => Some(joints.joints[index::WRIST].pose),
            Self::Mesh(mesh) => mesh.wrist,
        }
    }

    /// The joints, if they are known.
    pub fn joints(&self) -> Option<&HandJoints> {
        match self {
            Self::Joints(joints) => Some(joints),
            Self::Mesh(_) => None,
        }
    }
}

impl PresentingHand {
    /// Poses a skin on joints in the object's frame. Triangles that the pose collapses are dropped.
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
            shape: HandShape::Joints(Box::new(joints)),
            skin: Some(MeshBvh::build_quick(mesh)),
        })
    }

    /// A hand without skin, for `PHYSICAL` validity, whose solids follow from the joints alone: a thousandth of the
    /// work. The joints must be finite and in the object's frame.
    pub fn of_joints(joints: HandJoints) -> Self {
        Self {
            palm: joints.palm_skin(),
            shape: HandShape::Joints(Box::new(joints)),
            skin: None,
        }
    }

    /// A hand of which only the mesh is known, for either validity.
    pub fn of_mesh(mesh: Arc<HandMesh>) -> Self {
        Self {
            palm: mesh.palm(),
            shape: HandShape::Mesh(mesh),
            skin: None,
        }
    }

    /// Its surface with search structure, which `THESIS` validity requires.
    pub fn surface(&self) -> Option<&MeshBvh> {
        match &self.shape {
            HandShape::Joints(_) => self.skin.as_ref(),
            HandShape::Mesh(mesh) => Some(&mesh.surface),
        }
    }

    /// As [`PresentingHand::new`], for joints in another frame.
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
