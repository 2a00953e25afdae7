//! What all attempts of a search share.

use std::sync::{Arc, OnceLock};

use super::{
    current::{CurrentGrasp, RecentHands},
    preference::Preference,
    settings::SearchSettings,
    turns::{HandleUse, Turn},
};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::{Stop, Stopped},
    },
    known::{
        entry::Entry,
        seed_source::{SeedContext, SeedSets, SeedSource},
        seeds::Seeds,
    },
    model::{
        grasp::Grasp,
        hand::{Digit, joints::HandJoints, rig::Rig},
        holdout::Holdout,
        requirements::Requirements,
        strategy::{BendRatioChoice, Strategy, Validity},
    },
    physical::{
        barriers::Barriers,
        grip::{Grip, wrist_after_advance},
        presented::{ObjectScene, Presented},
        shape::{HandShape, Proposal},
    },
    propose::{
        handles::wrap_handle,
        hooks::HangingPlaces,
        placement_cache::{PlacementCache, ROWS},
        prepared::{PreparedObject, PreparedRig},
        proposal::{ProposalContext, propose, propose_evenly},
    },
    rating::assessment::GraspContext,
    thesis,
};

/// Every how many attempts one is placed next to the present hand of a current grasp, and how far from it, in metres per axis
/// and radians. More of them find nothing where the giver has moved in.
const NEAR_HAND_EVERY: u64 = 2;
const NEAR_HAND: [f32; 2] = [0.03, 0.5];

/// What to grasp, and with which hand.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// How the object is held out.
    pub holdout: &'a Holdout,
    /// The holdout's object, prepared for proposals. A different object gives poor proposals; the checks use
    /// the holdout's.
    pub object: &'a PreparedObject,
    /// The receiving hand.
    pub rig: &'a PreparedRig,
}

/// A hand as `GUIDED` search proposes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guided {
    /// The hand.
    pub(super) proposal: Proposal,
    /// Whether it wraps a handle or hooks in: such hands succeed so often, and fail so soon, that others from seeds need not
    /// follow.
    pub(super) is_special: bool,
}

/// A holdout and the way attempts run, with data about the holdout that is computed once.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    task: Task<'a>,
    /// Strategy, friction and what Algorithm 1 derives from them.
    thesis: thesis::algorithm_1::ThesisScene<'a>,
    /// Present under `PHYSICAL` validity.
    physical: Option<(ObjectScene<'a>, Presented)>,
    /// Cached placements of the receiving hand, computed on first use.
    placements: OnceLock<Arc<PlacementCache>>,
    /// Where the object may hang in hooked fingers, computed on first use.
    hanging_places: OnceLock<HangingPlaces>,
    requirements: Requirements,
    /// Seeds of attempts, under `GUIDED` and `PHYSICAL`.
    seeds: SeedSets,
    /// The receiver's other hand, if both are to hold the object together.
    other_hand: Option<PreparedRig>,
    /// What a person would choose, computed on first use.
    preference: OnceLock<Preference>,
    /// The grasp to hold on to.
    current: Option<CurrentGrasp>,
    /// Where other people's hands were lately, and that prepared on first use.
    moved_hands: Arc<[Arc<HandJoints>]>,
    recent_hands: OnceLock<RecentHands>,
}

impl<'a> Scene<'a> {
    /// Prepares attempts at a task.
    pub fn new(task: Task<'a>, settings: &SearchSettings) -> Self {
        let query = &settings.query;
        let seeds = if query.uses_known_grips() {
            settings.known.seeds.clone()
        } else {
            SeedSource::Nothing
        };
        let Task { holdout, rig, .. } = task;
        let friction = query.friction_on(&holdout.object);
        Self {
            task,
            thesis: thesis::algorithm_1::ThesisScene::new(
                holdout,
                rig,
                query.strategy,
                query.bend_ratios,
                friction,
            ),
            placements: OnceLock::new(),
            hanging_places: OnceLock::new(),
            requirements: query.requirements,
            seeds: SeedSets::new(seeds),
            other_hand: query.other_hand.clone(),
            preference: OnceLock::new(),
            current: query.current,
            moved_hands: Arc::clone(&query.recent_hands),
            recent_hands: OnceLock::new(),
            physical: match query.validity {
                Validity::Thesis => None,
                Validity::Physical => Some((
                    ObjectScene::new(&holdout.object, friction),
                    Presented::of(holdout),
                )),
            },
        }
    }

