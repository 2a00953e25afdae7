//! Around services that keep, answer or stream.

use std::{convert::Infallible, pin::Pin, sync::Mutex};

use bytes::Bytes;
use http::HeaderMap;
use http_body::{Body as _, Frame};
use http_body_util::StreamBody;
use tower::Layer as _;

use super::{
    super::{SearchSummary, answer::code_in},
    *,
};
use crate::middleware::Around;

/// A service that keeps every request and never answers.
#[derive(Clone, Default)]
struct Keeper(Arc<Mutex<Vec<Request<Body>>>>);

impl Service<Request<Body>> for Keeper {
    type Response = Response<Body>;
    type Error = Infallible;
    type Future = std::future::Pending<Result<Response<Body>, Infallible>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        self.0.lock().unwrap().push(request);
        std::future::pending()
    }
}

const SUMMARY: SearchSummary = SearchSummary {
    outcome: "FOUND",
    attempts: 1,
    time: Duration::ZERO,
};

/// Admits one upload.
fn admitting_one() -> Calls {
    Calls {
        in_flight: watch::Sender::new(()),
        uploads: Arc::new(Semaphore::new(1)),
        maximum_uploads: 1,
        upload_grace: Duration::from_mins(1),
        reserve: Arc::new(DeadlineReserve::new(Duration::ZERO, Instant::now())),
        largest_upload: 1 << 20,
        longest_call: Duration::from_mins(1),
        packers: Arc::new(Semaphore::new(1)),
    }
}

fn request(path: &str) -> Request<Body> {
    Request::builder()
        .uri(path)
        .header("grpc-timeout", "3S")
        .body(Body::empty())
        .unwrap()
}

#[tokio::test]
async fn only_uploads_come_with_a_permit() {
    let calls = admitting_one();
    let keeper = Keeper::default();
    let mut service = Around(calls.clone()).layer(keeper.clone());
    let running = [
        service.call(request(UPLOAD_METHODS[0])),
        service.call(request("/grasp.v1.GraspService/FindGrasp")),
    ];
    assert_eq!(calls.in_flight.receiver_count(), 2);
    drop(running);
    assert_eq!(calls.in_flight.receiver_count(), 0);
    let kept = keeper.0.lock().unwrap();
    let has_permit = |request: &Request<Body>| request.extensions().get::<UploadPermit>().is_some();
    assert_eq!(kept.iter().map(has_permit).collect::<Vec<_>>(), [true, false]);
}

