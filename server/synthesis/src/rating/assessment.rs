//! Turns a valid grip into a rated grasp of a presented object: forces, type, comfort and score.

use super::{
    scoring::{comfort, digit_totals, grip_values, score},
    taxonomy::classify,
};
use crate::{
    base::{
        pose::Pose,
        rejection::Rejection,
        stopwatch::{Step, Stopwatch},
    },
    model::{
        grasp::{Contact, Grasp, PhysicalMargins},
        grasp_type::{Classification, GraspType},
        hand::{HandPose, rig::Rig},
        holdout::ArmPose,
        object::GraspObject,
        requirements::Requirements,
    },
    physical::{
        barriers::BarrierClearances,
        both_hands::{HalfGrip, hold_together},
        grip::{Grip, Gripper, PosedDigits, clear_of_barriers},
        immobility::{Balance, Buffers, balance},
        presented::{ObjectScene, Presented},
        solids::{HandSolids, TrackedSolids},
    },
    thesis::algorithm_1::HeldObject,
};

/// The type of a grip in which the load hangs.
const HOOK: Classification = Classification {
    grasp_type: Some(GraspType::FixedHook),
    confidence: 1.0,
};

/// The object, presentation, hand and requirements that a grip is assessed against.
#[derive(Clone, Copy, Debug)]
pub struct GraspContext<'a> {
    /// The object to be held.
    pub object: ObjectScene<'a>,
    /// Its presentation.
    pub presented: &'a Presented,
    /// The receiving hand.
    pub rig: &'a Rig,
    /// The requirements on the grasp, in the object's frame.
    pub requirements: &'a Requirements,
}

impl GraspContext<'_> {
    /// Checks and rates the grip that `gripper` has just closed, whose hand is `solids`.
    pub(crate) fn assess(
        &self,
        grip: &Grip,
        solids: &HandSolids,
        gripper: &mut Gripper,
        stopwatch: &mut Stopwatch<'_>,
    ) -> Result<Box<Grasp>, Rejection> {
        let Self {
            object, presented, ..
        } = self;
        let classification = self.classified(grip, &gripper.contacts, gripper.hang.is_some())?;

        // Step 5 of Algorithm 1, Immobility Validation, for the object as it is presented.
        let load = object.load(&gripper.soft_contacts, presented.up);
        let load = gripper.hang.map_or(load, |hang| hang.load_at_rest(load));
        let held = balance(&gripper.soft_contacts, &load, &mut gripper.buffers);
        stopwatch.lap(Step::ImmobilityValidation);
        let balance = held.ok_or(Rejection::NotImmobilizing)?;
        let clearances = self.clearances(grip, solids)?;
        let mut grasp = unscored_grasp(
            grip,
            &gripper.contacts,
            classification,
            grip.epsilon,
            balance,
            presented,
            clearances,
        );
        grasp.hangs = gripper.hang.is_some();
        let relative_closure = gripper.hang.map_or_else(
            || gripper.relative_closure(object, grip.epsilon),
            |hang| hang.relative_lip(),
        );
        self.rated(grasp, relative_closure, solids).map(Box::new)
    }

    /// Closes or opens the digits of a posed hand as little as it takes to touch and assesses the grasp or, if that is not valid,
    /// the hand as posed.
    ///
    /// # Errors
    /// The first failed check of the touching hand.
    pub fn hold_posed(&self, pose: &HandPose, gripper: &mut Gripper) -> Result<Box<Grasp>, Rejection> {
        let mut hold = |digits| {
            let (grip, solids) = gripper.hold_posed(&self.object, self.rig, pose, self.presented, digits)?;
            self.assess(&grip, &solids, gripper, &mut Stopwatch::off())
        };
        hold(PosedDigits::Settled).or_else(|failed| hold(PosedDigits::Still).map_err(|_| failed))
    }

    /// The type of a hand; always a hook if the load hangs.
    pub fn classification(&self, pose: &HandPose, contacts: &[Contact], hangs: bool) -> Classification {
        if hangs {
            HOOK
        } else {
            classify(self.rig, pose, contacts, &self.object.object.local_shape)
        }
    }

    /// The grip's type, if the requirements admit it and the contacts.
    pub(super) fn classified(
        &self,
        grip: &Grip,
        contacts: &[Contact],
        hangs: bool,
    ) -> Result<Classification, Rejection> {
        let classification = self.classification(&grip.pose, contacts, hangs);
        let is_admitted = self.requirements.admits_contacts(contacts)
            && self.requirements.admits_type(classification.grasp_type);
        is_admitted
            .then_some(classification)
            .ok_or(Rejection::UnmetRequirement)
    }

    pub(super) fn clearances(
        &self,
        grip: &Grip,
        solids: &HandSolids,
    ) -> Result<BarrierClearances, Rejection> {
        let tracked = TrackedSolids::of_rig(self.rig, grip.pose.frame_from_wrist, solids);
        let clearances = clear_of_barriers(&tracked, self.presented.barriers());
        clearances.ok_or(Rejection::FingerCollision)
    }

    pub(super) fn rated(
        &self,
        grasp: Grasp,
        relative_closure: f32,
        solids: &HandSolids,
    ) -> Result<Grasp, Rejection> {
        let mut grasp = self.scored(grasp, relative_closure, solids);
        let wrist = grasp.pose.frame_from_wrist;
        grasp.arm = self.required_arm(wrist);
        // Closing may have moved the wrist since its placement was admitted.
        let is_admitted = self.is_not_banned(wrist)
            && self.requirements.admits(&grasp)
            && self.is_reached(grasp.arm.as_ref());
        is_admitted.then_some(grasp).ok_or(Rejection::UnmetRequirement)
    }

    /// The grasp with its score. `relative_closure` is as for a rated one.
    #[must_use]
    pub(crate) fn scored(&self, mut grasp: Grasp, relative_closure: f32, solids: &HandSolids) -> Grasp {
        let (object, rig) = (&self.object, self.rig);
        let (pose, contacts, classification) = (&grasp.pose, &grasp.contacts, grasp.classification);
        let values = grip_values(
            object,
            rig,
            pose,
            contacts,
            classification,
            relative_closure,
            solids,
        );
        grasp.score = Some(score(values, &grasp, object, rig, self.presented));
        grasp
    }

    /// True unless the wrist is near that of a grip with which the object is not to be taken.
    pub(crate) fn is_not_banned(&self, object_from_wrist: Pose) -> bool {
        let object = self.object.object;
        object.admits_wrist(self.rig.handedness, object_from_wrist)
    }

    pub(crate) fn required_arm(&self, wrist: Pose) -> Option<ArmPose> {
        let must_reach = self.presented.receiver.must_reach();
        must_reach
            .then(|| self.presented.arm_of(self.object.object, self.rig, wrist))
            .flatten()
    }

    /// True unless the receiver's arm must reach the wrist and does not; `arm` is from [`Presented::arm_of`].
    pub fn is_reached(&self, arm: Option<&ArmPose>) -> bool {
        !self.presented.receiver.must_reach() || arm.is_some()
    }
}

