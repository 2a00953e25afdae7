//! A search that finds nothing says what limits one hand.

use std::{sync::Arc, time::Duration};

use glam::{Quat, Vec3};
use grasp_assets::{hands::hand, objects::object};
use grasp_proto::v1;
use grasp_synthesis::{
    model::hand::Handedness,
    search::{limits::limits, scene::Task, settings::Query},
};
use grasp_tests::{
    TestServer,
    random_holdouts::{Givers, giving_hands, place},
};
use rand::SeedableRng as _;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::{
    fixtures::{box_request, floating_remote, impossible},
    parts::{with, with_object},
};

/// Givers placed on each object, and holdouts drawn from them.
const GIVERS: u64 = 3;
const HOLDOUTS: usize = 8;

async fn report_of(server: &TestServer, request: v1::FindGraspRequest) -> (v1::Outcome, v1::SearchReport) {
    let answer = server.grasps().await.find_grasp(request).await;
    let answer = answer.expect("the request is valid").into_inner();
    (
        answer.outcome(),
        answer.report.expect("every answer has a report"),
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unliftable_box_is_limited_by_mass_alone() {
    let server = TestServer::start().await;
    let create = with_object(box_request("anvil"), |object| object.mass_kg = 80.0);
    server
        .objects()
        .await
        .create_object(create)
        .await
        .expect("the box is sound");
    let mut request = v1::FindGraspRequest::new("objects/anvil").with_budget(Duration::from_millis(60));
    let (outcome, report) = report_of(&server, request.clone()).await;
    assert_eq!(outcome, v1::Outcome::BudgetExhausted);
    let [limit] = &report.limits[..] else {
        panic!("{:?}", report.limits);
    };
    assert_eq!((limit.check(), limit.value), (v1::Check::Mass, Some(80.0)));
    assert!(!limit.passed);
    let bound = limit.bound.expect("masses have a bound");
    assert!((60.0..80.0).contains(&bound), "{bound}");
    assert!(
        limit.description.starts_with("mass: 80.0 kg"),
        "{}",
        limit.description
    );
    // The conditions are those of the physical checks.
    request.requirements_mut().thesis = Some(v1::ThesisOptions {
        thesis_validity: true,
        ..Default::default()
    });
    request.search_mut().max_attempts = Some(1);
    assert_eq!(report_of(&server, request).await.1.limits, []);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_untouchable_box_is_limited_by_its_forbidden_surfaces() {
    let server = TestServer::start().await;
    let request = with(impossible(&server).await, |request| {
        request.search_mut().max_attempts = Some(3);
    });
    let (outcome, report) = report_of(&server, request).await;
    assert_eq!(outcome, v1::Outcome::BudgetExhausted);
    let [limit] = &report.limits[..] else {
        panic!("{:?}", report.limits);
    };
    assert_eq!(
        (limit.check(), limit.value, limit.bound),
        (v1::Check::Forbidden, Some(1.0), None)
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn too_little_time_is_no_limit() {
    let server = TestServer::start().await;
    let short = with(floating_remote(), |request| {
        // It places hands at random and uses no known grips.
        request.requirements_mut().thesis = Some(v1::ThesisOptions {
            strategy: v1::Strategy::E.into(),
            ..Default::default()
        });
        request.search_mut().max_attempts = Some(1);
    });
    let mut exhausted = 0;
    for seed in 0..20 {
        let (outcome, report) = report_of(&server, short.clone().with_seed(seed)).await;
        assert_eq!(report.limits, []);
        exhausted += u32::from(outcome == v1::Outcome::BudgetExhausted);
    }
    assert!(exhausted > 0, "one attempt rarely succeeds");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn random_holdouts_that_are_answered_have_no_limits() {
    let server = TestServer::start().await;
    let hands = giving_hands();
    let rig = &hand("adult", Handedness::Right).expect("it is built in").rig;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(18);
    let mut found = 0;
    for name in ["remote", "scalpel", "scissors"] {
        let object = object(name).expect("it is built in");
        let placed: Vec<_> = (0..GIVERS)
            .map(|seed| place(&object.object, &hands, seed))
            .collect();
        let givers = Givers::new(&hands, &placed).expect("the givers are of these hands");
        for _ in 0..HOLDOUTS {
            let drawn = givers.draw(&mut random);
            let request = drawn
                .request(&format!("objects/{name}"))
                .with_budget(Duration::from_secs(1));
            if report_of(&server, request).await.0 != v1::Outcome::Found {
                continue;
            }
            found += 1;
            let holdout = drawn.holdout(Arc::clone(&object.object));
            let task = Task {
                holdout: &holdout,
                object: &object.prepared,
                rig,
            };
            assert_eq!(limits(task, &Query::default()), [], "{name}");
        }
    }
    assert!(found > 12, "only {found} were found");
    server.stop().await;
}

/// A sheet of 20 × 20 cm on a table.
fn flat_on_a_table(object: &str, thickness: f32) -> v1::FindGraspRequest {
    let below = Vec3::NEG_Y * (0.5 * thickness + 0.02);
    let table = v1::Shape::solid_box(v1::Pose::new(below, Quat::IDENTITY), Vec3::new(0.6, 0.02, 0.4));
    v1::FindGraspRequest::new(object)
        .with_obstacle(table)
        .with_budget(Duration::from_millis(200))
}

#[tokio::test(flavor = "multi_thread")]
async fn what_lies_flat_on_a_table_is_limited_by_it_and_not_without() {
    let server = TestServer::start().await;
    let thickness = 0.002;
    let vertices = "v -.1 -.001 -.1\nv .1 -.001 -.1\nv -.1 .001 -.1\nv .1 .001 -.1\n\
                    v -.1 -.001 .1\nv .1 -.001 .1\nv -.1 .001 .1\nv .1 .001 .1\n";
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    let create = v1::CreateObjectRequest::new("sheet", [vertices, faces].concat(), 0.02);
    server.objects().await.create_object(create).await.unwrap();
    let request = flat_on_a_table("objects/sheet", thickness);
    let (outcome, report) = report_of(&server, request.clone()).await;
    assert_eq!(outcome, v1::Outcome::BudgetExhausted);
    let [limit] = &report.limits[..] else {
        panic!("{:?}", report.limits);
    };
    assert_eq!(
        (limit.check(), limit.value, limit.bound),
        (v1::Check::ObstacleClearance, Some(1.0), None)
    );
    assert!(
        limit.description.starts_with("obstacles: "),
        "{}",
        limit.description
    );
    let free = with(request, |request| request.holdout_mut().obstacles.clear());
    let (outcome, report) = report_of(&server, free.with_budget(Duration::from_secs(10))).await;
    assert_eq!((outcome, report.limits), (v1::Outcome::Found, Vec::new()));
    server.stop().await;
}
