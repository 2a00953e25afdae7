//! One attempt: places a hand by the strategy, closes it and checks its validity. If that fails and seeds are known, it tries hands
//! perturbed from those. `BothHands` does the same for two hands.

use glam::Vec3;

use super::scene::{Guided, Scene};
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
        both_hands::{HalfGrip, are_clear, suits_one_body},
        grip::{Grip, Gripper},
        immobility::Buffers,
        shape::{HandShape, Proposal},
        solids::{HandSolids, PreparedHand},
    },
    propose::{
        both_hands::{Aim, Mirror},
        prepared::PreparedRig,
    },
    rating::{
        assessment::{GraspContext, assess_both, thesis_grasp},
        scoring::middle,
    },
    thesis::{algorithm_1::ThesisAttempt, finger_posing::PosedDigit, wrist_placement::WristFrame},
};

/// Perturbed hands that an attempt tries after its fresh one.
const SEEDS_PER_ATTEMPT: usize = 16;

/// The scene of an attempt, its random stream, stopwatch and stop.
struct Course<'a, 'b> {
    scene: &'a Scene<'a>,
    stream: &'a mut AttemptStream,
    stopwatch: &'a mut Stopwatch<'b>,
    stop: Stop<'a>,
}

/// The state of an attempt. Reuse it for the next attempt to keep its buffers.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// Placements that the pruning measures discarded before the accepted one.
    pub pruned_placements: u64,
    wrist: WristFrame,
    /// The digits posed so far, thumb first.
    posed: Vec<DigitAngles>,
    thesis: ThesisAttempt,
    gripper: Gripper,
    both_hands: BothHands,
    is_special: bool,
}

impl Default for Attempt {
    fn default() -> Self {
        Self {
            pruned_placements: 0,
            wrist: WristFrame::new(Pose::IDENTITY),
            posed: Vec::with_capacity(5),
            thesis: ThesisAttempt::default(),
            gripper: Gripper::answering(),
            both_hands: BothHands::default(),
            is_special: false,
        }
    }
}

impl Attempt {
    /// The pose of the wrist.
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

    /// The hand so far; digits not yet posed are stretched.
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

    /// Tries a freshly placed hand and, if that fails and seeds are known, some hands perturbed from those; or two hands together,
    /// if requested. Asks `stop` at least every 50 µs or so of work.
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