/// The grasp of a grip that holds the presented object with the forces of `balance`.
pub(crate) fn unscored_grasp(
    grip: &Grip,
    contacts: &[Contact],
    classification: Classification,
    epsilon: f32,
    balance: Balance,
    presented: &Presented,
    clearances: BarrierClearances,
) -> Grasp {
    let total_force: glam::Vec3 = balance.forces.iter().sum();
    let comfort = comfort(digit_totals(contacts, &balance.forces));
    Grasp {
        pose: grip.pose,
        bend_ratios: grip.bend_ratios,
        contacts: contacts.to_vec(),
        forces: balance.forces,
        torsions: balance.torsions,
        wrench_angle: total_force.angle_between(presented.up),
        comfort,
        margins: Some(PhysicalMargins {
            residual: balance.residual,
            epsilon,
            penetration: grip.penetration,
            giver_clearance: clearances.hands,
            obstacle_clearance: clearances.obstacles,
        }),
        classification,
        hangs: false,
        score: None,
        arm: None,
        key_frames: None,
        other_hand: None,
    }
}

/// The grasp of a hand that holds the object under `THESIS` validity: typed, but without margins or score.
pub(crate) fn thesis_grasp(object: &GraspObject, rig: &Rig, held: HeldObject) -> Grasp {
    Grasp {
        bend_ratios: held.bend_ratios,
        wrench_angle: held.wrench_angle,
        comfort: comfort(held.digit_totals),
        classification: classify(rig, &held.pose, &held.contacts, &object.local_shape),
        pose: held.pose,
        contacts: held.contacts,
        forces: held.forces,
        torsions: Vec::new(),
        margins: None,
        hangs: false,
        score: None,
        arm: None,
        key_frames: None,
        other_hand: None,
    }
}

/// Checks and rates two hands that hold together: each against its own context, closure and balance for both.
pub(crate) fn assess_both(
    around: [&GraspContext<'_>; 2],
    halves: [&HalfGrip; 2],
    buffers: &mut Buffers,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<Box<Grasp>, Rejection> {
    let classified = |hand: usize| around[hand].classified(&halves[hand].grip, &halves[hand].contacts, false);
    let classifications = [classified(0)?, classified(1)?];
    let clearance = |hand: usize| around[hand].clearances(&halves[hand].grip, &halves[hand].solids);
    let clearances = [clearance(0)?, clearance(1)?];
    let presented = around[0].presented;
    let held = hold_together(&around[0].object, presented.up, halves, buffers, stopwatch)?;
    let [first, second] = held.balances;
    let total_force: glam::Vec3 = first.forces.iter().chain(&second.forces).sum();
    let rated = |hand: usize, balance| {
        let HalfGrip {
            grip,
            solids,
            contacts,
        } = halves[hand];
        let unscored = unscored_grasp(
            grip,
            contacts,
            classifications[hand],
            held.epsilon,
            balance,
            presented,
            clearances[hand],
        );
        let grasp = Grasp {
            wrench_angle: total_force.angle_between(presented.up),
            ..unscored
        };
        around[hand].rated(grasp, held.relative_closure, solids)
    };
    let mut grasp = Box::new(rated(0, first)?);
    grasp.other_hand = Some(Box::new(rated(1, second)?));
    Ok(grasp)
}
