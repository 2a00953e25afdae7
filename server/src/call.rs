//! A layer around every call: records arrival and deadline, counts and logs calls, measures how long answers take after
//! their search, and bounds uploads.

use std::{
    fmt,
    pin::Pin,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Context, Poll},
    time::{Duration, Instant},
};

use http::{Request, Response};
use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore};
use tonic::{Code, Status};
use tower::{Layer, Service};

use crate::{
    budget::parse_grpc_timeout,
    error::{Limit, ServiceError, blame_malformed_messages},
    reserve::DeadlineReserve,
};

/// Paths of the methods that build objects from large messages; their calls are admitted before the message is received.
const UPLOAD_METHODS: [&str; 2] = [
    "/grasp.v1.ObjectService/CreateObject",
    "/grasp.v1.ObjectService/UpdateObject",
];

/// Services whose calls are logged at level info. Probes and tools call the others.
const LOGGED_PACKAGE: &str = "/grasp.v1.";

/// When a client whose upload was rejected should retry: after about the time of an upload.
const RETRY_UPLOAD_AFTER: Duration = Duration::from_millis(250);

/// Largest number of logged characters of a method's path.
const LONGEST_LOGGED_METHOD: usize = 96;

/// What a handler knows about its call, and adds to the call's log line.
#[derive(Clone, Debug)]
pub(crate) struct CallContext {
    /// When the call's headers arrived.
    pub arrived: Instant,
    /// When the client stops waiting, if it set a deadline.
    pub deadline: Option<Instant>,
    log_fields: Arc<LogFields>,
    search_end: Arc<SearchEnd>,
}

/// What a handler adds to the log line.
#[derive(Debug, Default)]
struct LogFields {
    object: OnceLock<String>,
    reserve: OnceLock<Duration>,
    search: OnceLock<SearchSummary>,
}

/// The end of a call's search, from which the delay of its answer counts.
#[derive(Debug, Default)]
struct SearchEnd {
    /// When it has to end.
    due: OnceLock<Instant>,
    /// When it ended.
    actual: OnceLock<Instant>,
}

/// A search as it is logged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchSummary {
    /// Name of the outcome in the contract.
    pub outcome: &'static str,
    /// Number of attempts.
    pub attempts: u64,
    /// Its wall time.
    pub time: Duration,
}

impl CallContext {
    /// The context of a request; a new one without a deadline if the request did not pass [`CallLayer`].
    pub(crate) fn of<T>(request: &tonic::Request<T>) -> Self {
        request
            .extensions()
            .get()
            .cloned()
            .unwrap_or_else(|| Self::arriving(None))
    }

    fn arriving(timeout: Option<Duration>) -> Self {
        let arrived = Instant::now();
        Self {
            arrived,
            // A deadline beyond the clock's range counts as none.
            deadline: timeout.and_then(|timeout| arrived.checked_add(timeout)),
            log_fields: Arc::default(),
            search_end: Arc::default(),
        }
    }

    /// Records when the search that starts now has to end. A time that has passed counts as now: what was waited before,
    /// such as for the rest of a request, is no delay of the answer.
    pub(crate) fn search_is_due(&self, due: Instant) {
        let _ = self.search_end.due.set(due.max(Instant::now()));
    }

    /// Records when the search ended.
    pub(crate) fn search_ended(&self, at: Instant) {
        let _ = self.search_end.actual.set(at);
    }

    /// Adds the object's id to the log line.
    pub(crate) fn log_object(&self, id: &str) {
        // The first value stays.
        let _ = self.log_fields.object.set(id.to_owned());
    }

    /// Adds the part of the deadline that is kept for the answer to the log line, if there is a deadline.
    pub(crate) fn log_reserve(&self, reserve: Duration) {
        if self.deadline.is_some() {
            let _ = self.log_fields.reserve.set(reserve);
        }
    }

    /// Adds the search to the log line.
    pub(crate) fn log_search(&self, summary: SearchSummary) {
        let _ = self.log_fields.search.set(summary);
    }
}

/// Counts the calls in flight.
#[derive(Clone, Debug, Default)]
pub(crate) struct CallsInFlight(Arc<Counter>);

#[derive(Debug, Default)]
struct Counter {
    count: AtomicUsize,
    reached_zero: Notify,
}

impl CallsInFlight {
    /// Number of calls.
    pub(crate) fn count(&self) -> usize {
        self.0.count.load(Ordering::Acquire)
    }

    /// Waits until there are none.
    pub(crate) async fn none(&self) {
        loop {
            let reached_zero = self.0.reached_zero.notified();
            if self.count() == 0 {
                return;
            }
            reached_zero.await;
        }
    }

    fn enter(&self) -> InFlight {
        self.0.count.fetch_add(1, Ordering::AcqRel);
        InFlight(Arc::clone(&self.0))
    }
}

struct InFlight(Arc<Counter>);

impl Drop for InFlight {
    fn drop(&mut self) {
        if self.0.count.fetch_sub(1, Ordering::AcqRel) == 1 {
            self.0.reached_zero.notify_waiters();
        }
    }
}

