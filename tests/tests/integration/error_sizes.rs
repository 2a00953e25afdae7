//! Errors whose headers every client takes, whatever is wrong with how much.

use grasp_proto::v1::{self, shape::Kind};
use grasp_tests::TestServer;
use prost::Message;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::{
    fixtures::{box_request, floating_remote},
    malformed::{framed, headers_of},
    parts::{forbidden, update_of, with, with_object},
};

/// Largest headers and trailers of an error, each with 32 bytes as RFC 9113 (6.5.2) counts them. Clients of gRPC's C core may drop calls
/// from 8 kB on.
const MAX_BYTES: usize = 4 << 10;

/// A hand whose joints all lie in a heap and have no orientation.
fn wrong_hand() -> v1::PresentingHand {
    let joint = v1::JointPose {
        pose: Some(v1::Pose {
            position: Some(v1::Vector3 {
                x: f32::NAN,
                y: 0.0,
                z: 0.0,
            }),
            orientation: Some(v1::Quaternion::default()),
        }),
        radius: -1.0,
    };
    v1::HandJoints::new(v1::Handedness::Left, vec![joint; 26]).into()
}

fn requests() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let find = "GraspService/FindGrasp";
    let hand = floating_remote().with_presenting_hand(wrong_hand());
    let hands = with(hand.clone(), |request| {
        request.holdout_mut().other_hands = vec![wrong_hand(); 3];
    });
    let obstacle = v1::Shape {
        kind: Some(Kind::Tube(v1::TubeShape {
            points: Vec::new(),
            radii: vec![f32::NAN],
        })),
    };
    let obstacles = vec![obstacle; 64];
    let everything = with(hands.clone(), |request| {
        request.holdout_mut().obstacles.clone_from(&obstacles);
    });
    let obstacles = with(floating_remote(), |request| {
        request.holdout_mut().obstacles = obstacles;
    });
    let groups: Vec<_> = (0..200)
        .map(|number| format!("{number}{}", "Ö".repeat(300)))
        .collect();
    let groups: Vec<_> = groups.iter().map(String::as_str).collect();
    let triangles: Vec<_> = (1000..1500).collect();
    let names = with_object(box_request("crate"), |object| {
        object.labels = (0..200)
            .map(|number| (format!("Ä{number} {}", "é".repeat(400)), "\u{1}".repeat(900)))
            .collect();
        object.regions = vec![forbidden(&groups, &triangles)];
    });
    let forbidden = with_object(names.clone(), |object| object.labels.clear());
    let get = v1::GetObjectRequest {
        name: format!("objects/{}", "💥".repeat(9000)),
    };
    let update = update_of("objects/remote", |object| object.etag = "é".repeat(9000));
    vec![
        ("a hand", find, framed(&hand.encode_to_vec())),
        ("four hands", find, framed(&hands.encode_to_vec())),
        ("obstacles", find, framed(&obstacles.encode_to_vec())),
        ("all of it", find, framed(&everything.encode_to_vec())),
        (
            "labels",
            "ObjectService/CreateObject",
            framed(&names.encode_to_vec()),
        ),
        (
            "groups",
            "ObjectService/CreateObject",
            framed(&forbidden.encode_to_vec()),
        ),
        ("a name", "ObjectService/GetObject", framed(&get.encode_to_vec())),
        (
            "an etag",
            "ObjectService/UpdateObject",
            framed(&update.encode_to_vec()),
        ),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_arrive_whatever_is_wrong_with_how_much() {
    let server = TestServer::start().await;
    for (what, method, body) in requests() {
        let headers = headers_of(&server, method, body, &[]).await;
        let bytes: usize = headers
            .iter()
            .map(|(name, value)| name.as_str().len() + value.len() + 32)
            .sum();
        assert!(bytes < MAX_BYTES, "{what}: {bytes} bytes");
        let status = Status::from_header_map(&headers).expect("it has a status");
        assert!(
            !matches!(status.code(), Code::Ok | Code::Internal | Code::Unknown),
            "{what}: {status}"
        );
        println!("{what}: {bytes} bytes, {}", status.message());
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_first_of_many_wrong_joints_are_named_and_the_others_counted() {
    let server = TestServer::start().await;
    let request = floating_remote().with_presenting_hand(wrong_hand());
    let request = with(request, |request| {
        request.requirements_mut().friction = Some(-1.0);
    });
    let status = server.grasps().await.find_grasp(request).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let details = status.get_error_details();
    let listed = &details.bad_request().unwrap().field_violations;
    let has = |field: &str| listed.iter().any(|violation| violation.field == field);
    for joint in 0..2 {
        let joint = format!("holdout.presenting_hand.joints.joints[{joint}]");
        assert!(has(&format!("{joint}.pose.position")), "{listed:?}");
    }
    // What is wrong once is not crowded out.
    assert!(has("requirements.friction"), "{listed:?}");
    let rest = listed.last().unwrap();
    assert!(
        rest.field.is_empty() && rest.description.contains("more violations are not listed"),
        "{rest:?}"
    );
    server.stop().await;
}
