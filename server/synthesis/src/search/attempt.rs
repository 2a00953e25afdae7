//! One attempt: places, closes and checks a hand according to strategy and validity. If that fails and seeds are known, hands
//! perturbed from those follow.

use super::{
    both_hands::BothHands,
    scene::{Guided, Scene},
};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::Stop,
        stopwatch::{Step, Stopwatch},
    },
    model::{
        grasp::Grasp,
        hand::{DigitAngles, HandPose},
        strategy::Strategy,
    },
    physical::{
        grip::Gripper,
        shape::{HandShape, Proposal},
    },
    propose::prepared::PreparedRig,
    rating::assessment::{GraspContext, thesis_grasp},
    thesis::{algorithm_1::ThesisAttempt, finger_posing::PosedDigit, wrist_placement::WristFrame},
};

/// Perturbed hands that an attempt tries after its fresh one. They answer where a giver leaves little room, but only if a similar
/// grip is known; fewer leave more time for fresh placements.
const SEEDS_PER_ATTEMPT: usize = 16;

/// The scene of an attempt, its random stream, stopwatch and stop.
pub(super) struct Course<'a, 'b> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) stream: &'a mut AttemptStream,
    pub(super) stopwatch: &'a mut Stopwatch<'b>,
    pub(super) stop: Stop<'a>,
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

    /// The digits as Algorithm 1 posed them under `THESIS` validity, thumb first: all five, none, or the thumb alone if the
    /// search stops without it.
    pub fn posed_digits(&self) -> &[PosedDigit] {
        self.thesis.posed_digits()
    }

    /// The hand as far as the attempt got; digits that it did not pose are stretched.
    pub fn pose(&self, scene: &Scene<'_>) -> HandPose {
        let mut digits = scene.task.rig.stretched();
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
    /// Asks `stop` at least every 50 µs or so of work.
    ///
    /// # Errors
    /// The first failed check of the freshly placed hand, or the stop.
    pub fn run(
        &mut self,
        scene: &Scene<'_>,
        stream: &mut AttemptStream,
        stopwatch: &mut Stopwatch<'_>,
        stop: Stop<'_>,
    ) -> Result<Box<Grasp>, Failure> {
        stopwatch.start();
        self.pruned_placements = 0;
        self.posed.clear();
        self.is_special = false;
        let course = &mut Course {
            scene,
            stream,
            stopwatch,
            stop,
        };
        let Some(around) = scene.surroundings() else {
            return self.try_by_thesis(course);
        };
        if let Some(other) = &scene.query.other_hand {
            return self.try_both_hands(&around, other, course);
        }
        let fresh = self.try_physically(&around, course);
        if self.is_special || scene.seeds.is_empty() || !matches!(fresh, Err(Failure::Rejected { .. })) {
            return fresh;
        }
        let seeded = self.try_seeds(&around, course)?;
        seeded.map_or(fresh, Ok)
    }

    /// Algorithm 1, with the wrist placed according to the strategy.
    fn try_by_thesis(&mut self, course: &mut Course<'_, '_>) -> Result<Box<Grasp>, Failure> {
        let Course { scene, stop, .. } = *course;
        let Self {
            thesis,
            wrist,
            pruned_placements,
            ..
        } = self;
        let place_wrist = |stream: &mut AttemptStream| {
            *wrist = if scene.query.strategy == Strategy::Guided {
                WristFrame::new(scene.guided_proposal(stream, stop)?.proposal.object_from_wrist)
            } else {
                scene.thesis.placer.place(stream, stop, pruned_placements)?
            };
            admitted(scene, wrist)
        };
        let held =
            thesis.try_synthesize_grasp(&scene.thesis, place_wrist, course.stream, course.stopwatch, stop);
        self.posed
            .extend(thesis.posed_digits().iter().map(|digit| digit.angles));
        let grasp = thesis_grasp(&scene.thesis.holdout.object, scene.task.rig, held?);
        if scene.query.requirements.admits(&grasp) && scene.admits_wrist(grasp.pose.frame_from_wrist) {
            Ok(Box::new(grasp))
        } else {
            Err(Rejection::UnmetRequirement.into())
        }
    }

    /// `PHYSICAL` validity, with the hand placed according to the strategy.
    fn try_physically(
        &mut self,
        around: &GraspContext<'_>,
        course: &mut Course<'_, '_>,
    ) -> Result<Box<Grasp>, Failure> {
        let Course { scene, stop, .. } = *course;
        let is_guided = scene.query.strategy == Strategy::Guided;
        let placed = if is_guided {
            scene.guided_proposal(course.stream, stop).map(|guided| {
                self.is_special = guided.is_special;
                let Guided { proposal, .. } = guided;
                (WristFrame::new(proposal.object_from_wrist), Some(proposal))
            })
        } else {
            let placer = &scene.thesis.placer;
            let placed = placer.place(course.stream, stop, &mut self.pruned_placements);
            placed.map(|wrist| (wrist, None)).map_err(Failure::from)
        };
        course.stopwatch.lap(Step::WristPlacement);
        let (wrist, proposal) = placed?;
        self.wrist = wrist;
        admitted(scene, &wrist)?;
        let proposal = proposal.unwrap_or_else(|| Proposal {
            object_from_wrist: wrist.object_from_wrist,
            shape: HandShape::draw(scene.query.bend_ratios, course.stream),
            advance: 0.0,
        });
        let physical = &mut self.physical;
        let held = if is_guided {
            physical.hold_or_refine(around, &proposal, course.stream, course.stopwatch, stop)
        } else {
            physical.hold(around, &proposal, course.stopwatch, stop)
        };
        self.posed.extend_from_slice(&physical.gripper.posed);
        held
    }

    /// Two hands that hold the object together.
    fn try_both_hands(
        &mut self,
        around: &GraspContext<'_>,
        other: &PreparedRig,
        course: &mut Course<'_, '_>,
    ) -> Result<Box<Grasp>, Failure> {
        let around_other = GraspContext {
            rig: other,
            ..*around
        };
        let hands = &mut self.both_hands;
        let contexts = [around, &around_other];
        let held = hands.hold(contexts, other, course);
        if let Some(placed) = hands.placed {
            self.wrist = WristFrame::new(placed);
        }
        self.posed.extend_from_slice(&hands.first.posed);
        held
    }

    /// Tries [`SEEDS_PER_ATTEMPT`] hands perturbed from known grips.
    fn try_seeds(
        &mut self,
        around: &GraspContext<'_>,
        course: &mut Course<'_, '_>,
    ) -> Result<Option<Box<Grasp>>, Failure> {
        let Course { scene, stop, .. } = *course;
        let (seeds, entries) = scene.seeds.of_attempt(course.stream.attempt(), around, stop)?;
        let place = scene.place_of(scene.task.rig);
        for _ in 0..SEEDS_PER_ATTEMPT {
            stop.check()?;
            let proposal = seeds.propose(entries, &place, course.stream).filter(|proposal| {
                let wrist = proposal.object_from_wrist;
                scene.admits_wrist(wrist) && place.is_chosen(wrist, course.stream)
            });
            course.stopwatch.lap(Step::WristPlacement);
            let Some(proposal) = proposal else { continue };
            let physical = &mut self.physical;
            match physical.hold_or_refine(around, &proposal, course.stream, course.stopwatch, stop) {
                Ok(grasp) => return Ok(Some(grasp)),
                Err(Failure::Rejected { .. }) => {}
                Err(Failure::Stopped) => return Err(Failure::Stopped),
            }
        }
        Ok(None)
    }
}

/// The wrist, if it meets the request's requirements.
fn admitted(scene: &Scene<'_>, wrist: &WristFrame) -> Result<WristFrame, Failure> {
    if scene.admits_wrist(wrist.object_from_wrist) {
        Ok(*wrist)
    } else {
        Err(Rejection::UnmetRequirement.into())
    }
}

/// Consecutive perturbations without improvement after which a near miss is given up. More find grasps of thin objects sooner and
/// those of others later.
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
