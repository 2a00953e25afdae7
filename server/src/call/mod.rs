//! Middleware around every call: records arrival and deadline, counts and logs calls, measures how long answers take after
//! their search, limits their time, rejects those of connections that have too many or do not read, packs large messages, and bounds
//! uploads; no other call of the same service may send large messages. A call lasts until its answer's body has been handed to the
//! transport, which for streams may be long after its headers.

mod layer;
mod packing;
mod panics;
mod reads;
mod upload;

use std::{
    sync::{Arc, Mutex, OnceLock},
    task::{Context, Poll},
    time::{Duration, Instant},
};

use http::{HeaderMap, Response};
use tokio::sync::watch;
use tonic::{Code, body::Body};

pub(crate) use self::{
    layer::{BySize, Calls, is_upload},
    packing::Messages as FramedMessages,
    upload::UploadPermit,
};
use crate::{
    access::Caller,
    budget::DeadlineReserve,
    client::Client,
    executor::Admission,
    limits::locked,
    middleware::{FrameFilter, PolledFrame, filtered, next_frame},
};

/// How long before its deadline a call that is no search is answered, so that the answer may arrive in time.
const BEFORE_DEADLINE: Duration = Duration::from_millis(5);

/// Context of a call for its handler, which adds to the call's log line.
#[derive(Clone, Debug)]
pub(crate) struct CallContext {
    pub arrived: Instant,
    /// When the client stops waiting, if it set a deadline.
    pub deadline: Option<Instant>,
    pub client: Client,
    pub caller: Caller,
    record: Arc<CallRecord>,
}

/// Values that a handler records about its call; the first of each stays.
#[derive(Debug, Default)]
struct CallRecord {
    object: OnceLock<String>,
    reserve: OnceLock<Duration>,
    search: OnceLock<SearchSummary>,
    /// When the search has to end.
    due: OnceLock<Instant>,
    /// When it ended.
    ended: OnceLock<Instant>,
    /// The right to search, until the handler takes it.
    admission: Mutex<Option<Admission>>,
}

/// Log record of a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchSummary {
    /// The outcome: its name in the contract, or the verdict on a grasp or a holdout.
    pub outcome: &'static str,
    pub attempts: u64,
    pub time: Duration,
}

impl CallContext {
    /// The context of a request, set by [`Calls`].
    pub(crate) fn of<T>(request: &tonic::Request<T>) -> Self {
        let context = request.extensions().get().cloned();
        context.expect("every call has a context")
    }

    /// The context of a part of the call that arrived at `arrived` and is answered like a call of its own.
    pub(crate) fn of_part(&self, arrived: Instant) -> Self {
        Self {
            arrived,
            deadline: self.deadline,
            client: self.client.clone(),
            caller: self.caller.clone(),
            record: Arc::default(),
        }
    }

    fn arriving(timeout: Option<Duration>, client: Client) -> Self {
        let arrived = Instant::now();
        Self {
            arrived,
            // A deadline beyond the clock's range counts as none.
            deadline: timeout.and_then(|timeout| arrived.checked_add(timeout)),
            client,
            caller: Caller::default(),
            record: Arc::default(),
        }
    }

    /// Makes it the call of a client that a token or certificate names.
    fn identify(&mut self, caller: Caller) {
        if let Some(name) = caller.name() {
            self.client = Client::Named(Arc::clone(name));
        }
        self.caller = caller;
    }

    /// The right to search that the call came with. Parts of a call have none.
    pub(crate) fn take_admission(&self) -> Option<Admission> {
        locked(&self.record.admission).take()
    }

    /// When a search that takes at most `longest` has to end.
    pub(crate) fn latest_end(&self, longest: Duration) -> Instant {
        let latest = self.arrived + longest;
        self.deadline.map_or(latest, |deadline| deadline.min(latest))
    }

    /// When a call that is no search has to be answered, if it has a deadline.
    pub(crate) fn answer_due(&self) -> Option<Instant> {
        let deadline = self.deadline?;
        Some(deadline.checked_sub(BEFORE_DEADLINE).unwrap_or(deadline))
    }

    /// Records when the search that starts now has to end. A past time counts as now: earlier waiting, such as for the rest of a
    /// request, is no delay of the answer.
    pub(crate) fn search_is_due(&self, due: Instant) {
        let _ = self.record.due.set(due.max(Instant::now()));
    }

    pub(crate) fn search_ended(&self, at: Instant, summary: SearchSummary) {
        let _ = self.record.ended.set(at);
        let _ = self.record.search.set(summary);
    }

    pub(crate) fn log_object(&self, id: &str) {
        let _ = self.record.object.set(id.to_owned());
    }

