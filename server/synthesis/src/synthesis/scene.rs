//! What all attempts of a search share.

use std::sync::{Arc, OnceLock};

use super::{
    closing_motion::DigitMotion,
    immobility_validation::Load,
    random::AttemptStream,
    start_grips::{Demand, StartFrom, StartGrips},
    wrenches::Wrench,
    wrist_placement::WristPlacer,
};
use crate::{
    atlas::{entry::Entry, starts::Starts},
    constraints::Constraints,
    guided::{
        proposal::{Place, propose, propose_evenly},
        repertoire::{ROWS, Repertoire},
        surface_pairs::SurfacePairs,
    },
    hand::rig::Rig,
    holdout::Holdout,
    physical::{
        attempt::Surroundings,
        grip::settled_wrist,
        scene::{ObjectScene, Presented},
        shape::Proposal,
    },
    strategy::{BendRatioChoice, Strategy, Validity},
};

/// Attempts that ask of each pair of points that they draw whether it is off the giver's hand. Many searches end with
/// them; from then on it is worth 180 µs to ask it of all pairs at once, of which a giver who covers the object leaves few.
const SOON: u64 = 4;

/// A holdout and how attempts at it go, with what they find out about it once.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    pub(super) holdout: &'a Holdout,
    pub(super) rig: &'a Rig,
    pub(super) strategy: Strategy,
    pub(super) bend_ratios: BendRatioChoice,
    pub(super) placer: WristPlacer<'a>,
    /// How the digits close in steps, once it was asked for: `PHYSICAL` never does, and it takes longer than a look-up.
    pub(super) motion: OnceLock<[DigitMotion; 5]>,
    pub(super) load: Load,
    /// Under `PHYSICAL` validity.
    pub(super) physical: Option<(ObjectScene<'a>, Presented)>,
    /// What the giver's hand leaves of the object's surface, once it was asked for.
    free_surface: OnceLock<SurfacePairs>,
    /// Where the receiving hand has room at the object, once it was asked for.
    repertoire: OnceLock<Arc<Repertoire>>,
    pub(super) constraints: Constraints,
    /// Grips that attempts start from, under `GUIDED` and `PHYSICAL`.
    pub(super) starts: StartGrips,
}

impl<'a> Scene<'a> {
    /// Prepares attempts at a holdout. `friction` is the coefficient of static friction.
    pub fn new(
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
            motion: OnceLock::new(),
            load: Load {
                gravity: Wrench::of_gravity(holdout.object.mass, holdout.up),
                centre_of_mass: holdout.object.centre_of_mass,
                friction,
            },
            physical: None,
            free_surface: OnceLock::new(),
            repertoire: OnceLock::new(),
            constraints: Constraints::default(),
            starts: StartGrips::default(),
        }
    }

    /// The same with attempts that, having failed, start from known grips; for `GUIDED` and `PHYSICAL`.
    #[must_use]
    pub fn starting_from(self, from: StartFrom) -> Self {
        Self {
            starts: StartGrips::new(from),
            ..self
        }
    }

    /// The same with demands on the grasps, in the object's frame.
    #[must_use]
    pub fn with_constraints(self, constraints: Constraints) -> Self {
        Self { constraints, ..self }
    }

    /// Under `PHYSICAL` validity: the object, and how it is held out.
    pub fn physical(&self) -> Option<(&ObjectScene<'a>, &Presented)> {
        self.physical
            .as_ref()
            .map(|(object, presented)| (object, presented))
    }

    /// The receiving hand.
    pub fn rig(&self) -> &'a Rig {
        self.rig
    }

    /// Under `PHYSICAL` validity: what an attempt works with.
    pub(crate) fn surroundings(&self) -> Option<Surroundings<'_>> {
        let (object, presented) = self.physical.as_ref()?;
        Some(Surroundings {
            object: *object,
            presented,
            rig: self.rig,
            constraints: &self.constraints,
        })
    }

    /// Where GUIDED search proposes the hand of an attempt.
    pub(super) fn place(&self, attempt: u64) -> Place<'_> {
        let object = &self.holdout.object;
        let presented = self.physical.as_ref().map(|(_, presented)| presented);
        let giver = presented.and_then(|presented| presented.giver.as_ref());
        let surface = match giver {
            Some(giver) if attempt >= SOON => self
                .free_surface
                .get_or_init(|| object.surface_pairs.free_of(giver)),
            _ => &object.surface_pairs,
        };
        Place {
            object,
            surface,
            giver,
            rig: self.rig,
            repertoire: None,
        }
    }

    /// The same with what the first attempts choose from.
    fn known_place(&self, attempt: u64) -> Place<'_> {
        let repertoire = || {
            self.repertoire
                .get_or_init(|| self.holdout.object.repertoire(self.rig))
        };
        Place {
            repertoire: (attempt < ROWS).then(|| &**repertoire()),
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
            return propose(&self.known_place(stream.attempt()), stream, interrupted);
        }
        // What is likely to hold was learned of what holds by `PHYSICAL` validity.
        let proposal = propose_evenly(&self.place(stream.attempt()), stream, interrupted)?;
        let scene = ObjectScene::new(&self.holdout.object, self.load.friction);
        Some(Proposal {
            object_from_wrist: settled_wrist(&scene, self.rig, &proposal)?,
            advance: 0.0,
            ..proposal
        })
    }

    /// The grips that an attempt starts from, and those that they are of. None if there are none, or if interrupted.
    pub(super) fn starts(
        &self,
        presented: &Presented,
        attempt: u64,
        interrupted: &impl Fn() -> bool,
    ) -> Option<(&Starts, &[Entry])> {
        let demand = Demand {
            rig: self.rig,
            presented,
            constraints: &self.constraints,
        };
        self.starts.of_attempt(attempt, &demand, interrupted)
    }

    /// What is demanded of the grasps.
    pub fn constraints(&self) -> &Constraints {
        &self.constraints
    }

    /// The same with grasps that count as valid as `validity` says.
    #[must_use]
    pub fn with_validity(self, validity: Validity) -> Self {
        let friction = self.load.friction;
        Self {
            physical: match validity {
                Validity::Thesis => None,
                Validity::Physical => Some((
                    ObjectScene::new(&self.holdout.object, friction),
                    Presented::of(self.holdout),
                )),
            },
            ..self
        }
    }
}
