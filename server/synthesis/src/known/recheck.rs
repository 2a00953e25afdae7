//! The checks of known grips that depend on the holdout: its barriers and the forces.

use super::{
    atlas::Atlas,
    entry::{Entry, nearest_direction},
};
use crate::{
    model::{grasp::Grasp, holdout::ArmPose, requirements::Check, strategy::Validity},
    physical::{
        contacts::soften,
        grip::{Gripper, clear_of_barriers},
        immobility::{FrictionUse, balance, balance_with},
        solids::TrackedSolids,
    },
    rating::{
        assessment::{GraspContext, unscored_grasp},
        scoring::score,
    },
};

/// Checks known grips of an object against one holdout.
#[derive(Clone, Copy, Debug)]
pub struct GripChecker<'a> {
    around: GraspContext<'a>,
    /// The nearest of [`super::entry::DIRECTIONS`] to the one against gravity.
    direction: usize,
    /// True if the friction differs from that of the grips' evaluation.
    friction_differs: bool,
}

impl<'a> GripChecker<'a> {
    /// Prepares checks of grips of an atlas or of no atlas.
    pub fn new(around: GraspContext<'a>, atlas: Option<&Atlas>) -> Self {
        let (object, presented) = (around.object, around.presented);
        Self {
            around,
            direction: atlas.map_or_else(
                || nearest_direction(presented.up),
                |atlas| atlas.direction(presented.up),
            ),
            friction_differs: object.friction != object.object.friction_under(Validity::Physical),
        }
    }

    /// The grasp of a known grip for the holdout, with its score; `None` if it does not meet the requirements, is too close to a
    /// barrier, or the object slips. `solids` are the grip's, from [`Entry::tracked_solids`].
    pub fn check(&self, entry: &Entry, solids: &TrackedSolids, gripper: &mut Gripper) -> Option<Box<Grasp>> {
        let requirements = self.around.requirements;
        if !entry.meets(requirements) {
            return None;
        }
        let grasp = self.check_holdout(entry, solids, gripper).ok()?;
        requirements.admits(&grasp).then(|| Box::new(grasp))
    }

    pub(crate) fn check_holdout(
        &self,
        entry: &Entry,
        solids: &TrackedSolids,
        gripper: &mut Gripper,
    ) -> Result<Grasp, Check> {
        let (scene, presented) = (&self.around.object, self.around.presented);
        if !self.around.is_not_banned(entry.grip.pose.frame_from_wrist) {
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
        // Gravity is up to 18° from the direction of the stored friction use: less may do here.
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
        grasp.score = Some(score(
            entry.grip_values,
            &grasp,
            scene,
            self.around.rig,
            presented,
        ));
        Ok(grasp)
    }

    pub(crate) fn arm(&self, entry: &Entry) -> Result<Option<ArmPose>, Check> {
        let arm = self.around.required_arm(entry.grip.pose.frame_from_wrist);
        self.around
            .is_reached(arm.as_ref())
            .then_some(arm)
            .ok_or(Check::Reach)
    }
}
