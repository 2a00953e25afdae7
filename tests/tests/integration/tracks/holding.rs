//! The grasp of a track: at its start, through changes, while the giver moves, and while hands are lost.

use glam::Vec3;
use grasp_proto::v1::{self, CurrentGraspStatus, presenting_hand::Form};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout, wire_pose};

use super::{
    Created, Tracked, assert_blames, assert_wrong, frame, frame_of, held, overtaken, pose_of, remote,
    swaying, time_of, wrist_of,
};
use crate::fixtures::{find, milliseconds};

#[tokio::test(flavor = "multi_thread")]
async fn one_grasp_is_kept_alike_by_streams_pushes_and_calls_while_giver_and_object_move_together() {
    let server = TestServer::start().await;
    let sent = remote().with_seed(3);
    let created = server.grasps().await.create_track(sent.clone()).await;
    let created = created.unwrap().into_inner();
    let name = created.name.clone();
    let expected = v1::Track {
        name: name.clone(),
        ..sent.clone()
    };
    assert_eq!(created, expected);
    let pushed = Created {
        server: &server,
        name,
    };
    let first = pushed.ask(frame(0, swaying(0))).await;
    assert_eq!(first.status(), CurrentGraspStatus::Replanned);
    let found = first.grasp.expect("a grasp is found");
    let track = v1::Track {
        current: found.hand.clone(),
        ..sent.clone()
    };
    let mut streamed = Tracked::of(&server, track).await;
    streamed.ask(frame(0, swaying(0))).await;
    for sequence in 1..30 {
        let moved = frame(sequence, swaying(sequence));
        let answer = streamed.ask(moved.clone()).await;
        assert_eq!(
            answer.status(),
            CurrentGraspStatus::Kept,
            "frame {sequence}: {answer:?}"
        );
        let like = pushed.ask(moved.clone()).await;
        assert!(answer.server_time.is_some() && like.server_time.is_some());
        let like = v1::TrackAnswer {
            server_time: answer.server_time,
            ..like
        };
        assert_eq!(answer, like, "frame {sequence}");
        let grasp = answer.grasp.as_ref().expect("answers are full");
        let [hand, before] = [grasp, &found].map(|grasp| grasp.hand.as_ref().expect("it is set"));
        assert_eq!(
            (hand.object_from_wrist, hand.digits(), hand.handedness),
            (before.object_from_wrist, before.digits(), before.handedness),
            "frame {sequence}"
        );
        let expected = pose_of(Some(moved.client_from_object())) * pose_of(hand.object_from_wrist);
        let wrist = wrist_of(&answer);
        assert!(
            wrist.position.distance(expected.position) < 1e-5,
            "frame {sequence}"
        );

        let request = v1::FindGraspRequest {
            holdout: held(moved, |holdout| "objects/remote".clone_into(&mut holdout.object)).holdout,
            receiver: sent.receiver.clone(),
            search: sent.search,
            current: Some(found.current()),
            ..Default::default()
        };
        let called = find(&server, request).await;
        assert_eq!(
            (called.grasp(), called.current.as_ref()),
            (answer.grasp.as_ref(), answer.current.as_ref()),
            "frame {sequence}"
        );
    }
}

/// An obstacle as large as a fist in the palm of a grasp.
fn in_the_palm(answer: &v1::TrackAnswer) -> v1::Shape {
    let middle = wrist_of(answer).transform_point(Vec3::new(0.0, 0.02, -0.03));
    v1::Shape::capsule(middle, middle + Vec3::Y * 0.001, 0.03)
}

