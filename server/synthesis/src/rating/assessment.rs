//! The grasp that a valid grip is: forces, type, comfort and score for what is presented.

use super::{
    comfort::{comfort, digit_totals},
    scoring::{grip_values, score},
    taxonomy::classify,
};
use crate::{
    base::{
        rejection::Rejection,
        stopwatch::{Step, Stopwatch},
    },
    model::{
        constraints::Constraints,
        grasp::{Contact, Grasp, PhysicalMargins},
        grasp_type::Classification,
        hand::rig::Rig,
    },
    physical::{
        grip::{Grip, Gripper, NoGrip, clear_of_giver},
        immobility::{Balance, balance},
        scene::{ObjectScene, Presented},
        solids::{HandSolids, TrackedSolids},
    },
    thesis::algorithm_1::HeldObject,
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

impl Surroundings<'_> {
    /// The grasp that a grip is here which a gripper has just made.
    ///
    /// # Errors
    /// The first check that fails.
    pub fn hold_with(
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
        let tracked = TrackedSolids::of_rig(rig, grip.pose.frame_from_wrist, solids);
        let giver_clearance = clear_of_giver(&tracked, presented.giver.as_ref());
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
pub fn grasp(
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

/// The grasp that a hand is which holds an object by the thesis' validity.
pub fn thesis_grasp(rig: &Rig, held: HeldObject) -> Grasp {
    Grasp {
        bend_ratios: held.bend_ratios,
        wrench_angle: held.wrench_angle,
        comfort: comfort(held.digit_totals),
        classification: classify(rig, &held.pose, &held.contacts),
        pose: held.pose,
        contacts: held.contacts,
        forces: held.forces,
        torsions: Vec::new(),
        margins: None,
        score: None,
        key_frames: None,
    }
}
