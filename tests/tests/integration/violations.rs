//! Each method refuses requests that break the contract, in one form, and malformed messages; messages may be packed with gzip.
//! The server's own tests have the tables of violations.

use std::time::Duration;

use grasp_proto::v1::{self, track_holdout_request::Message};
use grasp_tests::TestServer;
use tonic::{Code, Response, Status, codec::CompressionEncoding::Gzip};
use tonic_types::StatusExt as _;

use crate::{
    fixtures::{
        assert_status, blamed_fields, bounded, box_request, create, floating_remote, forbidden, held_remote,
        milliseconds, reason, reproducible, seconds, update_of, with, with_object,
    },
    wire::{answer_over_http_2, framed_bytes},
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

#[tokio::test(flavor = "multi_thread")]
async fn searches_and_tracks_name_what_is_wrong() {
    let server = TestServer::start().await;
    let mut grasps = server.grasps().await;
    // An unknown object is reported among the other violations.
    let wrong = with(v1::FindGraspRequest::new("objects/nothing"), |request| {
        request.requirements_mut().friction = Some(-1.0);
        request.search_mut().budget = Some(seconds(-1));
    });
    let fields = ["requirements.friction", "search.budget", "holdout.object"];
    assert_refused(grasps.find_grasp(wrong.clone()).await, &fields);
    let stream = v1::StreamGraspsRequest::from(wrong.clone());
    assert_refused(grasps.stream_grasps(stream).await, &fields);
    let evaluation = v1::EvaluateHoldoutRequest {
        other_presenting_hands: vec![v1::PresentingHand { form: None }],
        ..floating_remote().into()
    };
    let evaluation = with(evaluation, |request| request.search = None);
    assert_refused(
        grasps.evaluate_holdout(evaluation).await,
        &["other_presenting_hands[0]"],
    );
    let nowhere = v1::HandPose::new("rigs/adult", v1::Handedness::Right)
        .with_digits([Some(v1::DigitAngles::default()); 5]);
    let validation = v1::ValidateGraspRequest {
        nearest_budget: Some(seconds(0)),
        ..v1::ValidateGraspRequest::from(floating_remote()).with_pose(nowhere)
    };
    assert_refused(
        grasps.validate_grasp(validation).await,
        &["pose", "nearest_budget"],
    );

    let name = || "tracks/1".to_owned();
    let frame = v1::TrackFrame {
        track: name(),
        ..Default::default()
    };
    assert_refused(grasps.push_frame(frame).await, &["track"]);
    let delete = v1::DeleteTrackRequest { name: name() };
    assert_refused(grasps.delete_track(delete).await, &["name"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_names_everything_that_is_wrong() {
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
        ..Default::default()
    };
    let first = |message| {
        tokio_stream::once(v1::TrackHoldoutRequest {
            message: Some(message),
        })
    };
    let created = grasps.create_track(wrong.clone()).await.expect_err("it is wrong");
    let streamed = grasps.track_holdout(first(Message::Track(wrong))).await;
    let [created, streamed] =
        [created, streamed.expect_err("it is wrong")].map(|status| blamed_fields(&status));
    for field in [
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
    ] {
        let in_stream = format!("track.{field}");
        assert!(
            created.iter().any(|blamed| blamed == field),
            "{field}: {created:?}"
        );
        assert!(streamed.contains(&in_stream), "{in_stream}: {streamed:?}");
    }
    assert_eq!(server.gauges().tracks(), 0);
    let frame = first(Message::Frame(v1::TrackFrame::default()));
    assert_refused(grasps.track_holdout(frame).await, &["track"]);
    let missing = grasps.create_track(v1::Track::new("objects/missing")).await;
    assert_eq!(missing.expect_err("there is none").code(), Code::NotFound);
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_name_what_is_wrong() {
    let server = TestServer::start().await;
    let mut objects = server.objects().await;
    let wrong = with_object(box_request("Bad Name"), |object| {
        object.mass_kg = f32::NAN;
        object.regions = vec![forbidden(&["lid"], &[3, 12])];
    });
    let fields = [
        "object.name",
        "object.mass_kg",
        "object.regions[0].groups[0]",
        "object.regions[0].triangles[1]",
    ];
    assert_refused(objects.create_object(wrong).await, &fields);
    let no_mesh = v1::CreateObjectRequest::new("broken", "not a mesh", 0.1);
    assert_refused(objects.create_object(no_mesh).await, &["mesh"]);
    create(&server, box_request("crate")).await.unwrap();
    for (update, fields) in [
        (
            update_of("crate", |object| object.mass_kg = -1.0),
            &["object.name", "object.mass_kg"][..],
        ),
        (
            update_of("objects/crate", |object| {
                object.regions = vec![forbidden(&["lid"], &[12])];
            }),
            &["object.regions[0].groups[0]", "object.regions[0].triangles[0]"],
        ),
    ] {
        assert_refused(objects.update_object(update).await, fields);
    }
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
    let delete = v1::DeleteObjectRequest {
        name: name(),
        ..Default::default()
    };
    assert_refused(objects.delete_object(delete).await, &["name"]);
    let list = v1::ListObjectsRequest {
        page_size: -1,
        filter: "level=kitchen OR fragile".into(),
        view: 99,
        ..Default::default()
    };
    assert_refused(objects.list_objects(list).await, &["page_size", "filter", "view"]);
    let watch = v1::WatchObjectsRequest {
        filter: "level".to_owned(),
        ..Default::default()
    };
    assert_refused(objects.watch_objects(watch).await, &["filter"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_wrong_known_grip_is_named() {
    let hand = |rig: &str, base_pitch: f32| {
        let digit = v1::DigitAngles {
            base_pitch,
            ..Default::default()
        };
        v1::HandPose::new(rig, v1::Handedness::Right)
            .with_object_from_wrist(v1::Pose::default())
            .with_digits([Some(digit); 5])
    };
    let grip = |name: &str, preference, hand| v1::KnownGrip::new(name, preference, hand);
    let large = v1::HandPose {
        scale: Some(3.0),
        ..hand("giant", 0.0)
    };
    let partly = v1::HandPose {
        object_from_wrist: None,
        client_from_wrist: Some(v1::Pose::default()),
        little: None,
        ..hand("rigs/adult", 0.0)
    };
    let grips = vec![
        v1::KnownGrip::default(),
        v1::KnownGrip {
            near_distance: Some(0.1),
            ..grip("a", v1::Preference::Preferred, large)
        },
        grip("a", v1::Preference::Preferred, hand("rigs/adult", 3.0)),
        v1::KnownGrip {
            near_distance: Some(2.0),
            near_angle: Some(f32::NAN),
            ..grip("b", v1::Preference::Forbidden, hand("", 0.0))
        },
        grip("c", v1::Preference::Avoided, partly),
    ];
    let server = TestServer::start().await;
    let wrong = with_object(box_request("crate"), |object| object.known_grips = grips);
    let fields = [
        "object.known_grips[0].name",
        "object.known_grips[0].preference",
        "object.known_grips[0].hand",
        "object.known_grips[1].hand.rig",
        "object.known_grips[1].hand.scale",
        "object.known_grips[1].near_distance",
        "object.known_grips[2].name",
        "object.known_grips[2].hand.thumb.base_pitch",
        "object.known_grips[2].hand.index.base_pitch",
        "object.known_grips[2].hand.middle.base_pitch",
        "object.known_grips[2].hand.ring.base_pitch",
        "object.known_grips[2].hand.little.base_pitch",
        "object.known_grips[3].near_distance",
        "object.known_grips[3].near_angle",
        "object.known_grips[4].preference",
        "object.known_grips[4].hand.object_from_wrist",
        "object.known_grips[4].hand.little",
    ];
    assert_refused(server.objects().await.create_object(wrong).await, &fields);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rig_names_everything_that_is_wrong() {
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
    let blamed = blamed_fields(&rigs.create_rig(wrong).await.expect_err("it is wrong"));
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
    let name = || "adult".to_owned();
    assert_refused(rigs.get_rig(v1::GetRigRequest { name: name() }).await, &["name"]);
    assert_refused(
        rigs.delete_rig(v1::DeleteRigRequest { name: name() }).await,
        &["name"],
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn bytes_that_are_no_message_are_invalid_arguments() {
    let server = TestServer::start().await;
    let wrong = [
        ("an unknown wire type", framed_bytes(&[0x0f])),
        ("a length beyond the end", framed_bytes(&[0x0a, 0x7f, b'x'])),
        ("text that is not UTF-8", framed_bytes(&[0x0a, 0x02, 0xff, 0xfe])),
        ("a varint without an end", framed_bytes(&[0xff; 12])),
        ("a frame cut short", framed_bytes(b"name")[..7].to_vec()),
        ("no frame", Vec::new()),
        (
            "compression that was not announced",
            [&[1, 0, 0, 0, 1], &b"x"[..]].concat(),
        ),
        ("an invalid flag", [&[9, 0, 0, 0, 1], &b"x"[..]].concat()),
    ];
    for method in [
        "ObjectService/GetObject",
        "ObjectService/CreateObject",
        "GraspService/FindGrasp",
    ] {
        for (what, body) in &wrong {
            let answer = bounded(what, answer_over_http_2(&server, method, &[], body.clone())).await;
            let status = answer.status_in_headers();
            let found = (status.code(), reason(&status));
            let expected = (Code::InvalidArgument, "MALFORMED_MESSAGE".to_owned());
            assert_eq!(found, expected, "{what} to {method}: {status:?}");
        }
    }
    // The server is as before, and right bytes are understood.
    let name = b"\x0a\x0eobjects/remote";
    let answer = answer_over_http_2(&server, "ObjectService/GetObject", &[], framed_bytes(name)).await;
    assert_eq!(answer.status_in_headers().code(), Code::Ok);
}

#[tokio::test(flavor = "multi_thread")]
async fn packed_requests_are_understood() {
    let server = TestServer::start().await;
    let mut plain = server.grasps().await;
    let mut packing = server.grasps().await.send_compressed(Gzip);
    let request = reproducible(floating_remote());
    let packed = packing.find_grasp(request.clone()).await.unwrap();
    let unpacked = plain.find_grasp(request).await.unwrap();
    assert_eq!(packed.into_inner().grasps, unpacked.into_inner().grasps);
    let mut objects = server.objects().await.send_compressed(Gzip);
    let object = objects.create_object(box_request("crate")).await.unwrap();
    assert_eq!(object.into_inner().triangle_count, 12);
}

#[tokio::test(flavor = "multi_thread")]
async fn large_answers_are_packed_for_clients_that_accept_it() {
    let server = TestServer::start().await;
    let get = || v1::GetMeshRequest {
        name: "objects/remote".to_owned(),
    };
    let mut glb = Vec::new();
    for accepts in [false, true] {
        let mut objects = server.objects().await;
        if accepts {
            objects = objects.accept_compressed(Gzip);
        }
        let answer = objects.get_mesh(get()).await.unwrap();
        let encoding = answer.metadata().get("grpc-encoding").cloned();
        assert_eq!(encoding.is_some_and(|encoding| encoding == "gzip"), accepts);
        let mut parts = answer.into_inner();
        let mut pieces = Vec::new();
        while let Some(part) = parts.message().await.unwrap() {
            pieces.extend(part.piece);
        }
        glb.push(pieces);
    }
    assert!(glb[0].len() > 1000 && glb[0] == glb[1]);
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_of_small_messages_are_not_packed() {
    let server = TestServer::start().await;
    let mut grasps = server.grasps().await.accept_compressed(Gzip);
    let request = v1::StreamGraspsRequest::from(floating_remote()).with_budget(Duration::from_millis(50));
    let answer = grasps.stream_grasps(request).await.unwrap();
    assert_eq!(answer.metadata().get("grpc-encoding"), None);
    let mut stream = answer.into_inner();
    let mut messages = 0;
    while stream.message().await.unwrap().is_some() {
        messages += 1;
    }
    assert!(messages >= 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn messages_that_are_too_large_once_unpacked_are_refused() {
    let server =
        TestServer::start_with(|config| config.maximum_object_bytes = (1 << 20).try_into().unwrap()).await;
    let mut objects = server.objects().await.send_compressed(Gzip);
    let mut grasps = server.grasps().await.send_compressed(Gzip);
    // 40 MB of one letter take 40 kB.
    let bomb = v1::CreateObjectRequest {
        mesh: vec![b'\n'; 40_000_000],
        ..box_request("bomb")
    };
    // The bound of a method that takes no mesh is its own, though the packed message is smaller than that.
    let name = "n".repeat(1 << 20);
    let find = v1::FindGraspRequest::new(name.clone());
    for status in [
        objects.create_object(bomb).await.unwrap_err(),
        objects
            .get_object(v1::GetObjectRequest { name })
            .await
            .unwrap_err(),
        grasps.find_grasp(find).await.unwrap_err(),
    ] {
        assert_status(&status, Code::OutOfRange, "MESSAGE_TOO_LARGE");
    }
    // A message that is not packed as declared is the client's fault.
    let mut body = framed_bytes(b"no gzip");
    body[0] = 1;
    let headers = [("grpc-encoding", "gzip")];
    let answer = answer_over_http_2(&server, "ObjectService/GetObject", &headers, body).await;
    assert_status(
        &answer.status_in_headers(),
        Code::InvalidArgument,
        "MALFORMED_MESSAGE",
    );
}
