//! The checks of known grips that depend on the holdout: its barriers and the forces.

use super::{entry::Entry, gravity::nearest_direction};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    model::{grasp::Grasp, hand::rig::Rig, strategy::Validity},
    physical::{
        contacts::soften,
        grip::{Gripper, clear_of_barriers},
        immobility::{FrictionUse, balance_with},
        scene::{ObjectScene, Presented},
        solids::TrackedSolids,
    },
    rating::{assessment::unscored_grasp, scoring::score},
};

/// Checks known grips of an object against one holdout.
#[derive(Clone, Copy, Debug)]
pub struct GripChecker<'a> {
    scene: &'a ObjectScene<'a>,
    rig: &'a Rig,
    presented: &'a Presented,
    /// The nearest of [`super::gravity::DIRECTIONS`] to the one against gravity.
    direction: usize,
    /// Does the friction differ from the one that the grips were evaluated under?
    friction_differs: bool,
    /// Do the grips' stored friction uses apply?
    knows_friction_uses: bool,
}

impl<'a> GripChecker<'a> {
    /// Prepares checks of grips of an object and a rig.
    pub fn new(scene: &'a ObjectScene<'a>, rig: &'a Rig, presented: &'a Presented) -> Self {
        let friction_differs = scene.friction != scene.object.friction_under(Validity::Physical);
        Self {
            scene,
            rig,
            presented,
            direction: nearest_direction(presented.up),
            friction_differs,
            knows_friction_uses: !friction_differs,
        }
    }

    /// The same with some mechanisms switched off.
    #[must_use]
    pub(crate) fn with_mechanisms(self, mechanisms: Mechanisms) -> Self {
        Self {
            knows_friction_uses: self.knows_friction_uses && mechanisms.has(Mechanism::FrictionUses),
            ..self
        }
    }

    /// The grasp of a known grip for the holdout, with its score; none if it is too close to a barrier or the
    /// object slips. `solids` are the grip's, from [`Entry::tracked_solids`].
    pub fn check(&self, entry: &Entry, solids: &TrackedSolids, gripper: &mut Gripper) -> Option<Grasp> {
        let Self {
            scene,
            rig,
            presented,
            ..
        } = *self;
        if !scene
            .object
            .admits_wrist(rig.handedness, entry.grip.pose.frame_from_wrist)
        {
            return None;
        }
        let clearances = clear_of_barriers(solids, presented.barriers())?;
        soften(&entry.contacts, scene.friction, &mut gripper.soft_contacts);
        let load = scene.load(&gripper.soft_contacts, presented.up);
        let known_use = if self.knows_friction_uses {
            entry.friction_uses.get(self.direction)
        } else {
            FrictionUse::default()
        };
        let balance = balance_with(&gripper.soft_contacts, &load, known_use, &mut gripper.buffers)?;
        let epsilon = if self.friction_differs {
            gripper.closure(scene)?
        } else {
            entry.grip.epsilon
        };
        let must_reach = presented.receiver.must_reach();
        let arm = must_reach.then(|| presented.arm_of(scene.object, rig, entry.grip.pose.frame_from_wrist));
        let arm = match arm {
            Some(None) => return None,
            reached => reached.flatten(),
        };
        let mut grasp = unscored_grasp(
            &entry.grip,
            &entry.contacts,
            entry.classification,
            epsilon,
            balance,
            presented,
            clearances,
        );
        grasp.arm = arm;
        grasp.score = Some(score(entry.grip_values, &grasp, scene, rig, presented));
        Some(grasp)
    }
}
