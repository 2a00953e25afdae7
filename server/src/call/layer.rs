//! The middleware itself: around every service, from a call's headers to the end of its answer.

use std::{
    sync::Arc,
    task::{Context, Poll},
    time::{Duration, Instant},
};

use http::{Request, Response, header};
use tokio::sync::{Semaphore, watch};
use tokio_util::sync::CancellationToken;
use tonic::{Code, Status, body::Body, server::NamedService};
use tower::Service;

use super::{
    CallContext, LOGGED_PACKAGE, OpenCall,
    ending::ended_by,
    packing::{accepts_gzip, packing},
    panics::contained,
    reads::{ReadPlace, Reads, is_read},
    upload::{BYTES_WITHOUT_PLACE, UploadPermit, bounded_upload},
};
use crate::{
    access::Door,
    budget::DeadlineReserve,
    client::Client,
    error::{ServiceError, blame_client},
    executor::SearchExecutor,
    limits::{ClientPermits, MAX_FIND_REQUEST, Places},
    metrics::Metrics,
    middleware::{Answer, Middleware, filtered},
    net::{Reader, arriving},
    sync::locked,
    traces::Traces,
};

/// Methods that build objects or rigs from large messages. The number of such messages received at a time is bounded.
const UPLOAD_METHODS: [&str; 4] = [
    "/grasp.v1.ObjectService/CreateObject",
    "/grasp.v1.ObjectService/UpdateObject",
    STREAMED_UPLOAD,
    "/grasp.v1.HandRigService/CreateRig",
];

/// Methods that search.
const SEARCH_METHODS: [&str; 4] = [
    "/grasp.v1.GraspService/FindGrasp",
    "/grasp.v1.GraspService/StreamGrasps",
    "/grasp.v1.GraspService/ValidateGrasp",
    "/grasp.v1.GraspService/EvaluateHoldout",
];

/// Path of the upload in pieces, which limits its own time.
const STREAMED_UPLOAD: &str = "/grasp.v1.ObjectService/UploadObject";

/// Methods that stream small messages for which clients wait: packing would delay them.
const AWAITED_STREAMS: [&str; 3] = [
    "/grasp.v1.GraspService/StreamGrasps",
    "/grasp.v1.GraspService/TrackHoldout",
    "/grasp.v1.ObjectService/WatchObjects",
];

/// How long before its deadline an unanswered call ends, so that its client may still learn why.
const BEFORE_END: Duration = Duration::from_millis(1);

/// True if a method takes large messages, once its call is admitted.
pub(crate) fn is_upload(path: &str) -> bool {
    UPLOAD_METHODS.contains(&path)
}

/// Wraps every service; see the module documentation.
#[derive(Clone, Debug)]
pub(crate) struct Calls {
    /// Lets calls in.
    pub door: Arc<Door>,
    pub metrics: Arc<Metrics>,
    pub traces: Traces,
    /// Has a receiver per call in flight.
    pub in_flight: watch::Sender<()>,
    /// Admits searches.
    pub executor: SearchExecutor,
    /// Longest time of a search.
    pub longest_search: Duration,
    /// One place per concurrent upload.
    pub uploads: Places,
    /// Permits of each client to build or prepare something.
    pub heavy: Arc<ClientPermits>,
    /// Lets calls that read or delete take turns.
    pub reads: Arc<Reads>,
    /// Longest pause in an upload.
    pub upload_grace: Duration,
    /// One permit per thread that packs messages.
    pub packers: Arc<Semaphore>,
    /// Learns the delays of answers.
    pub reserve: Arc<DeadlineReserve>,
    /// Largest message of an upload, in bytes.
    pub largest_upload: usize,
    /// Longest time from a call's headers to those of its answer.
    pub longest_call: Duration,
    /// Cancelled when the server begins to shut down.
    pub shutdown: CancellationToken,
    /// Cancelled when running calls have had their time to end.
    pub drained: CancellationToken,
}

impl Calls {
    /// Admits a search, or a call that reads or deletes, which then waits for its turn.
    fn admit(&self, path: &str, context: &CallContext) -> Result<Option<ReadPlace>, ServiceError> {
        let client = &context.client;
        if SEARCH_METHODS.contains(&path) {
            let due = context.latest_end(self.longest_search);
            let own = context.caller.take_search()?;
            let admission = self.executor.admit(client, due)?.within(own);
            *locked(&context.record.admission) = Some(admission);
        }
        is_read(path).then(|| self.reads.enter(client)).transpose()
    }

    /// When and with which error an unanswered call ends.
    fn end(&self, path: &str, context: &CallContext) -> Option<(Instant, ServiceError)> {
        let before = |deadline: Instant| deadline.checked_sub(BEFORE_END).unwrap_or(deadline);
        let due = context
            .deadline
            .map(|deadline| (before(deadline), ServiceError::DeadlineExceeded));
        let limit = self.longest_call;
        let longest =
            (path != STREAMED_UPLOAD).then(|| (context.arrived + limit, ServiceError::TookTooLong { limit }));
        due.into_iter().chain(longest).min_by_key(|&(at, _)| at)
    }
}

