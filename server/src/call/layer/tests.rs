//! The layer around services that keep, answer or stream.

use std::{convert::Infallible, sync::Mutex};

use http::HeaderMap;
use http_body::{Body as _, Frame};

use super::*;

/// A service that keeps every request and never answers.
#[derive(Clone, Default)]
struct Keeper(Arc<Mutex<Vec<Request<Body>>>>);

impl Service<Request<Body>> for Keeper {
    type Response = Response<()>;
    type Error = Infallible;
    type Future = std::future::Pending<Result<Response<()>, Infallible>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
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
        upload_grace: Duration::from_mins(1),
        reserve: Arc::new(DeadlineReserve::new(Duration::ZERO, Instant::now())),
        largest_upload: 1 << 20,
        longest_call: Duration::from_mins(1),
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
    let layer = layer();
    let keeper = Keeper::default();
    let mut service = layer.layer(keeper.clone());
    let calls = [
        service.call(request(UPLOAD_METHODS[0])),
        service.call(request("/grasp.v1.GraspService/FindGrasp")),
    ];
    assert_eq!(layer.in_flight.count(), 2);
    drop(calls);
    assert_eq!(layer.in_flight.count(), 0);
    let kept = keeper.0.lock().unwrap();
    let has_permit = |request: &Request<Body>| request.extensions().get::<UploadPermit>().is_some();
    assert_eq!(kept.iter().map(has_permit).collect::<Vec<_>>(), [true, false]);
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

/// A body of one message and its trailers, as a stream that has ended has it.
#[derive(Default)]
struct Streamed(Vec<Frame<&'static [u8]>>);

impl http_body::Body for Streamed {
    type Data = &'static [u8];
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Self::Data>, Infallible>>> {
        Poll::Ready(self.0.pop().map(Ok))
    }
}

#[tokio::test]
async fn a_call_lasts_until_its_body_ends() {
    let layer = layer();
    let mut service = layer.layer(tower::service_fn(|_: Request<Body>| async {
        let mut trailers = HeaderMap::new();
        trailers.insert("grpc-status", "14".parse().unwrap());
        let frames = vec![Frame::trailers(trailers), Frame::data(&b"message"[..])];
        Ok::<_, Infallible>(Response::new(Streamed(frames)))
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
        assert_eq!(layer.in_flight.count(), 1);
    }
    assert_eq!(frames, 2);
    drop(body);
    assert_eq!(layer.in_flight.count(), 0);
}

#[tokio::test]
async fn calls_end_at_the_limit_but_streamed_uploads_do_not() {
    let layer = CallLayer {
        longest_call: Duration::from_millis(5),
        ..layer()
    };
    let mut service = layer.layer(Keeper::default());
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

#[tokio::test]
async fn calls_without_an_answer_end_before_the_transport_ends_them() {
    let layer = layer();
    let mut service = layer.layer(Keeper::default());
    for path in [STREAMED_UPLOAD, "/grasp.v1.GraspService/FindGrasp"] {
        let mut short = request(path);
        short.headers_mut().insert("grpc-timeout", "30m".parse().unwrap());
        // Like the transport's: it looks at the answer first.
        let answer = tokio::time::timeout(Duration::from_millis(30), service.call(short)).await;
        let answer = answer.expect("it is answered at the deadline").unwrap();
        assert_eq!(code_in(answer.headers()), Some(Code::DeadlineExceeded), "{path}");
    }
    assert_eq!(layer.in_flight.count(), 0);
}

/// A body whose parts are given one at a time.
#[derive(Clone, Default)]
struct Fed(Arc<Mutex<Option<&'static [u8]>>>);

impl http_body::Body for Fed {
    type Data = &'static [u8];
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

/// A stream that has been answered with headers: its layer, its context, its body, and what the body is fed with.
async fn started_stream() -> (CallLayer, CallContext, AnswerBody<Fed>, Fed) {
    let (layer, fed, kept) = (layer(), Fed::default(), Arc::new(Mutex::new(None)));
    let mut service = layer.layer(tower::service_fn({
        let (fed, kept) = (fed.clone(), Arc::clone(&kept));
        move |request: Request<Body>| {
            *kept.lock().unwrap() = request.extensions().get::<CallContext>().cloned();
            std::future::ready(Ok::<_, Infallible>(Response::new(fed.clone())))
        }
    }));
    let answer = service
        .call(request("/grasp.v1.GraspService/StreamGrasps"))
        .await
        .unwrap();
    let context = kept.lock().unwrap().take().unwrap();
    (layer, context, answer.into_body(), fed)
}

fn poll(body: &mut AnswerBody<Fed>) -> bool {
    let mut cx = Context::from_waker(std::task::Waker::noop());
    Pin::new(body).poll_frame(&mut cx).is_ready()
}

#[tokio::test]
async fn delay_of_a_stream_adds_up_while_the_transport_waits() {
    let (layer, context, mut body, fed) = started_stream().await;
    let pause = Duration::from_millis(20);
    context.search_is_due(Instant::now() + Duration::from_hours(1));
    // Grasps come while the search runs.
    assert!(!poll(&mut body));
    *fed.0.lock().unwrap() = Some(b"a grasp");
    assert!(poll(&mut body) && !poll(&mut body));
    assert!(layer.reserve.at(Instant::now()) < pause);
    context.search_ended(Instant::now());
    for part in 1..=3 {
        assert!(!poll(&mut body), "the transport waits");
        std::thread::sleep(pause);
        *fed.0.lock().unwrap() = Some(b"what came last");
        assert!(poll(&mut body));
        // Twice the delay, which a moment later counts a little less.
        assert!(layer.reserve.at(Instant::now()) > (2 * part) * pause * 19 / 20);
    }
}

#[tokio::test]
async fn delay_of_a_stream_does_not_count_while_its_client_reads_nothing() {
    let (layer, context, mut body, fed) = started_stream().await;
    let second = Duration::from_secs(1);
    let past = Instant::now().checked_sub(second).unwrap();
    context.search_is_due(Instant::now() + second);
    context.search_ended(past);
    *fed.0.lock().unwrap() = Some(b"the summary");
    assert!(poll(&mut body));
    drop(body);
    assert!(layer.reserve.at(Instant::now()) < second);
}

#[tokio::test]
async fn a_stream_that_is_dropped_at_its_deadline_is_at_least_as_late() {
    let (layer, context, mut body, _fed) = started_stream().await;
    let pause = Duration::from_millis(20);
    context.search_is_due(Instant::now());
    assert!(!poll(&mut body));
    std::thread::sleep(pause);
    drop(body);
    assert!(layer.reserve.at(Instant::now()) > 2 * pause * 19 / 20);
}
