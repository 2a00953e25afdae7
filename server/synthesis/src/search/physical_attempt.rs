//! One attempt at a grasp under `PHYSICAL` validity.

use crate::{
    base::{
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::Stop,
        stopwatch::Stopwatch,
    },
    model::grasp::Grasp,
    physical::{grip::Gripper, shape::Proposal},
    rating::assessment::GraspContext,
};

/// Consecutive perturbations without improvement after which a near miss is given up. More find grasps of
/// thin objects sooner and those of others later.
const MAX_FAILED_REFINEMENTS: usize = 4;

/// The hand of an attempt, as far as it got, and its buffers.
#[derive(Clone, Debug)]
pub struct PhysicalAttempt {
    /// Closes the hand.
    pub gripper: Gripper,
}

impl Default for PhysicalAttempt {
    fn default() -> Self {
        Self {
            gripper: Gripper::answering(),
        }
    }
}

impl PhysicalAttempt {
    /// Closes and checks a proposed hand. If it nearly has enough closure, perturbs it repeatedly, each time
    /// from the hand with most closure so far.
    ///
    /// # Errors
    /// The first check that the proposed hand fails, an unmet requirement if a perturbed hand fails nothing
    /// else, or the stop signal.
    pub fn hold_or_refine(
        &mut self,
        around: &GraspContext<'_>,
        proposal: &Proposal,
        stream: &mut AttemptStream,
        stopwatch: &mut Stopwatch<'_>,
        stop: Stop<'_>,
    ) -> Result<Box<Grasp>, Failure> {
        let mut rejected = self.hold(around, proposal, stopwatch, stop);
        let (Err(Failure::Rejected { .. }), Some(share)) = (&rejected, self.gripper.near_miss()) else {
            return rejected;
        };
        // A failed attempt reports the proposed hand, not a perturbed one.
        let posed = self.gripper.posed.clone();
        let mut nearest = (share, *proposal);
        let mut failures = 0;
        while failures < MAX_FAILED_REFINEMENTS {
            failures += 1;
            let perturbed = nearest.1.perturbed(stream);
            match self.hold(around, &perturbed, stopwatch, stop) {
                // The hand holds, but not as the requirements demand.
                Err(unmet) if unmet == Rejection::UnmetRequirement.into() => {
                    rejected = Err(unmet);
                    break;
                }
                Err(Failure::Rejected { .. }) => {}
                end => return end,
            }
            if let Some(share) = self.gripper.near_miss().filter(|&share| share > nearest.0) {
                nearest = (share, perturbed);
                failures = 0;
            }
        }
        self.gripper.posed = posed;
        rejected
    }

    /// Closes and checks a proposed hand.
    ///
    /// # Errors
    /// The first check that fails, or the stop signal.
    pub fn hold(
        &mut self,
        around: &GraspContext<'_>,
        proposal: &Proposal,
        stopwatch: &mut Stopwatch<'_>,
        stop: Stop<'_>,
    ) -> Result<Box<Grasp>, Failure> {
        let GraspContext {
            object,
            presented,
            rig,
            ..
        } = around;
        let (grip, solids) = self
            .gripper
            .grip(object, rig, proposal, Some(presented), stopwatch, stop)?;
        Ok(around.assess(&grip, &solids, &mut self.gripper, stopwatch)?)
    }
}
