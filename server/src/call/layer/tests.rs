//! Calls whose service answers with a stream, or never.

use std::convert::Infallible;

use bytes::Bytes;
use http::HeaderMap;
use http_body::Frame;
use http_body_util::StreamBody;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use super::{
    super::{SearchSummary, code_in},
    *,
};
use crate::{error::Limit, middleware::next_frame};

const FIND: &str = "/grasp.v1.GraspService/FindGrasp";

const SUMMARY: SearchSummary = SearchSummary {
    outcome: "FOUND",
    attempts: 1,
    time: Duration::ZERO,
    failed_check: None,
};

/// A call as its service sees it.
struct Call {
    answer: Answer<Infallible>,
    request: Request<Body>,
    /// Where the parts of its answer come from.
    parts: mpsc::Sender<Result<Frame<Bytes>, Status>>,
}

impl Call {
    /// A call of a method. It is answered at once with the start of a stream, or never.
    fn new(calls: &Calls, path: &str, is_answered: bool) -> Self {
        let request = Request::builder().uri(path).header("grpc-timeout", "3S");
        let (parts, receiver) = mpsc::channel(8);
        let body = Body::new(StreamBody::new(ReceiverStream::new(receiver)));
        let mut kept = None;
        let answer = calls.handle(request.body(Body::empty()).unwrap(), |request| {
            kept = Some(request);
            async move {
                if !is_answered {
                    std::future::pending::<()>().await;
                }
                Ok(Response::new(body))
            }
        });
        Self {
            answer,
            request: kept.unwrap(),
            parts,
        }
    }

    fn context(&self) -> &CallContext {
        self.request.extensions().get().unwrap()
    }

    fn send(&self, part: &'static str) {
        self.parts
            .try_send(Ok(Frame::data(Bytes::from_static(part.as_bytes()))))
            .unwrap();
    }
}

fn admitting_one() -> Calls {
    Calls {
        door: Arc::new(Door::open(None, false).unwrap()),
        metrics: Arc::default(),
        traces: Traces::default(),
        in_flight: watch::Sender::new(()),
        executor: SearchExecutor::new(1, 8).expect("a thread starts"),
        longest_search: Duration::from_secs(10),
        heavy: Arc::new(ClientPermits::new(1)),
        reads: Arc::default(),
        uploads: Places::new(Limit::Uploads, 1, Duration::ZERO),
        upload_grace: Duration::from_mins(1),
        reserve: Arc::new(DeadlineReserve::new(Duration::ZERO, Instant::now())),
        largest_upload: 1 << 20,
        longest_call: Duration::from_mins(1),
        packers: Arc::new(Semaphore::new(1)),
        shutdown: CancellationToken::new(),
        drained: CancellationToken::new(),
    }
}

fn poll(body: &mut Body) -> bool {
    let mut cx = Context::from_waker(std::task::Waker::noop());
    matches!(next_frame(body, &mut cx), Poll::Ready(Some(_)))
}

#[test]
fn delay_of_an_answer_counts_from_the_end_of_its_search() {
    let now = Instant::now();
    let (hour, second) = (Duration::from_hours(1), Duration::from_secs(1));
    let past = now.checked_sub(second).unwrap();
    for (due, ended, is_late) in [
        // A search that ended a second ago, with an hour left.
        (now + hour, Some(past), true),
        // A running search, dropped before its deadline.
        (now + hour, None, false),
        // A time before the start of the search counts as its start.
        (past, None, false),
    ] {
        let calls = admitting_one();
        let call = Call::new(&calls, FIND, false);
        call.context().search_is_due(due);
        if let Some(ended) = ended {
            call.context().search_ended(ended, SUMMARY);
        }
        drop(call);
        assert_eq!(calls.reserve.at(Instant::now()) > second, is_late);
    }
}

#[tokio::test]
async fn a_call_lasts_until_its_body_ends() {
    let calls = admitting_one();
    let call = Call::new(&calls, "/grasp.v1.ObjectService/WatchObjects", true);
    call.send("message");
    let trailers = HeaderMap::from_iter([("grpc-status".parse().unwrap(), "14".parse().unwrap())]);
    call.parts.try_send(Ok(Frame::trailers(trailers))).unwrap();
    let mut body = call.answer.await.unwrap().into_body();
    assert!(poll(&mut body) && poll(&mut body) && !poll(&mut body));
    assert_eq!(calls.in_flight.receiver_count(), 1);
    drop(body);
    assert_eq!(calls.in_flight.receiver_count(), 0);
}

#[tokio::test]
async fn calls_end_at_the_limit_but_streamed_uploads_do_not() {
    let calls = Calls {
        longest_call: Duration::from_millis(5),
        ..admitting_one()
    };
    let answer = Call::new(&calls, FIND, false).answer.await.unwrap();
    assert_eq!(code_in(answer.headers()), Some(Code::DeadlineExceeded));
    let upload = Call::new(&calls, STREAMED_UPLOAD, false).answer;
    let ended = tokio::time::timeout(Duration::from_millis(50), upload).await;
    ended.unwrap_err();
}

#[tokio::test]
async fn delay_of_a_stream_adds_up_while_the_transport_waits() {
    let calls = admitting_one();
    let mut call = Call::new(&calls, FIND, true);
    let mut body = (&mut call.answer).await.unwrap().into_body();
    let pause = Duration::from_millis(20);
    call.context()
        .search_is_due(Instant::now() + Duration::from_hours(1));
    // Grasps arrive while the search runs.
    assert!(!poll(&mut body));
    call.send("a grasp");
    assert!(poll(&mut body) && !poll(&mut body));
    assert!(calls.reserve.at(Instant::now()) < pause);
    call.context().search_ended(Instant::now(), SUMMARY);
    for part in 1..=3 {
        assert!(!poll(&mut body), "the transport waits");
        std::thread::sleep(pause);
        if part < 3 {
            call.send("what came last");
            assert!(poll(&mut body));
        } else {
            // The client no longer waits, as at its deadline.
            body = Body::empty();
        }
        // Twice the delay, which a moment later counts a little less.
        assert!(calls.reserve.at(Instant::now()) > (2 * part) * pause * 19 / 20);
    }
}

#[tokio::test]
async fn delay_of_a_stream_does_not_count_while_its_client_reads_nothing() {
    let calls = admitting_one();
    let mut call = Call::new(&calls, FIND, true);
    let mut body = (&mut call.answer).await.unwrap().into_body();
    let second = Duration::from_secs(1);
    call.context().search_is_due(Instant::now() + second);
    call.context()
        .search_ended(Instant::now().checked_sub(second).unwrap(), SUMMARY);
    call.send("the summary");
    assert!(poll(&mut body));
    drop(body);
    assert!(calls.reserve.at(Instant::now()) < second);
}
