//! What holds for every call: its arrival and deadline, its line in the log, its place in the count of calls, and
//! the bound on uploads.

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
    error::{Limit, ServiceError},
};

/// Path of the one method whose messages are large: it is admitted before its message is received.
const UPLOAD_METHOD: &str = "/grasp.v1.ObjectService/CreateObject";

/// Services whose calls are logged for every request; the others are asked by probes and tools.
const LOGGED_PACKAGE: &str = "/grasp.v1.";

/// When a client whose upload was turned away should try again: about the time of an upload.
const RETRY_UPLOAD_AFTER: Duration = Duration::from_millis(250);

/// Characters of a method's path that are logged at most.
const LONGEST_LOGGED_METHOD: usize = 96;

/// What a handler may know and tell about its call.
#[derive(Clone, Debug)]
pub(crate) struct CallContext {
    /// When the call's headers arrived.
    pub arrived: Instant,
    /// When the client stops waiting.
    pub deadline: Option<Instant>,
    told: Arc<Told>,
}

/// What a handler adds to the line in the log.
#[derive(Debug, Default)]
struct Told {
    object: OnceLock<String>,
    search: OnceLock<SearchSummary>,
}

/// A search in a line of the log.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchSummary {
    /// How it ended, as the contract names it.
    pub outcome: &'static str,
    /// Attempts that were run.
    pub attempts: u64,
    /// Its wall time.
    pub time: Duration,
}

impl CallContext {
    /// The context of a request; of one that came without [`CallLayer`], a new one without a deadline.
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
            // A deadline beyond the clock's end is none.
            deadline: timeout.and_then(|timeout| arrived.checked_add(timeout)),
            told: Arc::default(),
        }
    }

    /// Names the object in the log.
    pub(crate) fn tell_object(&self, id: &str) {
        // A handler tells once; a second word would change nothing.
        let _ = self.told.object.set(id.to_owned());
    }

    /// Describes the search in the log.
    pub(crate) fn tell_search(&self, summary: SearchSummary) {
        let _ = self.told.search.set(summary);
    }
}

/// The calls that have no answer yet.
#[derive(Clone, Debug, Default)]
pub(crate) struct CallsInFlight(Arc<Counter>);

#[derive(Debug, Default)]
struct Counter {
    count: AtomicUsize,
    reached_zero: Notify,
}

impl CallsInFlight {
    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.0.count.load(Ordering::Acquire)
    }

    /// Returns when there is none.
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

/// Wraps every service; see the module.
#[derive(Clone, Debug)]
pub(crate) struct CallLayer {
    /// Counts the calls.
    pub in_flight: CallsInFlight,
    /// Bounds the uploads.
    pub uploads: Arc<Semaphore>,
    /// How many uploads there may be.
    pub maximum_uploads: usize,
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
        let upload = if request.uri().path() == UPLOAD_METHOD {
            let Ok(permit) = Arc::clone(&self.layer.uploads).try_acquire_owned() else {
                line.ends_with(Code::ResourceExhausted);
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
            let answer = answer.await;
            line.ends_with(match &answer {
                Ok(response) => code_of(response),
                Err(_) => Code::Internal,
            });
            answer
        })
    }
}

/// The right to receive and build an object. It travels with the request, and from there into the work.
#[derive(Clone, Debug)]
pub(crate) struct UploadPermit {
    _permit: Arc<OwnedSemaphorePermit>,
}

/// The status of a response: in its headers if it has no message, else it ended well when it began.
fn code_of<R>(response: &Response<R>) -> Code {
    response
        .headers()
        .get("grpc-status")
        .map_or(Code::Ok, |status| Code::from_bytes(status.as_bytes()))
}

/// A call's line in the log, written when the call ends in whatever way.
struct LogLine {
    method: String,
    context: CallContext,
    code: Option<Code>,
    _in_flight: InFlight,
}

impl LogLine {
    /// Notes the status; without it, the call was cancelled.
    fn ends_with(&mut self, code: Code) {
        self.code = Some(code);
    }
}

impl Drop for LogLine {
    fn drop(&mut self) {
        let told = &self.context.told;
        let search = told.search.get();
        let status = Shouted(self.code.unwrap_or(Code::Cancelled));
        let total_us = micros(self.context.arrived.elapsed());
        macro_rules! log {
            ($level:ident) => {
                tracing::$level!(
                    method = %self.method,
                    object = told.object.get(),
                    outcome = search.map(|s| s.outcome),
                    attempts = search.map(|s| s.attempts),
                    search_us = search.map(|s| micros(s.time)),
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

/// A code as gRPC writes it: `INVALID_ARGUMENT`.
struct Shouted(Code);

impl fmt::Display for Shouted {
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
    fn codes_are_written_as_grpc_does() {
        assert_eq!(Shouted(Code::InvalidArgument).to_string(), "INVALID_ARGUMENT");
        assert_eq!(Shouted(Code::Ok).to_string(), "OK");
    }

    #[tokio::test]
    async fn the_count_is_none_only_when_all_calls_have_ended() {
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

    /// A service that keeps every request without an answer.
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

    fn request(path: &str) -> Request<()> {
        Request::builder()
            .uri(path)
            .header("grpc-timeout", "3S")
            .body(())
            .unwrap()
    }

    #[tokio::test]
    async fn an_upload_too_many_is_turned_away_before_it_is_received() {
        let layer = CallLayer {
            in_flight: CallsInFlight::default(),
            uploads: Arc::new(Semaphore::new(1)),
            maximum_uploads: 1,
        };
        let keeper = Keeper::default();
        let mut service = layer.layer(keeper.clone());
        let first = service.call(request(UPLOAD_METHOD));
        let second = service.call(request(UPLOAD_METHOD)).await.unwrap();
        assert_eq!(code_of(&second), Code::ResourceExhausted);
        // Calls of other methods are not uploads.
        let other = service.call(request("/grasp.v1.GraspService/FindGrasp"));
        assert_eq!(layer.in_flight.count(), 2);
        drop((first, other));
        assert_eq!(layer.in_flight.count(), 0);
        // The permit goes with the request, which the keeper still works on.
        assert_eq!(layer.uploads.available_permits(), 0);
        assert_eq!(keeper.0.lock().unwrap().len(), 2);
        keeper.0.lock().unwrap().clear();
        assert_eq!(layer.uploads.available_permits(), 1);
    }

    #[tokio::test]
    async fn a_handler_learns_when_its_call_arrived_and_ends() {
        let keeper = Keeper::default();
        let layer = CallLayer {
            in_flight: CallsInFlight::default(),
            uploads: Arc::new(Semaphore::new(1)),
            maximum_uploads: 1,
        };
        let before = Instant::now();
        let _call = layer
            .layer(keeper.clone())
            .call(request("/grasp.v1.GraspService/FindGrasp"));
        let kept = keeper.0.lock().unwrap();
        let context = kept[0].extensions().get::<CallContext>().unwrap();
        assert!(before <= context.arrived && context.arrived <= Instant::now());
        assert_eq!(context.deadline, Some(context.arrived + Duration::from_secs(3)));
    }
}
