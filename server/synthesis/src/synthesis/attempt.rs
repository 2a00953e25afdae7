//! Algorithm 1 (`TRYSYNTHESIZEGRASP`): one attempt at a grasp.
//!
//! The thesis prints "or `ISIMMOBILIZINGGRASP`" in line 6; a grasp is invalid if it does NOT immobilize.

use super::{
    closing_motion::hand_motion,
    collision_validation::collision,
    comfort::comfort,
    contact_validation::{collect_contacts, touches_forbidden_surface},
    finger_posing::{PosedDigit, find_touching_finger_pose, missing_contacts},
    immobility_validation::{DistributionChoice, Immobility, ImmobilityBuffers},
    random::AttemptStream,
    scene::Scene,
    stopwatch::{Step, Stopwatch},
    wrist_placement::WristFrame,
};
use crate::{
    grasp::{Contact, Grasp},
    hand::{Digit, HandPose},
    physical::{
        attempt::{PhysicalAttempt, Surroundings},
        grip::NoGrip,
        shape::{HandShape, Proposal},
    },
    pose::Pose,
    rejection::Rejection,
    strategy::Strategy,
    taxonomy::classify,
};

/// Hands beside known grips that an attempt tries after its own. Where a giver leaves little room, they are what holds: of 62
/// searches of a tenth of a second by one worker, for 31 holdouts of the built-in scalpel that its atlas does not answer,
/// none found a grasp without them, and 39 with as few as eight an attempt. But they hold only where something like them is
/// known, and fewer leave more of the time to hands that are placed anew: without any an attempt took 85 µs there, with
/// eight 282.
const BESIDE_KNOWN: usize = 16;

/// The stop signal came.
struct Interrupted;

/// How an attempt ended.
#[derive(Clone, Debug, PartialEq)]
pub enum AttemptEnd {
    /// With a valid grasp.
    Valid(Box<Grasp>),
    /// With a failed check. `wrench_angle` is the smallest angle of Eq. 4.5 in radians, if it came to that.
    Rejected {
        /// The check that failed.
        rejection: Rejection,
        /// For `NotImmobilizing`: the best distribution's angle.
        wrench_angle: Option<f32>,
    },
    /// The stop signal came before it was over.
    Interrupted,
}

/// The state of an attempt, kept from one to the next for its buffers.
#[derive(Clone, Debug)]
pub struct Attempt {
    pruned_placements: u64,
    wrist: WristFrame,
    digits: [PosedDigit; 5],
    /// How many of `digits` this attempt posed.
    posed: usize,
    contacts: Vec<Contact>,
    immobility: ImmobilityBuffers,
    physical: PhysicalAttempt,
}

impl Default for Attempt {
    fn default() -> Self {
        Self {
            pruned_placements: 0,
            wrist: WristFrame::new(Pose::IDENTITY),
            digits: [PosedDigit::default(); 5],
            posed: 0,
            contacts: Vec::new(),
            immobility: ImmobilityBuffers::default(),
            physical: PhysicalAttempt::default(),
        }
    }
}

impl Attempt {
    /// How many placements the measures pruned before the attempt had one.
    pub fn pruned_placements(&self) -> u64 {
        self.pruned_placements
    }

    /// Where the attempt placed the wrist.
    pub fn wrist(&self) -> &WristFrame {
        &self.wrist
    }

    /// The digits that the attempt posed, thumb first: all five, or none, or the thumb alone where the search stops
    /// without it.
    pub fn posed_digits(&self) -> &[PosedDigit] {
        &self.digits[..self.posed]
    }

    /// The hand as far as the attempt came; digits that it did not pose are stretched.
    pub fn pose(&self, scene: &Scene<'_>) -> HandPose {
        let mut digits = scene.rig.stretched();
        for (angles, posed) in digits.iter_mut().zip(&self.digits[..self.posed]) {
            *angles = posed.angles;
        }
        HandPose {
            frame_from_wrist: self.wrist.object_from_wrist,
            digits,
        }
    }