/// The reserve that a call leaves behind when it is dropped, after its search with these times.
fn reserve_after(due: Instant, ended: Option<Instant>) -> Duration {
    let (calls, keeper) = (admitting_one(), Keeper::default());
    let call = Around(calls.clone())
        .layer(keeper.clone())
        .call(request("/grasp.v1.GraspService/FindGrasp"));
    let context: CallContext = keeper.0.lock().unwrap()[0].extensions().get().cloned().unwrap();
    context.search_is_due(due);
    if let Some(ended) = ended {
        context.search_ended(ended, SUMMARY);
    }
    drop(call);
    calls.reserve.at(Instant::now())
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

#[tokio::test]
async fn a_call_lasts_until_its_body_ends() {
    let calls = admitting_one();
    let mut service = Around(calls.clone()).layer(tower::service_fn(|_: Request<Body>| async {
        let mut trailers = HeaderMap::new();
        trailers.insert("grpc-status", "14".parse().unwrap());
        let frames = [
            Frame::data(Bytes::from_static(b"message")),
            Frame::trailers(trailers),
        ];
        let body = StreamBody::new(tokio_stream::iter(frames.map(Ok::<_, Status>)));
        Ok::<_, Infallible>(Response::new(Body::new(body)))
    }));
    let mut body = service
        .call(request("/grasp.v1.ObjectService/WatchObjects"))
        .await
        .unwrap()
        .into_body();
    let mut cx = Context::from_waker(std::task::Waker::noop());
    let mut frames = 0;
    while let Poll::Ready(Some(frame)) = Pin::new(&mut body).poll_frame(&mut cx) {
        frame.unwrap();
        frames += 1;
        assert_eq!(calls.in_flight.receiver_count(), 1);
    }
    assert_eq!(frames, 2);
    drop(body);
    assert_eq!(calls.in_flight.receiver_count(), 0);
}

#[tokio::test]
async fn calls_end_at_the_limit_but_streamed_uploads_do_not() {
    let calls = Calls {
        longest_call: Duration::from_millis(5),
        ..admitting_one()
    };
    let mut service = Around(calls.clone()).layer(Keeper::default());
    let answer = service
        .call(request("/grasp.v1.GraspService/FindGrasp"))
        .await
        .unwrap();
    assert_eq!(code_in(answer.headers()), Some(Code::DeadlineExceeded));
    let upload = service.call(request(STREAMED_UPLOAD));
    assert!(
        tokio::time::timeout(Duration::from_millis(50), upload)
            .await
            .is_err()
    );
}

/// A body whose parts are given one at a time.
#[derive(Clone, Default)]
struct Fed(Arc<Mutex<Option<Bytes>>>);

impl http_body::Body for Fed {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        self: Pin<&mut Self>,
        _: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Self::Data>, Infallible>>> {
        match self.0.lock().unwrap().take() {
            Some(part) => Poll::Ready(Some(Ok(Frame::data(part)))),
            None => Poll::Pending,
        }
    }
}

/// A stream that has been answered with headers: its calls, its context, its body, and what the body is fed with.
async fn started_stream() -> (Calls, CallContext, Body, Fed) {
    let (calls, fed, kept) = (admitting_one(), Fed::default(), Arc::new(Mutex::new(None)));
    let mut service = Around(calls.clone()).layer(tower::service_fn({
        let (fed, kept) = (fed.clone(), Arc::clone(&kept));
        move |request: Request<Body>| {
            *kept.lock().unwrap() = request.extensions().get::<CallContext>().cloned();
            std::future::ready(Ok::<_, Infallible>(Response::new(Body::new(fed.clone()))))
        }
    }));
    let answer = service
        .call(request("/grasp.v1.GraspService/StreamGrasps"))
        .await
        .unwrap();
    let context = kept.lock().unwrap().take().unwrap();
    (calls, context, answer.into_body(), fed)
}

fn poll(body: &mut Body) -> bool {
    let mut cx = Context::from_waker(std::task::Waker::noop());
    Pin::new(body).poll_frame(&mut cx).is_ready()
}

#[tokio::test]
async fn delay_of_a_stream_adds_up_while_the_transport_waits() {
    let (calls, context, mut body, fed) = started_stream().await;
    let pause = Duration::from_millis(20);
    context.search_is_due(Instant::now() + Duration::from_hours(1));
    // Grasps come while the search runs.
    assert!(!poll(&mut body));
    *fed.0.lock().unwrap() = Some(Bytes::from_static(b"a grasp"));
    assert!(poll(&mut body) && !poll(&mut body));
    assert!(calls.reserve.at(Instant::now()) < pause);
    context.search_ended(Instant::now(), SUMMARY);
    for part in 1..=3 {
        assert!(!poll(&mut body), "the transport waits");
        std::thread::sleep(pause);
        *fed.0.lock().unwrap() = Some(Bytes::from_static(b"what came last"));
        assert!(poll(&mut body));
        // Twice the delay, which a moment later counts a little less.
        assert!(calls.reserve.at(Instant::now()) > (2 * part) * pause * 19 / 20);
    }
}

#[tokio::test]
async fn delay_of_a_stream_does_not_count_while_its_client_reads_nothing() {
    let (calls, context, mut body, fed) = started_stream().await;
    let second = Duration::from_secs(1);
    let past = Instant::now().checked_sub(second).unwrap();
    context.search_is_due(Instant::now() + second);
    context.search_ended(past, SUMMARY);
    *fed.0.lock().unwrap() = Some(Bytes::from_static(b"the summary"));
    assert!(poll(&mut body));
    drop(body);
    assert!(calls.reserve.at(Instant::now()) < second);
}

#[tokio::test]
async fn a_stream_that_is_dropped_at_its_deadline_is_at_least_as_late() {
    let (calls, context, mut body, _fed) = started_stream().await;
    let pause = Duration::from_millis(20);
    context.search_is_due(Instant::now());
    assert!(!poll(&mut body));
    std::thread::sleep(pause);
    drop(body);
    assert!(calls.reserve.at(Instant::now()) > 2 * pause * 19 / 20);
}
