//! One attempt at a grasp under `PHYSICAL` validity: a grip that holds what is presented.

use crate::{
    base::{random::AttemptStream, rejection::Rejection, stopwatch::Stopwatch},
    model::grasp::Grasp,
    physical::{
        grip::{Gripper, NoGrip},
        shape::Proposal,
    },
    rating::assessment::GraspContext,
};

/// How many hands are tried in vain beside one that nearly held. Of hands beside a near miss on scissors, one or two in a
/// hundred hold, of those that are proposed evenly, one in four hundred; on what is easy to hold, as many of both. With twice
/// as many, grasps of thin objects are found up to a tenth sooner, those of others a tenth to a fifth later.
const PATIENCE: usize = 4;

/// The hand of an attempt, as far as it came, and its buffers.
#[derive(Clone, Debug, Default)]
pub struct PhysicalAttempt {
    /// Closes the hand.
    pub gripper: Gripper,
}

impl PhysicalAttempt {
    /// Everything after a hand was proposed; of one that has nearly enough closure, others beside it are tried, each beside
    /// the one that had most.
    ///
    /// # Errors
    /// The first check that the proposed hand fails, an unmet constraint if that is all that another one fails, or the stop
    /// signal.
    pub fn hold_or_refine(
        &mut self,
        around: &GraspContext<'_>,
        proposal: &Proposal,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> Result<Box<Grasp>, NoGrip> {
        let mut refused = self.hold(around, proposal, stopwatch, interrupted);
        let (Err(NoGrip::Rejected(_)), Some(share)) = (&refused, self.gripper.near_miss()) else {
            return refused;
        };
        // What is told of a hand that fails is the proposed one's.
        let posed = self.gripper.posed.clone();
        let mut nearest = (share, *proposal);
        let mut in_vain = 0;
        while in_vain < PATIENCE {
            in_vain += 1;
            let perturbed = nearest.1.perturbed(stream);
            match self.hold(around, &perturbed, stopwatch, interrupted) {
                // It holds, and is not wanted so.
                Err(NoGrip::Rejected(Rejection::UnmetConstraint)) => {
                    refused = Err(NoGrip::Rejected(Rejection::UnmetConstraint));
                    break;
                }
                Err(NoGrip::Rejected(_)) => {}
                end => return end,
            }
            if let Some(share) = self.gripper.near_miss().filter(|&share| share > nearest.0) {
                nearest = (share, perturbed);
                in_vain = 0;
            }
        }
        self.gripper.posed = posed;
        refused
    }

    /// Everything after a hand was proposed.
    ///
    /// # Errors
    /// The first check that fails, or the stop signal.
    pub fn hold(
        &mut self,
        around: &GraspContext<'_>,
        proposal: &Proposal,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> Result<Box<Grasp>, NoGrip> {
        let GraspContext {
            object,
            presented,
            rig,
            ..
        } = around;
        let (grip, solids) =
            self.gripper
                .grip(object, rig, proposal, Some(presented), stopwatch, interrupted)?;
        around.assess(&grip, &solids, &mut self.gripper, stopwatch)
    }
}
