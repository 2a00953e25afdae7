//! One attempt at a grasp under `PHYSICAL` validity: a grip that holds what is presented.

use super::{
    grip::{Grip, Gripper, NoGrip, clear_of_giver},
    immobility::{Balance, balance},
    scene::{ObjectScene, Presented},
    shape::Proposal,
    solids::{HandSolids, ToldSolids},
};
use crate::{
    constraints::Constraints,
    grasp::{Contact, Grasp, PhysicalMargins},
    hand::rig::Rig,
    rejection::Rejection,
    score::{grip_values, score},
    synthesis::{
        comfort::{comfort, digit_totals},
        random::AttemptStream,
        stopwatch::{Step, Stopwatch},
    },
    taxonomy::{Classification, classify},
};

/// What an attempt works with.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// The object.
    pub object: ObjectScene<'a>,
    /// How it is held out.
    pub presented: &'a Presented,
    /// The receiving hand.
    pub rig: &'a Rig,
    /// What is demanded of the grasp, in the object's frame.
    pub constraints: &'a Constraints,
}

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
        around: &Surroundings<'_>,
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
            let beside = nearest.1.beside(stream);
            match self.hold(around, &beside, stopwatch, interrupted) {
                // It holds, and is not wanted so.
                Err(NoGrip::Rejected(Rejection::UnmetConstraint)) => {
                    refused = Err(NoGrip::Rejected(Rejection::UnmetConstraint));
                    break;
                }
                Err(NoGrip::Rejected(_)) => {}
                end => return end,
            }
            if let Some(share) = self.gripper.near_miss().filter(|&share| share > nearest.0) {
                nearest = (share, beside);
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
        around: &Surroundings<'_>,
        proposal: &Proposal,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> Result<Box<Grasp>, NoGrip> {
        let Surroundings {
            object,
            presented,
            rig,
            ..
        } = around;
        let (grip, solids) =
            self.gripper
                .grip(object, rig, proposal, Some(presented), stopwatch, interrupted)?;
        around.hold_with(&grip, &solids, &mut self.gripper, stopwatch)
    }
}

impl Surroundings<'_> {
    /// The grasp that a grip is here which a gripper has just made.
    ///
    /// # Errors
    /// The first check that fails.
    pub(crate) fn hold_with(
        &self,
        grip: &Grip,
        solids: &HandSolids,
        gripper: &mut Gripper,
        stopwatch: &mut impl Stopwatch,
    ) -> Result<Box<Grasp>, NoGrip> {
        let Self {
            object,
            presented,
            rig,
            constraints,
        } = self;
        let contacts = &gripper.contacts;
        let classification = classify(rig, &grip.pose, contacts);
        if !constraints.admits_contacts(contacts) || !constraints.admits_type(classification.grasp_type) {
            return Err(NoGrip::Rejected(Rejection::UnmetConstraint));
        }

        // Step 5, Immobility Validation, for what is held as it is held out.
        let load = object.load(presented.up);
        let held = balance(&gripper.soft_contacts, &load, &mut gripper.buffers);
        stopwatch.lap(Step::ImmobilityValidation);
        let balance = held.ok_or(NoGrip::Rejected(Rejection::NotImmobilizing))?;
        let told = ToldSolids::of_rig(rig, grip.pose.frame_from_wrist, solids);
        let giver_clearance = clear_of_giver(&told, presented.giver.as_ref());
        let giver_clearance = giver_clearance.ok_or(NoGrip::Rejected(Rejection::FingerCollision))?;
        let mut grasp = grasp(
            grip,
            &gripper.contacts,
            classification,
            grip.epsilon,
            balance,
            presented,
            giver_clearance,
        );
        let of_grip = grip_values(
            object,
            rig,
            &grip.pose,
            &grasp.contacts,
            classification,
            grip.epsilon,
            solids,
        );
        grasp.score = Some(score(of_grip, &grasp, object, rig, presented));
        // Palm and digits may have moved the wrist since its place was admitted.
        if !constraints.admits(&grasp) {
            return Err(NoGrip::Rejected(Rejection::UnmetConstraint));
        }
        Ok(Box::new(grasp))
    }
}

/// The grasp that a grip is when it holds what is presented by the forces of `balance`, not rated yet.
pub(crate) fn grasp(
    grip: &Grip,
    contacts: &[Contact],
    classification: Classification,
    epsilon: f32,
    balance: Balance,
    presented: &Presented,
    giver_clearance: Option<f32>,
) -> Grasp {
    let sum: glam::Vec3 = balance.forces.iter().sum();
    let comfort = comfort(digit_totals(contacts, &balance.forces));
    Grasp {
        pose: grip.pose,
        bend_ratios: grip.bend_ratios,
        contacts: contacts.to_vec(),
        forces: balance.forces,
        torsions: balance.torsions,
        wrench_angle: sum.angle_between(presented.up),
        comfort,
        margins: Some(PhysicalMargins {
            residual: balance.residual,
            epsilon,
            penetration: grip.penetration,
            giver_clearance,
        }),
        classification,
        score: None,
        key_frames: None,
    }
}
