//! Middleware around every call: records arrival and deadline, counts and logs calls, measures how long answers take after
//! their search, limits their time, rejects those of connections that have too many or do not read, packs large messages, and bounds
//! uploads; no other call of the same service may send large messages. A call lasts until its answer's body has been handed to the
//! transport, which for streams may be long after its headers.

mod answer;
mod layer;
mod packing;
mod upload;

use std::{
    sync::{Arc, OnceLock},
    time::{Duration, Instant},
};

pub(crate) use self::{
    layer::{BySize, Calls},
    upload::UploadPermit,
};

/// How long before its deadline a call that is no search is answered, so that the answer may arrive in time.
const BEFORE_DEADLINE: Duration = Duration::from_millis(5);

/// What a handler knows about its call, and adds to the call's log line.
#[derive(Clone, Debug)]
pub(crate) struct CallContext {
    /// When the call's headers arrived.
    pub arrived: Instant,
    /// When the client stops waiting, if it set a deadline.
    pub deadline: Option<Instant>,
    record: Arc<CallRecord>,
}

/// What a handler tells of its call; the first value of each stays.
#[derive(Debug, Default)]
struct CallRecord {
    object: OnceLock<String>,
    reserve: OnceLock<Duration>,
    search: OnceLock<SearchSummary>,
    /// When the search has to end.
    due: OnceLock<Instant>,
    /// When it ended.
    ended: OnceLock<Instant>,
}

/// A search as it is logged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchSummary {
    /// The outcome: its name in the contract, or what was found about a grasp or a holdout.
    pub outcome: &'static str,
    /// Number of attempts.
    pub attempts: u64,
    /// Its wall time.
    pub time: Duration,
}

impl CallContext {
    /// The context of a request, which [`Calls`] gives to each.
    pub(crate) fn of<T>(request: &tonic::Request<T>) -> Self {
        let context = request.extensions().get().cloned();
        context.expect("every call has a context")
    }

    /// The context of a part of the call that arrived at a time and is answered like a call of its own.
    pub(crate) fn of_part(&self, arrived: Instant) -> Self {
        Self {
            arrived,
            deadline: self.deadline,
            record: Arc::default(),
        }
    }

    fn arriving(timeout: Option<Duration>) -> Self {
        let arrived = Instant::now();
        Self {
            arrived,
            // A deadline beyond the clock's range counts as none.
            deadline: timeout.and_then(|timeout| arrived.checked_add(timeout)),
            record: Arc::default(),
        }
    }

    /// When a call that is no search has to be answered, if it has a deadline.
    pub(crate) fn answer_due(&self) -> Option<Instant> {
        let deadline = self.deadline?;
        Some(deadline.checked_sub(BEFORE_DEADLINE).unwrap_or(deadline))
    }

    /// Records when the search that starts now has to end. A time that has passed counts as now: what was waited before,
    /// such as for the rest of a request, is no delay of the answer.
    pub(crate) fn search_is_due(&self, due: Instant) {
        let _ = self.record.due.set(due.max(Instant::now()));
    }

    /// Records when the search ended, and adds it to the log line.
    pub(crate) fn search_ended(&self, at: Instant, summary: SearchSummary) {
        let _ = self.record.ended.set(at);
        let _ = self.record.search.set(summary);
    }

    /// Adds the object's id to the log line.
    pub(crate) fn log_object(&self, id: &str) {
        let _ = self.record.object.set(id.to_owned());
    }

    /// Adds the part of the deadline that is kept for the answer to the log line, if there is a deadline.
    pub(crate) fn log_reserve(&self, reserve: Duration) {
        if self.deadline.is_some() {
            let _ = self.record.reserve.set(reserve);
        }
    }
}
