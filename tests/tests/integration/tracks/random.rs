//! Random messages in random order: whatever comes, a track answers wrong frames by name and goes on, or ends with a status that names
//! a message that is none; its answers are in order, and nothing queues.

use std::{
    collections::BTreeSet,
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

use grasp_proto::v1::{self, presenting_hand::Form, track_holdout_request::Message};
use grasp_tests::TestServer;
use rand::{Rng, RngExt as _, SeedableRng as _, seq::IndexedRandom as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status};

use super::{frame, open, setup, swaying};
use crate::fixtures::{blamed_fields, bounded, floating_remote, until};

/// Tracks of random messages.
const TRACKS: u64 = 40;

/// A way to make a right frame wrong with a wrong number, and the field that is to blame.
type Fault = (&'static str, fn(&mut v1::TrackFrame, f32));

/// All of them.
const FAULTS: [Fault; 13] = [
    ("frame.client_from_object.position", |frame, wrong| {
        position(frame).x = wrong;
    }),
    ("frame.client_from_object.orientation", |frame, wrong| {
        pose(frame).orientation = Some(v1::Quaternion {
            w: wrong,
            ..Default::default()
        });
    }),
    ("frame.client_from_object.orientation", |frame, _| {
        pose(frame).orientation = Some(v1::Quaternion::default());
    }),
    ("frame.presenting_hand", |frame, _| {
        frame.presenting_hand = Some(v1::PresentingHand { form: None });
    }),
    ("frame.presenting_hand.angles.rig", |frame, _| {
        "claw".clone_into(&mut angles(frame).rig);
    }),
    ("frame.presenting_hand.angles.digits", |frame, _| {
        angles(frame).digits.truncate(3);
    }),
    (
        "frame.presenting_hand.angles.digits[0].base_pitch",
        |frame, wrong| {
            angles(frame).digits[0].base_pitch = wrong;
        },
    ),
    ("frame.presenting_hand.joints.joints", |frame, _| {
        frame.presenting_hand = Some(v1::PresentingHand {
            form: Some(Form::Joints(v1::HandJoints {
                handedness: v1::Handedness::Left.into(),
                joint_set: v1::JointSet::Openxr26.into(),
                joints: vec![v1::JointPose::default(); 7],
            })),
        });
    }),
    ("frame.other_hands", |frame, _| {
        frame.other_hands = vec![v1::PresentingHand::default(); 9];
    }),
    ("frame.obstacles", |frame, _| {
        frame.obstacles = vec![v1::Obstacle { shape: None }; 2];
    }),
    ("frame.up", |frame, _| {
        // A direction of any length will do.
        frame.up = Some(v1::Vector3::default());
    }),
    ("frame.capture_time", |frame, _| {
        frame.capture_time = Some(prost_types::Duration {
            seconds: i64::MAX,
            nanos: -1,
        });
    }),
    ("frame.receiving_hand", |frame, _| {
        frame.receiving_hand = Some(v1::HandAngles::default());
    }),
];

fn pose(frame: &mut v1::TrackFrame) -> &mut v1::Pose {
    frame.client_from_object.as_mut().expect("the frame has a pose")
}

fn position(frame: &mut v1::TrackFrame) -> &mut v1::Vector3 {
    pose(frame).position.as_mut().expect("the pose has a position")
}

fn angles(frame: &mut v1::TrackFrame) -> &mut v1::HandAngles {
    match frame.presenting_hand.as_mut().and_then(|hand| hand.form.as_mut()) {
        Some(Form::Angles(angles)) => angles,
        other => panic!("{other:?} are no angles"),
    }
}

/// A frame that is wrong in one to three ways, and what is to blame.
fn wrong_frame(sequence: u64, random: &mut impl Rng) -> (v1::TrackFrame, &'static str) {
    let mut wrong = frame(sequence, swaying(sequence));
    let &value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e30]
        .choose(random)
        .expect("there are some");
    let &(field, spoil) = FAULTS.choose(random).expect("there are some");
    spoil(&mut wrong, value);
    (wrong, field)
}

/// A message of a random track, and the field to blame if it is wrong. `last` is the largest number of a frame.
fn message(last: &mut Option<u64>, random: &mut impl Rng) -> (Option<Message>, Option<&'static str>) {
    let next = last.map_or(0, |last| last + random.random_range(1..4_u64));
    match (random.random_range(0..40_u32), *last) {
        (0, _) => (None, Some("frame")),
        (1, _) => (
            Some(Message::Setup(setup(v1::TrackPolicy::default()))),
            Some("setup"),
        ),
        (2 | 3, Some(last)) => {
            // Once more, or an earlier one.
            let early = last - random.random_range(0..=last);
            let timeless = v1::TrackFrame {
                capture_time: None,
                ..frame(early, swaying(early))
            };
            (Some(Message::Frame(timeless)), Some("frame.sequence"))
        }
        (5..8, _) => {
            let (frame, field) = wrong_frame(next, random);
            (Some(Message::Frame(frame)), Some(field))
        }
        (kind, _) => {
            *last = Some(next);
            let mut right = frame(next, swaying(next));
            match kind {
                8..12 => right.capture_time = None,
                12..16 => right.presenting_hand = None,
                16..20 => right.client_from_object = None,
                20..24 => right.committed = true,
                _ => {}
            }
            (Some(Message::Frame(right)), None)
        }
    }
}

/// Fails unless a status is that of a wrong message, and names the field.
fn assert_blames(status: &Status, field: &str, what: &str) {
    assert_eq!(status.code(), Code::InvalidArgument, "{what}: {status:?}");
    let blamed = blamed_fields(status);
    assert!(
        blamed.iter().any(|blamed| blamed.starts_with(field)),
        "{what}: {field} in {blamed:?}"
    );
}

/// Fails unless the server answers as if nothing had happened, and keeps nothing of the tracks.
async fn assert_unharmed(server: &TestServer) {
    until("the end of the tracks", || server.gauges().tracks() == 0).await;
    until("the end of the calls", || server.gauges().calls() == 0).await;
    until("the end of the searches", || server.gauges().searches() == 0).await;
    let asked = server.grasps().await.find_grasp(floating_remote()).await;
    let answer = asked.expect("the server answers").into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::Found);
}

