//! One attempt: places, closes and checks a hand according to strategy and validity. If that fails and seeds
//! are known, hands perturbed from those follow.

use super::{
    both_hands::BothHands,
    physical_attempt::PhysicalAttempt,
    scene::{Guided, Scene},
};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        rejection::Rejection,
        stopwatch::{Step, Stopwatch},
    },
    model::{
        grasp::Grasp,
        hand::{DigitAngles, HandPose},
        strategy::Strategy,
    },
    physical::{
        grip::NoGrip,
        shape::{HandShape, Proposal},
    },
    propose::prepared::PreparedRig,
    rating::assessment::{GraspContext, thesis_grasp},
    thesis::{
        algorithm_1::{Failure, ThesisAttempt},
        finger_posing::PosedDigit,
        wrist_placement::WristFrame,
    },
};

/// Perturbed hands that an attempt tries after its fresh one. They answer where a giver leaves little room,
/// but only if a similar grip is known; fewer leave more time for fresh placements.
const SEEDS_PER_ATTEMPT: usize = 16;

/// How an attempt ended.
#[derive(Clone, Debug, PartialEq)]
pub enum AttemptEnd {
    /// With a valid grasp.
    Valid(Box<Grasp>),
    /// With a failed check.
    Rejected {
        /// The check.
        rejection: Rejection,
        /// For `NotImmobilizing` under `THESIS` validity: the smallest angle of Eq. 4.5, in radians.
        wrench_angle: Option<f32>,
    },
    /// The stop signal came first.
    Interrupted,
}

impl From<Failure> for AttemptEnd {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Rejected {
                rejection,
                wrench_angle,
            } => Self::Rejected {
                rejection,
                wrench_angle,
            },
            Failure::Interrupted => Self::Interrupted,
        }
    }
}

impl From<NoGrip> for AttemptEnd {
    fn from(no_grip: NoGrip) -> Self {
        match no_grip {
            NoGrip::Rejected(rejection) => Failure::from(rejection).into(),
            NoGrip::Interrupted => Self::Interrupted,
        }
    }
}

/// The state of an attempt. Reuse it for the next attempt to keep its buffers.
#[derive(Clone, Debug)]
pub struct Attempt {
    pruned_placements: u64,
    wrist: WristFrame,
    /// The digits posed by this attempt, thumb first.
    posed: Vec<DigitAngles>,
    thesis: ThesisAttempt,
    physical: PhysicalAttempt,
    both_hands: BothHands,
    /// Whether the hand was placed on a handle or to hook in.
    is_special: bool,
}

impl Default for Attempt {
    fn default() -> Self {
        Self {
            pruned_placements: 0,
            wrist: WristFrame::new(Pose::IDENTITY),
            posed: Vec::with_capacity(5),
            thesis: ThesisAttempt::default(),
            physical: PhysicalAttempt::default(),
            both_hands: BothHands::default(),
            is_special: false,
        }
    }
}

impl Attempt {
    /// How many placements the pruning measures discarded before accepting one.
    pub fn pruned_placements(&self) -> u64 {
        self.pruned_placements
    }

    /// Where the attempt placed the wrist.
    pub fn wrist(&self) -> &WristFrame {
        &self.wrist
    }

    /// True if the attempt failed before posing a digit.
    pub fn is_unposed(&self) -> bool {
        self.posed.is_empty()
    }

    /// The digits as Algorithm 1 posed them under `THESIS` validity, thumb first: all five, none, or the
    /// thumb alone if the search stops without it.
    pub fn posed_digits(&self) -> &[PosedDigit] {
        self.thesis.posed_digits()
    }

    /// The hand as far as the attempt got; digits that it did not pose are stretched.
    pub fn pose(&self, scene: &Scene<'_>) -> HandPose {
        let mut digits = scene.rig().stretched();
        for (angles, posed) in digits.iter_mut().zip(&self.posed) {
            *angles = *posed;
        }
        HandPose {
            frame_from_wrist: self.wrist.object_from_wrist,
            digits,
        }
    }

    /// Tries a freshly placed hand, and, if that fails and seeds are known, some hands perturbed from those; or two hands
    /// together if the search asks for both.
    /// Calls `interrupted` at least every 50 µs or so of work.
    pub fn run(
        &mut self,
        scene: &Scene<'_>,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> AttemptEnd {
        stopwatch.start();
        self.pruned_placements = 0;
        self.posed.clear();
        self.is_special = false;
        let Some(around) = scene.surroundings() else {
            return self.try_by_thesis(scene, stream, stopwatch, interrupted);
        };
        if let Some(other) = scene.other_hand() {
            return self.try_both_hands(scene, &around, other, stream, stopwatch, interrupted);
        }
        let end = self.try_physically(scene, &around, stream, stopwatch, interrupted);
        if self.is_special || scene.has_no_seeds() || !matches!(end, AttemptEnd::Rejected { .. }) {
            return end;
        }
        match self.try_seeds(scene, &around, stream, stopwatch, interrupted) {
            Ok(Some(grasp)) => AttemptEnd::Valid(grasp),
            // A failed attempt reports its freshly placed hand.
            Ok(None) => end,
            Err(Interrupted) => AttemptEnd::Interrupted,
        }
    }

