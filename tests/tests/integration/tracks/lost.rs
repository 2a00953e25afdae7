//! What headsets send now and then: hands that have lost tracking, times and numbers out of order. It is answered in its frame, and the
//! track goes on.

use glam::Vec3;
use grasp_proto::v1::{self, StandingStatus, presenting_hand::Form};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout, wire_pose};

use super::{Tracked, open, pose_of, status_of, time_of};

/// The built-in holdout of the remote, given by joints, moved together.
fn frame(sequence: u64, moved: Pose) -> v1::TrackFrame {
    let built_in = grasp_assets::holdouts::holdouts();
    let of_remote = built_in.iter().find(|holdout| holdout.object == "remote");
    let mut holdout = ClientHoldout::of_built_in(of_remote.expect("it is built in"));
    holdout.client_from_object = moved * holdout.client_from_object;
    holdout.giver = holdout.giver.transformed(moved);
    let request = holdout.request("objects/remote");
    v1::TrackFrame {
        sequence,
        capture_time: Some(time_of(sequence)),
        client_from_object: request.client_from_object,
        presenting_hand: request.presenting_hand,
        ..Default::default()
    }
}

fn joints_of(frame: &mut v1::TrackFrame) -> &mut Vec<v1::JointPose> {
    match frame.presenting_hand.as_mut().and_then(|hand| hand.form.as_mut()) {
        Some(Form::Joints(joints)) => &mut joints.joints,
        _ => panic!("the giver is given by joints"),
    }
}

