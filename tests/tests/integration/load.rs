//! Concurrent calls, up to the limits and beyond; what every method that searches promises: dropped calls stop their work, deadlines
//! are kept, and a full server sheds.

use std::time::{Duration, Instant};

use grasp_proto::{
    v1::{self, grasp_service_client::GraspServiceClient},
    wire_duration,
};
use grasp_tests::TestServer;
use prost::Message as _;
use tonic::{Code, Request, Status, transport::Channel};
use tonic_types::StatusExt as _;

use crate::{
    fixtures::{assert_status, bounded, find, floating_remote, impossible, impossible_at_once, until},
    wire,
};

/// The budget of searches near a hand in requests without one.
const SHORT: Duration = Duration::from_millis(50);

/// A method that searches.
#[derive(Clone, Copy, Debug)]
enum Method {
    Find,
    Stream,
    Validate,
    Evaluate,
}

impl Method {
    const ALL: [Self; 4] = [Self::Find, Self::Stream, Self::Validate, Self::Evaluate];

    /// Calls it for a holdout; validations also search for a grasp near one that is not valid.
    async fn call(
        self,
        mut grasps: GraspServiceClient<Channel>,
        holdout: v1::FindGraspRequest,
        timeout: Option<Duration>,
    ) -> Result<(), Status> {
        fn with<T>(message: T, timeout: Option<Duration>) -> Request<T> {
            let mut request = Request::new(message);
            if let Some(timeout) = timeout {
                request.set_timeout(timeout);
            }
            request
        }
        match self {
            Self::Find => grasps.find_grasp(with(holdout, timeout)).await.map(drop),
            Self::Stream => {
                let call = grasps.stream_grasps(with(holdout.into(), timeout));
                let mut messages = call.await?.into_inner();
                while messages.message().await?.is_some() {}
                Ok(())
            }
            Self::Validate => grasps
                .validate_grasp(with(validation(holdout), timeout))
                .await
                .map(drop),
            Self::Evaluate => grasps
                .evaluate_holdout(with(holdout.into(), timeout))
                .await
                .map(drop),
        }
    }

    /// Its call in a task.
    async fn spawn(
        self,
        server: &TestServer,
        holdout: v1::FindGraspRequest,
    ) -> tokio::task::JoinHandle<Result<(), Status>> {
        tokio::spawn(self.call(server.grasps().await, holdout, None))
    }
}

/// A request to check an open hand where the object is.
fn validation(holdout: v1::FindGraspRequest) -> v1::ValidateGraspRequest {
    let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Right)
        .with_object_from_wrist(v1::Pose::default())
        .with_digits([Some(v1::DigitAngles::default()); 5]);
    let nearest_budget = wire_duration(holdout.budget().unwrap_or(SHORT));
    v1::ValidateGraspRequest {
        nearest_budget: Some(nearest_budget),
        ..v1::ValidateGraspRequest::from(holdout).with_pose(hand)
    }
}

/// A holdout for which there is much time and no grasp.
async fn long(server: &TestServer) -> v1::FindGraspRequest {
    impossible(server).await.with_budget(Duration::from_secs(10))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dropped_call_stops_the_work() {
    let server = TestServer::start().await;
    let holdout = long(&server).await;
    for method in Method::ALL {
        let call = method.spawn(&server, holdout.clone()).await;
        until("the work", || server.gauges().searches() == 1).await;
        let dropped = Instant::now();
        call.abort();
        until("the end of the work", || server.gauges().searches() == 0).await;
        until("the end of the call", || server.gauges().calls() == 0).await;
        // Its budget alone would end it after 10 s.
        let took = dropped.elapsed();
        assert!(took < Duration::from_secs(8), "{method:?}: {took:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_answer_comes_before_the_deadline() {
    // The work has a quarter of the deadline, and the answer the rest.
    let server =
        TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::from_mins(1)).await;
    let holdout = impossible_at_once(&server)
        .await
        .with_budget(Duration::from_secs(10));
    for method in Method::ALL {
        let timeout = Some(Duration::from_secs(4));
        let call = Box::pin(method.call(server.grasps().await, holdout.clone(), timeout));
        let answer = bounded("the answer", call).await;
        if let Err(status) = answer {
            // On a machine that is too busy to end the work in time; a client that had given up would say that it cancelled.
            assert_status(&status, Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
        }
        until("the end of the work", || server.gauges().searches() == 0).await;
        until("the end of the call", || server.gauges().calls() == 0).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deadline_that_has_passed_is_answered_as_such() {
    let server = TestServer::start().await;
    let holdout = impossible_at_once(&server).await;
    let messages = [
        ("FindGrasp", holdout.encode_to_vec()),
        ("ValidateGrasp", validation(holdout.clone()).encode_to_vec()),
        (
            "EvaluateHoldout",
            v1::EvaluateHoldoutRequest::from(holdout).encode_to_vec(),
        ),
    ];
    for (method, message) in messages {
        // tonic's client would not wait for the answer.
        let path = format!("GraspService/{method}");
        let headers = [("grpc-timeout", "1n")];
        let call = wire::call(server.address(), &path, &headers, wire::framed_bytes(&message));
        let (_, status) = bounded("an answer", call)
            .await
            .messages::<v1::FindGraspResponse>();
        assert_status(&status, Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
        until("the end of the work", || server.gauges().searches() == 0).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_beyond_the_limit_of_searches_are_shed() {
    let server = TestServer::start_with(|config| config.maximum_searches = 1.try_into().unwrap()).await;
    let holdout = long(&server).await;
    for method in Method::ALL {
        let running = method.spawn(&server, holdout.clone()).await;
        until("the work", || server.gauges().searches() == 1).await;
        for further in Method::ALL {
            let status = further
                .call(server.grasps().await, holdout.clone(), None)
                .await
                .unwrap_err();
            assert_status(&status, Code::ResourceExhausted, "TOO_MANY_SEARCHES");
            let details = status.get_error_details();
            assert!(details.retry_info().unwrap().retry_delay > Some(Duration::ZERO));
            assert!(status.metadata().contains_key("grpc-retry-pushback-ms"));
        }
        running.abort();
        until("the end of the work", || server.gauges().searches() == 0).await;
        let after = method.call(server.grasps().await, floating_remote(), None).await;
        after.expect("the place is free again");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_search_does_not_block_others() {
    let server = TestServer::start().await;
    let hopeless = long(&server).await;
    let mut client = server.grasps().await;
    let long = tokio::spawn(async move { client.find_grasp(hopeless).await });
    until("the long search", || server.gauges().searches() == 1).await;
    let answer = find(&server, floating_remote()).await;
    assert_eq!(answer.outcome(), v1::Outcome::Found);
    assert!(
        !long.is_finished(),
        "the short search was answered only after the long one"
    );
    long.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_beyond_the_limit_wait() {
    let server = TestServer::start_with(|config| config.maximum_connections = 1.try_into().unwrap()).await;
    let mut first = server.objects().await;
    let list = v1::ListObjectsRequest::default;
    first
        .list_objects(list())
        .await
        .expect("the first connection has a place");
    let mut second = server.objects_lazily();
    let waiting = tokio::spawn(async move { second.list_objects(list()).await });
    for _ in 0..50 {
        first
            .list_objects(list())
            .await
            .expect("the first connection keeps its place");
    }
    assert!(
        !waiting.is_finished(),
        "the second connection was served along with the first"
    );
    drop(first);
    bounded("the second connection's answer", waiting)
        .await
        .unwrap()
        .expect("the place is free");
}
