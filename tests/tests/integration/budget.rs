//! Budgets, deadlines and dropped calls.

use std::time::Duration;

use grasp_proto::{v1, wire_duration};
use grasp_tests::TestServer;
use tonic::Request;

use crate::{
    fixtures::{bounded, floating_remote, impossible, impossible_at_once, until},
    parts::{budget_of, hand as hand_of, reproducible, with},
};

/// Longer than any test takes.
const LONG: Duration = Duration::from_secs(10);

/// The request limited to so many attempts.
fn attempting(request: v1::FindGraspRequest, attempts: u64) -> v1::FindGraspRequest {
    with(request, |request| {
        request.search_mut().max_attempts = Some(attempts);
    })
}

fn sum_of_rejections(report: &v1::SearchReport) -> u64 {
    report.rejections.iter().map(|rejection| rejection.count).sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn exhausted_attempts_are_an_answer_with_a_report() {
    let server = TestServer::start().await;
    let request = attempting(impossible(&server).await, 300).with_budget(LONG);
    let request = with(reproducible(request), |request| {
        request.requirements_mut().thesis = Some(v1::ThesisOptions {
            record_step_times: true,
            ..Default::default()
        });
    });
    let answer = server
        .grasps()
        .await
        .find_grasp(request)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    assert_eq!(answer.grasps, []);
    let origin = answer.origin.unwrap();
    assert_eq!((origin.seed, origin.attempt), (7, None));
    assert_eq!(origin.source(), v1::GraspSource::Unspecified);
    let report = answer.report.unwrap();
    assert_eq!(report.attempts, 300);
    assert_eq!(sum_of_rejections(&report), 300);
    assert_eq!(report.budget, Some(wire_duration(LONG)));
    let thesis = report.thesis.expect("step times were asked for");
    assert_eq!(thesis.step_times.len(), 5);
    let miss = report.nearest_miss.expect("an attempt came closest");
    assert!(miss.attempt < 300);
    let hand = miss.hand.expect("it has a hand");
    assert!(hand.client_from_wrist.is_some() && hand.object_from_wrist.is_some());
    assert_eq!((hand.rig.as_str(), hand.digits()), ("rigs/adult", [None; 5]));
    let verdict = miss.verdict.expect("it failed a check");
    assert!(!verdict.passed);
    assert!(report.rejections.iter().any(|count| count.check == verdict.check));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_exhausted_budget_is_an_answer() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(Duration::from_millis(80));
    let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
    let answer = answer.unwrap().into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    assert_eq!(budget_of(&answer), Duration::from_millis(80));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_servers_default_and_maximum_bound_the_budget() {
    let server = TestServer::start_with(|config| {
        config.budgets.default = Duration::from_millis(30);
        config.budgets.maximum = Duration::from_millis(60);
    })
    .await;
    let request = impossible(&server).await;
    for (asked, in_force) in [(request.clone(), 30), (request.with_budget(LONG), 60)] {
        let answer = bounded("the answer", server.grasps().await.find_grasp(asked)).await;
        assert_eq!(
            budget_of(&answer.unwrap().into_inner()),
            Duration::from_millis(in_force)
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_budget_a_search_for_the_best_continues_for_the_first() {
    let server = TestServer::start_with(|config| config.budgets.default = Duration::from_millis(200)).await;
    let request = with(impossible(&server).await, |request| {
        request.search_mut().choice = v1::GraspChoice::BestWithinBudget.into();
    });
    let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
    let answer = answer.unwrap().into_inner();
    // The report names the budget for the best, but the default budget was searched.
    assert_eq!(budget_of(&answer), Duration::from_millis(5));
    assert!(
        answer.search_time() >= Duration::from_millis(190),
        "{:?}",
        answer.search_time()
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_deadline_less_the_reserve_bounds_the_budget() {
    let server =
        TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::from_millis(1900)).await;
    let mut request = Request::new(impossible_at_once(&server).await.with_budget(LONG));
    request.set_timeout(Duration::from_secs(2));
    let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
    let answer = answer.expect("the answer comes before the deadline").into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    // A quarter of the deadline, as the reserve would take more.
    assert_eq!(budget_of(&answer), Duration::from_millis(500));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_reserve_grows_with_the_delays_of_answers() {
    let server = TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::ZERO).await;
    let message = attempting(impossible_at_once(&server).await, 1);
    let mut budgets = Vec::new();
    for _ in 0..2 {
        let mut request = Request::new(message.clone());
        request.set_timeout(Duration::from_millis(500));
        let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
        budgets.push(budget_of(&answer.unwrap().into_inner()));
    }
    // No delay was known to the first; that of its answer, over threads and through the codec, exceeds a microsecond.
    let micros = Duration::from_micros;
    assert!(
        (micros(499_990)..=micros(500_000)).contains(&budgets[0]),
        "{budgets:?}"
    );
    assert!((micros(125_000)..budgets[0]).contains(&budgets[1]), "{budgets:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dropped_call_stops_the_work() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(LONG);
    let mut client = server.grasps().await;
    let call = tokio::spawn(async move { client.find_grasp(request).await });
    until("the search", || server.gauges().searches() == 1).await;
    call.abort();
    // The budget alone would end the search within 10 s, well before these waits time out: the gauges show the order of
    // events.
    until("the end of the search", || server.gauges().searches() == 0).await;
    until("the end of the call", || server.gauges().calls() == 0).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_found_grasp_has_all_its_parts() {
    let server = TestServer::start().await;
    let answer = server
        .grasps()
        .await
        .find_grasp(floating_remote())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::Found);
    let [grasp] = &answer.grasps[..] else {
        panic!("{answer:?}");
    };
    let hand = hand_of(grasp);
    assert_eq!(
        (hand.rig.as_str(), hand.handedness()),
        ("rigs/adult", v1::Handedness::Right)
    );
    assert_eq!(hand.convention(), v1::Convention::Openxr);
    assert_eq!(hand.scale, None);
    assert!(hand.digits().iter().all(Option::is_some));
    assert_eq!(hand.joints.len(), 26);
    // Without an object pose, both frames are the same; the wrist is the second joint.
    let [in_client, in_object] =
        [hand.client_from_wrist, hand.object_from_wrist].map(|pose| pose.expect("every grasp has a wrist"));
    assert_eq!(in_client.position, in_object.position);
    // A product of rotations is renormalised.
    let [a, b] = [in_client, in_object].map(|pose| pose.orientation());
    assert!(a.abs_diff_eq(b, 1e-6), "{a} {b}");
    assert_eq!(hand.joints[1].pose, hand.client_from_wrist);
    assert!(hand.joints.iter().all(|joint| joint.radius > 0.0));
    assert!(grasp.contacts.len() >= 2);
    assert_eq!(grasp.contacts[0].digit(), v1::Digit::Thumb);
    assert!(
        grasp
            .contacts
            .iter()
            .any(|contact| contact.digit() != v1::Digit::Thumb)
    );
    for contact in &grasp.contacts {
        let is_of_palm = contact.digit() == v1::Digit::Unspecified;
        let phalanges = if is_of_palm { 0..=0 } else { 1..=3 };
        assert!(phalanges.contains(&contact.phalanx), "{contact:?}");
    }
    for check in [v1::Check::Balance, v1::Check::Closure, v1::Check::Penetration] {
        assert!(grasp.margin(check).is_some(), "{check:?}");
    }
    assert!(grasp.margins.iter().all(|margin| margin.passed));
    assert!(answer.origin.as_ref().unwrap().attempt.is_some());
    assert!(answer.report.as_ref().unwrap().nearest_miss.is_none());
    server.stop().await;
}
