//! What headsets send now and then: hands that have lost tracking, times and numbers out of order. It is answered in its frame, and the
//! track goes on.

use glam::Vec3;
use grasp_proto::v1::{self, CurrentGraspStatus, presenting_hand::Form};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout, wire_pose};

use super::{
    Tracked, assert_blames, assert_wrong,
    created::{Created, overtaken},
    frame_of, held, pose_of, remote, time_of, wrist_of,
};

/// The built-in holdout of the remote, given by joints, moved together.
fn frame(sequence: u64, moved: Pose) -> v1::TrackFrame {
    let built_in = grasp_assets::holdouts::holdouts();
    let of_remote = built_in.iter().find(|holdout| holdout.object == "remote");
    let mut holdout = ClientHoldout::of_built_in(of_remote.expect("it is built in"));
    holdout.client_from_object = moved * holdout.client_from_object;
    holdout.giver = holdout.giver.transformed(moved);
    frame_of(sequence, holdout.request("objects/remote"))
}

fn joints_of(frame: &mut v1::TrackFrame) -> &mut Vec<v1::JointPose> {
    let holdout = frame.holdout.as_mut().expect("it is set");
    match holdout
        .presenting_hand
        .as_mut()
        .and_then(|hand| hand.form.as_mut())
    {
        Some(Form::Joints(joints)) => &mut joints.joints,
        _ => panic!("the giver is given by joints"),
    }
}

/// The giver's hand of a frame.
fn hands_of(frame: v1::TrackFrame) -> Vec<v1::PresentingHand> {
    let holdout = frame.holdout.into_iter();
    holdout.filter_map(|holdout| holdout.presenting_hand).collect()
}

