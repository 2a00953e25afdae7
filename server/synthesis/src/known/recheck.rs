//! The checks of known grips that depend on the holdout: its barriers and the forces.

use super::{atlas::Atlas, entry::Entry, gravity::nearest_direction};
use crate::{
    model::{grasp::Grasp, hand::rig::Rig, holdout::ArmPose, requirements::Check, strategy::Validity},
    physical::{
        contacts::soften,
        grip::{Gripper, clear_of_barriers},
        immobility::{FrictionUse, balance, balance_with},
        presented::{ObjectScene, Presented},
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
        }
    }

    /// The same for the grips of an atlas.
    #[must_use]
    pub fn of_atlas(self, atlas: Option<&Atlas>) -> Self {
        Self {
            direction: atlas.map_or(self.direction, |atlas| atlas.direction(self.presented.up)),
            ..self
        }
    }

    /// The grasp of a known grip for the holdout, with its score; `None` if it is too close to a barrier or the
    /// object slips. `solids` are the grip's, from [`Entry::tracked_solids`].
    pub fn check(&self, entry: &Entry, solids: &TrackedSolids, gripper: &mut Gripper) -> Option<Grasp> {
        self.try_check(entry, solids, gripper).ok()
    }

    /// The same.
    ///
    /// # Errors
    /// The first check that the grip fails.
    pub fn try_check(
        &self,
        entry: &Entry,
        solids: &TrackedSolids,
        gripper: &mut Gripper,
    ) -> Result<Grasp, Check> {
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
            return Err(Check::Banned);
        }
        let clearances = clear_of_barriers(solids, presented.barriers()).ok_or(Check::GiverClearance)?;
        soften(&entry.contacts, scene.friction, &mut gripper.soft_contacts);
        let load = scene.load(&gripper.soft_contacts, presented.up);
        let known_use = if self.friction_differs {
            FrictionUse::default()
        } else {
            entry.friction_uses.get(self.direction)
        };
        let held = balance_with(&gripper.soft_contacts, &load, known_use, &mut gripper.buffers)
            .ok_or(Check::Balance)?;
        let epsilon = if self.friction_differs {
            gripper.closure(scene).ok_or(Check::Balance)?
        } else {
            entry.grip.epsilon
        };
        let arm = self.arm(entry)?;
        // Gravity is up to 18° from where the use is known from: less may do here, as for the same hand without an atlas.
        let held = if known_use == FrictionUse::Low {
            held
        } else {
            balance(&gripper.soft_contacts, &load, &mut gripper.buffers).unwrap_or(held)
        };
        let mut grasp = unscored_grasp(
            &entry.grip,
            &entry.contacts,
            entry.classification,
            epsilon,
            held,
            presented,
            clearances,
        );
        grasp.arm = arm;
        grasp.score = Some(score(entry.grip_values, &grasp, scene, rig, presented));
        Ok(grasp)
    }

    /// The receiver's arm, if it must reach the grip.
    ///
    /// # Errors
    /// [`Check::Reach`] if it does not.
    pub fn arm(&self, entry: &Entry) -> Result<Option<ArmPose>, Check> {
        let Self {
            scene,
            rig,
            presented,
            ..
        } = *self;
        if !presented.receiver.must_reach() {
            return Ok(None);
        }
        let arm = presented.arm_of(scene.object, rig, entry.grip.pose.frame_from_wrist);
        arm.map(Some).ok_or(Check::Reach)
    }
}
