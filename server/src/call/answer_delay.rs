//! How long an answer takes after its search.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use super::SearchEnd;
use crate::reserve::DeadlineReserve;

/// Measures for how long the transport waits for an answer after the end of the call's search. As long as it does not ask, because the
/// client does not read, nothing counts. If the call is dropped while it waits, which is what a client does at its deadline, the
/// answer would have taken at least until then.
#[derive(Debug)]
pub(super) struct AnswerDelay {
    search_end: Arc<SearchEnd>,
    reserve: Arc<DeadlineReserve>,
    /// Since when the transport waits, if it does.
    waits_since: Option<Instant>,
    /// For how long it has waited for other parts of the answer, from the end of the search on.
    waited: Duration,
}

impl AnswerDelay {
    /// The delay of a call that has arrived, whose answer the transport waits for.
    pub(super) fn new(search_end: Arc<SearchEnd>, reserve: Arc<DeadlineReserve>) -> Self {
        Self {
            search_end,
            reserve,
            waits_since: Some(Instant::now()),
            waited: Duration::ZERO,
        }
    }

    /// The transport asks for the next part of the answer.
    pub(super) fn asked(&mut self) {
        self.waits_since.get_or_insert_with(Instant::now);
    }

    /// It has the part that it asked for.
    pub(super) fn answered(&mut self) {
        let (Some(since), Some(&due)) = (self.waits_since.take(), self.search_end.due.get()) else {
            return;
        };
        let now = Instant::now();
        let end = self
            .search_end
            .actual
            .get()
            .map_or(due, |&actual| actual.min(due));
        self.waited += now.saturating_duration_since(end.max(since));
        self.reserve.record(self.waited, now);
    }
}

impl Drop for AnswerDelay {
    fn drop(&mut self) {
        self.answered();
    }
}