    /// `TRYSYNTHESIZEGRASP`; where grips are known, also with some hands beside those, if it fails. `interrupted` is asked
    /// often enough that at most some 50 µs of work lie between two calls.
    pub fn try_synthesize_grasp(
        &mut self,
        scene: &Scene<'_>,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> AttemptEnd {
        stopwatch.start();
        let end = self.try_anew(scene, stream, stopwatch, interrupted);
        if scene.starts.is_empty() || !matches!(end, AttemptEnd::Rejected { .. }) {
            return end;
        }
        match self.try_beside_known(scene, stream, stopwatch, interrupted) {
            Ok(Some(grasp)) => AttemptEnd::Valid(grasp),
            // What is told of an attempt that fails is the hand that was placed anew.
            Ok(None) => end,
            Err(Interrupted) => AttemptEnd::Interrupted,
        }
    }

    /// Tries [`BESIDE_KNOWN`] hands beside known grips.
    fn try_beside_known(
        &mut self,
        scene: &Scene<'_>,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> Result<Option<Box<Grasp>>, Interrupted> {
        let Some(around) = scene.surroundings() else {
            return Ok(None);
        };
        let starts = scene.starts(around.presented, stream.attempt(), interrupted);
        let (starts, entries) = starts.ok_or(Interrupted)?;
        let place = scene.place(stream.attempt());
        for _ in 0..BESIDE_KNOWN {
            if interrupted() {
                return Err(Interrupted);
            }
            let proposal = starts
                .propose(entries, &place, stream)
                .filter(|proposal| scene.constraints.admits_wrist(proposal.object_from_wrist));
            stopwatch.lap(Step::WristPlacement);
            let Some(proposal) = proposal else { continue };
            let physical = &mut self.physical;
            match physical.hold_or_refine(&around, &proposal, stream, stopwatch, interrupted) {
                Ok(grasp) => return Ok(Some(grasp)),
                Err(NoGrip::Rejected(_)) => {}
                Err(NoGrip::Interrupted) => return Err(Interrupted),
            }
        }
        Ok(None)
    }

    /// All five steps, with a hand that is placed anew.
    fn try_anew(
        &mut self,
        scene: &Scene<'_>,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> AttemptEnd {
        self.pruned_placements = 0;
        self.posed = 0;
        let reject = |rejection| AttemptEnd::Rejected {
            rejection,
            wrench_angle: None,
        };

        // Step 1, Wrist Placement.
        let proposal = if scene.strategy == Strategy::Guided {
            let proposal = scene.guided_proposal(stream, interrupted);
            stopwatch.lap(Step::WristPlacement);
            let Some(proposal) = proposal else {
                return if interrupted() {
                    AttemptEnd::Interrupted
                } else {
                    reject(Rejection::NoContacts)
                };
            };
            self.wrist = WristFrame::new(proposal.object_from_wrist);
            Some(proposal)
        } else {
            let placed = scene
                .placer
                .place(stream, interrupted, &mut self.pruned_placements);
            stopwatch.lap(Step::WristPlacement);
            let Some(wrist) = placed else {
                return AttemptEnd::Interrupted;
            };
            self.wrist = wrist;
            None
        };
        if !scene.constraints.admits_wrist(self.wrist.object_from_wrist) {
            return reject(Rejection::UnmetConstraint);
        }
        if let Some(around) = scene.surroundings() {
            let proposal = proposal.unwrap_or_else(|| Proposal {
                object_from_wrist: self.wrist.object_from_wrist,
                shape: HandShape::draw(scene.bend_ratios, stream),
                advance: 0.0,
            });
            return self.hold_physically(&around, &proposal, scene.strategy, stream, stopwatch, interrupted);
        }

        // Step 2, Finger Posing.
        let posed = self.pose_digits(scene, stream, interrupted);
        stopwatch.lap(Step::FingerPosing);
        if !posed {
            return AttemptEnd::Interrupted;
        }
        if let Some(rejection) = missing_contacts(scene.strategy, &self.digits[..self.posed]) {
            return reject(rejection);
        }

        // Step 3, Collision Validation.
        let collision = collision(scene.holdout, scene.rig, &self.wrist, &self.digits);
        stopwatch.lap(Step::CollisionValidation);
        if let Some(rejection) = collision {
            return reject(rejection);
        }

        // Step 4, Contact Validation.
        let object = &scene.holdout.object;
        collect_contacts(object, &self.digits, &mut self.contacts);
        let unwanted = touches_forbidden_surface(object, &self.contacts);
        stopwatch.lap(Step::ContactValidation);
        if unwanted {
            return reject(Rejection::UnwantedContact);
        }

        // Step 5, Immobility Validation.
        let choice = if scene.strategy.takes_first_force_distribution() {
            DistributionChoice::FirstSufficient
        } else {
            DistributionChoice::Best
        };
        let immobility = self
            .immobility
            .validate(&self.contacts, &scene.load, choice, stream, interrupted);
        stopwatch.lap(Step::ImmobilityValidation);
        match immobility {
            Immobility::Immobilizing(wrench_angle) => {
                let grasp = self.grasp(scene, wrench_angle);
                if scene.constraints.admits(&grasp) {
                    AttemptEnd::Valid(Box::new(grasp))
                } else {
                    reject(Rejection::UnmetConstraint)
                }
            }
            Immobility::NotImmobilizing(wrench_angle) => AttemptEnd::Rejected {
                rejection: Rejection::NotImmobilizing,
                wrench_angle: Some(wrench_angle),
            },
            Immobility::Interrupted => AttemptEnd::Interrupted,
        }
    }