/// A field that is to blame, and a way to lose a hand.
type Loss = (&'static str, fn(&mut Vec<v1::JointPose>));

/// The ways in which headsets say that a hand is lost.
const LOSSES: [Loss; 7] = [
    ("frame.presenting_hand.joints.joints", |joints| {
        let nowhere = v1::JointPose {
            client_from_joint: Some(wire_pose(Pose::IDENTITY)),
            radius: 0.0,
        };
        joints.fill(nowhere);
    }),
    (
        "frame.presenting_hand.joints.joints[0].client_from_joint",
        |joints| {
            joints.fill(v1::JointPose::default());
        },
    ),
    ("frame.presenting_hand.joints.joints", Vec::clear),
    ("frame.presenting_hand.joints.joints[9]", |joints| {
        joints[9].client_from_joint = Some(wire_pose(Pose::from_position(Vec3::Y * 9.0)));
    }),
    (
        "frame.presenting_hand.joints.joints[3].client_from_joint",
        |joints| {
            let pose = joints[3].client_from_joint.as_mut().expect("it is set");
            pose.position.as_mut().expect("it is set").x = f32::NAN;
        },
    ),
    (
        "frame.presenting_hand.joints.joints[4].client_from_joint",
        |joints| {
            let pose = joints[4].client_from_joint.as_mut().expect("it is set");
            pose.orientation = Some(v1::Quaternion::default());
        },
    ),
    ("frame.presenting_hand.joints.joints[7].radius", |joints| {
        joints[7].radius = -1.0;
    }),
];

fn assert_blames(answer: &v1::TrackAnswer, field: &str) {
    assert!(
        answer.warnings.iter().any(|warning| warning.starts_with(field)),
        "{field} in {:?}",
        answer.warnings
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_hand_is_where_it_was_at_the_object_and_its_joints_are_named() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let (mut pushed, name) = open::open(&server).await;
    let found = track.ask(frame(0, Pose::IDENTITY)).await.grasp.expect("a grasp");
    open::push(&server, &name, frame(0, Pose::IDENTITY))
        .await
        .unwrap();
    open::next(&mut pushed).await;
    let mut sequence = 0;
    for (field, lose) in LOSSES {
        sequence += 1;
        let moved = Pose::from_position(Vec3::X * 0.01 * sequence as f32);
        let mut lost = frame(sequence, moved);
        lose(joints_of(&mut lost));
        let answer = track.ask(lost.clone()).await;
        assert_eq!(status_of(&answer), StandingStatus::Kept, "{field}: {answer:?}");
        assert_blames(&answer, field);
        let grasp = answer.grasp.as_ref().expect("answers are full");
        assert_eq!(grasp.object_from_wrist, found.object_from_wrist);
        // As far from the giver as with the hand where it was.
        let margins = grasp.margins.as_ref().expect("it is physical");
        let before = found.margins.as_ref().expect("it is physical");
        let [now, before] = [margins, before].map(|margins| margins.giver_clearance.expect("a giver"));
        assert!((now - before).abs() < 1e-5, "{field}: {now} {before}");
        let expected = moved * pose_of(found.client_from_wrist);
        assert!(
            pose_of(answer.client_from_wrist)
                .position
                .distance(expected.position)
                < 1e-4
        );

        assert!(!open::push(&server, &name, lost).await.unwrap(), "{field}");
        let answer = open::next(&mut pushed).await;
        assert_eq!(
            (answer.sequence, status_of(&answer)),
            (sequence, StandingStatus::Kept)
        );
        assert_blames(&answer, field);

        sequence += 1;
        let back = track.ask(frame(sequence, moved)).await;
        assert_eq!(status_of(&back), StandingStatus::Kept, "{field}");
        assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_any_hand_before_a_lost_one_has_no_grasp_and_the_next_frame_one() {
    let server = TestServer::start().await;
    let (mut pushed, name) = open::open(&server).await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let mut lost = frame(0, Pose::IDENTITY);
    LOSSES[0].1(joints_of(&mut lost));
    open::push(&server, &name, lost.clone()).await.unwrap();
    for answer in [track.ask(lost).await, open::next(&mut pushed).await] {
        let standing = answer.standing.as_ref().unwrap();
        assert_eq!(
            (standing.status(), standing.no_grasp()),
            (StandingStatus::None, v1::NoGraspReason::WrongFrame)
        );
        assert!(answer.grasp.is_none());
        assert_blames(&answer, LOSSES[0].0);
    }
    let good = frame(1, Pose::IDENTITY);
    open::push(&server, &name, good.clone()).await.unwrap();
    for answer in [track.ask(good).await, open::next(&mut pushed).await] {
        assert_eq!(status_of(&answer), StandingStatus::Replanned);
        assert!(answer.grasp.is_some() && answer.warnings.is_empty());
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn times_and_numbers_out_of_order_are_answered_with_a_warning() {
    let server = TestServer::start().await;
    let policy = v1::TrackPolicy {
        predict_ahead: Some(crate::fixtures::milliseconds(30)),
        ..Default::default()
    };
    let mut track = Tracked::remote(&server, policy).await;
    let at = |sequence: u64, time: Option<u64>| v1::TrackFrame {
        capture_time: time.map(time_of),
        ..frame(sequence, Pose::IDENTITY)
    };
    for (frame, field) in [
        (at(5, Some(100)), None),
        (at(6, Some(101)), None),
        (at(7, Some(100)), Some("frame.capture_time")),
        (at(8, Some(101)), None),
        // A restarted clock.
        (at(9, Some(0)), Some("frame.capture_time")),
        (at(10, Some(1)), None),
        (at(10, Some(2)), Some("frame.sequence")),
        (at(3, Some(3)), Some("frame.sequence")),
        // A restarted counter.
        (at(4, Some(4)), None),
        (at(5, None), Some("frame.capture_time")),
        (at(6, Some(5)), None),
    ] {
        let (sequence, time) = (frame.sequence, frame.capture_time);
        let answer = track.ask(frame).await;
        let is_first = answer.standing.as_ref().unwrap().fall.is_none() && sequence == 5 && field.is_none();
        assert!(
            status_of(&answer) == StandingStatus::Kept || is_first,
            "{sequence} {time:?}: {answer:?}"
        );
        match field {
            Some(field) => assert_blames(&answer, field),
            None => assert_eq!(answer.warnings, [""; 0], "{sequence} {time:?}"),
        }
    }
    // Pushed frames may overtake each other, but their clock may be restarted.
    let (mut pushed, name) = open::open(&server).await;
    for (frame, overtaken) in [
        (at(5, Some(9)), false),
        (at(6, Some(2)), false),
        (at(6, Some(10)), true),
    ] {
        assert_eq!(open::push(&server, &name, frame).await.unwrap(), overtaken);
        if !overtaken {
            let answer = open::next(&mut pushed).await;
            assert_eq!(answer.warnings.len(), usize::from(answer.sequence == 6));
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn other_hands_that_are_lost_are_where_they_were() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let with_other = |sequence: u64| {
        let far = frame(sequence, Pose::from_position(Vec3::Z * 0.5));
        v1::TrackFrame {
            other_hands: far.presenting_hand.into_iter().collect(),
            ..frame(sequence, Pose::IDENTITY)
        }
    };
    let first = track.ask(with_other(0)).await;
    assert!(first.grasp.is_some());
    let mut lost = with_other(1);
    let mut hand = frame(1, Pose::IDENTITY);
    LOSSES[0].1(joints_of(&mut hand));
    lost.other_hands = hand.presenting_hand.into_iter().collect();
    let answer = track.ask(lost).await;
    assert_eq!(status_of(&answer), StandingStatus::Kept);
    assert_blames(&answer, "frame.other_hands[0].joints.joints");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_frame_is_answered_with_every_violation_and_the_track_goes_on() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let found = track.ask(frame(0, Pose::IDENTITY)).await;
    let cases: [(v1::TrackFrame, &[&str]); 3] = [
        (
            v1::TrackFrame {
                client_from_object: Some(v1::Pose {
                    position: Some(v1::Vector3 {
                        x: f32::NAN,
                        y: 0.0,
                        z: 0.0,
                    }),
                    orientation: Some(v1::Quaternion::default()),
                }),
                presenting_hand: Some(v1::PresentingHand { form: None }),
                ..frame(1, Pose::IDENTITY)
            },
            &[
                "frame.client_from_object.position",
                "frame.client_from_object.orientation",
                "frame.presenting_hand",
            ],
        ),
        (
            v1::TrackFrame {
                obstacles: vec![v1::Obstacle { shape: None }; 2],
                up: Some(v1::Vector3::default()),
                ..frame(3, Pose::IDENTITY)
            },
            &["frame.obstacles[0]", "frame.obstacles[1]", "frame.up"],
        ),
        (
            v1::TrackFrame {
                object: "objects/missing".to_owned(),
                ..frame(5, Pose::IDENTITY)
            },
            &["frame.object"],
        ),
    ];
    for (wrong, fields) in cases {
        let next = wrong.sequence + 1;
        let answer = track.ask(wrong).await;
        let standing = answer.standing.as_ref().unwrap();
        assert_eq!(
            (standing.status(), standing.no_grasp()),
            (StandingStatus::None, v1::NoGraspReason::WrongFrame)
        );
        for field in fields {
            assert_blames(&answer, field);
        }
        let answer = track.ask(frame(next, Pose::IDENTITY)).await;
        assert_eq!(status_of(&answer), StandingStatus::Kept, "{answer:?}");
        assert_eq!(
            answer.grasp.unwrap().object_from_wrist,
            found.grasp.as_ref().unwrap().object_from_wrist
        );
    }
    server.stop().await;
}
