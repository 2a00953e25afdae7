//! Budgets, deadlines and dropped calls.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::Request;

use crate::fixtures::{
    bounded, floating_remote, impossible, impossible_at_once, milliseconds, seconds, until,
};

fn sum_of_rejections(report: &v1::SearchReport) -> u64 {
    report.rejections.iter().map(|rejection| rejection.count).sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn exhausted_attempts_are_an_answer_with_a_report() {
    let server = TestServer::start().await;
    let request = v1::FindGraspRequest {
        max_attempts: Some(300),
        budget: Some(seconds(10)),
        record_step_times: true,
        reproducible: true,
        ..impossible(&server).await
    };
    let answer = server
        .grasps()
        .await
        .find_grasp(request)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    assert_eq!(answer.grasp, None);
    let report = answer.report.unwrap();
    assert_eq!((report.attempts, report.seed, report.workers), (300, 7, 2));
    assert_eq!(sum_of_rejections(&report), 300);
    assert_eq!(
        (report.strategy(), report.validity()),
        (v1::Strategy::Guided, v1::Validity::Physical)
    );
    assert_eq!(report.budget, Some(seconds(10)));
    assert_eq!(report.step_times.len(), 5);
    assert_eq!(report.attempt, None);
    let miss = report.nearest_miss.expect("an attempt came closest");
    assert!(miss.attempt < 300 && miss.client_from_wrist.is_some());
    assert!(
        report
            .rejections
            .iter()
            .any(|count| count.rejection == miss.rejection)
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_exhausted_budget_is_an_answer() {
    let server = TestServer::start().await;
    let request = v1::FindGraspRequest {
        budget: Some(milliseconds(80)),
        ..impossible(&server).await
    };
    let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
    let answer = answer.unwrap().into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    assert_eq!(answer.report.unwrap().budget, Some(milliseconds(80)));
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
    for (asked, in_force) in [(None, 30), (Some(seconds(100)), 60)] {
        let request = v1::FindGraspRequest {
            budget: asked,
            ..request.clone()
        };
        let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
        let report = answer.unwrap().into_inner().report.unwrap();
        assert_eq!(report.budget, Some(milliseconds(in_force)));
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_budget_a_search_for_the_best_continues_for_the_first() {
    let server = TestServer::start_with(|config| config.budgets.default = Duration::from_millis(200)).await;
    let request = v1::FindGraspRequest {
        choice: v1::Choice::BestWithinBudget.into(),
        ..impossible(&server).await
    };
    let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
    let report = answer.unwrap().into_inner().report.unwrap();
    // The report names the budget for the best, but the default budget was searched.
    assert_eq!(report.budget, Some(milliseconds(5)));
    let took = report.search_time.expect("it is always reported");
    assert!(took.seconds > 0 || took.nanos >= 190_000_000, "{took:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_deadline_less_the_reserve_bounds_the_budget() {
    let server =
        TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::from_millis(1900)).await;
    let mut request = Request::new(v1::FindGraspRequest {
        budget: Some(seconds(10)),
        ..impossible_at_once(&server).await
    });
    request.set_timeout(Duration::from_secs(2));
    let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
    let answer = answer.expect("the answer comes before the deadline").into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    // A quarter of the deadline, as the reserve would take more.
    assert_eq!(answer.report.unwrap().budget, Some(milliseconds(500)));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_reserve_grows_with_the_delays_of_answers() {
    let server = TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::ZERO).await;
    let message = v1::FindGraspRequest {
        max_attempts: Some(1),
        ..impossible_at_once(&server).await
    };
    let mut budgets = Vec::new();
    for _ in 0..2 {
        let mut request = Request::new(message.clone());
        request.set_timeout(Duration::from_millis(500));
        let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
        let budget = answer.unwrap().into_inner().report.unwrap().budget.unwrap();
        budgets.push(budget.nanos);
    }
    // No delay was known to the first; that of its answer, over threads and through the codec, exceeds a microsecond.
    assert!((499_990_000..=500_000_000).contains(&budgets[0]), "{budgets:?}");
    assert!((125_000_000..budgets[0]).contains(&budgets[1]), "{budgets:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dropped_call_stops_the_work() {
    let server = TestServer::start().await;
    let request = v1::FindGraspRequest {
        budget: Some(seconds(10)),
        ..impossible(&server).await
    };
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
    let grasp = answer.grasp.unwrap();
    assert_eq!(
        (grasp.rig.as_str(), grasp.handedness()),
        ("adult", v1::Handedness::Right)
    );
    assert_eq!((grasp.digits.len(), grasp.joints.len()), (5, 26));
    // Without an object pose, both frames are the same; the wrist is the second joint.
    let [in_client, in_object] = [grasp.client_from_wrist, grasp.object_from_wrist].map(|pose| {
        let pose = pose.expect("every grasp has a wrist");
        let q = pose.orientation.expect("every pose has an orientation");
        (pose.position, [q.x, q.y, q.z, q.w])
    });
    assert_eq!(in_client.0, in_object.0);
    // A product of rotations is renormalised.
    let parts = in_client.1.iter().zip(in_object.1);
    assert!(parts.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
    assert_eq!(grasp.joints[1].client_from_joint, grasp.client_from_wrist);
    assert!(grasp.joints.iter().all(|joint| joint.radius > 0.0));
    assert!(grasp.contacts.len() >= 2);
    assert_eq!(grasp.contacts[0].digit(), v1::Digit::Thumb);
    assert!(
        grasp
            .contacts
            .iter()
            .any(|contact| contact.digit() != v1::Digit::Thumb)
    );
    let report = answer.report.unwrap();
    assert!(report.attempt.is_some() && report.nearest_miss.is_none());
    server.stop().await;
}
