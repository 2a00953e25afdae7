//! How long an answer takes after its search.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use super::SearchEnd;
use crate::budget::DeadlineReserve;

/// Measures for how long the transport waits for an answer after the end of the call's search. As long as it does not ask, because the
/// client does not read, nothing counts. If the call is dropped while it waits, which is what a client does at its deadline, the
/// answer would have taken at least until then.
#[derive(Debug)]
pub(super) struct AnswerDelay {
    search_end: Arc<SearchEnd>,
    reserve: Arc<DeadlineReserve>,
    transport: Transport,
    /// For how long it has waited for other parts of the answer, from the end of the search on.
    waited: Duration,
}

/// What the transport does.
#[derive(Clone, Copy, Debug)]
enum Transport {
    /// It waits for the first part, as it has since the call arrived.
    Waits,
    /// It has asked for another part.
    WaitsSince(Instant),
    /// It has all that it asked for.
    Idles,
}

impl AnswerDelay {
    /// The delay of a call that has arrived.
    pub(super) fn new(search_end: Arc<SearchEnd>, reserve: Arc<DeadlineReserve>) -> Self {
        Self {
            search_end,
            reserve,
            transport: Transport::Waits,
            waited: Duration::ZERO,
        }
    }

    /// The transport asks for the next part of the answer.
    pub(super) fn asked(&mut self) {
        if let Transport::Idles = self.transport {
            self.transport = Transport::WaitsSince(Instant::now());
        }
    }

    /// It has the part that it asked for.
    pub(super) fn answered(&mut self) {
        let transport = std::mem::replace(&mut self.transport, Transport::Idles);
        let Some(&due) = self.search_end.due.get() else {
            return;
        };
        let end = self
            .search_end
            .actual
            .get()
            .map_or(due, |&actual| actual.min(due));
        let start = match transport {
            Transport::Waits => end,
            Transport::WaitsSince(asked) => end.max(asked),
            Transport::Idles => return,
        };
        let now = Instant::now();
        self.waited += now.saturating_duration_since(start);
        self.reserve.record(self.waited, now);
    }
}

impl Drop for AnswerDelay {
    fn drop(&mut self) {
        self.answered();
    }
}