/// A field that is to blame, and a way to lose a hand.
type Loss = (&'static str, fn(&mut Vec<v1::JointPose>));

/// The ways in which headsets say that a hand is lost.
const LOSSES: [Loss; 7] = [
    ("holdout.presenting_hand.joints.joints", |joints| {
        let nowhere = v1::JointPose {
            pose: Some(wire_pose(Pose::IDENTITY)),
            radius: 0.0,
        };
        joints.fill(nowhere);
    }),
    ("holdout.presenting_hand.joints.joints[0].pose", |joints| {
        joints.fill(v1::JointPose::default());
    }),
    ("holdout.presenting_hand.joints.joints", Vec::clear),
    ("holdout.presenting_hand.joints.joints[9]", |joints| {
        joints[9].pose = Some(wire_pose(Pose::from_position(Vec3::Y * 9.0)));
    }),
    ("holdout.presenting_hand.joints.joints[3].pose", |joints| {
        let pose = joints[3].pose.as_mut().expect("it is set");
        pose.position.as_mut().expect("it is set").x = f32::NAN;
    }),
    ("holdout.presenting_hand.joints.joints[4].pose", |joints| {
        let pose = joints[4].pose.as_mut().expect("it is set");
        pose.orientation = Some(v1::Quaternion::default());
    }),
    ("holdout.presenting_hand.joints.joints[7].radius", |joints| {
        joints[7].radius = -1.0;
    }),
];

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_hand_is_where_it_was_at_the_object_and_its_joints_are_named() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let pushed = Created::remote(&server).await;
    let found = track.ask(frame(0, Pose::IDENTITY)).await.grasp.expect("a grasp");
    pushed.ask(frame(0, Pose::IDENTITY)).await;
    let mut sequence = 0;
    for (field, lose) in LOSSES {
        sequence += 1;
        let moved = Pose::from_position(Vec3::X * 0.01 * sequence as f32);
        let mut lost = frame(sequence, moved);
        lose(joints_of(&mut lost));
        let answer = track.ask(lost.clone()).await;
        assert_eq!(answer.status(), CurrentGraspStatus::Kept, "{field}: {answer:?}");
        assert_blames(&answer, field);
        let grasp = answer.grasp.as_ref().expect("answers are full");
        assert_eq!(grasp.object_from_wrist(), found.object_from_wrist());
        // As far from the giver as with the hand where it was.
        let [now, before] = [grasp, &found].map(|grasp| {
            let clearance = grasp.margin(v1::Check::GiverClearance);
            clearance.expect("there is a giver")
        });
        assert!((now - before).abs() < 1e-5, "{field}: {now} {before}");
        let expected = moved * pose_of(found.client_from_wrist());
        let wrist = wrist_of(&answer);
        assert!(wrist.position.distance(expected.position) < 1e-4);

        let answer = pushed.ask(lost).await;
        assert_eq!(answer.status(), CurrentGraspStatus::Kept, "{field}");
        assert_blames(&answer, field);

        sequence += 1;
        let back = track.ask(frame(sequence, moved)).await;
        assert_eq!(back.status(), CurrentGraspStatus::Kept, "{field}");
        assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_any_hand_before_a_lost_one_has_no_grasp_and_the_next_frame_one() {
    let server = TestServer::start().await;
    let pushed = Created::remote(&server).await;
    let mut track = Tracked::remote(&server).await;
    let mut lost = frame(0, Pose::IDENTITY);
    LOSSES[0].1(joints_of(&mut lost));
    for answer in [track.ask(lost.clone()).await, pushed.ask(lost).await] {
        assert_wrong(&answer, LOSSES[0].0);
    }
    let good = frame(1, Pose::IDENTITY);
    for answer in [track.ask(good.clone()).await, pushed.ask(good).await] {
        assert_eq!(answer.status(), CurrentGraspStatus::Replanned);
        assert!(answer.grasp.is_some() && answer.warnings.is_empty());
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn times_and_numbers_out_of_order_are_answered_with_a_warning() {
    let server = TestServer::start().await;
    let track = v1::Track {
        prediction_horizon: Some(crate::fixtures::milliseconds(30)),
        ..remote()
    };
    let mut track = Tracked::of(&server, track).await;
    let at = |sequence: u64, time: Option<u64>| v1::TrackFrame {
        capture_time: time.map(|time| grasp_proto::wire_duration(time_of(time))),
        ..frame(sequence, Pose::IDENTITY)
    };
    for (frame, field) in [
        (at(5, Some(100)), None),
        (at(6, Some(101)), None),
        (at(7, Some(100)), Some("capture_time")),
        (at(8, Some(101)), None),
        // A restarted clock.
        (at(9, Some(0)), Some("capture_time")),
        (at(10, Some(1)), None),
        (at(10, Some(2)), Some("sequence")),
        (at(3, Some(3)), Some("sequence")),
        // A restarted counter.
        (at(4, Some(4)), None),
        (at(5, None), Some("capture_time")),
        (at(6, Some(5)), None),
    ] {
        let (sequence, time) = (frame.sequence, frame.capture_time);
        let answer = track.ask(frame).await;
        let current = answer.current.as_ref().unwrap();
        let is_first = current.failed_check.is_none() && sequence == 5 && field.is_none();
        assert!(
            answer.status() == CurrentGraspStatus::Kept || is_first,
            "{sequence} {time:?}: {answer:?}"
        );
        match field {
            Some(field) => assert_blames(&answer, field),
            None => assert_eq!(answer.warnings, [""; 0], "{sequence} {time:?}"),
        }
    }
    // Pushed frames may overtake each other, but their clock may be restarted.
    let pushed = Created::remote(&server).await;
    for (frame, warnings) in [(at(5, Some(9)), 0), (at(6, Some(2)), 1)] {
        assert_eq!(pushed.ask(frame).await.warnings.len(), warnings);
    }
    let late = pushed.push(at(6, Some(10))).await.unwrap();
    assert_eq!(late, overtaken(6));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn other_hands_that_are_lost_are_where_they_were() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let with_other = |sequence: u64| {
        let far = frame(sequence, Pose::from_position(Vec3::Z * 0.5));
        held(frame(sequence, Pose::IDENTITY), |holdout| {
            holdout.other_hands = hands_of(far);
        })
    };
    let first = track.ask(with_other(0)).await;
    assert!(first.grasp.is_some());
    let mut hand = frame(1, Pose::IDENTITY);
    LOSSES[0].1(joints_of(&mut hand));
    let lost = held(with_other(1), |holdout| holdout.other_hands = hands_of(hand));
    let answer = track.ask(lost).await;
    assert_eq!(answer.status(), CurrentGraspStatus::Kept);
    assert_blames(&answer, "holdout.other_hands[0].joints.joints");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_frame_is_answered_with_every_violation_and_the_track_goes_on() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let found = track.ask(frame(0, Pose::IDENTITY)).await;
    let cases: [(v1::TrackFrame, &[&str]); 4] = [
        (
            held(frame(1, Pose::IDENTITY), |holdout| {
                holdout.client_from_object = Some(v1::Pose {
                    position: Some(Vec3::new(f32::NAN, 0.0, 0.0).into()),
                    orientation: Some(v1::Quaternion::default()),
                });
                holdout.presenting_hand = Some(v1::PresentingHand { form: None });
            }),
            &[
                "holdout.client_from_object.position",
                "holdout.client_from_object.orientation",
                "holdout.presenting_hand",
            ],
        ),
        (
            held(frame(3, Pose::IDENTITY), |holdout| {
                holdout.obstacles = vec![v1::Shape { kind: None }; 2];
                holdout.up = Some(v1::Vector3::default());
                (holdout.scale, holdout.mass_kg) = (Some(1.0), Some(1.0));
            }),
            &[
                "holdout.obstacles[0]",
                "holdout.obstacles[1]",
                "holdout.up",
                "holdout.scale",
                "holdout.mass_kg",
            ],
        ),
        (
            v1::TrackFrame {
                receiver: Some(v1::Receiver {
                    rig: "rigs/adult".to_owned(),
                    handedness: v1::Handedness::Right.into(),
                    scale: Some(1.0),
                    both_hands: true,
                    ..Default::default()
                }),
                ..frame(5, Pose::IDENTITY)
            },
            &[
                "receiver.rig",
                "receiver.handedness",
                "receiver.scale",
                "receiver.both_hands",
            ],
        ),
        (
            held(frame(7, Pose::IDENTITY), |holdout| {
                "objects/missing".clone_into(&mut holdout.object);
            }),
            &["holdout.object"],
        ),
    ];
    for (wrong, fields) in cases {
        let next = wrong.sequence + 1;
        let answer = track.ask(wrong).await;
        for field in fields {
            assert_wrong(&answer, field);
        }
        let answer = track.ask(frame(next, Pose::IDENTITY)).await;
        assert_eq!(answer.status(), CurrentGraspStatus::Kept, "{answer:?}");
        assert_eq!(
            answer.grasp.unwrap().object_from_wrist(),
            found.grasp.as_ref().unwrap().object_from_wrist()
        );
    }
    server.stop().await;
}
