//! Requests that break the contract are refused by each method with every wrong field, in one form.

use grasp_proto::v1::{self, receiver::Body};
use grasp_tests::TestServer;
use tonic::{Code, Response, Status};
use tonic_types::StatusExt as _;

use crate::fixtures::{
    BOX_OBJ, assert_status, blamed_fields, box_request, create, floating_remote, forbidden, held_remote,
    milliseconds, seconds, update_of, with, with_object,
};

/// Fails unless a call was refused for these fields, each with a description in house style.
fn assert_refused<T: std::fmt::Debug>(answer: Result<Response<T>, Status>, fields: &[&str]) {
    let status = answer.expect_err("it is wrong");
    assert_status(&status, Code::InvalidArgument, "INVALID_REQUEST");
    assert_eq!(blamed_fields(&status), fields);
    let details = status.get_error_details();
    for violation in &details.bad_request().expect("it has fields").field_violations {
        let text = &violation.description;
        let starts_small = text.chars().next().is_some_and(|first| !first.is_uppercase());
        assert!(starts_small && !text.ends_with('.'), "{text}");
    }
}

/// A quaternion that is no rotation.
fn turned_by_nothing() -> v1::Pose {
    v1::Pose {
        position: None,
        orientation: Some(v1::Quaternion::default()),
    }
}

/// A stretched hand that is nowhere.
fn lost_hand() -> v1::HandPose {
    v1::HandPose::new("rigs/adult", v1::Handedness::Right).with_digits([Some(v1::DigitAngles::default()); 5])
}

/// A search that is wrong in all parts.
fn wrong_search() -> v1::FindGraspRequest {
    with(held_remote(), |request| {
        let holdout = request.holdout_mut();
        holdout.object = "objects/nothing".into();
        holdout.client_from_object = Some(turned_by_nothing());
        holdout.up = Some(v1::Vector3::default());
        request.receiver = Some(v1::Receiver {
            body: Some(Body::ClientShoulder(glam::Vec3::NAN.into())),
            max_reach: Some(-1.0),
            ..Default::default()
        });
        request.requirements_mut().friction = Some(-1.0);
        request.requirements_mut().must_touch = vec![1, 9];
        request.search_mut().budget = Some(seconds(-1));
    })
}

