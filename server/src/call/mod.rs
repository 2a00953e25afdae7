//! Middleware around every call: records arrival and deadline, counts and logs calls, measures how long answers take after
//! their search, limits their time, rejects those of connections that have too many or do not read, packs large messages, and bounds
//! uploads; no other call of the same service may send large messages. A call lasts until its answer's body has been handed to the
//! transport, which for streams may be long after its headers.

mod ending;
mod layer;
mod packing;
mod panics;
mod reads;
mod request_id;
mod upload;

use std::{
    borrow::Cow,
    sync::{Arc, OnceLock},
    task::{Context, Poll},
    time::{Duration, Instant},
};

use grasp_proto::{code_name, v1};
use http::{HeaderMap, HeaderValue, Response};
use tokio::sync::watch;
use tonic::{Code, body::Body};

use self::request_id::request_id;
pub(crate) use self::{
    layer::{BySize, Calls, is_upload},
    packing::Messages as FramedMessages,
    request_id::REQUEST_ID,
    upload::UploadPermit,
};
use crate::{
    access::Caller,
    budget::{DeadlineReserve, parse_grpc_timeout},
    client::Client,
    error::add_request_id,
    executor::{Admission, QueueTime},
    metrics::{Method, Metrics},
    middleware::{FrameFilter, PolledFrame, filtered, next_frame},
    net::Reader,
    sync::{Mutex, locked},
    traces::{CallTrace, Interval, Traces},
};

/// How long before its deadline a call that is no search is answered, so that the answer may arrive in time.
const BEFORE_DEADLINE: Duration = Duration::from_millis(5);

/// Context of a call for its handler, which adds to the call's log line.
#[derive(Clone, Debug)]
pub(crate) struct CallContext {
    /// The client's id of the request, or a new one.
    request_id: HeaderValue,
    pub arrived: Instant,
    /// When the client stops waiting, if it set a deadline.
    pub deadline: Option<Instant>,
    pub client: Client,
    pub caller: Caller,
    metrics: Arc<Metrics>,
    /// The header with the span of the caller.
    traceparent: Option<HeaderValue>,
    record: Arc<CallRecord>,
}

