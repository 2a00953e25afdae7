//! Requests that break the contract are rejected with every wrong field, and the server stays up.

use grasp_proto::v1::{self, presenting_hand::Form};
use grasp_tests::TestServer;
use tonic::Code;

use crate::fixtures::{assert_blamed, blamed_fields, floating_remote, held_remote, receiving};

type Mutation = fn(&mut v1::FindGraspRequest);

type JointsMutation = fn(&mut v1::HandJoints);

fn quaternion(w: f32) -> v1::Pose {
    v1::Pose {
        position: None,
        orientation: Some(v1::Quaternion {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w,
        }),
    }
}

fn position(x: f32) -> v1::Pose {
    v1::Pose {
        position: Some(vector(x)),
        orientation: None,
    }
}

fn vector(x: f32) -> v1::Vector3 {
    v1::Vector3 { x, y: 0.0, z: 0.0 }
}

fn duration(seconds: i64, nanos: i32) -> prost_types::Duration {
    prost_types::Duration { seconds, nanos }
}

fn angles(request: &mut v1::FindGraspRequest) -> &mut v1::HandAngles {
    match &mut request.presenting_hand.as_mut().unwrap().form {
        Some(Form::Angles(angles)) => angles,
        _ => panic!("the request has angles"),
    }
}

/// A flat hand of 25 joints a centimetre apart, with the wrist at the origin.
fn flat_hand() -> v1::HandJoints {
    let joint = |x: f32, z: f32| v1::JointPose {
        client_from_joint: Some(v1::Pose {
            position: Some(v1::Vector3 { x, y: 0.0, z }),
            orientation: None,
        }),
        radius: 0.009,
    };
    let mut joints = vec![joint(0.0, 0.0)];
    for digit in 0..5_u8 {
        let count = if digit == 0 { 4 } else { 5 };
        let x = 0.04 - 0.02 * f32::from(digit);
        joints.extend((0..count).map(|i: u8| joint(x, -0.03 - 0.03 * f32::from(i))));
    }
    v1::HandJoints {
        handedness: v1::Handedness::Left.into(),
        joint_set: v1::JointSet::Webxr25.into(),
        joints,
    }
}

