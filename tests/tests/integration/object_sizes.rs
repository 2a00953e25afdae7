//! Objects held out at other sizes than those they were created with, and with other masses.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;
use prost::Message as _;

use crate::{
    atlases::with_complete_atlas,
    fixtures::{assert_blamed, box_request, floating_remote, unaided},
    parts::{reproducible, with, with_object},
};

async fn create(server: &TestServer, id: &str, meters_per_unit: f32, mass_kg: f32) {
    let request = with_object(box_request(id), |object| {
        object.meters_per_unit = Some(meters_per_unit);
        object.mass_kg = mass_kg;
    });
    let created = server.objects().await.create_object(request).await;
    created.expect("the box is sound");
}

async fn find(server: &TestServer, request: v1::FindGraspRequest) -> v1::FindGraspResponse {
    let found = server.grasps().await.find_grasp(request).await;
    found.expect("the request is valid").into_inner()
}

/// A reproducible search for a grasp of an object that nobody holds.
fn floating(id: &str) -> v1::FindGraspRequest {
    reproducible(v1::FindGraspRequest::new(format!("objects/{id}")))
        .receiving(v1::Handedness::Right)
        .with_budget(Duration::from_secs(10))
        .with_seed(11)
}

/// An answer without what differs from run to run.
fn unchanging(answer: v1::FindGraspResponse) -> Vec<u8> {
    let report = answer.report.expect("every answer has a report");
    v1::FindGraspResponse {
        report: Some(v1::SearchReport {
            search_time: None,
            ..report
        }),
        ..answer
    }
    .encode_to_vec()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_at_another_size_is_held_like_one_created_at_it() {
    let server = TestServer::start().await;
    create(&server, "own", 1.0, 0.1).await;
    // Powers of two scale coordinates without rounding, so that the answers are the same bit for bit.
    for (id, scale) in [("half", 0.5_f32), ("double", 2.0)] {
        create(&server, id, scale, 0.1 * scale.powi(3)).await;
        let resized = with(floating("own"), |request| {
            request.holdout_mut().scale = Some(scale);
        });
        let expected = find(&server, floating(id)).await;
        assert_eq!(expected.outcome(), v1::Outcome::Found, "{id}");
        // Prepared by the first call, kept for the second.
        for _ in 0..2 {
            let answer = find(&server, resized.clone()).await;
            assert_eq!(unchanging(answer), unchanging(expected.clone()), "{id}");
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn mass_scales_with_the_volume_unless_the_request_has_one() {
    let server = TestServer::start().await;
    create(&server, "crate", 1.0, 0.1).await;
    let weight = async |scale: Option<f32>, mass: Option<f32>| {
        let request = with(floating("crate"), |request| {
            request.holdout_mut().scale = scale;
            request.holdout_mut().mass_kg = mass;
        });
        let answer = find(&server, request).await;
        let grasp = answer.grasp().expect("the box can be held");
        // The forces of the hand balance gravity, which is along the object's y here.
        let forces = grasp.contacts.iter().map(v1::Contact::force);
        forces.map(|force| force.y).sum::<f32>() / 9.81
    };
    for (scale, mass, expected) in [
        (None, None, 0.1),
        (Some(1.5), None, 0.1 * 1.5 * 1.5 * 1.5),
        (Some(1.5), Some(0.2), 0.2),
        (None, Some(0.6), 0.6),
    ] {
        let carried = weight(scale, mass).await;
        // Valid grasps may leave a few hundredths of the weight unbalanced.
        assert!(
            (carried / expected - 1.0).abs() < 0.05,
            "{scale:?} {mass:?}: {carried} kg"
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn known_grasps_of_the_object_are_starts_at_another_size() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let resized = with(reproducible(floating_remote()), |request| {
        request.holdout_mut().scale = Some(1.25);
    })
    .receiving(v1::Handedness::Right);
    let answer = find(&server, resized.clone()).await;
    assert_eq!(answer.outcome(), v1::Outcome::Found);
    let report = answer.report.expect("every answer has a report");
    let origin = answer.origin.expect("every answer has an origin");
    // None is answered as it is.
    assert!(report.attempts > 0, "{report:?}");
    assert!(
        origin.atlases.len() == 1 && !origin.atlases[0].stamp.is_empty(),
        "{origin:?}"
    );
    let answer = find(&server, unaided(resized)).await;
    assert_eq!(answer.origin.expect("every answer has an origin").atlases, []);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn sizes_and_masses_out_of_range_are_named() {
    let server = TestServer::start().await;
    for scale in [0.2, 4.1, f32::NAN, f32::INFINITY, -1.0] {
        let request = with(floating_remote(), |request| {
            request.holdout_mut().scale = Some(scale);
            request.holdout_mut().mass_kg = Some(0.0);
        });
        assert_blamed(&server, request, &["holdout.scale", "holdout.mass_kg"]).await;
    }
    // A mesh that is as small as meshes may be, made smaller.
    create(&server, "speck", 2.5e-5, 0.1).await;
    let request = with(floating("speck"), |request| {
        request.holdout_mut().scale = Some(0.25);
    });
    assert_blamed(&server, request, &["holdout.scale"]).await;
    server.stop().await;
}