/// Values that a handler records about its call; the first of each stays.
#[derive(Debug, Default)]
struct CallRecord {
    object: OnceLock<String>,
    reserve: OnceLock<Duration>,
    search: OnceLock<SearchSummary>,
    /// When the object was prepared for searches, if it was not.
    preparation: OnceLock<Interval>,
    /// How long the search has waited for its turns.
    queue_time: OnceLock<Arc<QueueTime>>,
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
    /// The check for which there is no grasp, or not the current one.
    pub failed_check: Option<v1::Check>,
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
            request_id: self.request_id.clone(),
            arrived,
            deadline: self.deadline,
            client: self.client.clone(),
            caller: self.caller.clone(),
            metrics: Arc::clone(&self.metrics),
            traceparent: None,
            record: Arc::default(),
        }
    }

    pub(crate) fn arriving(headers: &HeaderMap, client: Client, metrics: &Arc<Metrics>) -> Self {
        let arrived = Instant::now();
        let timeout = headers.get("grpc-timeout");
        let timeout = timeout.and_then(|timeout| parse_grpc_timeout(timeout.to_str().ok()?));
        Self {
            request_id: request_id(headers),
            arrived,
            // A deadline beyond the clock's range counts as none.
            deadline: timeout.and_then(|timeout| arrived.checked_add(timeout)),
            client,
            caller: Caller::default(),
            metrics: Arc::clone(metrics),
            traceparent: headers.get("traceparent").cloned(),
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

    pub(crate) fn request_id(&self) -> &str {
        self.request_id.to_str().unwrap_or_default()
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
        let SearchSummary {
            outcome,
            time,
            failed_check,
            ..
        } = summary;
        self.metrics.searched(time, outcome, failed_check);
        let _ = self.record.ended.set(at);
        let _ = self.record.search.set(summary);
    }

    /// Records the right with which the call's search begins.
    pub(crate) fn search_begins(&self, admission: &Admission) {
        let _ = self.record.queue_time.set(admission.queue_time());
    }

    /// Records that the object was prepared for searches since then.
    pub(crate) fn prepared_since(&self, start: Instant) {
        let _ = self.record.preparation.set((start, Instant::now()));
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
#[derive(Debug)]
struct OpenCall {
    method: Method,
    path: Cow<'static, str>,
    context: CallContext,
    /// `None` of one that is cancelled, or lost with its connection.
    code: Option<Code>,
    reader: Option<Arc<Reader>>,
    reserve: Arc<DeadlineReserve>,
    traces: Traces,
    transport: Transport,
    /// How long the transport has waited for parts of the answer since the end of the search. Nothing counts while the client does not
    /// read; one that drops the call at its deadline would have waited at least until then.
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
        reader: Option<Arc<Reader>>,
        in_flight: &watch::Sender<()>,
        reserve: &Arc<DeadlineReserve>,
        traces: &Traces,
    ) -> Self {
        let method = context.metrics.call_started(path);
        let clipped = || path.chars().take(MAX_LOGGED_METHOD).collect();
        Self {
            method,
            path: context
                .metrics
                .path(method)
                .map_or_else(|| Cow::Owned(clipped()), Cow::Borrowed),
            context,
            code: None,
            reader,
            reserve: Arc::clone(reserve),
            traces: traces.clone(),
            transport: Transport::Waits,
            waited: Duration::ZERO,
            _in_flight: in_flight.subscribe(),
        }
    }

    fn fail(&mut self, code: Code) {
        self.code = Some(code);
    }

    /// The answer, with whose body the call ends.
    fn answer(mut self, mut answer: Response<Body>) -> Response<Body> {
        self.read_status(answer.headers_mut());
        answer
            .headers_mut()
            .insert(REQUEST_ID, self.context.request_id.clone());
        answer.map(|inner| filtered(inner, self))
    }

    /// Reads the status in headers or trailers, and adds the id of the request to an error.
    fn read_status(&mut self, headers: &mut HeaderMap) {
        let Some(code) = code_in(headers) else { return };
        self.code = Some(code);
        if code != Code::Ok
            && let Some(reason) = add_request_id(headers, self.context.request_id())
        {
            self.context.metrics.refused(reason);
        }
    }

    fn trace(&self, code: Code) {
        let CallContext { arrived, record, .. } = &self.context;
        let search = record.search.get();
        let ended = record.ended.get().copied();
        let began = ended
            .zip(search)
            .and_then(|(ended, search)| ended.checked_sub(search.time));
        // Its turns come one by one; here, all waiting comes first.
        let queue_time = record.queue_time.get().map(|queue_time| queue_time.get());
        let turn = began
            .zip(ended)
            .map(|(began, ended)| ended.min(began + queue_time.unwrap_or_default()));
        let parts = [
            ("preparation", record.preparation.get().copied()),
            ("queue", began.zip(turn)),
            ("search", turn.zip(ended)),
        ];
        self.traces.record(&CallTrace {
            method: self.path.trim_start_matches('/'),
            request_id: self.context.request_id(),
            traceparent: self.context.traceparent.as_ref(),
            object: record.object.get().map(String::as_str),
            outcome: search.map(|search| search.outcome),
            code,
            time: (*arrived, Instant::now()),
            parts: parts
                .into_iter()
                .filter_map(|(name, time)| Some((name, time?)))
                .collect(),
        });
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
        // A connection that the server closes is unavailable to its client.
        let code = self.code.unwrap_or_else(|| {
            let is_cut_off = self.reader.as_ref().is_some_and(|reader| reader.is_closing());
            if is_cut_off {
                Code::Unavailable
            } else {
                Code::Cancelled
            }
        });
        let total = self.context.arrived.elapsed();
        let metrics = &self.context.metrics;
        metrics.call_ended(self.method, code, total);
        let late = self.context.deadline.map(|deadline| deadline.elapsed());
        // A client that gave up earlier says nothing about answers.
        if let Some(late) = late.filter(|late| self.code.is_some() || !late.is_zero()) {
            metrics.overshot(late);
        }
        if self.traces.are_on() {
            self.trace(code);
        }
        let (status, total_us) = (code_name(code), micros(total));
        macro_rules! log {
            ($level:ident) => {
                tracing::$level!(
                    method = %self.path,
                    client = %self.context.client,
                    request_id = self.context.request_id(),
                    object = record.object.get(),
                    outcome = search.map(|s| s.outcome),
                    attempts = search.map(|s| s.attempts),
                    search_us = search.map(|s| micros(s.time)),
                    queue_us = record.queue_time.get().map(|queue_time| micros(queue_time.get())),
                    reserve_us = record.reserve.get().copied().map(micros),
                    total_us,
                    %status,
                    "call"
                )
            };
        }
        if self.path.starts_with(LOGGED_PACKAGE) {
            log!(info);
        } else {
            log!(debug);
        }
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}

/// A call ends with the body of its answer.
impl FrameFilter for OpenCall {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        self.asked();
        let mut polled = next_frame(inner, cx);
        if polled.is_ready() {
            self.answered();
        }
        if let Poll::Ready(Some(Ok(frame))) = &mut polled
            && let Some(trailers) = frame.trailers_mut()
        {
            self.read_status(trailers);
        }
        polled
    }
}