    /// Algorithm 1, with the wrist placed according to the strategy.
    fn try_by_thesis(
        &mut self,
        scene: &Scene<'_>,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> AttemptEnd {
        let Self {
            thesis,
            wrist,
            pruned_placements,
            ..
        } = self;
        let place_wrist = |stream: &mut AttemptStream| {
            *wrist = if scene.strategy() == Strategy::Guided {
                WristFrame::new(
                    guided_proposal(scene, stream, interrupted)?
                        .proposal
                        .object_from_wrist,
                )
            } else {
                place_by_ladder(scene, stream, pruned_placements, interrupted)?
            };
            admitted(scene, wrist)
        };
        let held = thesis.try_synthesize_grasp(scene.thesis(), place_wrist, stream, stopwatch, interrupted);
        self.posed
            .extend(thesis.posed_digits().iter().map(|digit| digit.angles));
        match held {
            Ok(held) => {
                let grasp = thesis_grasp(&scene.thesis().holdout.object, scene.rig(), held);
                if scene.requirements().admits(&grasp) && scene.admits_wrist(grasp.pose.frame_from_wrist) {
                    AttemptEnd::Valid(Box::new(grasp))
                } else {
                    Failure::from(Rejection::UnmetRequirement).into()
                }
            }
            Err(failure) => failure.into(),
        }
    }

    /// `PHYSICAL` validity, with the hand placed according to the strategy.
    fn try_physically(
        &mut self,
        scene: &Scene<'_>,
        around: &GraspContext<'_>,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> AttemptEnd {
        let is_guided = scene.strategy() == Strategy::Guided;
        let placed = if is_guided {
            guided_proposal(scene, stream, interrupted).map(|guided| {
                self.is_special = guided.is_special;
                let Guided { proposal, .. } = guided;
                (WristFrame::new(proposal.object_from_wrist), Some(proposal))
            })
        } else {
            place_by_ladder(scene, stream, &mut self.pruned_placements, interrupted)
                .map(|wrist| (wrist, None))
        };
        stopwatch.lap(Step::WristPlacement);
        let (wrist, proposal) = match placed {
            Ok(placed) => placed,
            Err(failure) => return failure.into(),
        };
        self.wrist = wrist;
        if let Err(failure) = admitted(scene, &wrist) {
            return failure.into();
        }
        let proposal = proposal.unwrap_or_else(|| Proposal {
            object_from_wrist: wrist.object_from_wrist,
            shape: HandShape::draw(scene.bend_ratios(), stream),
            advance: 0.0,
        });
        let physical = &mut self.physical;
        let held = if is_guided {
            physical.hold_or_refine(around, &proposal, stream, stopwatch, interrupted)
        } else {
            physical.hold(around, &proposal, stopwatch, interrupted)
        };
        self.posed.extend_from_slice(&physical.gripper.posed);
        held.map_or_else(AttemptEnd::from, AttemptEnd::Valid)
    }

    /// Two hands that hold the object together.
    fn try_both_hands(
        &mut self,
        scene: &Scene<'_>,
        around: &GraspContext<'_>,
        other: &PreparedRig,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> AttemptEnd {
        let around_other = GraspContext {
            rig: other,
            ..*around
        };
        let hands = &mut self.both_hands;
        let contexts = [around, &around_other];
        let held = hands.hold(scene, contexts, other, stream, stopwatch, interrupted);
        if let Some(placed) = hands.placed {
            self.wrist = WristFrame::new(placed);
        }
        self.posed.extend_from_slice(&hands.first.posed);
        held.map_or_else(AttemptEnd::from, AttemptEnd::Valid)
    }

    /// Tries [`SEEDS_PER_ATTEMPT`] hands perturbed from known grips.
    fn try_seeds(
        &mut self,
        scene: &Scene<'_>,
        around: &GraspContext<'_>,
        stream: &mut AttemptStream,
        stopwatch: &mut impl Stopwatch,
        interrupted: &impl Fn() -> bool,
    ) -> Result<Option<Box<Grasp>>, Interrupted> {
        let seeds = scene.seeds(around.presented, stream.attempt(), interrupted);
        let (seeds, entries) = seeds.ok_or(Interrupted)?;
        let place = scene.place();
        for _ in 0..SEEDS_PER_ATTEMPT {
            if interrupted() {
                return Err(Interrupted);
            }
            let proposal = seeds.propose(entries, &place, stream).filter(|proposal| {
                let wrist = proposal.object_from_wrist;
                scene.admits_wrist(wrist) && place.is_chosen(wrist, stream)
            });
            stopwatch.lap(Step::WristPlacement);
            let Some(proposal) = proposal else { continue };
            let physical = &mut self.physical;
            match physical.hold_or_refine(around, &proposal, stream, stopwatch, interrupted) {
                Ok(grasp) => return Ok(Some(grasp)),
                Err(NoGrip::Rejected(_)) => {}
                Err(NoGrip::Interrupted) => return Err(Interrupted),
            }
        }
        Ok(None)
    }
}

/// The stop signal came.
struct Interrupted;

/// A hand as `GUIDED` search proposes it.
fn guided_proposal(
    scene: &Scene<'_>,
    stream: &mut AttemptStream,
    interrupted: &impl Fn() -> bool,
) -> Result<Guided, Failure> {
    scene.guided_proposal(stream, interrupted).ok_or_else(|| {
        if interrupted() {
            Failure::Interrupted
        } else {
            Rejection::NoContacts.into()
        }
    })
}

/// A wrist as strategies A to F place it.
fn place_by_ladder(
    scene: &Scene<'_>,
    stream: &mut AttemptStream,
    pruned: &mut u64,
    interrupted: &impl Fn() -> bool,
) -> Result<WristFrame, Failure> {
    let placer = &scene.thesis().placer;
    placer
        .place(stream, interrupted, pruned)
        .ok_or(Failure::Interrupted)
}

/// The wrist, if it meets the request's requirements.
fn admitted(scene: &Scene<'_>, wrist: &WristFrame) -> Result<WristFrame, Failure> {
    if scene.admits_wrist(wrist.object_from_wrist) {
        Ok(*wrist)
    } else {
        Err(Rejection::UnmetRequirement.into())
    }
}
