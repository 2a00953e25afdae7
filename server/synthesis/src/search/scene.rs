//! What all attempts of a search share.

use std::sync::{Arc, OnceLock};

use super::settings::SearchSettings;
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    base::random::AttemptStream,
    known::{
        entry::Entry,
        seed_source::{Demand, SeedSets, SeedSource},
        seeds::Seeds,
    },
    model::{
        bend_ratios::BendRatioChoice,
        constraints::Constraints,
        hand::rig::Rig,
        holdout::Holdout,
        strategy::{Strategy, Validity},
    },
    physical::{
        grip::wrist_after_advance,
        scene::{ObjectScene, Presented},
        shape::Proposal,
    },
    propose::{
        placement_cache::{PlacementCache, ROWS},
        prepared::{PreparedObject, PreparedRig},
        proposal::{ProposalContext, propose, propose_evenly},
        surface_pairs::SurfacePairs,
    },
    rating::assessment::GraspContext,
    thesis,
};

/// Attempts that ask of each pair of points that they draw whether it is off the giver's hand. Many searches end with
/// them; from then on it is worth 180 µs to ask it of all pairs at once, of which a giver who covers the object leaves few.
const ATTEMPTS_BEFORE_FREE_SURFACE: u64 = 4;

/// What is to be taken, and by which hand.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// How the object is held out.
    pub holdout: &'a Holdout,
    /// The same object, prepared. Of another one, proposals would be poor; the checks ask the holdout's.
    pub object: &'a PreparedObject,
    /// The receiving hand.
    pub rig: &'a PreparedRig,
}

/// A holdout and how attempts at it go, with what they find out about it once.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    task: Task<'a>,
    /// Strategy, friction and what Algorithm 1 derives of them.
    thesis: thesis::thesis_scene::ThesisScene<'a>,
    /// Under `PHYSICAL` validity.
    physical: Option<(ObjectScene<'a>, Presented)>,
    /// What the giver's hand leaves of the object's surface, once it was asked for.
    free_surface: OnceLock<SurfacePairs>,
    /// Where the receiving hand has room at the object, once it was asked for.
    placements: OnceLock<Arc<PlacementCache>>,
    constraints: Constraints,
    /// Grips that attempts start from, under `GUIDED` and `PHYSICAL`.
    seeds: SeedSets,
    mechanisms: Mechanisms,
}

impl<'a> Scene<'a> {
    /// Prepares attempts at a task.
    pub fn new(task: Task<'a>, settings: &SearchSettings) -> Self {
        let query = &settings.query;
        let mechanisms = settings.run.mechanisms;
        let seeds_are_used = match &settings.known.seeds {
            SeedSource::Nothing => false,
            SeedSource::Atlas(_) => mechanisms.has(Mechanism::Seeds),
            SeedSource::Transferred(_) => mechanisms.has(Mechanism::TransferredGrips),
        };
        let seeds = if seeds_are_used && query.uses_known_grips() {
            settings.known.seeds.clone()
        } else {
            SeedSource::Nothing
        };
        let Task { holdout, rig, .. } = task;
        let friction = query.friction_on(&holdout.object);
        Self {
            task,
            thesis: thesis::thesis_scene::ThesisScene::new(
                holdout,
                rig,
                query.strategy,
                query.bend_ratios,
                friction,
            ),
            free_surface: OnceLock::new(),
            placements: OnceLock::new(),
            constraints: query.constraints,
            seeds: SeedSets::new(seeds),
            mechanisms,
            physical: match query.validity {
                Validity::Thesis => None,
                Validity::Physical => Some((
                    ObjectScene::new(&holdout.object, friction),
                    Presented::with_mechanisms(mechanisms, holdout),
                )),
            },
        }
    }

    /// Under `PHYSICAL` validity: the object, and how it is held out.
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

    /// What is demanded of the grasps.
    pub fn constraints(&self) -> &Constraints {
        &self.constraints
    }

