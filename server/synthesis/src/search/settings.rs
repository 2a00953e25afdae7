//! The settings of a search: the query, prior knowledge, and how to run it.

use std::{sync::Arc, time::Duration};

use super::{current::CurrentGrasp, report::GraspObserver};
use crate::{
    known::{atlas::Atlas, seeds::SeedSource},
    model::{
        hand::{HandPose, joints::HandJoints, rig::Rig},
        holdout::Holdout,
        object::GraspObject,
        requirements::Requirements,
        strategy::{BendRatioChoice, Choice, Strategy, Validity},
    },
    physical::presented::{ObjectScene, Presented},
    propose::prepared::PreparedRig,
    rating::assessment::GraspContext,
};

/// Default of [`Query::refinement`]: a third of a frame at 60 Hz, in which a new object's searches find a few valid grasps.
pub const REFINEMENT: Duration = Duration::from_millis(5);

/// The settings of a search.
#[derive(Clone, Debug, Default)]
pub struct SearchSettings {
    /// The requested grasp.
    pub query: Query,
    /// Prior knowledge.
    pub known: Known,
    /// How to run it.
    pub run: Run,
}

impl SearchSettings {
    /// The learned grips that the search may use; `None` if there are none.
    pub fn learned(&self) -> Option<&Atlas> {
        let Self { query, known, run } = self;
        let may_use = query.uses_known_grips() && !run.reproducible;
        let learned = known.learned.as_deref().filter(|_| may_use);
        learned.filter(|learned| !learned.is_empty())
    }
}

/// The requested grasp. By default, any that is valid under `PHYSICAL`.
#[derive(Clone, Debug)]
pub struct Query {
    /// Placement of hands.
    pub strategy: Strategy,
    /// Condition for a valid grasp.
    pub validity: Validity,
    /// Bend ratios that a digit tries.
    pub bend_ratios: BendRatioChoice,
    /// Coefficient of static friction, more than 0; `None` for the object's own.
    pub friction: Option<f32>,
    /// Requirements beyond validity, in the object's frame.
    pub requirements: Requirements,
    /// Choice among valid grasps.
    pub choice: Choice,
    /// How much longer a search for the first valid grasp looks for a natural one after it found another; without one, the
    /// highest score wins. Reproducible searches count attempts instead ([`super::REFINING_ATTEMPTS`]). At 0, the first grasp is
    /// the answer. Known grips are not searched further.
    pub refinement: Duration,
    /// The receiver's other hand, if both are to hold the object together: under `GUIDED` and `PHYSICAL` only.
    pub other_hand: Option<PreparedRig>,
    /// The grasp that the receiver holds on to, of the same rig, under `GUIDED` and `PHYSICAL`; [`super::current::settle`] decides
    /// about it. A search for the first valid grasp then starts some attempts near the present hand and prefers near grasps.
    pub current: Option<CurrentGrasp>,
    /// Other people's hands over the last second, the latest last, in the object's frame. A grasp that follows the current one
    /// keeps clear of all of them if possible.
    pub recent_hands: Arc<[Arc<HandJoints>]>,
}

impl Default for Query {
    fn default() -> Self {
        Self {
            strategy: Strategy::Guided,
            validity: Validity::Physical,
            bend_ratios: Strategy::Guided.default_bend_ratios(),
            friction: None,
            requirements: Requirements::default(),
            choice: Choice::FirstValid,
            refinement: REFINEMENT,
            other_hand: None,
            current: None,
            recent_hands: Arc::default(),
        }
    }
}

impl Query {
    /// True if known grips may answer the query; they are of one hand.
    pub fn uses_known_grips(&self) -> bool {
        self.other_hand.is_none() && self.strategy.uses_known_grips(self.validity)
    }

    pub(super) fn around<'a>(
        &'a self,
        holdout: &'a Holdout,
        presented: &'a Presented,
        rig: &'a Rig,
    ) -> GraspContext<'a> {
        GraspContext {
            object: ObjectScene::new(&holdout.object, self.friction_on(&holdout.object)),
            presented,
            rig,
            requirements: &self.requirements,
        }
    }

    /// The coefficient of friction for grasps on an object.
    pub fn friction_on(&self, object: &GraspObject) -> f32 {
        self.friction
            .unwrap_or_else(|| object.friction_under(self.validity))
    }
}

/// Data about object and rig known before the search. By default none.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Grips to try first, if [`Query::uses_known_grips`].
    pub atlas: Option<Arc<Atlas>>,
    /// Grips that earlier searches found, under the object's own friction; tried after the atlas. Reproducible searches ignore
    /// them.
    pub learned: Option<Arc<Atlas>>,
    /// The source of seeds for attempts if no known grip is valid; ignored where `atlas` is.
    pub seeds: SeedSource,
    /// Hands in the object's frame to try before all other known grips; ignored where `atlas` is.
    pub preferred: Arc<[HandPose]>,
    /// Number of known grips to skip, as returned by [`super::find_known_grasp`].
    pub tried: usize,
}

impl Known {
    /// True if there are no grips to try.
    pub fn is_empty(&self) -> bool {
        let learned = self.learned.as_ref();
        self.atlas.is_none() && learned.is_none_or(|learned| learned.is_empty()) && self.preferred.is_empty()
    }
}

/// How to run a search. By default, one worker until it finds a grasp.
#[derive(Clone, Debug)]
pub struct Run {
    /// Seed of all attempts' random streams.
    pub seed: u64,
    /// Return the first valid grip in the atlas' order, or else the valid attempt with the lowest index, replaced by a natural
    /// grasp soon after it, instead of the first to finish.
    pub reproducible: bool,
    /// The lowest attempt index.
    pub first_attempt: u64,
    /// Largest number of attempts.
    pub max_attempts: u64,
    /// When to give up, by the search's clock.
    pub deadline: Option<Duration>,
    /// Number of racing workers; at least 1.
    pub workers: usize,
    /// Record the time spent in each step.
    pub record_step_times: bool,
    /// Sees every valid grasp as it is found.
    pub observer: Option<Arc<dyn GraspObserver>>,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            seed: 0,
            reproducible: false,
            first_attempt: 0,
            max_attempts: u64::MAX,
            deadline: None,
            workers: 1,
            record_step_times: false,
            observer: None,
        }
    }
}
