//! Requests that break the contract are rejected with every wrong field, and the server stays up.

use grasp_proto::v1::{self, presenting_hand::Form, receiver::Body};
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    fixtures::{BOX_OBJ, assert_blamed, blamed_fields, box_request, floating_remote, held_remote, receiving},
    parts::{forbidden, with, with_object},
};

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

/// The giver's hand, by its angles.
fn giver(request: &mut v1::FindGraspRequest) -> &mut v1::HandPose {
    match &mut request.holdout_mut().presenting_hand.as_mut().unwrap().form {
        Some(Form::Pose(hand)) => hand,
        _ => panic!("the request has angles"),
    }
}

fn thesis(request: &mut v1::FindGraspRequest) -> &mut v1::ThesisOptions {
    request.requirements_mut().thesis.get_or_insert_default()
}

/// A flat hand of 25 joints a centimetre apart, with the wrist at the origin.
fn flat_hand() -> v1::HandJoints {
    let joint = |x: f32, z: f32| v1::JointPose {
        pose: Some(v1::Pose {
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
    v1::HandJoints::new(v1::Handedness::Left, joints)
}

fn with_joints(change: impl FnOnce(&mut v1::HandJoints)) -> v1::FindGraspRequest {
    let request = floating_remote().with_presenting_hand(with(flat_hand(), change));
    with(request, |request| request.search_mut().max_attempts = Some(1))
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_search_is_validated() {
    let server = TestServer::start().await;
    let table: &[(Mutation, &str)] = &[
        (|r| r.holdout_mut().object = String::new(), "holdout.object"),
        (|r| r.holdout_mut().object = "remote".into(), "holdout.object"),
        (
            |r| r.holdout_mut().object = "objects/../x".into(),
            "holdout.object",
        ),
        (
            |r| r.holdout_mut().client_from_object = Some(quaternion(0.0)),
            "holdout.client_from_object.orientation",
        ),
        (
            |r| r.holdout_mut().client_from_object = Some(quaternion(0.9)),
            "holdout.client_from_object.orientation",
        ),
        (
            |r| r.holdout_mut().client_from_object = Some(quaternion(f32::NAN)),
            "holdout.client_from_object.orientation",
        ),
        (
            |r| r.holdout_mut().client_from_object = Some(position(f32::NAN)),
            "holdout.client_from_object.position",
        ),
        (
            |r| r.holdout_mut().client_from_object = Some(position(f32::INFINITY)),
            "holdout.client_from_object.position",
        ),
        (
            |r| r.holdout_mut().client_from_object = Some(position(1e6)),
            "holdout.client_from_object.position",
        ),
        (|r| r.holdout_mut().up = Some(vector(0.0)), "holdout.up"),
        (|r| r.holdout_mut().up = Some(vector(f32::NAN)), "holdout.up"),
        (|r| r.search_mut().budget = Some(duration(0, 0)), "search.budget"),
        (|r| r.search_mut().budget = Some(duration(-1, 0)), "search.budget"),
        (|r| r.search_mut().budget = Some(duration(1, -1)), "search.budget"),
        (
            |r| r.search_mut().budget = Some(duration(0, 2_000_000_000)),
            "search.budget",
        ),
        (
            |r| r.search_mut().budget = Some(duration(i64::MIN, i32::MIN)),
            "search.budget",
        ),
        (
            |r| r.search_mut().budget = Some(duration(i64::MAX, 0)),
            "search.budget",
        ),
        (|r| r.search_mut().max_attempts = Some(0), "search.max_attempts"),
        (
            |r| {
                r.search_mut().replay_attempt = Some(u64::MAX);
                r.receiver = Some(receiving(v1::Handedness::Right));
            },
            "search.replay_attempt",
        ),
        // A choice that is not supported yet.
        (|r| r.search_mut().choice = 4, "search.choice"),
        (|r| thesis(r).strategy = 99, "requirements.thesis.strategy"),
        (|r| thesis(r).bend_ratios = -1, "requirements.thesis.bend_ratios"),
        (|r| r.output_mut().convention = 99, "output.convention"),
        (
            |r| r.requirements_mut().friction = Some(0.0),
            "requirements.friction",
        ),
        (
            |r| r.requirements_mut().friction = Some(f32::NAN),
            "requirements.friction",
        ),
        (
            |r| r.requirements_mut().friction = Some(50.0),
            "requirements.friction",
        ),
        (|r| r.receiver_mut().rig = "rigs/robot".into(), "receiver.rig"),
        // Names are whole.
        (|r| r.receiver_mut().rig = "adult".into(), "receiver.rig"),
        (|r| r.receiver_mut().handedness = 3, "receiver.handedness"),
        (
            |r| r.holdout_mut().presenting_hand = Some(v1::PresentingHand { form: None }),
            "holdout.presenting_hand",
        ),
        (|r| r.holdout = None, "holdout"),
    ];
    for (mutate, field) in table {
        let mut request = floating_remote();
        mutate(&mut request);
        assert_blamed(&server, request, &[field]).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_posed_hand_is_validated() {
    let server = TestServer::start().await;
    let table: &[(Mutation, &[&str])] = &[
        (|r| giver(r).rig = "rigs/robot".into(), &["rig"]),
        (|r| giver(r).rig = "adult".into(), &["rig"]),
        (|r| giver(r).rig = String::new(), &["rig"]),
        (|r| giver(r).handedness = 0, &["handedness"]),
        (|r| giver(r).handedness = 7, &["handedness"]),
        (|r| giver(r).convention = 99, &["convention"]),
        (|r| giver(r).client_from_wrist = None, &[""]),
        (
            |r| giver(r).client_from_wrist = Some(quaternion(0.0)),
            &["client_from_wrist.orientation"],
        ),
        (
            |r| {
                giver(r).client_from_wrist = None;
                giver(r).object_from_wrist = Some(quaternion(0.0));
            },
            &["object_from_wrist.orientation"],
        ),
        (
            |r| *giver(r) = giver(r).clone().with_digits([None; 5]),
            &["thumb", "index", "middle", "ring", "little"],
        ),
        (|r| giver(r).little = None, &["little"]),
        (
            |r| giver(r).middle.as_mut().unwrap().base_pitch = 3.0,
            &["middle.base_pitch"],
        ),
        (
            |r| giver(r).thumb.as_mut().unwrap().base_yaw = f32::NAN,
            &["thumb.base_yaw"],
        ),
        (
            |r| giver(r).little.as_mut().unwrap().second_pitch = -1.0,
            &["little.second_pitch"],
        ),
        (
            |r| giver(r).index.as_mut().unwrap().third_pitch = Some(9.0),
            &["index.third_pitch"],
        ),
    ];
    for (mutate, fields) in table {
        let pose = "holdout.presenting_hand.pose";
        let fields: Vec<_> = fields.iter().map(|field| format!("{pose}.{field}")).collect();
        let fields: Vec<_> = fields.iter().map(|field| field.trim_end_matches('.')).collect();
        assert_blamed(&server, with(held_remote(), mutate), &fields).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_tracked_hand_is_validated() {
    let server = TestServer::start().await;
    let answer = server.grasps().await.find_grasp(with_joints(|_| {})).await;
    assert!(answer.is_ok(), "the unchanged hand is accepted: {answer:?}");
    let joints = "holdout.presenting_hand.joints";
    let table: &[(&str, JointsMutation)] = &[
        ("handedness", |hand| hand.handedness = 0),
        ("joints", |hand| hand.joints.clear()),
        ("joints", |hand| hand.joints.truncate(24)),
        ("joints", |hand| hand.joints.extend_from_within(..2)),
        ("joints[3].radius", |hand| hand.joints[3].radius = -0.001),
        ("joints[3].radius", |hand| hand.joints[3].radius = f32::NAN),
        ("joints[3].radius", |hand| hand.joints[3].radius = 1.0),
        ("joints[24].pose", |hand| hand.joints[24].pose = None),
        ("joints[1].pose.orientation", |hand| {
            hand.joints[1].pose = Some(quaternion(2.0));
        }),
        ("joints[9]", |hand| hand.joints[9].pose = Some(position(10.0))),
        ("joints", |hand| {
            for joint in &mut hand.joints {
                joint.pose = Some(position(0.0));
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
    let holdout = request.holdout_mut();
    holdout.object = "objects/nothing".into();
    holdout.client_from_object = Some(quaternion(0.0));
    holdout.up = Some(vector(0.0));
    giver(&mut request).middle.as_mut().unwrap().base_pitch = 3.0;
    request.receiver = Some(v1::Receiver {
        body: Some(Body::ClientShoulder(vector(f32::NAN))),
        max_reach: Some(-1.0),
        ..Default::default()
    });
    request.requirements = Some(v1::Requirements {
        friction: Some(-1.0),
        client_approach: Some(vector(0.0)),
        max_approach_angle: -1.0,
        allowed_grasp_types: vec![14, 34, 0],
        excluded_grasp_types: vec![14, 15],
        must_touch: vec![1, 9],
        must_not_touch: vec![1],
        thesis: Some(v1::ThesisOptions {
            max_comfort: Some(-1.0),
            ..Default::default()
        }),
    });
    request.search_mut().budget = Some(duration(-1, 0));
    let fields = [
        "holdout.client_from_object.orientation",
        "holdout.presenting_hand.pose.middle.base_pitch",
        "holdout.up",
        "receiver.max_reach",
        "receiver.client_shoulder",
        "requirements.friction",
        "requirements.client_approach",
        "requirements.max_approach_angle",
        "requirements.allowed_grasp_types[1]",
        "requirements.allowed_grasp_types[2]",
        "requirements.excluded_grasp_types[0]",
        "requirements.must_touch[1]",
        "requirements.must_not_touch[0]",
        "requirements.thesis.max_comfort",
        "search.budget",
        // An unknown object among other violations is one of them.
        "holdout.object",
    ];
    assert_blamed(&server, request, &fields).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_new_object_is_validated() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    let request = with_object(
        v1::CreateObjectRequest::new("Bad Name", BOX_OBJ, f32::NAN),
        |object| {
            object.meters_per_unit = Some(-1.0);
            object.center_of_mass = Some(vector(f32::INFINITY));
            object.friction = Some(0.0);
            object.regions = vec![forbidden(&["lid"], &[3, 12])];
        },
    );
    let status = client.create_object(request).await.unwrap_err();
    let fields = [
        "object.name",
        "object.meters_per_unit",
        "object.mass_kg",
        "object.center_of_mass",
        "object.friction",
        "object.regions[0].groups[0]",
        "object.regions[0].triangles[1]",
    ];
    assert_eq!(blamed_fields(&status), fields);

    for obj in [
        "",
        "not a mesh",
        "v 0 0 0\nf 1 2 3\n",
        "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
    ] {
        let request = v1::CreateObjectRequest::new("broken", obj, 0.1);
        let status = client.create_object(request).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument, "{obj:?}: {status}");
        assert!(
            blamed_fields(&status).iter().all(|field| field == "mesh"),
            "{obj:?}: {status}"
        );
    }
    // Millimetres mistaken for metres.
    let request = with_object(box_request("tower"), |object| {
        object.meters_per_unit = Some(1000.0);
    });
    let tower = client.create_object(request).await.unwrap().into_inner();
    assert!(
        tower
            .warnings
            .iter()
            .any(|warning| warning.contains("meters_per_unit")),
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
        view: 99,
    };
    let status = client.list_objects(request).await.unwrap_err();
    assert_eq!(
        blamed_fields(&status),
        ["page_size", "page_token", "filter", "order_by", "view"]
    );
    server.stop().await;
}