    /// Runs Algorithm 1 with the wrist placed by the strategy.
    fn try_by_thesis(&mut self, course: &mut Course<'_, '_>) -> Result<Box<Grasp>, Failure> {
        let Course { scene, stop, .. } = *course;
        let place_wrist = |stream: &mut AttemptStream| {
            self.wrist = if scene.query.strategy == Strategy::Guided {
                WristFrame::new(scene.guided_proposal(stream, stop)?.proposal.object_from_wrist)
            } else {
                let pruned = &mut self.pruned_placements;
                scene.thesis.placer.place(stream, stop, pruned)?
            };
            admitted(scene, &self.wrist)
        };
        let thesis = &mut self.thesis;
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

    /// Seeks a grasp of `PHYSICAL` validity with the hand placed by the strategy.
    fn try_physically(
        &mut self,
        around: &GraspContext<'_>,
        course: &mut Course<'_, '_>,
    ) -> Result<Box<Grasp>, Failure> {
        let Course { scene, stop, .. } = *course;
        let is_guided = scene.query.strategy == Strategy::Guided;
        let placed = if is_guided {
            scene.guided_proposal(course.stream, stop).map(|guided| {
                let Guided { proposal, is_special } = guided;
                self.is_special = is_special;
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
        let gripper = &mut self.gripper;
        let held = if is_guided {
            hold_or_refine(gripper, around, &proposal, course.stream, course.stopwatch, stop)
        } else {
            hold(gripper, around, &proposal, course.stopwatch, stop)
        };
        self.posed.extend_from_slice(&gripper.posed);
        held
    }

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
            let proposal = seeds
                .propose(entries, false, &place, course.stream)
                .filter(|proposal| {
                    let wrist = proposal.object_from_wrist;
                    scene.admits_wrist(wrist) && place.is_chosen(wrist, course.stream)
                });
            course.stopwatch.lap(Step::WristPlacement);
            let Some(proposal) = proposal else { continue };
            let gripper = &mut self.gripper;
            match hold_or_refine(gripper, around, &proposal, course.stream, course.stopwatch, stop) {
                Ok(grasp) => return Ok(Some(grasp)),
                Err(Failure::Rejected { .. }) => {}
                Err(Failure::Stopped) => return Err(Failure::Stopped),
            }
        }
        Ok(None)
    }
}

fn admitted(scene: &Scene<'_>, wrist: &WristFrame) -> Result<WristFrame, Failure> {
    let is_admitted = scene.admits_wrist(wrist.object_from_wrist);
    let admitted = is_admitted.then_some(*wrist);
    admitted.ok_or_else(|| Rejection::UnmetRequirement.into())
}

/// Consecutive perturbations without improvement before a near miss is given up.
const MAX_FAILED_REFINEMENTS: usize = 4;

/// Closes and checks a proposed hand.
///
/// # Errors
/// The first check that fails, or the stop signal.
pub fn hold(
    gripper: &mut Gripper,
    around: &GraspContext<'_>,
    proposal: &Proposal,
    stopwatch: &mut Stopwatch<'_>,
    stop: Stop<'_>,
) -> Result<Box<Grasp>, Failure> {
    let (grip, solids) = close(gripper, around, proposal, stopwatch, stop)?;
    Ok(around.assess(&grip, &solids, gripper, stopwatch)?)
}

fn close(
    gripper: &mut Gripper,
    around: &GraspContext<'_>,
    proposal: &Proposal,
    stopwatch: &mut Stopwatch<'_>,
    stop: Stop<'_>,
) -> Result<(Grip, HandSolids), Failure> {
    let presented = Some(around.presented);
    gripper.grip(&around.object, around.rig, proposal, presented, stopwatch, stop)
}

/// Closes and checks a proposed hand. If it nearly has enough closure, perturbs it repeatedly, always from the hand with most
/// closure.
///
/// # Errors
/// The first check that the proposed hand fails, an unmet requirement if a perturbed hand fails nothing else, or the stop signal.
pub fn hold_or_refine(
    gripper: &mut Gripper,
    around: &GraspContext<'_>,
    proposal: &Proposal,
    stream: &mut AttemptStream,
    stopwatch: &mut Stopwatch<'_>,
    stop: Stop<'_>,
) -> Result<Box<Grasp>, Failure> {
    let mut rejected = hold(gripper, around, proposal, stopwatch, stop);
    let (Err(Failure::Rejected { .. }), Some(share)) = (&rejected, gripper.near_miss()) else {
        return rejected;
    };
    // A failed attempt reports the proposed hand, not a perturbed one.
    let posed = gripper.posed.clone();
    let mut nearest = (share, *proposal);
    let mut failures = 0;
    while failures < MAX_FAILED_REFINEMENTS {
        failures += 1;
        let perturbed = nearest.1.perturbed(stream);
        match hold(gripper, around, &perturbed, stopwatch, stop) {
            // The hand holds the object but violates the requirements.
            Err(unmet) if unmet == Rejection::UnmetRequirement.into() => {
                rejected = Err(unmet);
                break;
            }
            Err(Failure::Rejected { .. }) => {}
            end => return end,
        }
        if let Some(share) = gripper.near_miss().filter(|&share| share > nearest.0) {
            nearest = (share, perturbed);
            failures = 0;
        }
    }
    gripper.posed = posed;
    rejected
}

/// Hands tried opposite a hand that holds its side. More find holds of lopsided objects sooner, those of others later.
const OTHER_HANDS: usize = 8;

/// Share of attempts whose first hand must have a mirror image that suits the same body. The others serve objects without symmetry.
const SYMMETRIC_SHARE: f32 = 0.75;

/// The first hand of an attempt, and the buffers of both.
#[derive(Clone, Debug)]
struct BothHands {
    first: Gripper,
    /// Wrist pose at which the first hand was placed; `None` if no placement fits.
    placed: Option<Pose>,
    other: Gripper,
    buffers: Buffers,
}

impl Default for BothHands {
    fn default() -> Self {
        Self {
            first: Gripper::sharing(),
            placed: None,
            other: Gripper::sharing(),
            buffers: Buffers::default(),
        }
    }
}

/// A first hand that holds its side, and the data that the other hand needs.
struct First<'a> {
    around: &'a GraspContext<'a>,
    proposal: Proposal,
    half: HalfGrip,
    obstacle: PreparedHand,
    place: Vec3,
}

impl BothHands {
    /// Draws and closes a hand, then up to [`OTHER_HANDS`] other hands until one holds together with it.
    fn hold(
        &mut self,
        [around, around_other]: [&GraspContext<'_>; 2],
        other_rig: &PreparedRig,
        course: &mut Course<'_, '_>,
    ) -> Result<Box<Grasp>, Failure> {
        self.placed = None;
        self.first.posed.clear();
        let first = self.hold_first(around, around_other, course)?;
        let object = around.object.object;
        let up = around.presented.up;
        let mirrors: Vec<Mirror> = Mirror::beside(object, up, first.place).collect();
        let admits = |wrist: Pose| {
            around.requirements.admits_wrist(wrist)
                && suits_one_body(
                    [
                        (around.rig, first.half.grip.pose.frame_from_wrist),
                        (around_other.rig, wrist),
                    ],
                    up,
                )
        };
        let place = course.scene.place_of(other_rig);
        let mut rejection = Rejection::NoContacts;
        for attempt in 0..OTHER_HANDS {
            let proposal = if let Some(mirror) = mirrors.get(attempt) {
                Some(mirror.proposal(&first.proposal))
            } else {
                let across = match mirrors.len() {
                    0 => 2.0 * object.centre_of_mass - first.place,
                    count => mirrors[course.stream.below(count)].point(first.place),
                };
                place.propose_half(Aim::Near(across), admits, course.stream, course.stop)
            };
            course.stopwatch.lap(Step::WristPlacement);
            course.stop.check()?;
            let Some(proposal) = proposal else { continue };
            match self.complete(&first, around_other, &proposal, admits, course) {
                Err(Failure::Rejected { rejection: other, .. }) => rejection = other,
                end => return end,
            }
        }
        Err(rejection.into())
    }

    fn hold_first<'a>(
        &mut self,
        around: &'a GraspContext<'_>,
        around_other: &GraspContext<'_>,
        course: &mut Course<'_, '_>,
    ) -> Result<First<'a>, Failure> {
        let object = around.object.object;
        let up = around.presented.up;
        let is_symmetric = course.stream.unit() < SYMMETRIC_SHARE;
        let admits = |wrist: Pose| {
            let palm = wrist.transform_point(around.rig.palm);
            let suits = |mirror: Mirror| {
                suits_one_body([(around.rig, wrist), (around_other.rig, mirror.wrist(wrist))], up)
            };
            around.requirements.admits_wrist(wrist)
                && (!is_symmetric || Mirror::beside(object, up, palm).any(suits))
        };
        let aim = Aim::Outside {
            centre: object.centre_of_mass,
            up,
        };
        let proposal = course.scene.place_of(course.scene.task.rig).propose_half(
            aim,
            admits,
            course.stream,
            course.stop,
        );
        course.stopwatch.lap(Step::WristPlacement);
        course.stop.check()?;
        let proposal = proposal.ok_or(Rejection::NoContacts)?;
        self.placed = Some(proposal.object_from_wrist);
        let half = close_half(&mut self.first, around, &proposal, course)?;
        Ok(First {
            around,
            proposal,
            obstacle: PreparedHand::new(&half.tracked(around.rig)),
            place: middle(half.contacts.iter()),
            half,
        })
    }

