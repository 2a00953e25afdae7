//! What is left to check of known grips when an object is held out.

use super::{entry::Entry, gravity::nearest};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    model::{grasp::Grasp, hand::rig::Rig, strategy::Validity},
    physical::{
        contacts::soften,
        grip::{Gripper, clear_of_giver},
        immobility::{FrictionUse, balance_with},
        scene::{ObjectScene, Presented},
        solids::TrackedSolids,
    },
    rating::{assessment::unscored_grasp, scoring::score},
};

/// An object that is held out, as known grips are asked to hold it.
#[derive(Clone, Copy, Debug)]
pub struct Recheck<'a> {
    scene: &'a ObjectScene<'a>,
    rig: &'a Rig,
    presented: &'a Presented,
    /// The direction of [`super::gravity::DIRECTIONS`] that gravity's is nearest to.
    direction: usize,
    /// Is the friction another than the one that grips are known under?
    friction_differs: bool,
    /// Is the friction that they use known from before?
    knows_friction_uses: bool,
}

impl<'a> Recheck<'a> {
    /// Asks grips of an object and a rig.
    pub fn new(scene: &'a ObjectScene<'a>, rig: &'a Rig, presented: &'a Presented) -> Self {
        let friction_differs = scene.friction != scene.object.friction_under(Validity::Physical);
        Self {
            scene,
            rig,
            presented,
            direction: nearest(presented.up),
            friction_differs,
            knows_friction_uses: !friction_differs,
        }
    }

    /// The same by some of the mechanisms.
    #[must_use]
    pub(crate) fn with_mechanisms(self, mechanisms: Mechanisms) -> Self {
        Self {
            knows_friction_uses: self.knows_friction_uses && mechanisms.has(Mechanism::FrictionUses),
            ..self
        }
    }

    /// The grasp that a grip is for what is presented, with its score; none if it comes too near to the giver or the object
    /// slips. `solids` are the grip's, as [`Entry::tracked_solids`] gives them.
    pub fn hold(&self, entry: &Entry, solids: &TrackedSolids, gripper: &mut Gripper) -> Option<Grasp> {
        let Self {
            scene,
            rig,
            presented,
            ..
        } = *self;
        let giver_clearance = clear_of_giver(solids, presented.giver.as_ref())?;
        soften(&entry.contacts, scene.friction, &mut gripper.soft_contacts);
        let load = scene.load(presented.up);
        let least_use = if self.knows_friction_uses {
            entry.friction_uses.get(self.direction)
        } else {
            FrictionUse::default()
        };
        let balance = balance_with(&gripper.soft_contacts, &load, least_use, &mut gripper.buffers)?;
        let epsilon = if self.friction_differs {
            gripper.closure(scene)?
        } else {
            entry.grip.epsilon
        };
        let mut grasp = unscored_grasp(
            &entry.grip,
            &entry.contacts,
            entry.classification,
            epsilon,
            balance,
            presented,
            giver_clearance,
        );
        grasp.score = Some(score(entry.grip_values, &grasp, scene, rig, presented));
        Some(grasp)
    }
}