/// Wraps every service; see the module documentation.
#[derive(Clone, Debug)]
pub(crate) struct CallLayer {
    /// Counter of calls.
    pub in_flight: CallsInFlight,
    /// One permit per concurrent upload.
    pub uploads: Arc<Semaphore>,
    /// Largest number of concurrent uploads.
    pub maximum_uploads: usize,
    /// Learns the delays of answers.
    pub reserve: Arc<DeadlineReserve>,
}

impl<S> Layer<S> for CallLayer {
    type Service = CallService<S>;

    fn layer(&self, inner: S) -> Self::Service {
        CallService {
            inner,
            layer: self.clone(),
        }
    }
}

/// A service in its [`CallLayer`].
#[derive(Clone, Debug)]
pub(crate) struct CallService<S> {
    inner: S,
    layer: CallLayer,
}

impl<S, B, R> Service<Request<B>> for CallService<S>
where
    S: Service<Request<B>, Response = Response<R>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
    R: Default + Send + 'static,
{
    type Response = Response<R>;
    type Error = S::Error;
    type Future = Pin<Box<dyn Future<Output = Result<Response<R>, S::Error>> + Send>>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, mut request: Request<B>) -> Self::Future {
        let timeout = request
            .headers()
            .get("grpc-timeout")
            .and_then(|header| header.to_str().ok())
            .and_then(parse_grpc_timeout);
        let context = CallContext::arriving(timeout);
        let mut line = LogLine {
            method: request.uri().path().chars().take(LONGEST_LOGGED_METHOD).collect(),
            context: context.clone(),
            code: None,
            _in_flight: self.layer.in_flight.enter(),
        };
        let delay = AnswerDelay {
            search_end: Arc::clone(&context.search_end),
            reserve: Arc::clone(&self.layer.reserve),
        };
        let upload = if UPLOAD_METHODS.contains(&request.uri().path()) {
            let Ok(permit) = Arc::clone(&self.layer.uploads).try_acquire_owned() else {
                line.set_code(Code::ResourceExhausted);
                let status = Status::from(ServiceError::Overloaded {
                    limit: Limit::Uploads,
                    maximum: self.layer.maximum_uploads,
                    retry_after: RETRY_UPLOAD_AFTER,
                });
                return Box::pin(std::future::ready(Ok(status.into_http())));
            };
            Some(permit)
        } else {
            None
        };
        let extensions = request.extensions_mut();
        extensions.insert(context);
        if let Some(permit) = upload {
            extensions.insert(UploadPermit {
                _permit: Arc::new(permit),
            });
        }
        let answer = self.inner.call(request);
        Box::pin(async move {
            let answer = answer.await.map(blame_malformed_messages);
            drop(delay);
            line.set_code(match &answer {
                Ok(response) => code_of(response),
                Err(_) => Code::Internal,
            });
            answer
        })
    }
}

/// The right to receive and build an object. The handler takes it from the request and holds it while it works.
#[derive(Clone, Debug)]
pub(crate) struct UploadPermit {
    _permit: Arc<OwnedSemaphorePermit>,
}

/// The status of a response: that of its headers if it has no message, otherwise OK.
fn code_of<R>(response: &Response<R>) -> Code {
    response
        .headers()
        .get("grpc-status")
        .map_or(Code::Ok, |status| Code::from_bytes(status.as_bytes()))
}

/// Measures the delay from the end of a call's search to its answer. If the call is dropped first, which is what a
/// client does at its deadline, the answer would have taken at least until then.
struct AnswerDelay {
    search_end: Arc<SearchEnd>,
    reserve: Arc<DeadlineReserve>,
}

impl Drop for AnswerDelay {
    fn drop(&mut self) {
        let SearchEnd { due, actual } = &*self.search_end;
        if let Some(&due) = due.get() {
            let now = Instant::now();
            let end = actual.get().map_or(due, |&actual| actual.min(due));
            self.reserve.record(now.saturating_duration_since(end), now);
        }
    }
}

/// A call's log line, written when the call ends, for whatever reason.
struct LogLine {
    method: String,
    context: CallContext,
    code: Option<Code>,
    _in_flight: InFlight,
}

impl LogLine {
    /// Records the status. A line without one is logged as cancelled.
    fn set_code(&mut self, code: Code) {
        self.code = Some(code);
    }
}

