//! The data that all attempts of a search share, and the hands that `GUIDED` search proposes from it.

use std::sync::{Arc, OnceLock};

use super::{
    current::{CurrentGrasp, RecentHands},
    preference::{HandleUse, Preference, Turn},
    settings::{Query, SearchSettings},
};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::{Stop, Stopped},
    },
    known::seeds::{SeedSets, SeedSource},
    model::{
        grasp::Grasp,
        hand::{Digit, rig::Rig},
        holdout::Holdout,
        strategy::Validity,
    },
    physical::{
        barriers::Barriers,
        grip::{Grip, wrist_after_advance},
        presented::{ObjectScene, Presented},
        shape::{HandShape, Proposal},
    },
    propose::{
        handles::{HangingPlaces, wrap_handle},
        prepared::{PlacementCache, PreparedObject, PreparedRig, ROWS},
        proposal::{ProposalContext, propose, propose_evenly},
    },
    rating::assessment::GraspContext,
    thesis::algorithm_1::ThesisScene,
};

/// Every how many attempts one starts next to the present hand of a current grasp, and how far from it, in metres per axis and
/// radians. More of them find nothing where the giver moved in.
const NEAR_HAND_EVERY: u64 = 2;
const NEAR_HAND: [f32; 2] = [0.03, 0.5];

/// The holdout and the hand that takes the object.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// How the object is held out.
    pub holdout: &'a Holdout,
    /// The holdout's object, prepared for proposals. A different object gives poor proposals; the checks use the holdout's.
    pub object: &'a PreparedObject,
    /// The receiving hand.
    pub rig: &'a PreparedRig,
}

/// A hand as `GUIDED` search proposes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guided {
    pub(super) proposal: Proposal,
    /// True if it wraps a handle or hooks in: such hands succeed often and fail soon, so no seeds follow.
    pub(super) is_special: bool,
}