/// What is wrong with it; an unknown object among other violations is one of them.
const WRONG_SEARCH: [&str; 8] = [
    "holdout.client_from_object.orientation",
    "holdout.up",
    "receiver.max_reach",
    "receiver.client_shoulder",
    "requirements.friction",
    "requirements.must_touch[1]",
    "search.budget",
    "holdout.object",
];

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_with_a_holdout_is_named_at_once_by_each_method() {
    let server = TestServer::start().await;
    let mut grasps = server.grasps().await;
    let wrong = wrong_search();
    assert_refused(grasps.find_grasp(wrong.clone()).await, &WRONG_SEARCH);
    assert_refused(
        grasps
            .stream_grasps(v1::StreamGraspsRequest::from(wrong.clone()))
            .await,
        &WRONG_SEARCH,
    );
    let mut rated = wrong.clone();
    rated.search = None;
    let evaluation = v1::EvaluateHoldoutRequest {
        other_presenting_hands: vec![v1::PresentingHand { form: None }, lost_hand().into()],
        ..rated.into()
    };
    let mut fields = vec!["other_presenting_hands[0]", "other_presenting_hands[1].pose"];
    fields.extend(WRONG_SEARCH.iter().filter(|field| !field.starts_with("search")));
    let status = grasps
        .evaluate_holdout(evaluation)
        .await
        .expect_err("it is wrong");
    let mut blamed = blamed_fields(&status);
    blamed.sort_unstable();
    fields.sort_unstable();
    assert_eq!(blamed, fields);
    let validation = v1::ValidateGraspRequest {
        nearest_budget: Some(prost_types::Duration::default()),
        ..v1::ValidateGraspRequest::from(floating_remote()).with_pose(lost_hand())
    };
    assert_refused(
        grasps.validate_grasp(validation).await,
        &["pose", "nearest_budget"],
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_with_a_track_is_named_at_once() {
    let server = TestServer::start().await;
    let mut grasps = server.grasps().await;
    let of_frames = held_remote().holdout.expect("it has one");
    let wrong = v1::Track {
        holdout: Some(v1::Holdout {
            object: "remote".to_owned(),
            obstacles: vec![v1::Shape::ball(glam::Vec3::ZERO, 0.1)],
            other_hands: of_frames.presenting_hand.iter().cloned().collect(),
            ..of_frames
        }),
        receiver: Some(v1::Receiver {
            both_hands: true,
            ..Default::default()
        }),
        requirements: Some(v1::Requirements {
            thesis: Some(v1::ThesisOptions {
                thesis_validity: true,
                ..Default::default()
            }),
            ..Default::default()
        }),
        search: Some(v1::SearchOptions {
            replay_attempt: Some(3),
            ..Default::default()
        }),
        current: Some(v1::HandPose::default()),
        min_score_gain: Some(1.5),
        min_dwell: Some(milliseconds(-1)),
        prediction_horizon: Some(milliseconds(501)),
        grace: Some(seconds(6)),
        may_change_hand: true,
        ..Default::default()
    };
    let fields = [
        "holdout.object",
        "holdout.client_from_object",
        "holdout.presenting_hand",
        "holdout.other_hands",
        "holdout.obstacles",
        "receiver.both_hands",
        "requirements.thesis.thesis_validity",
        "search.replay_attempt",
        "current.rig",
        "min_score_gain",
        "min_dwell",
        "prediction_horizon",
        "grace",
    ];
    let created = grasps.create_track(wrong.clone()).await.expect_err("it is wrong");
    let first = v1::TrackHoldoutRequest {
        message: Some(v1::track_holdout_request::Message::Track(wrong)),
    };
    let streamed = grasps.track_holdout(tokio_stream::once(first)).await;
    let streamed = streamed.expect_err("it is wrong");
    let (created, streamed) = (blamed_fields(&created), blamed_fields(&streamed));
    for field in fields {
        let in_stream = format!("track.{field}");
        assert!(
            created.iter().any(|blamed| blamed == field),
            "{field}: {created:?}"
        );
        assert!(streamed.contains(&in_stream), "{in_stream}: {streamed:?}");
    }
    assert_eq!(server.gauges().tracks(), 0);
    let frame = v1::TrackHoldoutRequest {
        message: Some(v1::track_holdout_request::Message::Frame(
            v1::TrackFrame::default(),
        )),
    };
    assert_refused(grasps.track_holdout(tokio_stream::once(frame)).await, &["track"]);
    let missing = grasps.create_track(v1::Track::new("objects/missing")).await;
    assert_eq!(missing.expect_err("there is none").code(), Code::NotFound);
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_with_an_object_is_named_at_once() {
    let server = TestServer::start().await;
    let mut objects = server.objects().await;
    let wrong = with_object(
        v1::CreateObjectRequest::new("Bad Name", BOX_OBJ, f32::NAN),
        |object| {
            object.meters_per_unit = Some(-1.0);
            object.center_of_mass = Some(glam::Vec3::INFINITY.into());
            object.friction = Some(0.0);
            object.regions = vec![forbidden(&["lid"], &[3, 12])];
        },
    );
    let fields = [
        "object.name",
        "object.meters_per_unit",
        "object.mass_kg",
        "object.center_of_mass",
        "object.friction",
        "object.regions[0].groups[0]",
        "object.regions[0].triangles[1]",
    ];
    assert_refused(objects.create_object(wrong).await, &fields);
    assert_refused(
        objects.create_object(v1::CreateObjectRequest::default()).await,
        &["object"],
    );
    let no_mesh = v1::CreateObjectRequest::new("broken", "not a mesh", 0.1);
    assert_refused(objects.create_object(no_mesh).await, &["mesh"]);

    create(&server, box_request("crate")).await.unwrap();
    let wrong = with(update_of("crate", |object| object.mass_kg = -1.0), |update| {
        update.update_mask = Some(prost_types::FieldMask {
            paths: vec!["mass_kg".to_owned(), "mesh".to_owned()],
        });
    });
    let fields = ["object.name", "update_mask.paths[1]", "object.mass_kg"];
    assert_refused(objects.update_object(wrong).await, &fields);
    let wrong = update_of("objects/crate", |object| {
        object.regions = vec![forbidden(&["lid"], &[12])];
    });
    let fields = ["object.regions[0].groups[0]", "object.regions[0].triangles[0]"];
    assert_refused(objects.update_object(wrong).await, &fields);

    let name = || "remote".to_owned();
    assert_refused(
        objects.get_object(v1::GetObjectRequest { name: name() }).await,
        &["name"],
    );
    assert_refused(
        objects.get_mesh(v1::GetMeshRequest { name: name() }).await,
        &["name"],
    );
    assert_refused(
        objects.get_atlas(v1::GetAtlasRequest { name: name() }).await,
        &["name"],
    );
    let list = v1::ListObjectsRequest {
        page_size: -1,
        page_token: "made up".into(),
        filter: "level=kitchen OR fragile".into(),
        order_by: "size".into(),
        view: 99,
    };
    let fields = ["page_size", "page_token", "filter", "order_by", "view"];
    assert_refused(objects.list_objects(list).await, &fields);
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_with_a_rig_is_named_at_once() {
    let server = TestServer::start().await;
    let mut rigs = server.rigs().await;
    let wrong = v1::CreateRigRequest {
        rig_id: "Mine".to_owned(),
        limits: vec![v1::DigitLimits::default(); 4],
        joint_map: vec![v1::RigNode::default()],
        handedness: 7,
        joints: vec![v1::HandJoints::default(); 3],
        ..Default::default()
    };
    let status = rigs.create_rig(wrong).await.expect_err("it is wrong");
    let blamed = blamed_fields(&status);
    for field in [
        "rig_id",
        "joints",
        "joint_map",
        "joint_map[0].node",
        "joint_map[0].joint",
        "limits[0].digit",
        "limits[0].min",
        "limits[0].max",
        "handedness",
    ] {
        assert!(blamed.iter().any(|blamed| blamed == field), "{field}: {blamed:?}");
    }
    for models in [Vec::new(), vec![vec![0]; 3]] {
        let wrong = v1::CreateRigRequest {
            rig_id: "mine".to_owned(),
            models,
            ..Default::default()
        };
        assert_refused(rigs.create_rig(wrong).await, &["models"]);
    }
    let name = "adult".to_owned();
    assert_refused(rigs.get_rig(v1::GetRigRequest { name }).await, &["name"]);
}
