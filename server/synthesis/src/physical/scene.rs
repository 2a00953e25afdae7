//! What grips and holds are judged by: the object under a friction, and what a holdout adds to it.

use glam::Vec3;

use super::{
    immobility::Load,
    solids::{PreparedHand, TrackedSolids},
};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    model::{holdout::Holdout, object::GraspObject},
};

/// Smallest Ferrari-Canny epsilon of a grasp on an object that fingers get round. In a simulation, grasps above 0.02 did
/// not fall under gravity and half of them held against pulls in all directions. A higher one gives firmer grasps and
/// finds fewer.
const LEAST_EPSILON: f32 = 0.02;

/// Of the epsilon that a thin object allows at best, the share that a grasp must have: a rod can only be kept from rolling
/// by friction at its radius, however it is held.
const LEAST_SHARE_OF_BEST: f32 = 0.25;

/// An object as something to hold: everything that does not depend on how it is held out.
#[derive(Clone, Copy, Debug)]
pub struct ObjectScene<'a> {
    /// The object.
    pub object: &'a GraspObject,
    /// Coefficient of static friction between skin and object.
    pub friction: f32,
    /// Half the diagonal of its box, in metres: how far from the middle a force can act.
    pub characteristic_length: f32,
    /// The closure that a grip must have.
    pub least_epsilon: f32,
}

impl<'a> ObjectScene<'a> {
    /// The object under a friction.
    pub fn new(object: &'a GraspObject, friction: f32) -> Self {
        let half_extents = object.bounding_box.half_extents;
        let characteristic_length = half_extents.length();
        // The mean of the two smaller ones: how far from its long axis the surface is.
        let thickness = 0.5 * (half_extents.element_sum() - half_extents.max_element());
        let best = friction * thickness / characteristic_length;
        Self {
            object,
            friction,
            characteristic_length,
            least_epsilon: LEAST_EPSILON.min(LEAST_SHARE_OF_BEST * best),
        }
    }

    /// What the contacts have to hold when `up` is against gravity.
    pub fn load(&self, up: Vec3) -> Load {
        Load {
            mass: self.object.mass,
            centre_of_mass: self.object.centre_of_mass,
            up,
            characteristic_length: self.characteristic_length,
        }
    }
}

/// What a holdout adds to its object.
#[derive(Clone, Debug)]
pub struct Presented {
    /// The giver's hand, in the object's frame.
    pub giver: Option<PreparedHand>,
    /// The middle of the giver's palm, in metres.
    pub giver_palm: Option<Vec3>,
    /// Unit vector against gravity, in the object's frame.
    pub up: Vec3,
}

impl Presented {
    /// How the object of a holdout is presented.
    pub fn of(holdout: &Holdout) -> Self {
        Self::of_with(Mechanisms::ALL, holdout)
    }

    /// [`Presented::of`] by some of the mechanisms.
    pub(crate) fn of_with(mechanisms: Mechanisms, holdout: &Holdout) -> Self {
        let prepared = |solids: &TrackedSolids| {
            if mechanisms.has(Mechanism::GiverOrder) {
                PreparedHand::new(solids)
            } else {
                PreparedHand::in_anatomical_order(solids)
            }
        };
        let giver = holdout.presenting_hand.as_ref();
        Self {
            giver: giver.map(|hand| prepared(&TrackedSolids::of_joints(&hand.joints))),
            giver_palm: giver.map(|hand| hand.palm),
            up: holdout.up,
        }
    }
}