    fn complete(
        &mut self,
        first: &First<'_>,
        around: &GraspContext<'_>,
        proposal: &Proposal,
        admits: impl Fn(Pose) -> bool,
        course: &mut Course<'_, '_>,
    ) -> Result<Box<Grasp>, Failure> {
        let half = close_half(&mut self.other, around, proposal, course)?;
        // Closing may have moved either wrist since its placement.
        if !admits(half.grip.pose.frame_from_wrist) {
            return Err(Rejection::UnmetRequirement.into());
        }
        let is_clear = are_clear(&first.obstacle, &half.tracked(around.rig));
        course.stopwatch.lap(Step::CollisionValidation);
        if !is_clear {
            return Err(Rejection::FingerCollision.into());
        }
        Ok(assess_both(
            [first.around, around],
            [&first.half, &half],
            &mut self.buffers,
            course.stopwatch,
        )?)
    }
}

fn close_half(
    gripper: &mut Gripper,
    around: &GraspContext<'_>,
    proposal: &Proposal,
    course: &mut Course<'_, '_>,
) -> Result<HalfGrip, Failure> {
    let (grip, solids) = close(gripper, around, proposal, course.stopwatch, course.stop)?;
    Ok(HalfGrip {
        grip,
        solids,
        contacts: gripper.contacts.clone(),
    })
}