    /// Adds the part of the deadline reserved for the answer to the log line, if there is a deadline.
    pub(crate) fn log_reserve(&self, reserve: Duration) {
        if self.deadline.is_some() {
            let _ = self.record.reserve.set(reserve);
        }
    }
}

/// Trailer, or header of an answer without a message, with the status.
const STATUS: &str = "grpc-status";

/// Services whose calls are logged at level info. Probes and tools call the others.
const LOGGED_PACKAGE: &str = "/grasp.v1.";

/// Largest number of logged characters of a method's path.
const MAX_LOGGED_METHOD: usize = 96;

fn code_in(headers: &HeaderMap) -> Option<Code> {
    headers
        .get(STATUS)
        .map(|status| Code::from_bytes(status.as_bytes()))
}

/// A call from its arrival to the end of its answer, when it is logged.
///
/// It measures for how long the transport waits for parts of the answer after the end of the call's search. Nothing counts while the
/// client does not read. A client drops the call at its deadline: the answer would have taken at least until then.
#[derive(Debug)]
struct OpenCall {
    method: String,
    context: CallContext,
    /// `None` is logged as cancelled.
    code: Option<Code>,
    reserve: Arc<DeadlineReserve>,
    transport: Transport,
    /// How long the transport has waited for parts of the answer since the end of the search.
    waited: Duration,
    _in_flight: watch::Receiver<()>,
}

#[derive(Clone, Copy, Debug)]
enum Transport {
    /// It waits for the first part, since the call arrived.
    Waits,
    /// It has requested another part.
    WaitsSince(Instant),
    /// It has every requested part.
    Idles,
}

impl OpenCall {
    /// A call that has arrived; it counts as a receiver of `in_flight`.
    fn new(
        path: &str,
        context: CallContext,
        in_flight: &watch::Sender<()>,
        reserve: &Arc<DeadlineReserve>,
    ) -> Self {
        Self {
            method: path.chars().take(MAX_LOGGED_METHOD).collect(),
            context,
            code: None,
            reserve: Arc::clone(reserve),
            transport: Transport::Waits,
            waited: Duration::ZERO,
            _in_flight: in_flight.subscribe(),
        }
    }

    fn fail(&mut self, code: Code) {
        self.code = Some(code);
    }

    /// The answer, with whose body the call ends.
    fn answer(mut self, answer: Response<Body>) -> Response<Body> {
        self.code = code_in(answer.headers()).or(self.code);
        answer.map(|inner| filtered(inner, self))
    }

    /// The transport requests the next part of the answer.
    fn asked(&mut self) {
        if let Transport::Idles = self.transport {
            self.transport = Transport::WaitsSince(Instant::now());
        }
    }

    /// The transport has the requested part.
    fn answered(&mut self) {
        let transport = std::mem::replace(&mut self.transport, Transport::Idles);
        let record = &self.context.record;
        let Some(&due) = record.due.get() else { return };
        let end = record.ended.get().map_or(due, |&ended| ended.min(due));
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

impl Drop for OpenCall {
    fn drop(&mut self) {
        self.answered();
        let record = &self.context.record;
        let search = record.search.get();
        let status = grpc_name(self.code.unwrap_or(Code::Cancelled));
        let total_us = micros(self.context.arrived.elapsed());
        macro_rules! log {
            ($level:ident) => {
                tracing::$level!(
                    method = %self.method,
                    object = record.object.get(),
                    outcome = search.map(|s| s.outcome),
                    attempts = search.map(|s| s.attempts),
                    search_us = search.map(|s| micros(s.time)),
                    reserve_us = record.reserve.get().copied().map(micros),
                    total_us,
                    %status,
                    "call"
                )
            };
        }
        if self.method.starts_with(LOGGED_PACKAGE) {
            log!(info);
        } else {
            log!(debug);
        }
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}

/// A code in the spelling of gRPC: `INVALID_ARGUMENT`.
fn grpc_name(code: Code) -> String {
    let mut name = String::new();
    for character in format!("{code:?}").chars() {
        if !name.is_empty() && character.is_ascii_uppercase() {
            name.push('_');
        }
        name.push(character.to_ascii_uppercase());
    }
    name
}

/// A call ends with the body of its answer.
impl FrameFilter for OpenCall {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        self.asked();
        let polled = next_frame(inner, cx);
        if polled.is_ready() {
            self.answered();
        }
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && let Some(code) = frame.trailers_ref().and_then(code_in)
        {
            self.code = Some(code);
        }
        polled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_codes_are_spelled_as_in_grpc() {
        assert_eq!(grpc_name(Code::InvalidArgument), "INVALID_ARGUMENT");
        assert_eq!(grpc_name(Code::Ok), "OK");
    }
}
