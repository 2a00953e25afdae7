//! The same request gets the same answer from any server with any number of workers.

use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::fixtures::{find, floating_remote, held_remote, reproducible, unchanging, with};

fn origin(answer: &v1::FindGraspResponse) -> &v1::GraspOrigin {
    answer.origin.as_ref().expect("every answer has an origin")
}

/// The request for this attempt alone.
fn replay(request: v1::FindGraspRequest, attempt: Option<u64>) -> v1::FindGraspRequest {
    with(request, |request| {
        let search = request.search_mut();
        search.replay_attempt = attempt;
        search.max_attempts = None;
        search.choice = v1::GraspChoice::Unspecified.into();
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_workers_gives_the_same_bytes() {
    for request in [floating_remote(), held_remote()] {
        let request = reproducible(request);
        let mut answers = Vec::new();
        for workers in [1, 2, 3, 8] {
            let server = TestServer::start_with(|config| config.workers = workers.try_into().unwrap()).await;
            let answer = find(&server, request.clone()).await;
            assert_eq!(answer.outcome(), v1::Outcome::Found, "{request:?}");
            answers.push(unchanging(answer));
            server.stop().await;
        }
        assert!(answers.windows(2).all(|pair| pair[0] == pair[1]));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_reported_seed_and_attempt_replay_the_grasp() {
    let server = TestServer::start().await;
    let unseeded = with(floating_remote(), |request| request.search_mut().seed = None);
    let first = find(&server, unseeded).await;
    let found = origin(&first);
    let request = floating_remote()
        .with_seed(found.seed)
        .receiving(first.hand().expect("it can be held").handedness());
    let second = find(&server, replay(request, found.attempt)).await;
    assert_eq!(second.grasps, first.grasps);
    assert_eq!((second.attempts(), origin(&second).attempt), (1, found.attempt));
}

#[tokio::test(flavor = "multi_thread")]
async fn an_absent_seed_is_drawn_per_request() {
    let server = TestServer::start().await;
    let request = with(floating_remote(), |request| {
        request.search_mut().seed = None;
        request.search_mut().max_attempts = Some(1);
    });
    let first = find(&server, request.clone()).await;
    let second = find(&server, request).await;
    assert_ne!(origin(&first).seed, origin(&second).seed);
}
