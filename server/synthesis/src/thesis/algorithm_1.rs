//! Algorithm 1 (`TRYSYNTHESIZEGRASP`): one attempt at a grasp.
//!
//! Erratum: line 6 of the thesis prints "or `ISIMMOBILIZINGGRASP`", but a grasp is invalid if it does NOT immobilize.

use std::sync::OnceLock;

use glam::Vec3;

use super::{
    collision_and_contact_validation::{collect_contacts, collision, touches_forbidden_surface},
    finger_posing::{DigitMotion, PosedDigit, find_touching_finger_pose, hand_motion, missing_contacts},
    immobility_validation::{Immobility, ImmobilityBuffers, Load, Wrench},
    wrist_placement::{WristFrame, WristPlacer},
};
use crate::{
    base::{
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::{Stop, Stopped},
        stopwatch::{Step, Stopwatch},
    },
    model::{
        grasp::Contact,
        hand::{Digit, HandPose, rig::Rig},
        holdout::Holdout,
        strategy::{BendRatioChoice, Strategy},
    },
};

/// A hand that passed every check of Algorithm 1, in the object's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldObject {
    /// Wrist and joint angles.
    pub pose: HandPose,
    /// The bend ratio each digit closed with, thumb first; `None` for a digit without contact.
    pub bend_ratios: [Option<f32>; 5],
    /// Contacts, thumb first.
    pub contacts: Vec<Contact>,
    /// Force on the object at each contact, in newtons.
    pub forces: Vec<Vec3>,
    /// Total force magnitude of each digit in newtons, thumb first.
    pub digit_totals: [f32; 5],
    /// The angle of Eq. 4.5, in radians.
    pub wrench_angle: f32,
}

/// The working state of an attempt. Reuse it to reuse its buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct ThesisAttempt {
    digits: [PosedDigit; 5],
    /// Number of leading `digits` that this attempt posed.
    posed: usize,
    contacts: Vec<Contact>,
    immobility: ImmobilityBuffers,
}

impl ThesisAttempt {
    /// The digits that the attempt posed, thumb first: all five, none, or only the thumb if it missed and the strategy
    /// then stops posing.
    pub(crate) fn posed_digits(&self) -> &[PosedDigit] {
        &self.digits[..self.posed]
    }

    /// `TRYSYNTHESIZEGRASP`. `place_wrist` performs step 1 through [`ThesisScene::placer`] or another source of wrist
    /// frames. `stop` is asked about every 50 µs.
    pub(crate) fn try_synthesize_grasp(
        &mut self,
        scene: &ThesisScene<'_>,
        place_wrist: impl FnOnce(&mut AttemptStream) -> Result<WristFrame, Failure>,
        stream: &mut AttemptStream,
        stopwatch: &mut Stopwatch<'_>,
        stop: Stop<'_>,
    ) -> Result<HeldObject, Failure> {
        self.posed = 0;

        // Step 1: Wrist Placement.
        let wrist = place_wrist(stream);
        stopwatch.lap(Step::WristPlacement);
        let wrist = wrist?;

        // Step 2: Finger Posing.
        let posed = self.pose_digits(scene, &wrist, stream, stop);
        stopwatch.lap(Step::FingerPosing);
        posed?;
        if let Some(rejection) = missing_contacts(scene.strategy, &self.digits[..self.posed]) {
            return Err(rejection.into());
        }

        // Step 3: Collision Validation.
        let collision = collision(scene.holdout, scene.rig, &wrist, &self.digits);
        stopwatch.lap(Step::CollisionValidation);
        if let Some(rejection) = collision {
            return Err(rejection.into());
        }

        // Step 4: Contact Validation.
        let object = &scene.holdout.object;
        collect_contacts(object, &self.digits, &mut self.contacts);
        let unwanted = touches_forbidden_surface(object, &self.contacts);
        stopwatch.lap(Step::ContactValidation);
        if unwanted {
            return Err(Rejection::UnwantedContact.into());
        }

        // Step 5: Immobility Validation.
        let takes_first = scene.strategy.takes_first_force_distribution();
        let immobility = self
            .immobility
            .validate(&self.contacts, &scene.load, takes_first, stream, stop);
        stopwatch.lap(Step::ImmobilityValidation);
        match immobility? {
            Immobility::Immobilizing(wrench_angle) => Ok(self.held_object(&wrist, wrench_angle)),
            Immobility::NotImmobilizing(wrench_angle) => Err(Failure::Rejected {
                rejection: Rejection::NotImmobilizing,
                wrench_angle: Some(wrench_angle),
            }),
        }
    }

