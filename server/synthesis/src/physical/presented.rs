//! The setting in which a grip is judged: the object with its friction, and the rest of its holdout.

use std::sync::Arc;

use glam::Vec3;

use super::{
    barriers::{Barriers, PreparedObstacle},
    immobility::{Load, SoftContact, TorqueScale},
    receiver::Receiver,
    solids::{PreparedHand, TrackedSolids},
};
use crate::{
    base::pose::Pose,
    model::{
        hand::rig::Rig,
        holdout::{ArmPose, HandMesh, HandShape, Holdout},
        object::GraspObject,
    },
};

/// Smallest Ferrari-Canny epsilon of a valid grasp, without unit, for objects that fingers reach around.
const MIN_EPSILON: f32 = 0.02;

/// Required share of the best epsilon that a thin part allows: only friction at its radius keeps a rod from rolling.
const MIN_SHARE_OF_BEST: f32 = 0.25;

/// An object to be grasped, under the friction between it and the skin.
#[derive(Clone, Copy, Debug)]
pub struct ObjectScene<'a> {
    /// The object.
    pub object: &'a GraspObject,
    /// Coefficient of static friction between skin and object.
    pub friction: f32,
}

impl<'a> ObjectScene<'a> {
    /// The object with a friction coefficient between skin and surface.
    pub fn new(object: &'a GraspObject, friction: f32) -> Self {
        Self { object, friction }
    }

    /// The load on contacts when `up`, a unit vector in the object's frame, points against gravity.
    pub fn load(&self, contacts: &[SoftContact], up: Vec3) -> Load {
        Load {
            mass: self.object.mass,
            centre_of_mass: self.object.centre_of_mass,
            up,
            torque_scale: TorqueScale::of(contacts),
        }
    }

    /// Smallest Ferrari-Canny epsilon of a valid grip whose torques are measured by `scale`. It depends on the object only
    /// where the hand is.
    pub fn required_epsilon(&self, scale: &TorqueScale) -> f32 {
        let best = self.friction * self.object.local_thickness.near(scale.centre) / scale.length;
        MIN_EPSILON.min(MIN_SHARE_OF_BEST * best)
    }
}

/// The holdout apart from its object: the giver, other barriers, and the direction of gravity.
#[derive(Clone, Debug)]
pub struct Presented {
    /// The hands in the object's frame, the giver's first.
    pub hands: Vec<PreparedHand>,
    /// The hands that have a mesh; the others are exact as solids.
    pub meshes: Vec<Arc<HandMesh>>,
    /// Obstacles.
    pub obstacles: Vec<PreparedObstacle>,
    /// Centre of the giver's palm, in metres, in the object's frame.
    pub giver_palm: Option<Vec3>,
    /// The receiver.
    pub receiver: Receiver,
    /// Unit vector against gravity, in the object's frame.
    pub up: Vec3,
}

impl Presented {
    /// The giver and gravity of a holdout.
    pub fn of(holdout: &Holdout) -> Self {
        let prepared = |shape: &HandShape| match shape {
            HandShape::Joints(joints) => PreparedHand::new(&TrackedSolids::of_joints(joints)),
            HandShape::Mesh(mesh) => PreparedHand::inside(mesh),
        };
        let giver = holdout.presenting_hand.as_ref();
        let shapes = giver.map(|hand| &hand.shape).into_iter();
        let shapes = shapes.chain(&holdout.other_hands);
        let meshes = shapes.clone().filter_map(|shape| match shape {
            HandShape::Joints(_) => None,
            HandShape::Mesh(mesh) => Some(Arc::clone(mesh)),
        });
        Self {
            hands: shapes.map(prepared).collect(),
            meshes: meshes.collect(),
            obstacles: holdout.obstacles.iter().map(PreparedObstacle::new).collect(),
            giver_palm: giver.map(|hand| hand.palm),
            receiver: Receiver::new(
                holdout.stance,
                giver.and_then(|hand| hand.shape.wrist()),
                holdout.object.centre_of_mass,
                holdout.up,
            ),
            up: holdout.up,
        }
    }

    /// Gravity alone, with `up` the unit vector against it.
    pub fn alone(up: Vec3) -> Self {
        Self {
            hands: Vec::new(),
            meshes: Vec::new(),
            obstacles: Vec::new(),
            giver_palm: None,
            receiver: Receiver::ANYWHERE,
            up,
        }
    }

    /// The same without barriers.
    #[must_use]
    pub(crate) fn without_barriers(&self) -> Self {
        Self {
            giver_palm: self.giver_palm,
            receiver: self.receiver.clone(),
            ..Self::alone(self.up)
        }
    }

    /// The receiver's arm of a hand at the object with this wrist pose; `None` if the receiver's place is unknown, or if the arm
    /// does not reach the wrist clear of object and barriers.
    pub fn arm_of(&self, object: &GraspObject, rig: &Rig, object_from_wrist: Pose) -> Option<ArmPose> {
        self.receiver
            .arm(rig, object_from_wrist, &object.surface, self.barriers())
    }

    /// The barriers that a hand keeps clear of.
    pub fn barriers(&self) -> Barriers<'_> {
        Barriers {
            hands: &self.hands,
            meshes: &self.meshes,
            obstacles: &self.obstacles,
        }
    }
}