fn with_joints(change: impl FnOnce(&mut v1::HandJoints)) -> v1::FindGraspRequest {
    let mut joints = flat_hand();
    change(&mut joints);
    v1::FindGraspRequest {
        presenting_hand: Some(v1::PresentingHand {
            form: Some(Form::Joints(joints)),
        }),
        max_attempts: Some(1),
        ..floating_remote()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_search_is_validated() {
    let server = TestServer::start().await;
    let table: &[(Mutation, &str)] = &[
        (|r| r.object = String::new(), "object"),
        (|r| r.object = "remote".into(), "object"),
        (|r| r.object = "objects/../x".into(), "object"),
        (
            |r| r.client_from_object = Some(quaternion(0.0)),
            "client_from_object.orientation",
        ),
        (
            |r| r.client_from_object = Some(quaternion(0.9)),
            "client_from_object.orientation",
        ),
        (
            |r| r.client_from_object = Some(quaternion(f32::NAN)),
            "client_from_object.orientation",
        ),
        (
            |r| r.client_from_object = Some(position(f32::NAN)),
            "client_from_object.position",
        ),
        (
            |r| r.client_from_object = Some(position(f32::INFINITY)),
            "client_from_object.position",
        ),
        (
            |r| r.client_from_object = Some(position(1e6)),
            "client_from_object.position",
        ),
        (|r| r.up = Some(vector(0.0)), "up"),
        (|r| r.up = Some(vector(f32::NAN)), "up"),
        (|r| r.budget = Some(duration(0, 0)), "budget"),
        (|r| r.budget = Some(duration(-1, 0)), "budget"),
        (|r| r.budget = Some(duration(1, -1)), "budget"),
        (|r| r.budget = Some(duration(0, 2_000_000_000)), "budget"),
        (|r| r.budget = Some(duration(i64::MIN, i32::MIN)), "budget"),
        (|r| r.budget = Some(duration(i64::MAX, 0)), "budget"),
        (|r| r.max_attempts = Some(0), "max_attempts"),
        (
            |r| {
                r.only_attempt = Some(u64::MAX);
                r.receiving_hand = Some(receiving(v1::Handedness::Right));
            },
            "only_attempt",
        ),
        (|r| r.strategy = 99, "strategy"),
        // A choice that is not supported yet.
        (|r| r.choice = 3, "choice"),
        // A combination that is not supported yet.
        (
            |r| {
                r.choice = v1::Choice::BestWithinBudget.into();
                r.reproducible = true;
            },
            "reproducible",
        ),
        (|r| r.atlas = -1, "atlas"),
        (|r| r.bend_ratios = -1, "bend_ratios"),
        (|r| r.validity = 99, "validity"),
        (|r| r.convention = 99, "convention"),
        (|r| r.friction = Some(0.0), "friction"),
        (|r| r.friction = Some(f32::NAN), "friction"),
        (|r| r.friction = Some(50.0), "friction"),
        (
            |r| {
                r.receiving_hand = Some(v1::ReceivingHand {
                    rig: "robot".into(),
                    handedness: 0,
                    hand_scale: None,
                });
            },
            "receiving_hand.rig",
        ),
        (
            |r| {
                r.receiving_hand = Some(v1::ReceivingHand {
                    rig: String::new(),
                    handedness: 3,
                    hand_scale: None,
                });
            },
            "receiving_hand.handedness",
        ),
        (
            |r| r.presenting_hand = Some(v1::PresentingHand { form: None }),
            "presenting_hand",
        ),
    ];
    for (mutate, field) in table {
        let mut request = floating_remote();
        mutate(&mut request);
        assert_blamed(&server, request, &[field]).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_hand_by_angles_is_validated() {
    let server = TestServer::start().await;
    let table: &[(Mutation, &str)] = &[
        (|r| angles(r).rig = "robot".into(), "presenting_hand.angles.rig"),
        (|r| angles(r).rig = String::new(), "presenting_hand.angles.rig"),
        (|r| angles(r).handedness = 0, "presenting_hand.angles.handedness"),
        (|r| angles(r).handedness = 7, "presenting_hand.angles.handedness"),
        (
            |r| angles(r).client_from_wrist = Some(quaternion(0.0)),
            "presenting_hand.angles.client_from_wrist.orientation",
        ),
        (|r| angles(r).digits.clear(), "presenting_hand.angles.digits"),
        (|r| angles(r).digits.truncate(4), "presenting_hand.angles.digits"),
        (
            |r| angles(r).digits[2].base_pitch = 3.0,
            "presenting_hand.angles.digits[2].base_pitch",
        ),
        (
            |r| angles(r).digits[0].base_yaw = f32::NAN,
            "presenting_hand.angles.digits[0].base_yaw",
        ),
        (
            |r| angles(r).digits[4].second_pitch = -1.0,
            "presenting_hand.angles.digits[4].second_pitch",
        ),
        (
            |r| angles(r).digits[1].third_pitch = Some(9.0),
            "presenting_hand.angles.digits[1].third_pitch",
        ),
    ];
    for (mutate, field) in table {
        let mut request = held_remote();
        mutate(&mut request);
        assert_blamed(&server, request, &[field]).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_tracked_hand_is_validated() {
    let server = TestServer::start().await;
    let answer = server.grasps().await.find_grasp(with_joints(|_| {})).await;
    assert!(answer.is_ok(), "the unchanged hand is accepted: {answer:?}");
    let joints = "presenting_hand.joints";
    let table: [(&str, JointsMutation); 12] = [
        ("handedness", |hand| hand.handedness = 0),
        ("joint_set", |hand| hand.joint_set = 0),
        ("joint_set", |hand| hand.joint_set = 5),
        ("joints", |hand| hand.joints.clear()),
        ("joints", |hand| hand.joint_set = v1::JointSet::Openxr26.into()),
        ("joints[3].radius", |hand| hand.joints[3].radius = -0.001),
        ("joints[3].radius", |hand| hand.joints[3].radius = f32::NAN),
        ("joints[3].radius", |hand| hand.joints[3].radius = 1.0),
        ("joints[24].client_from_joint", |hand| {
            hand.joints[24].client_from_joint = None;
        }),
        ("joints[1].client_from_joint.orientation", |hand| {
            hand.joints[1].client_from_joint = Some(quaternion(2.0));
        }),
        ("joints[9]", |hand| {
            hand.joints[9].client_from_joint = Some(position(10.0));
        }),
        ("joints", |hand| {
            for joint in &mut hand.joints {
                joint.client_from_joint = Some(position(0.0));
            }
        }),
    ];
    for (field, change) in table {
        assert_blamed(&server, with_joints(change), &[&format!("{joints}.{field}")]).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn all_violations_are_reported_at_once() {
    let server = TestServer::start().await;
    let mut request = held_remote();
    request.object = "objects/nothing".into();
    request.client_from_object = Some(quaternion(0.0));
    angles(&mut request).digits[2].base_pitch = 3.0;
    request.up = Some(vector(0.0));
    request.budget = Some(duration(-1, 0));
    request.friction = Some(-1.0);
    request.constraints = Some(v1::Constraints {
        receiver_reach: Some(v1::Reach::default()),
        approach: Some(v1::ApproachCone::default()),
        allowed_grasp_types: vec![14, 34, 0],
        excluded_grasp_types: vec![14, 15],
        must_touch: vec![1, 9],
        must_not_touch: vec![1],
        max_comfort_e: Some(-1.0),
    });
    let fields = [
        "client_from_object.orientation",
        "presenting_hand.angles.digits[2].base_pitch",
        "up",
        "budget",
        "friction",
        "constraints.receiver_reach.client_shoulder",
        "constraints.receiver_reach.reach",
        "constraints.approach.client_direction",
        "constraints.approach.half_angle",
        "constraints.allowed_grasp_types[1]",
        "constraints.allowed_grasp_types[2]",
        "constraints.excluded_grasp_types[0]",
        "constraints.must_touch[1]",
        "constraints.must_not_touch[0]",
        "constraints.max_comfort_e",
        // An unknown object among other violations is one of them.
        "object",
    ];
    assert_blamed(&server, request, &fields).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_new_object_is_validated() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    let request = v1::CreateObjectRequest {
        object_id: "Bad Name".into(),
        mesh: crate::fixtures::BOX_OBJ.as_bytes().to_vec(),
        unit_metres: Some(-1.0),
        mass_kg: f32::NAN,
        centre_of_mass: Some(vector(f32::INFINITY)),
        friction: Some(0.0),
        forbidden: Some(v1::ForbiddenSurfaces {
            groups: vec!["lid".into()],
            triangles: vec![3, 12],
        }),
        ..Default::default()
    };
    let status = client.create_object(request).await.unwrap_err();
    let fields = [
        "object_id",
        "unit_metres",
        "mass_kg",
        "centre_of_mass",
        "friction",
        "forbidden.groups[0]",
        "forbidden.triangles[1]",
    ];
    assert_eq!(blamed_fields(&status), fields);

    for obj in [
        "",
        "not a mesh",
        "v 0 0 0\nf 1 2 3\n",
        "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
    ] {
        let request = v1::CreateObjectRequest {
            mesh: obj.as_bytes().to_vec(),
            ..crate::fixtures::box_request("broken")
        };
        let status = client.create_object(request).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument, "{obj:?}: {status}");
        assert!(
            blamed_fields(&status).iter().all(|field| field == "mesh"),
            "{obj:?}: {status}"
        );
    }
    // Millimetres mistaken for metres.
    let request = v1::CreateObjectRequest {
        unit_metres: Some(1000.0),
        ..crate::fixtures::box_request("tower")
    };
    let tower = client
        .create_object(request)
        .await
        .unwrap()
        .into_inner()
        .object
        .unwrap();
    assert!(
        tower
            .warnings
            .iter()
            .any(|warning| warning.contains("unit_metres")),
        "{:?}",
        tower.warnings
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn names_and_pages_are_validated() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    let status = client
        .get_object(v1::GetObjectRequest {
            name: "remote".into(),
        })
        .await
        .unwrap_err();
    assert_eq!(blamed_fields(&status), ["name"]);
    let request = v1::ListObjectsRequest {
        page_size: -1,
        page_token: "made up".into(),
        filter: "level=kitchen OR fragile".into(),
        order_by: "size".into(),
    };
    let status = client.list_objects(request).await.unwrap_err();
    assert_eq!(
        blamed_fields(&status),
        ["page_size", "page_token", "filter", "order_by"]
    );
    server.stop().await;
}
