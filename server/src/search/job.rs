//! One search: a checked request with everything it needs, from preparation to the response.

use std::{
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use grasp_proto::v1;
use grasp_synthesis::{
    base::{clock::Clock, mechanisms::Mechanisms},
    known::{entry::Entry, recent_grips::RecentGrips, seed_source::SeedSource},
    model::{
        holdout::Holdout,
        strategy::{Choice, Validity},
    },
    propose::prepared::PreparedObject,
    search::{
        GraspSource, LookUp, SearchEnd, SearchOutcome, find_known_grasp,
        key_frames::plan_key_frames,
        limits::limits,
        scene::Task,
        settings::{IMPROVEMENT, Known, Query, Run, SearchSettings},
    },
};
use rayon::ThreadPool;

use super::{holdout::holdout, progress::Progress, slices::search_in_slices};
use crate::{
    answer::{Circumstances, ClientFrame, find_response},
    atlases::KnownGrips,
    error::ServiceError,
    objects::StoredObject,
    validate::FindQuery,
};

/// Everything that a search needs.
#[derive(Debug)]
pub(crate) struct FindJob {
    /// The request.
    pub query: FindQuery,
    /// The object. Holding this reference keeps it from being evicted.
    pub object: Arc<PreparedObject>,
    /// The same object as stored, for its transferred grips.
    pub stored: Arc<StoredObject>,
    /// The request's seed, or a drawn one.
    pub seed: u64,
    /// When the call arrived; times count from here.
    pub arrived: Instant,
    /// Effective budget.
    pub budget: Duration,
    /// How long the search continues for a first grasp if it finds none within the budget; at least the budget.
    pub patience: Duration,
    /// Whether the call has a deadline, so that its answer must not wait for a search that ends late.
    pub has_deadline: bool,
    /// Number of workers.
    pub workers: usize,
    /// Known grips of the object and the hand.
    pub known: KnownGrips,
    /// Mechanisms of the search that are on.
    pub mechanisms: Mechanisms,
}

/// The result of a search.
#[derive(Debug)]
pub(crate) struct Answered {
    /// The response to the call.
    pub response: v1::FindGraspResponse,
    /// The grip if it was not known before, to be remembered.
    pub new_grip: Option<Entry>,
    /// When the search ended, before the response was made.
    pub ended: Instant,
}

/// A job whose holdout and settings are ready to be searched.
#[derive(Debug)]
pub(super) struct PreparedJob {
    query: FindQuery,
    object: Arc<PreparedObject>,
    holdout: Holdout,
    settings: SearchSettings,
    clock: SinceArrival,
    start: Instant,
    budget: Duration,
    patience: Duration,
}

/// How long a look-up of known grips may take on the call's own thread: about as long as decoding and encoding its
/// messages. A longer look-up answers more calls without switching threads, and delays other calls.
const LOOK_UP_TIME: Duration = Duration::from_micros(200);

/// Time since a call's arrival.
#[derive(Debug)]
struct SinceArrival(Instant);

impl Clock for SinceArrival {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

impl FindJob {
    /// True if preparation, look-up and response are quick enough for the call's own thread; planning key frames is
    /// not.
    pub(super) fn is_quick_if_known(&self) -> bool {
        (self.known.atlas.is_some() || !self.known.recent.is_empty())
            && !self.query.is_replay
            && self.query.choice == Choice::FirstValid
            && !self.query.reproducible
            && !self.query.plan_key_frames
    }

    /// When the search has to end, with or without a grasp.
    pub(crate) fn due(&self) -> Instant {
        self.arrived + self.patience
    }

    /// Places hands and obstacles around the object and makes the settings.
    ///
    /// # Errors
    /// The giver's joints fold its skin.
    pub(super) fn prepare(self) -> Result<PreparedJob, ServiceError> {
        let start = Instant::now();
        let query = self.query;
        let object_from_client = query.client_from_object.inverse();
        let holdout = holdout(&query, self.object.object())?;
        // Reproducible answers need a complete atlas: a growing one would change them.
        let atlas = self
            .known
            .atlas
            .filter(|atlas| !query.reproducible || atlas.is_complete());
        let seeds = match &atlas {
            Some(atlas) => SeedSource::Atlas(Arc::clone(atlas)),
            None if query.uses_seeds() => {
                let transferred = self.stored.transferred_grips(query.receiving_hand);
                transferred.map_or(SeedSource::Nothing, SeedSource::Transferred)
            }
            None => SeedSource::Nothing,
        };
        let settings = SearchSettings {
            query: Query {
                strategy: query.strategy,
                validity: query.validity,
                bend_ratios: query.bend_ratios,
                friction: query.friction,
                constraints: query.constraints.transformed(object_from_client),
                choice: query.choice,
                improvement: IMPROVEMENT,
                other_hand: query.other_hand.map(|hand| hand.rig.clone()),
            },
            known: Known {
                // A replay runs one attempt and tries no known grips.
                atlas: atlas.filter(|_| !query.is_replay),
                seeds,
                recent: if query.is_replay {
                    RecentGrips::default()
                } else {
                    self.known.recent
                },
                tried: 0,
            },
            run: Run {
                seed: self.seed,
                reproducible: query.reproducible,
                first_attempt: query.first_attempt,
                max_attempts: query.max_attempts,
                deadline: Some(self.budget),
                workers: self.workers,
                record_step_times: query.record_step_times,
                mechanisms: self.mechanisms,
            },
        };
        Ok(PreparedJob {
            query,
            object: self.object,
            holdout,
            settings,
            clock: SinceArrival(self.arrived),
            start,
            budget: self.budget,
            patience: self.patience,
        })
    }
}

impl PreparedJob {
    /// Answers with a known grip if one is found quickly; otherwise [`PreparedJob::run`] continues where this stopped.
    pub(super) fn look_up(&mut self) -> Option<Result<Answered, ServiceError>> {
        match find_known_grasp(self.task(), &self.settings, &self.clock, LOOK_UP_TIME) {
            LookUp::Found(outcome) => Some(self.answer(*outcome)),
            LookUp::NotFound { tried } => {
                self.settings.known.tried = tried;
                None
            }
        }
    }

    /// Searches.
    ///
    /// # Errors
    /// The search was stopped.
    pub(super) fn run(
        &self,
        pool: &ThreadPool,
        stop: &AtomicBool,
        progress: &Progress,
    ) -> Result<Answered, ServiceError> {
        let outcome = search_in_slices(
            pool,
            self.task(),
            &self.settings,
            self.patience,
            &self.clock,
            stop,
            progress,
        );
        self.answer(outcome)
    }

    fn task(&self) -> Task<'_> {
        Task {
            holdout: &self.holdout,
            object: &self.object,
            rig: &self.query.receiving_hand.rig,
        }
    }

    /// Makes the response of an outcome.
    ///
    /// # Errors
    /// The search was stopped.
    pub(super) fn answer(&self, mut outcome: SearchOutcome) -> Result<Answered, ServiceError> {
        let rig = &self.query.receiving_hand.rig;
        let ended = Instant::now();
        let search_time = ended - self.start;
        if let (true, Some(grasp)) = (self.query.plan_key_frames, &mut outcome.grasp) {
            let approach = self.settings.query.constraints.approach;
            let friction = self.settings.query.friction_on(&self.holdout.object);
            plan_key_frames(&self.holdout, rig, friction, approach, grasp);
        }
        if matches!(
            outcome.end,
            SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted
        ) {
            // A small part of what the budget leaves for the way back.
            outcome.report.limits = limits(self.task(), &self.settings.query);
        }
        let frame = ClientFrame {
            convention: self.query.convention,
            client_from_object: self.query.client_from_object,
        };
        let hands = self.query.presenting_hand.iter().chain(&self.query.other_hands);
        let warnings: Vec<String> = hands.flat_map(|hand| hand.warnings.iter().cloned()).collect();
        let circumstances = Circumstances {
            search_time,
            budget: self.budget,
            warnings: &warnings,
        };
        Ok(Answered {
            response: find_response(&outcome, rig, frame, &self.settings, circumstances)?,
            new_grip: self.new_grip(&outcome),
            ended,
        })
    }

    /// The grip to remember: one that was found by an attempt under the object's own friction, which the grips of an
    /// atlas are made for.
    fn new_grip(&self, outcome: &SearchOutcome) -> Option<Entry> {
        let own_friction = self.holdout.object.friction_under(Validity::Physical);
        let is_new = matches!(outcome.report.source, Some(GraspSource::Attempt(_)));
        let grasp = outcome.grasp.as_ref()?;
        (is_new && self.settings.query.friction_on(&self.holdout.object) == own_friction)
            .then(|| Entry::of_grasp(grasp))
            .flatten()
    }
}

#[cfg(test)]
mod tests;