    /// `CALCULATEHOLDPOSEANDCONTACTS`: poses the digits in turn, thumb first. From strategy D on, the fingers are posed
    /// only if the thumb touches (Algorithm 12).
    fn pose_digits(
        &mut self,
        scene: &ThesisScene<'_>,
        wrist: &WristFrame,
        stream: &mut AttemptStream,
        stop: Stop<'_>,
    ) -> Result<(), Stopped> {
        for (digit, motion) in Digit::ALL.into_iter().zip(scene.motion()) {
            stop.check()?;
            let posed = find_touching_finger_pose(
                &scene.holdout.object,
                wrist,
                motion,
                digit,
                scene.bend_ratios,
                stream,
            );
            let touches = posed.touches();
            self.digits[digit.index()] = posed;
            self.posed += 1;
            if digit == Digit::Thumb && !touches && scene.strategy >= Strategy::D {
                break;
            }
        }
        Ok(())
    }

    /// Collects the result once all checks have passed.
    fn held_object(&self, wrist: &WristFrame, wrench_angle: f32) -> HeldObject {
        HeldObject {
            pose: HandPose {
                frame_from_wrist: wrist.object_from_wrist,
                digits: self.digits.map(|digit| digit.angles),
            },
            bend_ratios: self.digits.map(|digit| digit.bend_ratio),
            contacts: self.contacts.clone(),
            forces: self.immobility.forces(),
            digit_totals: self.immobility.digit_totals(&self.contacts),
            wrench_angle,
        }
    }
}

/// A holdout, the receiving hand, and the settings of Algorithm 1.
#[derive(Clone, Debug)]
pub(crate) struct ThesisScene<'a> {
    /// The object and how it is presented.
    pub holdout: &'a Holdout,
    /// The receiving hand.
    pub rig: &'a Rig,
    /// Which of the modifications of chapter 5 apply.
    pub strategy: Strategy,
    /// The bend ratios a digit may close with.
    pub bend_ratios: BendRatioChoice,
    /// Draws wrist frames: step 1.
    pub placer: WristPlacer<'a>,
    /// The weight and friction of the object.
    pub load: Load,
    /// Tabulated on first use, since it takes longer than a look-up of known grips, which does not need it.
    motion: OnceLock<[DigitMotion; 5]>,
}

impl<'a> ThesisScene<'a> {
    /// Prepares attempts at a holdout. `friction` is the coefficient of static friction; it must be positive.
    pub(crate) fn new(
        holdout: &'a Holdout,
        rig: &'a Rig,
        strategy: Strategy,
        bend_ratios: BendRatioChoice,
        friction: f32,
    ) -> Self {
        debug_assert!(
            friction.is_finite() && friction > 0.0,
            "friction {friction} is not positive"
        );
        debug_assert!(
            holdout.up.is_normalized(),
            "up {} is not a unit vector",
            holdout.up
        );
        Self {
            holdout,
            rig,
            strategy,
            bend_ratios,
            placer: WristPlacer::new(holdout, rig, strategy),
            load: Load {
                gravity: Wrench::of_gravity(holdout.object.mass, holdout.up),
                centre_of_mass: holdout.object.centre_of_mass,
                friction,
            },
            motion: OnceLock::new(),
        }
    }

    /// The closing motion of each digit, thumb first.
    pub(crate) fn motion(&self) -> &[DigitMotion; 5] {
        self.motion.get_or_init(|| hand_motion(self.rig))
    }
}
