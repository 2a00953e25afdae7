//! What is asked of a search, what is known, and how it is run.

use std::{sync::Arc, time::Duration};

use crate::{
    base::mechanisms::Mechanisms,
    known::{atlas::Atlas, recent_grips::RecentGrips, seed_source::SeedSource},
    model::{
        bend_ratios::BendRatioChoice,
        constraints::Constraints,
        object::GraspObject,
        strategy::{Choice, Strategy, Validity},
    },
};

/// How to search.
#[derive(Clone, Debug, Default)]
pub struct SearchSettings {
    /// What is asked.
    pub query: Query,
    /// What is known.
    pub known: Known,
    /// How it is run.
    pub run: Run,
}

/// What is asked of a search. The default asks for any grasp that is valid under `PHYSICAL`.
#[derive(Clone, Debug)]
pub struct Query {
    /// How hands are placed.
    pub strategy: Strategy,
    /// Which grasps count as valid.
    pub validity: Validity,
    /// Which bend ratios a digit tries.
    pub bend_ratios: BendRatioChoice,
    /// Coefficient of static friction, more than 0; none: the object's own.
    pub friction: Option<f32>,
    /// What is demanded of grasps beyond being valid, in the object's frame.
    pub constraints: Constraints,
    /// Which of the valid grasps is wanted.
    pub choice: Choice,
}

impl Default for Query {
    fn default() -> Self {
        Self {
            strategy: Strategy::Guided,
            validity: Validity::Physical,
            bend_ratios: Strategy::Guided.default_bend_ratios(),
            friction: None,
            constraints: Constraints::default(),
            choice: Choice::FirstValid,
        }
    }
}

impl Query {
    /// True if known grips may answer it.
    pub fn uses_known_grips(&self) -> bool {
        self.strategy.uses_known_grips(self.validity)
    }

    /// The coefficient of friction that grasps on an object are judged by.
    pub fn friction_on(&self, object: &GraspObject) -> f32 {
        self.friction
            .unwrap_or_else(|| object.friction_under(self.validity))
    }
}

/// What is known before a search, of the same object and rig. The default knows nothing.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Grips to try first, where [`Query::uses_known_grips`].
    pub atlas: Option<Arc<Atlas>>,
    /// Grips near which hands are perturbed where none of the known ones is valid; likewise.
    pub seeds: SeedSource,
    /// Grips that earlier searches found, under the object's own friction. They are tried after those of the atlas; a
    /// reproducible search ignores them.
    pub recent: RecentGrips,
    /// How many known grips need not be tried again: [`super::LookUp::NotFound`] gave it for the same ones.
    pub tried: usize,
}

/// How a search is run. The default runs one worker until it finds a grasp.
#[derive(Clone, Debug)]
pub struct Run {
    /// Start of every attempt's random stream.
    pub seed: u64,
    /// Answer with the first valid grip in the atlas' order, or else with the valid attempt of the lowest index, instead
    /// of with the first to finish.
    pub reproducible: bool,
    /// The lowest attempt index.
    pub first_attempt: u64,
    /// How many attempts may run.
    pub max_attempts: u64,
    /// When to give up, by the clock that is handed in.
    pub deadline: Option<Duration>,
    /// How many workers race; at least 1.
    pub workers: usize,
    /// Record the time spent in each step?
    pub record_step_times: bool,
    /// Which mechanisms of a default search are on.
    pub mechanisms: Mechanisms,
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
            mechanisms: Mechanisms::ALL,
        }
    }
}