    /// What Algorithm 1 works with.
    pub(super) fn thesis(&self) -> &thesis::thesis_scene::ThesisScene<'a> {
        &self.thesis
    }

    /// Under `PHYSICAL` validity: what an attempt works with.
    pub(super) fn surroundings(&self) -> Option<GraspContext<'_>> {
        let (object, presented) = self.physical.as_ref()?;
        Some(GraspContext {
            object: *object,
            presented,
            rig: self.task.rig,
            constraints: &self.constraints,
        })
    }

    /// Where GUIDED search proposes the hand of an attempt.
    pub(super) fn place(&self, attempt: u64) -> ProposalContext<'_> {
        let Task { object, rig, .. } = self.task;
        let presented = self.physical.as_ref().map(|(_, presented)| presented);
        let giver = presented.and_then(|presented| presented.giver.as_ref());
        let surface = match giver {
            Some(giver)
                if attempt >= ATTEMPTS_BEFORE_FREE_SURFACE && self.mechanisms.has(Mechanism::FreeSurface) =>
            {
                self.free_surface
                    .get_or_init(|| object.surface_pairs().free_of(giver))
            }
            _ => object.surface_pairs(),
        };
        ProposalContext {
            object: object.object(),
            surface,
            giver,
            rig,
            placements: None,
            mechanisms: self.mechanisms,
        }
    }

    /// The same with the cached placements that the first attempts choose from.
    fn cached_place(&self, attempt: u64) -> ProposalContext<'_> {
        let Task { object, rig, .. } = self.task;
        let placements = || {
            self.placements
                .get_or_init(|| object.placement_cache_with(self.mechanisms, rig))
        };
        let chooses = attempt < ROWS && self.mechanisms.has(Mechanism::PlacementCache);
        ProposalContext {
            placements: chooses.then(|| &**placements()),
            ..self.place(attempt)
        }
    }

    /// A hand as GUIDED search proposes it, with the palm laid on where it is to be; none if the object has nothing for
    /// it, or if interrupted.
    pub(super) fn guided_proposal(
        &self,
        stream: &mut AttemptStream,
        interrupted: &impl Fn() -> bool,
    ) -> Option<Proposal> {
        if self.physical.is_some() {
            // Palm and forearm are looked at on the way there.
            let proposal = propose(&self.cached_place(stream.attempt()), stream, interrupted)?;
            return Some(self.shaped(proposal));
        }
        // What is likely to hold was learned of what holds by `PHYSICAL` validity.
        let proposal = propose_evenly(&self.place(stream.attempt()), stream, interrupted)?;
        let scene = ObjectScene::new(&self.task.holdout.object, self.thesis.load.friction);
        Some(Proposal {
            object_from_wrist: wrist_after_advance(&scene, self.task.rig, &proposal)?,
            advance: 0.0,
            ..proposal
        })
    }

    /// A proposal shaped by the mechanisms that are on.
    pub(super) fn shaped(&self, mut proposal: Proposal) -> Proposal {
        if !self.mechanisms.has(Mechanism::Preshape) {
            proposal.shape.preshape = [0.0; 2];
        }
        if !self.mechanisms.has(Mechanism::TuckedFingers) {
            proposal.shape.tucks = false;
        }
        proposal
    }

    /// The mechanisms that are on.
    pub(super) fn mechanisms(&self) -> Mechanisms {
        self.mechanisms
    }

    /// True if there is no grip to perturb hands near.
    pub(super) fn has_no_seeds(&self) -> bool {
        self.seeds.is_empty()
    }

    /// The grips that an attempt starts from, and those that they are of. None if there are none, or if interrupted.
    pub(super) fn seeds(
        &self,
        presented: &Presented,
        attempt: u64,
        interrupted: &impl Fn() -> bool,
    ) -> Option<(&Seeds, &[Entry])> {
        let demand = Demand {
            rig: self.task.rig,
            presented,
            constraints: &self.constraints,
            mechanisms: self.mechanisms,
        };
        self.seeds.of_attempt(attempt, &demand, interrupted)
    }
}