    /// Steps 2 to 5 under `PHYSICAL` validity.
    fn hold_physically(
        &mut self,
        around: &Surroundings<'_>,
        proposal: &Proposal,
        strategy: Strategy,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> AttemptEnd {
        let physical = &mut self.physical;
        let end = match strategy {
            Strategy::Guided => physical.hold_or_refine(around, proposal, stream, stopwatch, interrupted),
            _ => physical.hold(around, proposal, stopwatch, interrupted),
        };
        let posed = &self.physical.gripper.posed;
        for (digit, angles) in self.digits.iter_mut().zip(posed) {
            *digit = PosedDigit {
                angles: *angles,
                ..PosedDigit::default()
            };
        }
        self.posed = posed.len();
        match end {
            Ok(grasp) => AttemptEnd::Valid(grasp),
            Err(NoGrip::Rejected(rejection)) => AttemptEnd::Rejected {
                rejection,
                wrench_angle: None,
            },
            Err(NoGrip::Interrupted) => AttemptEnd::Interrupted,
        }
    }

    /// `CALCULATEHOLDPOSEANDCONTACTS`: poses the digits in turn, from strategy D on only while the thumb touches
    /// (Algorithm 12). False if interrupted.
    fn pose_digits(
        &mut self,
        scene: &Scene<'_>,
        stream: &mut AttemptStream,
        interrupted: &impl Fn() -> bool,
    ) -> bool {
        let motions = scene.motion.get_or_init(|| hand_motion(scene.rig));
        for (digit, motion) in Digit::ALL.into_iter().zip(motions) {
            if interrupted() {
                return false;
            }
            let posed = find_touching_finger_pose(
                &scene.holdout.object,
                &self.wrist,
                motion,
                digit,
                scene.bend_ratios,
                stream,
            );
            let touches = posed.touches();
            self.digits[digit.index()] = posed;
            self.posed += 1;
            if digit == Digit::Thumb && !touches && scene.strategy.stops_without_thumb() {
                break;
            }
        }
        true
    }

    /// The grasp of an attempt that passed all checks.
    fn grasp(&self, scene: &Scene<'_>, wrench_angle: f32) -> Grasp {
        let pose = self.pose(scene);
        Grasp {
            pose,
            bend_ratios: self.digits.map(|digit| digit.bend_ratio),
            contacts: self.contacts.clone(),
            forces: self.immobility.forces(),
            torsions: Vec::new(),
            wrench_angle,
            comfort: comfort(self.immobility.digit_totals(&self.contacts)),
            margins: None,
            classification: classify(scene.rig, &pose, &self.contacts),
            score: None,
            key_frames: None,
        }
    }
}