/// Sends random messages with random pauses, and reads to the end.
async fn random_track(server: &TestServer, seed: u64) {
    let what = format!("seed {seed}");
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let (sender, sent) = mpsc::channel(64);
    let first = Some(Message::Setup(setup(v1::TrackPolicy::default())));
    sender
        .send(v1::TrackHoldoutRequest { message: first })
        .await
        .unwrap();
    let mut grasps = server.grasps().await;
    let answers = grasps.track_holdout(ReceiverStream::new(sent)).await;
    let mut answers = answers.expect("the setup is right").into_inner();
    let sending = async {
        let (mut last, mut sent_frames, mut blamed) = (None, Vec::new(), None);
        for _ in 0..random.random_range(1..30_u32) {
            let (message, field) = message(&mut last, &mut random);
            match &message {
                Some(Message::Frame(frame)) => sent_frames.push((frame.sequence, field)),
                _ => blamed = field,
            }
            let sent = sender.send(v1::TrackHoldoutRequest { message }).await;
            sent.expect("nothing that ends a track came before");
            if blamed.is_some() {
                break;
            }
            if random.random_bool(0.3) {
                tokio::time::sleep(Duration::from_millis(random.random_range(0..20))).await;
            }
        }
        // A track with a message that is none must end though its client goes on.
        let open = blamed.is_some().then_some(sender);
        (sent_frames, blamed, open)
    };
    let reading = async {
        let mut answered = Vec::new();
        loop {
            match bounded("an answer or the end", answers.message()).await {
                Ok(Some(response)) => answered.push(response.answer.expect("it is set")),
                Ok(None) => return (answered, None),
                Err(status) => return (answered, Some(status)),
            }
        }
    };
    let ((sent_frames, blamed, _open), (answered, status)) = tokio::join!(sending, reading);
    let mut accounted = 0;
    for answer in answered {
        accounted += answer.skipped_frames as usize;
        let (sequence, field) = sent_frames[accounted];
        assert_eq!(answer.sequence, sequence, "{what}");
        assert_warns(&answer, field, &what);
        accounted += 1;
    }
    match (blamed, status) {
        (Some(field), Some(status)) => assert_blames(&status, field, &what),
        (None, None) => assert_eq!(accounted, sent_frames.len(), "{what}"),
        (blamed, status) => panic!("{what}: {blamed:?} ended with {status:?}"),
    }
}

