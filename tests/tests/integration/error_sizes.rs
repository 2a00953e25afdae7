//! Errors whose headers every client takes, whatever is wrong with how much.

use std::collections::BTreeMap;

use grasp_proto::v1::{self, obstacle::Shape, presenting_hand::Form};
use grasp_tests::TestServer;
use prost::Message;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::{
    fixtures::{box_request, floating_remote},
    malformed::{framed, headers_of},
};

/// Largest headers and trailers of an error, each with 32 bytes as RFC 9113 (6.5.2) counts them. Clients of gRPC's C core may drop calls
/// from 8 kB on.
const MAX_BYTES: usize = 4 << 10;

/// A hand whose joints all lie in a heap and have no orientation.
fn wrong_hand() -> v1::PresentingHand {
    let joint = v1::JointPose {
        client_from_joint: Some(v1::Pose {
            position: Some(v1::Vector3 {
                x: f32::NAN,
                y: 0.0,
                z: 0.0,
            }),
            orientation: Some(v1::Quaternion::default()),
        }),
        radius: -1.0,
    };
    v1::PresentingHand {
        form: Some(Form::Joints(v1::HandJoints {
            handedness: v1::Handedness::Left.into(),
            joint_set: v1::JointSet::Openxr26.into(),
            joints: vec![joint; 26],
        })),
    }
}

fn requests() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let find = "GraspService/FindGrasp";
    let hand = v1::FindGraspRequest {
        presenting_hand: Some(wrong_hand()),
        ..floating_remote()
    };
    let hands = v1::FindGraspRequest {
        other_hands: vec![wrong_hand(); 3],
        ..hand.clone()
    };
    let capsule = v1::CapsuleShape {
        radius: f32::NAN,
        ..Default::default()
    };
    let obstacles = v1::FindGraspRequest {
        obstacles: vec![
            v1::Obstacle {
                shape: Some(Shape::Capsule(capsule)),
            };
            64
        ],
        ..floating_remote()
    };
    let everything = v1::FindGraspRequest {
        obstacles: obstacles.obstacles.clone(),
        ..hands.clone()
    };
    let names = v1::CreateObjectRequest {
        labels: (0..200)
            .map(|number| (format!("Ä{number} {}", "é".repeat(400)), "\u{1}".repeat(900)))
            .collect(),
        forbidden: Some(v1::ForbiddenSurfaces {
            groups: (0..200)
                .map(|number| format!("{number}{}", "Ö".repeat(300)))
                .collect(),
            triangles: (1000..1500).collect(),
        }),
        ..box_request("crate")
    };
    let forbidden = v1::CreateObjectRequest {
        labels: BTreeMap::default(),
        ..names.clone()
    };
    let get = v1::GetObjectRequest {
        name: format!("objects/{}", "💥".repeat(9000)),
    };
    let update = v1::UpdateObjectRequest {
        name: "objects/remote".to_owned(),
        etag: "é".repeat(9000),
        ..Default::default()
    };
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
    let request = v1::FindGraspRequest {
        presenting_hand: Some(wrong_hand()),
        friction: Some(-1.0),
        ..floating_remote()
    };
    let status = server.grasps().await.find_grasp(request).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let details = status.get_error_details();
    let listed = &details.bad_request().unwrap().field_violations;
    let has = |field: &str| listed.iter().any(|violation| violation.field == field);
    for joint in 0..2 {
        let joint = format!("presenting_hand.joints.joints[{joint}]");
        assert!(has(&format!("{joint}.client_from_joint.position")), "{listed:?}");
    }
    // What is wrong once is not crowded out.
    assert!(has("friction"), "{listed:?}");
    let rest = listed.last().unwrap();
    assert!(
        rest.field.is_empty() && rest.description.contains("more violations are not listed"),
        "{rest:?}"
    );
    server.stop().await;
}