    /// Under `PHYSICAL` validity: the object and how it is presented.
    pub fn physical(&self) -> Option<(&ObjectScene<'a>, &Presented)> {
        self.physical
            .as_ref()
            .map(|(object, presented)| (object, presented))
    }

    /// The receiving hand.
    pub fn rig(&self) -> &'a Rig {
        self.task.rig
    }

    /// How hands are placed.
    pub fn strategy(&self) -> Strategy {
        self.thesis.strategy
    }

    /// Which bend ratios a digit tries.
    pub fn bend_ratios(&self) -> BendRatioChoice {
        self.thesis.bend_ratios
    }

    /// The requirements on grasps.
    pub fn requirements(&self) -> &Requirements {
        &self.requirements
    }

    /// True if the requirements admit a wrist pose, and the receiver's arm reaches it if it must.
    pub(super) fn admits_wrist(&self, object_from_wrist: Pose) -> bool {
        let presented = self.physical.as_ref().map(|(_, presented)| presented);
        let Task { holdout, rig, .. } = self.task;
        self.requirements.admits_wrist(object_from_wrist)
            && holdout.object.admits_wrist(rig.handedness, object_from_wrist)
            && presented.is_none_or(|presented| presented.receiver.reaches(rig, object_from_wrist))
    }

    /// The input of Algorithm 1.
    pub(super) fn thesis(&self) -> &thesis::algorithm_1::ThesisScene<'a> {
        &self.thesis
    }

    /// Under `PHYSICAL` validity: the input of an attempt.
    pub(super) fn surroundings(&self) -> Option<GraspContext<'_>> {
        let (object, presented) = self.physical.as_ref()?;
        Some(GraspContext {
            object: *object,
            presented,
            rig: self.task.rig,
            requirements: &self.requirements,
        })
    }

    /// How the object is held out.
    pub(super) fn holdout(&self) -> &Holdout {
        self.task.holdout
    }

    /// The receiver's other hand, if both are to hold the object together.
    pub(super) fn other_hand(&self) -> Option<&PreparedRig> {
        self.other_hand.as_ref()
    }

    /// Poses the receiver's arm of a grasp, if where the receiver stands can be assumed.
    pub(super) fn pose_arm(&self, grasp: &mut Grasp) {
        if let Some((object, presented)) = &self.physical
            && grasp.arm.is_none()
        {
            grasp.arm = presented.arm_of(object.object, self.task.rig, grasp.pose.frame_from_wrist);
        }
    }

    /// The grasp to hold on to.
    pub fn current(&self) -> Option<&CurrentGrasp> {
        self.current.as_ref()
    }

    /// Where other people's hands were lately, if that is known.
    pub(super) fn recent_hands(&self) -> Option<&RecentHands> {
        let recent = || RecentHands::of(&self.moved_hands);
        (!self.moved_hands.is_empty()).then(|| self.recent_hands.get_or_init(recent))
    }

    /// What a person would choose.
    pub(super) fn preference(&self) -> Preference {
        *self.preference.get_or_init(|| {
            let presented = self.physical.as_ref().map(|(_, presented)| presented);
            let barriers = presented.map_or(Barriers::NONE, Presented::barriers);
            Preference::of(self.task.object, barriers)
        })
    }

    /// Where `GUIDED` search may place the receiving hand.
    pub(super) fn place(&self) -> ProposalContext<'_> {
        self.place_of(self.task.rig)
    }

    /// Where it may place either hand.
    pub(super) fn place_of<'b>(&'b self, rig: &'b PreparedRig) -> ProposalContext<'b> {
        let Task { object, .. } = self.task;
        let presented = self.physical.as_ref().map(|(_, presented)| presented);
        ProposalContext {
            object: object.object(),
            surface: object.surface_pairs(),
            barriers: presented.map_or(Barriers::NONE, Presented::barriers),
            // Two hands carry from below and at the ends.
            chooses: presented.filter(|_| self.other_hand.is_none()),
            rig,
            placements: None,
        }
    }

    /// The same with cached placements, which only the first attempts use.
    fn cached_place(&self, attempt: u64) -> ProposalContext<'_> {
        let Task { object, rig, .. } = self.task;
        let placements = || self.placements.get_or_init(|| object.placement_cache(rig));
        ProposalContext {
            placements: (attempt < ROWS).then(|| &**placements()),
            ..self.place()
        }
    }

    /// A hand proposed by `GUIDED` search, with the palm settled on its target.
    ///
    /// # Errors
    /// The object offers no placement, or the stop came.
    pub(super) fn guided_proposal(
        &self,
        stream: &mut AttemptStream,
        stop: Stop<'_>,
    ) -> Result<Guided, Failure> {
        if let Some(near) = self.near_present_hand(stream) {
            return Ok(near);
        }
        if let Some((_, presented)) = &self.physical {
            let object = self.task.object;
            let has_handles = !object.handles().places().is_empty();
            let handles = match (has_handles, self.preference().wants_handle) {
                (false, _) => HandleUse::Impossible,
                (true, false) => HandleUse::Possible,
                (true, true) => HandleUse::Wanted,
            };
            let turn = Turn::of(stream.attempt(), object.mass, handles, self.requirements.hooks());
            let special = match turn {
                Turn::Anywhere => None,
                Turn::Handle => self.wrap(stream),
                Turn::Hook => self.hook(presented, stream, stop)?,
            };
            if let Some(proposal) = special {
                return Ok(Guided {
                    proposal,
                    is_special: true,
                });
            }
            // The proposal has checked palm and forearm already.
            let proposal = propose(&self.cached_place(stream.attempt()), stream, stop);
            stop.check()?;
            return Ok(Guided {
                proposal: proposal.ok_or(Rejection::NoContacts)?,
                is_special: false,
            });
        }
        // The success prior was learned under `PHYSICAL` validity.
        let proposal = propose_evenly(&self.place(), stream, stop);
        stop.check()?;
        let proposal = proposal.ok_or(Rejection::NoContacts)?;
        let scene = ObjectScene::new(&self.task.holdout.object, self.thesis.load.friction);
        let proposal = Proposal {
            object_from_wrist: wrist_after_advance(&scene, self.task.rig, &proposal)
                .ok_or(Rejection::NoContacts)?,
            advance: 0.0,
            ..proposal
        };
        Ok(Guided {
            proposal,
            is_special: false,
        })
    }

    /// A hand next to the present one, in some attempts after a current grasp. Leaves the stream as [`Self::wrap`] does.
    fn near_present_hand(&self, stream: &AttemptStream) -> Option<Guided> {
        let current = self.current.as_ref()?;
        if !stream.attempt().is_multiple_of(NEAR_HAND_EVERY) {
            return None;
        }
        let rig: &Rig = self.task.rig;
        let grip = Grip {
            pose: current.hand,
            bend_ratios: Digit::ALL.map(|digit| rig.has(digit).then_some(1.0)),
            penetration: 0.0,
            epsilon: 0.0,
        };
        let wrist = current.present.frame_from_wrist;
        let there = Proposal {
            object_from_wrist: wrist,
            shape: HandShape::of_grip(rig, &grip),
            advance: 0.0,
        };
        let pivot = wrist.transform_point(rig.palm);
        let proposal = there.perturbed_about(pivot, NEAR_HAND, &mut stream.clone());
        Some(Guided {
            proposal,
            is_special: false,
        })
    }

    /// A wrapped handle, if the object has one with room for the hand.
    fn wrap(&self, stream: &AttemptStream) -> Option<Proposal> {
        // Leaves the numbers that other proposals draw from the stream as they are.
        wrap_handle(&self.place(), &mut stream.clone())
    }

    /// Hooked fingers, if the object may hang in them. Leaves the stream as [`Self::wrap`] does.
    fn hook(
        &self,
        presented: &Presented,
        stream: &AttemptStream,
        stop: Stop<'_>,
    ) -> Result<Option<Proposal>, Stopped> {
        let Task { object, rig, .. } = self.task;
        let places = if let Some(places) = self.hanging_places.get() {
            places
        } else {
            let pairs = object.surface_pairs();
            let probed = HangingPlaces::of(object.object(), pairs, presented.up, stop)?;
            self.hanging_places.get_or_init(|| probed)
        };
        let place = self.place();
        let fits = |wrist| place.palm_fits(wrist);
        Ok(places.propose(rig, place.barriers, fits, &mut stream.clone()))
    }

    /// True if there are no seeds.
    pub(super) fn has_no_seeds(&self) -> bool {
        self.seeds.is_empty()
    }

    /// The seeds of an attempt and the grips they index.
    pub(super) fn seeds(
        &self,
        presented: &Presented,
        attempt: u64,
        stop: Stop<'_>,
    ) -> Result<(&Seeds, &[Entry]), Stopped> {
        let context = SeedContext {
            rig: self.task.rig,
            presented,
            requirements: &self.requirements,
        };
        self.seeds.of_attempt(attempt, &context, stop)
    }
}