/// Fails unless the answer to a frame names the field that is wrong with it, and only then has none.
fn assert_warns(answer: &v1::TrackAnswer, field: Option<&str>, what: &str) {
    let standing = answer.standing.as_ref().expect("it is set");
    let Some(field) = field else {
        assert_eq!(answer.warnings, [""; 0], "{what}");
        assert_ne!(standing.no_grasp(), v1::NoGraspReason::WrongFrame, "{what}");
        return;
    };
    let mut warnings = answer.warnings.iter();
    assert!(
        warnings.any(|warning| warning.starts_with(field)),
        "{what}: {field} in {:?}",
        answer.warnings
    );
    if field != "frame.sequence" {
        assert_eq!(standing.no_grasp(), v1::NoGraspReason::WrongFrame, "{what}");
        assert!(answer.grasp.is_none(), "{what}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_comes_a_track_answers_it_or_ends_with_what_was_wrong() {
    let server = TestServer::start().await;
    let mut tracks = tokio::task::JoinSet::new();
    let server = std::sync::Arc::new(server);
    for seed in 0..TRACKS {
        let server = std::sync::Arc::clone(&server);
        tracks.spawn(async move { random_track(&server, seed).await });
        if seed % 4 == 3 {
            while let Some(ended) = tracks.join_next().await {
                ended.expect("the track keeps its promises");
            }
        }
    }
    assert_unharmed(&server).await;
    std::sync::Arc::into_inner(server)
        .expect("no track is left")
        .stop()
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_fault_is_blamed_on_its_field() {
    let server = TestServer::start().await;
    let (_answers, track) = open::open(&server).await;
    for (number, (field, spoil)) in FAULTS.iter().enumerate() {
        for value in [f32::NAN, f32::INFINITY, -1e30] {
            let mut wrong = frame(1, swaying(1));
            spoil(&mut wrong, value);
            let status = open::push(&server, &track, wrong).await.unwrap_err();
            assert_blames(&status, field, &format!("fault {number} with {value}"));
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_reads_at_random_gets_the_newest_frames_and_an_account_of_the_others() {
    let server = TestServer::start().await;
    for seed in 0..3 {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut pauses = Xoshiro256PlusPlus::seed_from_u64(!seed);
        let super::Tracked { frames, mut answers } =
            super::Tracked::remote(&server, v1::TrackPolicy::default()).await;
        let last = 300;
        let sending = async move {
            for sequence in 0..=last {
                let message = Some(Message::Frame(frame(sequence, swaying(sequence))));
                frames.send(v1::TrackHoldoutRequest { message }).await.unwrap();
                if random.random_bool(0.2) {
                    tokio::time::sleep(Duration::from_millis(random.random_range(0..8))).await;
                }
            }
        };
        let reading = async {
            let mut next = 0;
            while let Some(response) = bounded("an answer", answers.message()).await.unwrap() {
                let answer = response.answer.unwrap();
                // Every frame is answered or overtaken by the next one that is.
                assert_eq!(
                    answer.sequence,
                    next + u64::from(answer.skipped_frames),
                    "seed {seed}"
                );
                next = answer.sequence + 1;
                if pauses.random_bool(0.5) {
                    tokio::time::sleep(Duration::from_millis(pauses.random_range(0..40))).await;
                }
            }
            next
        };
        let ((), next) = tokio::join!(sending, reading);
        assert_eq!(next, last + 1, "seed {seed}: the last frame is answered");
    }
    assert_unharmed(&server).await;
    server.stop().await;
}

/// Pushes random frames, of which every third or so is wrong; the numbers of those that were the latest.
async fn push_at_random(server: &TestServer, track: &str, numbers: &AtomicU64, seed: u64) -> Vec<u64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut grasps = server.grasps().await;
    let mut latest = Vec::new();
    for _ in 0..60 {
        let sequence = numbers.fetch_add(1, Ordering::Relaxed);
        let (pushed, field) = if random.random_bool(0.3) {
            let (frame, field) = wrong_frame(sequence, &mut random);
            (frame, Some(field))
        } else {
            (frame(sequence, swaying(sequence)), None)
        };
        let request = v1::PushFrameRequest {
            track: track.to_owned(),
            frame: Some(pushed),
        };
        match (bounded("the push", grasps.push_frame(request)).await, field) {
            (Ok(pushed), None) => {
                if !pushed.into_inner().overtaken {
                    latest.push(sequence);
                }
            }
            // What was overtaken is not looked at.
            (Ok(pushed), Some(field)) => assert!(pushed.into_inner().overtaken, "{field} was not blamed"),
            (Err(status), Some(field)) => assert_blames(&status, field, &format!("seed {seed}")),
            (Err(status), None) => panic!("frame {sequence} is right: {status:?}"),
        }
        if random.random_bool(0.3) {
            tokio::time::sleep(Duration::from_millis(random.random_range(0..10))).await;
        }
    }
    latest
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_that_push_to_one_track_at_random_get_its_answers_in_order() {
    let server = TestServer::start().await;
    let (mut answers, track) = open::open(&server).await;
    let numbers = AtomicU64::new(0);
    let pushing = async {
        let [a, b, c] = [1, 2, 3].map(|seed| push_at_random(&server, &track, &numbers, seed));
        let (a, b, c) = tokio::join!(a, b, c);
        let last = numbers.fetch_add(1, Ordering::Relaxed);
        let is_overtaken = open::push(&server, &track, frame(last, swaying(last))).await;
        assert!(!is_overtaken.unwrap(), "it is the latest");
        let accepted: BTreeSet<u64> = [a, b, c, vec![last]].into_iter().flatten().collect();
        accepted
    };
    let reading = async {
        let mut answered: Vec<v1::TrackAnswer> = Vec::new();
        // As many as are pushed; the last one cannot be overtaken.
        while answered.last().is_none_or(|answer| answer.sequence < 180) {
            answered.push(open::next(&mut answers).await);
        }
        answered
    };
    let (accepted, answered) = tokio::join!(pushing, reading);
    let sequences: Vec<u64> = answered.iter().map(|answer| answer.sequence).collect();
    assert!(sequences.is_sorted_by(|a, b| a < b), "{sequences:?}");
    assert!(sequences.iter().all(|sequence| accepted.contains(sequence)));
    let skipped: u64 = answered
        .iter()
        .map(|answer| u64::from(answer.skipped_frames))
        .sum();
    assert_eq!(answered.len() as u64 + skipped, accepted.len() as u64);
    assert_eq!(sequences.last(), accepted.last());
    drop(answers);
    assert_unharmed(&server).await;
    server.stop().await;
}