#[tokio::test(flavor = "multi_thread")]
async fn gives_a_committed_grasp_up_until_the_hand_no_longer_closes() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let first = track.ask(frame(0, swaying(0))).await;
    let committed = |sequence| v1::TrackFrame {
        committed: true,
        ..frame(sequence, swaying(0))
    };
    let kept = track.ask(committed(1)).await;
    assert_eq!(kept.status(), CurrentGraspStatus::Kept);
    let blocked = held(committed(2), |holdout| {
        holdout.obstacles = vec![in_the_palm(&first)];
    });
    let aborted = track.ask(blocked).await;
    assert_eq!(aborted.status(), CurrentGraspStatus::Aborted);
    assert!(aborted.grasp.is_none());
    let report = aborted.current.unwrap();
    let failed = report.failed_check.as_ref().unwrap();
    assert_eq!(failed.check(), v1::Check::ObstacleClearance);
    let withdrawal = report.withdrawal.clone().expect("a pose to withdraw to");
    let [from, to] = [
        first.grasp.unwrap().object_from_wrist(),
        withdrawal.object_from_wrist,
    ]
    .map(|wrist| pose_of(wrist).position);
    assert!((0.02..0.5).contains(&from.distance(to)), "{from} to {to}");
    // Nothing is in the way, but the hand has begun to withdraw.
    let still = track.ask(committed(3)).await.current.unwrap();
    assert_eq!(
        (still.status(), still.failed_check),
        (CurrentGraspStatus::Aborted, None)
    );
    assert_eq!(still.withdrawal, report.withdrawal);
    let again = track.ask(frame(4, swaying(0))).await;
    assert_eq!(again.status(), CurrentGraspStatus::Kept);
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_where_the_object_will_be_and_says_how_far_off_that_was() {
    let server = TestServer::start().await;
    let ahead = 33.333e-3;
    let track = v1::Track {
        prediction_horizon: Some(milliseconds(33)),
        ..remote()
    };
    let mut track = Tracked::of(&server, track).await;
    let drifting = |time: f32| Pose::from_position(Vec3::new(0.4 * time, 0.0, -0.2 * time));
    let mut last = None;
    let mut found = Pose::IDENTITY;
    for sequence in 0..12 {
        let time = sequence as f32 * 11.111e-3;
        let answer = track.ask(frame(sequence, drifting(time))).await;
        if let Some(grasp) = &answer.grasp {
            found = pose_of(grasp.object_from_wrist());
        }
        let held = pose_of(Some(frame(0, Pose::IDENTITY).client_from_object()));
        let expected = drifting(time + if sequence == 0 { 0.0 } else { ahead }) * held * found;
        assert!(
            wrist_of(&answer).position.distance(expected.position) < 5e-4,
            "frame {sequence}"
        );
        last = answer.last_prediction;
    }
    let error = last.expect("predictions have come true");
    assert!(
        error.object_distance < 1e-4 && error.object_angle < 1e-3,
        "{error:?}"
    );
    assert!(
        error.giver_distance.is_some_and(|distance| distance < 1e-4),
        "{error:?}"
    );
}

