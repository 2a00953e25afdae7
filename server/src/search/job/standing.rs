//! The part of a search that is about its standing grasp.

use std::time::Duration;

use grasp_synthesis::search::{
    SearchOutcome, prepare,
    standing::{Stand, StandingStatus, StandingVerdict, no_grasp_reason, stand},
};

use super::{Answered, HandSearch, PreparedJob};
use crate::{
    error::ServiceError,
    search::progress::{Ended, HandPlace},
};

impl PreparedJob {
    /// What is decided about the standing grasp without a search; none if it fell and nothing known replaces it, or if the clock
    /// reaches `until` first.
    pub(super) fn stand(
        &self,
        place: HandPlace,
        until: Option<Duration>,
    ) -> Option<(SearchOutcome, StandingVerdict)> {
        let settings = &self.hands[place].settings;
        match stand(&prepare(self.task(place), settings), settings, &self.clock, until)? {
            Stand::Settled(settled) => Some(*settled),
            Stand::Fallen(fall) => {
                self.fall.get_or_init(|| fall);
                None
            }
            Stand::OutOfTime => None,
        }
    }

    /// The hand of the standing grasp.
    pub(super) fn standing_place(&self) -> Option<HandPlace> {
        let has_it = |hand: &HandSearch| hand.settings.query.standing.is_some();
        self.hands.iter().position(has_it)
    }

    /// Makes the response without a search.
    pub(super) fn answer_standing(
        &self,
        hand: HandPlace,
        (outcome, verdict): (SearchOutcome, StandingVerdict),
    ) -> Result<Answered, ServiceError> {
        self.answer_with(Ended { hand, outcome }, Some(verdict))
    }

    /// What became of a standing grasp that fell.
    pub(super) fn verdict_after(&self, ended: &Ended) -> Option<StandingVerdict> {
        let place = self.standing_place()?;
        let settings = &self.hands[place].settings;
        let scene = prepare(self.task(place), settings);
        let is_same_hand = ended.hand == place;
        let mut verdict =
            StandingVerdict::after_search(&scene, self.fall.get().copied(), &ended.outcome, is_same_hand);
        if verdict.status == StandingStatus::None {
            let limits = &ended.outcome.report.limits;
            verdict.no_grasp = Some(no_grasp_reason(&scene, settings, limits));
        }
        Some(verdict)
    }
}
