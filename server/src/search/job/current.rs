//! The part of a search that is about its current grasp.

use grasp_synthesis::{
    base::stop::Stop,
    search::{
        SearchOutcome,
        current::{CurrentGraspStatus, CurrentGraspVerdict, Settlement, no_grasp_reason, settle},
        prepare,
    },
};

use super::{Answered, HandSearch, PreparedJob};
use crate::{
    error::ServiceError,
    search::progress::{Ended, HandPlace},
};

impl PreparedJob {
    /// What is decided about the current grasp without a search; `None` if it failed a check and nothing known replaces it, or if
    /// `stop` says so first.
    pub(super) fn settle(
        &self,
        place: HandPlace,
        stop: Stop<'_>,
    ) -> Option<(SearchOutcome, CurrentGraspVerdict)> {
        let settings = &self.hands[place].settings;
        match settle(&prepare(self.task(place), settings), settings, stop)? {
            Settlement::Settled(settled) => Some(*settled),
            Settlement::Failed(failed) => {
                self.failed.get_or_init(|| failed);
                None
            }
            Settlement::Stopped => None,
        }
    }

    /// The hand of the current grasp.
    pub(super) fn current_place(&self) -> Option<HandPlace> {
        let has_it = |hand: &HandSearch| hand.settings.query.current.is_some();
        self.hands.iter().position(has_it)
    }

    /// Makes the response without a search.
    pub(super) fn answer_current(
        &self,
        hand: HandPlace,
        (outcome, verdict): (SearchOutcome, CurrentGraspVerdict),
    ) -> Result<Answered, ServiceError> {
        self.answer_with(Ended { hand, outcome }, Some(verdict))
    }

    /// What became of a current grasp that failed a check.
    pub(super) fn verdict_after(&self, ended: &Ended) -> Option<CurrentGraspVerdict> {
        let place = self.current_place()?;
        let settings = &self.hands[place].settings;
        let scene = prepare(self.task(place), settings);
        let is_same_hand = ended.hand == place;
        let mut verdict = CurrentGraspVerdict::after_search(
            &scene,
            self.failed.get().copied(),
            &ended.outcome,
            is_same_hand,
        );
        if verdict.status == CurrentGraspStatus::None {
            let limits = &ended.outcome.report.limits;
            verdict.no_grasp = Some(no_grasp_reason(&scene, settings, limits));
        }
        Some(verdict)
    }
}