impl Middleware<Body> for Calls {
    fn handle<E, F>(&self, mut request: Request<Body>, next: impl FnOnce(Request<Body>) -> F) -> Answer<E>
    where
        E: Send + 'static,
        F: Future<Output = Result<Response<Body>, E>> + Send + 'static,
    {
        let reader = request.extensions().get::<Arc<Reader>>().cloned();
        let client = reader
            .as_ref()
            .map_or(Client::Local, |reader| reader.client.clone());
        let mut context = CallContext::arriving(request.headers(), client, &self.metrics);
        let path = request.uri().path();
        let peer = reader.as_ref().and_then(|reader| reader.peer.get());
        let admitted = self.door.admit(path, request.headers(), peer);
        let admitted = admitted.map(|caller| context.identify(caller));
        let mut call = OpenCall::new(
            path,
            context.clone(),
            reader.clone(),
            &self.in_flight,
            &self.reserve,
            &self.traces,
        );
        if let Err(error) = admitted {
            return Box::pin(std::future::ready(Ok(call.answer(refusal(error)))));
        }
        // No handler needs it.
        request.headers_mut().remove(header::AUTHORIZATION);
        let path = request.uri().path();
        let place = match reader.as_ref().map(|reader| reader.begin_call()).transpose() {
            Ok(place) => place,
            Err(error) => return Box::pin(std::future::ready(Ok(call.answer(refusal(error))))),
        };
        // Refused before the message is read, which costs more than the refusal.
        let admitted = match self.admit(path, &context) {
            Ok(admitted) => admitted,
            Err(error) => return Box::pin(std::future::ready(Ok(call.answer(refusal(error))))),
        };
        let end = self.end(path, &context);
        let upload =
            is_upload(path).then(|| UploadPermit::new(&self.uploads, &self.heavy, context.client.clone()));
        // Beyond these bytes, an upload has a place and needs no other bound.
        let (largest, most_counted) = match upload {
            Some(_) => (self.largest_upload, BYTES_WITHOUT_PLACE),
            None => (MAX_FIND_REQUEST, usize::MAX),
        };
        let ends = (!path.starts_with(LOGGED_PACKAGE)).then(|| self.shutdown.clone());
        let packs = !AWAITED_STREAMS.contains(&path) && accepts_gzip(request.headers());
        let client = context.client.clone();
        request.extensions_mut().insert(context);
        let (mut request, arriving) = arriving(request, most_counted);
        if let Some(permit) = upload {
            request.extensions_mut().insert(permit.clone());
            let grace = self.upload_grace;
            request = request.map(|body| bounded_upload(body, permit, grace));
        }
        let answer = contained(next(request), self.executor.faults.clone());
        let (packers, reads) = (Arc::clone(&self.packers), Arc::clone(&self.reads));
        let drained = self.drained.clone();
        let answer = async move {
            let turn = match admitted {
                Some(_) => reads.turn(&client).await,
                None => None,
            };
            let answer = answer.await?;
            drop((place, turn));
            let answer = match admitted {
                Some(read) => answer.map(|inner| filtered(inner, read)),
                None => answer,
            };
            Ok(match reader.map_or(Ok(()), |reader| reader.admit()) {
                Err(error) => refusal(error),
                Ok(()) if packs => packing(answer, packers),
                Ok(()) => answer,
            })
        };
        Box::pin(async move {
            let due = async {
                match end {
                    None => std::future::pending().await,
                    Some((at, error)) => {
                        tokio::time::sleep_until(at.into()).await;
                        error
                    }
                }
            };
            let answer = tokio::select! {
                biased;
                answer = answer => answer,
                error = due => Ok(refusal(error)),
                () = drained.cancelled() => Ok(refusal(ServiceError::ShuttingDown)),
            };
            drop(arriving);
            call.answered();
            match answer {
                Ok(answer) => {
                    let answer = blame_client(answer, largest);
                    Ok(call.answer(match ends {
                        Some(shutdown) => answer.map(|body| ended_by(body, shutdown)),
                        None => answer,
                    }))
                }
                Err(error) => {
                    call.fail(Code::Internal);
                    Err(error)
                }
            }
        })
    }
}

/// The same service twice: with the message limit of upload methods, and with that of all others. The limits hold for unpacked
/// messages, too.
#[derive(Clone, Debug)]
pub(crate) struct BySize<S> {
    pub large: S,
    pub small: S,
}

impl<S: NamedService> NamedService for BySize<S> {
    const NAME: &'static str = S::NAME;
}

impl<S: Service<Request<B>>, B> Service<Request<B>> for BySize<S> {
    type Response = S::Response;
    type Error = S::Error;
    type Future = S::Future;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        match (self.large.poll_ready(cx), self.small.poll_ready(cx)) {
            (Poll::Ready(large), Poll::Ready(small)) => Poll::Ready(large.and(small)),
            _ => Poll::Pending,
        }
    }

    fn call(&mut self, request: Request<B>) -> S::Future {
        if is_upload(request.uri().path()) {
            self.large.call(request)
        } else {
            self.small.call(request)
        }
    }
}

fn refusal(error: ServiceError) -> Response<Body> {
    Status::from(error).into_http()
}

#[cfg(test)]
mod tests;
