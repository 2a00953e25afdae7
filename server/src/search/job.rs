//! One search: what a call asks for, run on the threads of the executor.

use std::{
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use grasp_proto::v1;
use grasp_synthesis::{
    clock::Clock,
    holdout::{Holdout, PresentingHand},
    object::GraspObject,
    search::SearchSettings,
};
use rayon::ThreadPool;

use super::race::race;
use crate::{
    answer::{Circumstances, ClientFrame, find_response},
    error::ServiceError,
    validate::FindQuery,
};

/// Everything that a search needs.
#[derive(Debug)]
pub(crate) struct FindJob {
    /// What was asked for.
    pub query: FindQuery,
    /// The object; held, it is not evicted.
    pub object: Arc<GraspObject>,
    /// The seed that was asked for or drawn.
    pub seed: u64,
    /// When the call arrived: the budget counts from here.
    pub arrived: Instant,
    /// The budget that is in force.
    pub budget: Duration,
    /// Workers that race.
    pub workers: usize,
}

/// Time since a call's arrival.
struct SinceArrival(Instant);

impl Clock for SinceArrival {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

impl FindJob {
    /// Poses the giver's hand, searches and words the answer.
    ///
    /// # Errors
    /// The giver's joints fold its skin, or the search was told to stop.
    pub(crate) fn run(
        self,
        pool: &ThreadPool,
        stop: &AtomicBool,
    ) -> Result<v1::FindGraspResponse, ServiceError> {
        let start = Instant::now();
        let query = self.query;
        let object_from_client = query.client_from_object.inverse();
        let presenting_hand = match &query.presenting_hand {
            None => None,
            Some(giver) => Some(
                PresentingHand::in_frame(giver.skin, &giver.joints, object_from_client)
                    .map_err(|error| ServiceError::invalid(giver.field, error.to_string()))?,
            ),
        };
        let holdout = Holdout {
            object: self.object,
            presenting_hand,
            up: object_from_client.transform_vector(query.up),
        };
        let settings = SearchSettings {
            seed: self.seed,
            strategy: query.strategy,
            bend_ratios: query.bend_ratios,
            friction: query.friction.unwrap_or(holdout.object.friction),
            reproducible: query.reproducible,
            first_attempt: query.first_attempt,
            max_attempts: query.max_attempts,
            deadline: Some(self.budget),
            workers: self.workers,
            record_step_times: query.record_step_times,
        };
        let rig = &query.receiving_hand.rig;
        let outcome = race(pool, &holdout, rig, &settings, &SinceArrival(self.arrived), stop);
        let frame = ClientFrame {
            convention: query.convention,
            client_from_object: query.client_from_object,
        };
        let circumstances = Circumstances {
            search_time: start.elapsed(),
            budget: self.budget,
        };
        find_response(&outcome, rig, frame, &settings, circumstances)
    }
}