/// A track of the remote that begins with a hand.
fn track_with(hand: v1::HandPose) -> v1::Track {
    v1::Track {
        current: Some(hand),
        ..remote()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_begins_with_a_current_grasp() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let found = track.ask(frame(0, Pose::IDENTITY)).await.grasp.expect("a grasp");
    let hand = found.hand.clone().expect("it is set");
    let mut track = track_with(hand.clone());
    track.output_mut().changes_only = true;
    let mut next = Tracked::of(&server, track).await;
    let answer = next.ask(frame(0, Pose::IDENTITY)).await;
    assert_eq!(answer.status(), CurrentGraspStatus::Kept);
    let kept = answer.grasp.expect("it is kept");
    assert_eq!(kept.object_from_wrist(), found.object_from_wrist());
    assert!(!kept.contacts.is_empty(), "the first answer is whole");
    let answer = next.ask(frame(1, Pose::IDENTITY)).await;
    assert!(answer.grasp.expect("it is kept").contacts.is_empty());
    // An invalid hand is replaced by a grasp near it.
    let wrist = pose_of(found.object_from_wrist());
    let deep = v1::HandPose {
        object_from_wrist: Some(wire_pose(wrist * Pose::from_position(Vec3::Y * -0.03))),
        ..hand
    };
    let mut next = Tracked::of(&server, track_with(deep)).await;
    let answer = next.ask(frame(0, Pose::IDENTITY)).await;
    assert_eq!(answer.status(), CurrentGraspStatus::Replanned);
    let current = answer.current.unwrap();
    assert!(
        current.failed_check.is_some() && current.motion.is_some(),
        "{current:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_changes_its_object_and_begins_without_a_grasp_there() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    for sequence in 0..3 {
        track.ask(frame(sequence, Pose::IDENTITY)).await;
    }
    let free = |sequence| {
        held(frame(sequence, Pose::IDENTITY), |holdout| {
            holdout.presenting_hand = None;
        })
    };
    let other = |sequence| {
        held(free(sequence), |holdout| {
            "objects/scissors".clone_into(&mut holdout.object);
        })
    };
    let answer = track.ask(other(3)).await;
    let current = answer.current.clone().unwrap();
    assert_eq!(
        (current.status(), current.failed_check),
        (CurrentGraspStatus::Replanned, None)
    );
    let grasp = answer.grasp.expect("a grasp");
    // The grasp is of the scissors.
    let request = |object: &str| {
        v1::ValidateGraspRequest::new(object)
            .with_client_from_object(other(3).client_from_object())
            .with_pose(grasp.hand.clone().expect("it is set"))
    };
    let mut client = server.grasps().await;
    let valid = client.validate_grasp(request("objects/scissors")).await.unwrap();
    assert!(valid.into_inner().valid);
    let valid = client.validate_grasp(request("objects/remote")).await.unwrap();
    assert!(!valid.into_inner().valid);
    // The scissors stay the object of later frames.
    let kept = track.ask(free(4)).await;
    assert_eq!(kept.status(), CurrentGraspStatus::Kept);
    assert_eq!(kept.grasp.unwrap().object_from_wrist(), grasp.object_from_wrist());
    // The same with pushed frames.
    let pushed = Created::remote(&server).await;
    pushed.ask(frame(0, Pose::IDENTITY)).await;
    let answer = pushed.ask(other(1)).await;
    assert_eq!(answer.status(), CurrentGraspStatus::Replanned);
    let missing = held(frame(2, Pose::IDENTITY), |holdout| {
        "objects/missing".clone_into(&mut holdout.object);
    });
    assert_wrong(&pushed.ask(missing).await, "holdout.object");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_moves_with_frames_and_stays_in_those_without() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let with_shoulder = |sequence, client_shoulder: Option<Vec3>| v1::TrackFrame {
        receiver: client_shoulder.map(v1::Receiver::with_shoulder),
        ..frame(sequence, Pose::IDENTITY)
    };
    let far = Some(Vec3::new(0.3, 1.2, -2.0));
    let near = Some(Vec3::new(0.2, 1.4, 0.4));
    for (sequence, shoulder, is_near) in [
        (0, far, false),
        (1, None, false),
        (2, near, true),
        (3, None, true),
    ] {
        let answer = track.ask(with_shoulder(sequence, shoulder)).await;
        assert_eq!(answer.warnings, [""; 0]);
        assert_eq!(answer.grasp.is_some(), is_near, "{sequence}: {answer:?}");
        assert!(
            is_near || super::no_grasp(&answer) == v1::Check::Reach,
            "{answer:?}"
        );
    }
}

/// The built-in holdout of the remote, given by joints, moved together.
fn jointed(sequence: u64, moved: Pose) -> v1::TrackFrame {
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
    // A hand that is lost from the start has no grasp.
    let mut lost = jointed(0, Pose::IDENTITY);
    LOSSES[0].1(joints_of(&mut lost));
    assert_wrong(&track.ask(lost.clone()).await, LOSSES[0].0);
    assert_wrong(&pushed.ask(lost).await, LOSSES[0].0);
    let good = jointed(1, Pose::IDENTITY);
    pushed.ask(good.clone()).await;
    let first = track.ask(good).await;
    assert_eq!(first.status(), CurrentGraspStatus::Replanned);
    assert!(first.warnings.is_empty());
    let found = first.grasp.expect("a grasp");
    let mut sequence = 1;
    for (field, lose) in LOSSES {
        sequence += 1;
        let moved = Pose::from_position(Vec3::X * 0.01 * sequence as f32);
        let mut lost = jointed(sequence, moved);
        lose(joints_of(&mut lost));
        let answer = track.ask(lost.clone()).await;
        assert_eq!(answer.status(), CurrentGraspStatus::Kept, "{field}: {answer:?}");
        assert_blames(&answer, field);
        let grasp = answer.grasp.as_ref().expect("answers are full");
        assert_eq!(grasp.object_from_wrist(), found.object_from_wrist());
        // The distance from the giver is unchanged.
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
        let back = track.ask(jointed(sequence, moved)).await;
        assert_eq!(back.status(), CurrentGraspStatus::Kept, "{field}");
        assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    }
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
        ..jointed(sequence, Pose::IDENTITY)
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
}