/// A holdout and the way attempts run, with data about the holdout that is computed once.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    pub(super) task: Task<'a>,
    pub(super) query: Query,
    /// Strategy, friction and the data that Algorithm 1 derives from them.
    pub(super) thesis: ThesisScene<'a>,
    object: ObjectScene<'a>,
    presented: Option<Presented>,
    pub(super) seeds: SeedSets,
    // Computed on first use: cached placements of the receiving hand, places to hook in, the preference among grasps, and the
    // recent hands of other people.
    placements: OnceLock<Arc<PlacementCache>>,
    hanging_places: OnceLock<HangingPlaces>,
    preference: OnceLock<Preference>,
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
            query: query.clone(),
            thesis: ThesisScene::new(holdout, rig, query.strategy, query.bend_ratios, friction),
            object: ObjectScene::new(&holdout.object, friction),
            presented: (query.validity == Validity::Physical).then(|| Presented::of(holdout)),
            seeds: SeedSets::new(seeds),
            placements: OnceLock::new(),
            hanging_places: OnceLock::new(),
            preference: OnceLock::new(),
            recent_hands: OnceLock::new(),
        }
    }

    /// The context in which hands are assessed, under `PHYSICAL` validity.
    pub(super) fn surroundings(&self) -> Option<GraspContext<'_>> {
        Some(GraspContext {
            object: self.object,
            presented: self.presented.as_ref()?,
            rig: self.task.rig,
            requirements: &self.query.requirements,
        })
    }

    /// True if the requirements admit a wrist pose, and the receiver's arm reaches it if it has to.
    pub(super) fn admits_wrist(&self, object_from_wrist: Pose) -> bool {
        let Task { holdout, rig, .. } = self.task;
        let presented = self.presented.as_ref();
        self.query.requirements.admits_wrist(object_from_wrist)
            && holdout.object.admits_wrist(rig.handedness, object_from_wrist)
            && presented.is_none_or(|presented| presented.receiver.reaches(rig, object_from_wrist))
    }

    /// Poses the receiver's arm of a grasp if the receiver's position is known or assumed.
    pub(super) fn pose_arm(&self, grasp: &mut Grasp) {
        if let Some(presented) = &self.presented
            && grasp.arm.is_none()
        {
            let wrist = grasp.pose.frame_from_wrist;
            grasp.arm = presented.arm_of(self.object.object, self.task.rig, wrist);
        }
    }

    pub(super) fn current(&self) -> Option<&CurrentGrasp> {
        self.query.current.as_ref()
    }

    pub(super) fn recent_hands(&self) -> Option<&RecentHands> {
        let hands = &self.query.recent_hands;
        (!hands.is_empty()).then(|| self.recent_hands.get_or_init(|| RecentHands::of(hands)))
    }

    pub(super) fn preference(&self) -> Preference {
        *self
            .preference
            .get_or_init(|| Preference::of(self.task.object, self.barriers()))
    }

    fn barriers(&self) -> Barriers<'_> {
        self.presented
            .as_ref()
            .map_or(Barriers::NONE, Presented::barriers)
    }

    /// The context of `GUIDED` proposals for the receiving hand or the other one.
    pub(super) fn place_of<'b>(&'b self, rig: &'b PreparedRig) -> ProposalContext<'b> {
        let Task { object, .. } = self.task;
        ProposalContext {
            object: object.object(),
            surface: &object.surface_pairs,
            barriers: self.barriers(),
            // Two hands carry from below and at the ends.
            chooses: self
                .presented
                .as_ref()
                .filter(|_| self.query.other_hand.is_none()),
            rig,
            placements: None,
        }
    }

    /// A hand proposed by `GUIDED` search, with the palm settled on its target.
    pub(super) fn guided_proposal(
        &self,
        stream: &mut AttemptStream,
        stop: Stop<'_>,
    ) -> Result<Guided, Failure> {
        let anywhere = |proposal| Guided {
            proposal,
            is_special: false,
        };
        if let Some(near) = self.near_present_hand(stream) {
            return Ok(anywhere(near));
        }
        let Task { object, rig, .. } = self.task;
        let place = self.place_of(rig);
        let Some(presented) = &self.presented else {
            // The success prior was learned under `PHYSICAL` validity.
            let proposal = propose_evenly(&place, stream, stop);
            stop.check()?;
            let proposal = proposal.ok_or(Rejection::NoContacts)?;
            let wrist = wrist_after_advance(&self.object, rig, &proposal);
            return Ok(anywhere(Proposal {
                object_from_wrist: wrist.ok_or(Rejection::NoContacts)?,
                advance: 0.0,
                ..proposal
            }));
        };
        let handles = match (object.handles().places(), self.preference().wants_handle) {
            ([], _) => HandleUse::Impossible,
            (_, false) => HandleUse::Possible,
            (_, true) => HandleUse::Wanted,
        };
        let hooks = self.query.requirements.hooks();
        // Keep the numbers that other proposals draw.
        let own_stream = &mut stream.clone();
        let special = match Turn::of(stream.attempt(), object.mass, handles, hooks) {
            Turn::Anywhere => None,
            Turn::Handle => wrap_handle(&place, own_stream),
            Turn::Hook => {
                let places = self.hanging_places(presented, stop)?;
                places.propose(rig, place.barriers, |wrist| place.palm_fits(wrist), own_stream)
            }
        };
        if let Some(proposal) = special {
            return Ok(Guided {
                proposal,
                is_special: true,
            });
        }
        // Only the first attempts use cached placements. The proposal has checked palm and forearm already.
        let placements = || self.placements.get_or_init(|| object.placement_cache(rig));
        let place = ProposalContext {
            placements: (stream.attempt() < ROWS).then(|| &**placements()),
            ..place
        };
        let proposal = propose(&place, stream, stop);
        stop.check()?;
        Ok(anywhere(proposal.ok_or(Rejection::NoContacts)?))
    }

    /// A hand next to the present one, in some attempts after a current grasp. Leaves the stream unchanged.
    fn near_present_hand(&self, stream: &AttemptStream) -> Option<Proposal> {
        let current = self.current()?;
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
        Some(there.perturbed_about(pivot, NEAR_HAND, &mut stream.clone()))
    }

    fn hanging_places(&self, presented: &Presented, stop: Stop<'_>) -> Result<&HangingPlaces, Stopped> {
        if let Some(places) = self.hanging_places.get() {
            return Ok(places);
        }
        let object = self.task.object;
        let probed = HangingPlaces::of(object.object(), &object.surface_pairs, presented.up, stop)?;
        Ok(self.hanging_places.get_or_init(|| probed))
    }
}