impl Drop for LogLine {
    fn drop(&mut self) {
        let fields = &self.context.log_fields;
        let search = fields.search.get();
        let status = GrpcName(self.code.unwrap_or(Code::Cancelled));
        let total_us = micros(self.context.arrived.elapsed());
        macro_rules! log {
            ($level:ident) => {
                tracing::$level!(
                    method = %self.method,
                    object = fields.object.get(),
                    outcome = search.map(|s| s.outcome),
                    attempts = search.map(|s| s.attempts),
                    search_us = search.map(|s| micros(s.time)),
                    reserve_us = fields.reserve.get().copied().map(micros),
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
struct GrpcName(Code);

impl fmt::Display for GrpcName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, character) in format!("{:?}", self.0).chars().enumerate() {
            if place > 0 && character.is_ascii_uppercase() {
                f.write_str("_")?;
            }
            write!(f, "{}", character.to_ascii_uppercase())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::{convert::Infallible, sync::Mutex};

    use super::*;

    #[test]
    fn status_codes_are_spelled_as_in_grpc() {
        assert_eq!(GrpcName(Code::InvalidArgument).to_string(), "INVALID_ARGUMENT");
        assert_eq!(GrpcName(Code::Ok).to_string(), "OK");
    }

    #[tokio::test]
    async fn waits_until_all_calls_have_ended() {
        let calls = CallsInFlight::default();
        calls.none().await;
        let (first, second) = (calls.enter(), calls.enter());
        drop(first);
        let waiting = tokio::spawn({
            let calls = calls.clone();
            async move { calls.none().await }
        });
        tokio::task::yield_now().await;
        assert!(!waiting.is_finished());
        drop(second);
        waiting.await.unwrap();
    }

    /// A service that keeps every request and never answers.
    #[derive(Clone, Default)]
    struct Keeper(Arc<Mutex<Vec<Request<()>>>>);

    impl Service<Request<()>> for Keeper {
        type Response = Response<()>;
        type Error = Infallible;
        type Future = std::future::Pending<Result<Response<()>, Infallible>>;

        fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
            Poll::Ready(Ok(()))
        }

        fn call(&mut self, request: Request<()>) -> Self::Future {
            self.0.lock().unwrap().push(request);
            std::future::pending()
        }
    }

    /// A layer that admits one upload.
    fn layer() -> CallLayer {
        CallLayer {
            in_flight: CallsInFlight::default(),
            uploads: Arc::new(Semaphore::new(1)),
            maximum_uploads: 1,
            reserve: Arc::new(DeadlineReserve::new(Duration::ZERO, Instant::now())),
        }
    }

    fn request(path: &str) -> Request<()> {
        Request::builder()
            .uri(path)
            .header("grpc-timeout", "3S")
            .body(())
            .unwrap()
    }

    #[tokio::test]
    async fn rejects_uploads_beyond_the_maximum_before_they_are_received() {
        let layer = layer();
        let keeper = Keeper::default();
        let mut service = layer.layer(keeper.clone());
        let first = service.call(request(UPLOAD_METHODS[0]));
        let second = service.call(request(UPLOAD_METHODS[1])).await.unwrap();
        assert_eq!(code_of(&second), Code::ResourceExhausted);
        // Other methods need no permit.
        let other = service.call(request("/grasp.v1.GraspService/FindGrasp"));
        assert_eq!(layer.in_flight.count(), 2);
        drop((first, other));
        assert_eq!(layer.in_flight.count(), 0);
        // The kept request still holds the permit.
        assert_eq!(layer.uploads.available_permits(), 0);
        assert_eq!(keeper.0.lock().unwrap().len(), 2);
        keeper.0.lock().unwrap().clear();
        assert_eq!(layer.uploads.available_permits(), 1);
    }

    #[tokio::test]
    async fn passes_arrival_and_deadline_to_the_handler() {
        let keeper = Keeper::default();
        let layer = layer();
        let before = Instant::now();
        let _call = layer
            .layer(keeper.clone())
            .call(request("/grasp.v1.GraspService/FindGrasp"));
        let kept = keeper.0.lock().unwrap();
        let context = kept[0].extensions().get::<CallContext>().unwrap();
        assert!(before <= context.arrived && context.arrived <= Instant::now());
        assert_eq!(context.deadline, Some(context.arrived + Duration::from_secs(3)));
    }

    /// The call of a request whose search is recorded with the given times, and the layer.
    fn call_with_search(due: Instant, ended: Option<Instant>) -> (CallLayer, impl Future) {
        let (layer, keeper) = (layer(), Keeper::default());
        let call = layer
            .layer(keeper.clone())
            .call(request("/grasp.v1.GraspService/FindGrasp"));
        let kept = keeper.0.lock().unwrap();
        let context: &CallContext = kept[0].extensions().get().unwrap();
        context.search_is_due(due);
        if let Some(ended) = ended {
            context.search_ended(ended);
        }
        (layer, call)
    }

    /// The reserve that a call leaves behind when it is dropped.
    fn reserve_after(due: Instant, ended: Option<Instant>) -> Duration {
        let (layer, call) = call_with_search(due, ended);
        drop(call);
        layer.reserve.at(Instant::now())
    }

    #[test]
    fn delay_of_an_answer_counts_from_the_end_of_its_search() {
        let now = Instant::now();
        let (hour, second) = (Duration::from_hours(1), Duration::from_secs(1));
        let past = now.checked_sub(second).unwrap();
        // A search that ended a second before, and had an hour left.
        assert!(reserve_after(now + hour, Some(past)) > second);
        // One that runs, dropped before it has to end.
        assert!(reserve_after(now + hour, None) < second);
        // A time before the start of the search counts as its start.
        assert!(reserve_after(past, None) < second);
    }
}
