//! Tracking a giver who moves.

mod ends;
mod holding;

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, presenting_hand::Form, track_holdout_request::Message};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, wire_pose};
use rand::{Rng, RngExt as _, SeedableRng as _, seq::IndexedRandom as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status, Streaming};

use crate::fixtures::{blamed_fields, bounded, floating_remote, held_remote, until, with};

/// A track over one connection.
struct Tracked {
    frames: mpsc::Sender<v1::TrackHoldoutRequest>,
    answers: Streaming<v1::TrackAnswer>,
}

impl Tracked {
    /// Starts a track with a first message.
    async fn start(server: &TestServer, first: Message) -> Result<Self, Status> {
        // More than any test sends before it reads.
        let (frames, sent) = mpsc::channel(1024);
        let first = v1::TrackHoldoutRequest { message: Some(first) };
        frames.send(first).await.expect("there is room");
        let mut grasps = server.grasps().await;
        let answers = grasps.track_holdout(ReceiverStream::new(sent)).await?;
        Ok(Self {
            frames,
            answers: answers.into_inner(),
        })
    }

    /// Starts a track that is right.
    async fn of(server: &TestServer, track: v1::Track) -> Self {
        let started = Self::start(server, Message::Track(track)).await;
        started.expect("the track is right")
    }

    /// Tracks the remote.
    async fn remote(server: &TestServer) -> Self {
        Self::of(server, remote()).await
    }

    async fn send(&self, frame: v1::TrackFrame) {
        let message = Some(Message::Frame(frame));
        let sent = self.frames.send(v1::TrackHoldoutRequest { message }).await;
        sent.expect("the track is open");
    }

    /// The next answer, or the status that ends the track.
    async fn next(&mut self) -> Result<v1::TrackAnswer, Status> {
        let answer = bounded("an answer", self.answers.message()).await?;
        Ok(answer.expect("the track goes on"))
    }

    /// The answer to a frame.
    async fn ask(&mut self, frame: v1::TrackFrame) -> v1::TrackAnswer {
        let sequence = frame.sequence;
        self.send(frame).await;
        let answer = self.next().await.expect("the frame is right");
        assert_eq!(answer.sequence, sequence);
        answer
    }
}

/// A track of the remote, received by the right hand.
fn remote() -> v1::Track {
    // Unoptimised builds search longer than a frame.
    v1::Track::new("objects/remote")
        .receiving(v1::Handedness::Right)
        .with_budget(Duration::from_secs(5))
}

/// A frame with this holdout.
fn frame_of(sequence: u64, request: v1::FindGraspRequest) -> v1::TrackFrame {
    let holdout = v1::Holdout {
        object: String::new(),
        ..request.holdout.expect("it has one")
    };
    v1::TrackFrame::of(sequence, holdout).captured_at(time_of(sequence))
}

/// The held remote, moved with its giver.
fn frame(sequence: u64, moved: Pose) -> v1::TrackFrame {
    let mut held = held_remote();
    let holdout = held.holdout_mut();
    holdout.client_from_object = Some(wire_pose(moved * pose_of(holdout.client_from_object)));
    let Some(v1::PresentingHand {
        form: Some(Form::Pose(giver)),
    }) = &mut holdout.presenting_hand
    else {
        panic!("the giver is posed");
    };
    giver.client_from_wrist = Some(wire_pose(moved * pose_of(giver.client_from_wrist)));
    frame_of(sequence, held)
}

/// The same frame with another holdout.
fn held(frame: v1::TrackFrame, change: impl FnOnce(&mut v1::Holdout)) -> v1::TrackFrame {
    with(frame, |frame| change(frame.holdout.get_or_insert_default()))
}

/// The capture time of a frame at 90 Hz.
fn time_of(sequence: u64) -> Duration {
    Duration::from_micros(11_111 * sequence)
}

fn pose_of(pose: Option<v1::Pose>) -> Pose {
    let pose = pose.unwrap_or_default();
    Pose::new(pose.position(), pose.orientation().normalize())
}

/// Where the wrist of a grasp is in the client's frame.
fn wrist_of(answer: &v1::TrackAnswer) -> Pose {
    let grasp = answer.grasp.as_ref().expect("there is a grasp");
    pose_of(grasp.client_from_wrist())
}

/// A giver who sways and turns.
fn swaying(sequence: u64) -> Pose {
    let time = sequence as f32 / 90.0;
    Pose::new(
        Vec3::new(0.1 * (2.0 * time).sin(), 0.02 * (5.0 * time).cos(), 0.3 * time),
        Quat::from_rotation_y(0.3 * (3.0 * time).sin()),
    )
}

/// Why the answer has no grasp.
fn no_grasp(answer: &v1::TrackAnswer) -> v1::Check {
    answer.current.as_ref().expect("it is set").no_grasp()
}

/// Fails unless an answer is that to a wrong frame, and names the field.
fn assert_wrong(answer: &v1::TrackAnswer, field: &str) {
    assert_eq!(
        (answer.status(), no_grasp(answer)),
        (v1::CurrentGraspStatus::None, v1::Check::Frame),
        "{field}"
    );
    assert!(answer.grasp.is_none(), "{field}");
    assert_blames(answer, field);
}

/// Fails unless an answer's warnings name a field.
fn assert_blames(answer: &v1::TrackAnswer, field: &str) {
    assert!(
        answer.warnings.iter().any(|warning| warning.starts_with(field)),
        "{field} in {:?}",
        answer.warnings
    );
}

/// A created track.
struct Created<'a> {
    server: &'a TestServer,
    name: String,
}

impl<'a> Created<'a> {
    /// Creates a track.
    async fn start(server: &'a TestServer, track: v1::Track) -> Result<Self, Status> {
        let created = server.grasps().await.create_track(track).await?;
        let name = created.into_inner().name;
        Ok(Self { server, name })
    }

    /// Tracks the remote.
    async fn remote(server: &'a TestServer) -> Self {
        let started = Self::start(server, remote()).await;
        started.expect("the track is right")
    }

    async fn push(&self, frame: v1::TrackFrame) -> Result<v1::TrackAnswer, Status> {
        let frame = v1::TrackFrame {
            track: self.name.clone(),
            ..frame
        };
        let mut grasps = self.server.grasps().await;
        let answer = bounded("the answer", grasps.push_frame(frame)).await?;
        Ok(answer.into_inner())
    }

    /// The answer to a frame that no other overtakes.
    async fn ask(&self, frame: v1::TrackFrame) -> v1::TrackAnswer {
        let sequence = frame.sequence;
        let answer = self.push(frame).await.expect("the track is there");
        assert_eq!(answer.sequence, sequence);
        assert_ne!(answer.status(), v1::CurrentGraspStatus::Unspecified, "{sequence}");
        answer
    }

    async fn delete(&self) -> Result<(), Status> {
        let name = self.name.clone();
        let mut grasps = self.server.grasps().await;
        let deleted = grasps.delete_track(v1::DeleteTrackRequest { name });
        bounded("the deletion", deleted).await.map(|_| ())
    }
}

/// The answer to a frame that was overtaken.
fn overtaken(sequence: u64) -> v1::TrackAnswer {
    v1::TrackAnswer {
        sequence,
        ..Default::default()
    }
}

// Random messages in random order: a track names the fault of each wrong frame and goes on, or ends with a status that names an
// invalid message; its answers are in order, and nothing queues.

/// Tracks of random messages.
const TRACKS: u64 = 40;

/// A way to make a right frame wrong with a wrong number, and the field that is to blame.
type Fault = (&'static str, fn(&mut v1::TrackFrame, f32));

/// All faults.
const FAULTS: [Fault; 15] = [
    ("holdout.client_from_object.position", |frame, wrong| {
        pose(frame).position = Some(Vec3::new(wrong, 0.0, 0.0).into());
    }),
    ("holdout.client_from_object.orientation", |frame, wrong| {
        pose(frame).orientation = Some(v1::Quaternion {
            w: wrong,
            ..Default::default()
        });
    }),
    ("holdout.client_from_object.orientation", |frame, _| {
        pose(frame).orientation = Some(v1::Quaternion::default());
    }),
    ("holdout.presenting_hand", |frame, _| {
        holdout(frame).presenting_hand = Some(v1::PresentingHand { form: None });
    }),
    ("holdout.presenting_hand.pose.rig", |frame, _| {
        "claw".clone_into(&mut giver(frame).rig);
    }),
    ("holdout.presenting_hand.pose.index", |frame, _| {
        giver(frame).index = None;
    }),
    ("holdout.presenting_hand.pose.thumb.base_pitch", |frame, wrong| {
        giver(frame).thumb.get_or_insert_default().base_pitch = wrong;
    }),
    ("holdout.presenting_hand.joints.joints", |frame, _| {
        let joints = v1::HandJoints::new(v1::Handedness::Left, vec![v1::JointPose::default(); 7]);
        holdout(frame).presenting_hand = Some(joints.into());
    }),
    ("holdout.other_hands", |frame, _| {
        holdout(frame).other_hands = vec![v1::PresentingHand::default(); 9];
    }),
    ("holdout.obstacles", |frame, _| {
        holdout(frame).obstacles = vec![v1::Shape { kind: None }; 2];
    }),
    ("holdout.up", |frame, _| {
        // A direction of any length will do.
        holdout(frame).up = Some(v1::Vector3::default());
    }),
    ("holdout.scale", |frame, wrong| holdout(frame).scale = Some(wrong)),
    ("receiver.scale", |frame, wrong| {
        frame.receiver.get_or_insert_default().scale = Some(wrong);
    }),
    ("capture_time", |frame, _| {
        frame.capture_time = Some(prost_types::Duration {
            seconds: i64::MAX,
            nanos: -1,
        });
    }),
    ("receiving_hand", |frame, _| {
        frame.receiving_hand = Some(v1::HandPose::default());
    }),
];

fn holdout(frame: &mut v1::TrackFrame) -> &mut v1::Holdout {
    frame.holdout.as_mut().expect("the frame has a holdout")
}

fn pose(frame: &mut v1::TrackFrame) -> &mut v1::Pose {
    let pose = holdout(frame).client_from_object.as_mut();
    pose.expect("the holdout has a pose")
}

fn giver(frame: &mut v1::TrackFrame) -> &mut v1::HandPose {
    let hand = holdout(frame).presenting_hand.as_mut();
    match hand.and_then(|hand| hand.form.as_mut()) {
        Some(Form::Pose(pose)) => pose,
        other => panic!("{other:?} is not posed"),
    }
}

/// A frame that is wrong in one to three ways, and the field to blame.
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
        (1, _) => (Some(Message::Track(remote())), Some("track")),
        (2 | 3, Some(last)) => {
            // Once more, or an earlier one.
            let early = last - random.random_range(0..=last);
            let timeless = v1::TrackFrame {
                capture_time: None,
                ..frame(early, swaying(early))
            };
            (Some(Message::Frame(timeless)), Some("sequence"))
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
                12..16 => holdout(&mut right).presenting_hand = None,
                16..20 => holdout(&mut right).client_from_object = None,
                20..24 => right.committed = true,
                _ => {}
            }
            (Some(Message::Frame(right)), None)
        }
    }
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
    let first = Some(Message::Track(remote()));
    sender
        .send(v1::TrackHoldoutRequest { message: first })
        .await
        .unwrap();
    let mut grasps = server.grasps().await;
    let answers = grasps.track_holdout(ReceiverStream::new(sent)).await;
    let mut answers = answers.expect("the track is right").into_inner();
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
        // An invalid message must end the track although its client goes on.
        let open = blamed.is_some().then_some(sender);
        (sent_frames, blamed, open)
    };
    let reading = async {
        let mut answered = Vec::new();
        loop {
            match bounded("an answer or the end", answers.message()).await {
                Ok(Some(answer)) => answered.push(answer),
                Ok(None) => return (answered, None),
                Err(status) => return (answered, Some(status)),
            }
        }
    };
    let ((sent_frames, blamed, _open), (answered, status)) = tokio::join!(sending, reading);
    // Every frame is answered or overtaken by a later one that is.
    let mut accounted = 0;
    for answer in answered {
        let mut later = sent_frames[accounted..].iter();
        let overtaken =
            later.position(|&(sequence, field)| sequence == answer.sequence && fits(&answer, field));
        let overtaken =
            overtaken.unwrap_or_else(|| panic!("{what}: no frame after {accounted} fits {answer:?}"));
        accounted += overtaken + 1;
    }
    match (blamed, status) {
        (Some(field), Some(status)) => {
            assert_eq!(status.code(), Code::InvalidArgument, "{what}: {status:?}");
            let blamed = blamed_fields(&status);
            assert!(
                blamed.iter().any(|blamed| blamed.starts_with(field)),
                "{what}: {field} in {blamed:?}"
            );
        }
        (None, None) => assert_eq!(accounted, sent_frames.len(), "{what}"),
        (blamed, status) => panic!("{what}: {blamed:?} ended with {status:?}"),
    }
}

/// True if the answer is one to a frame of which this field is wrong.
fn fits(answer: &v1::TrackAnswer, field: Option<&str>) -> bool {
    let is_wrong = no_grasp(answer) == v1::Check::Frame;
    match field {
        None => answer.warnings.is_empty() && !is_wrong,
        Some(field) => {
            let is_blamed = answer.warnings.iter().any(|warning| warning.starts_with(field));
            is_blamed && (field == "sequence" || is_wrong && answer.grasp.is_none())
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_answers_every_message_or_ends_with_the_fault() {
    let server = TestServer::start().await;
    for seed in (0..TRACKS).step_by(4) {
        let track = |beside| random_track(&server, seed + beside);
        tokio::join!(track(0), track(1), track(2), track(3));
    }
    assert_unharmed(&server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_fault_is_blamed_on_its_field() {
    let server = TestServer::start().await;
    let track = Created::remote(&server).await;
    for (field, spoil) in FAULTS {
        for value in [f32::NAN, f32::INFINITY, -1e30] {
            let mut wrong = frame(1, swaying(1));
            spoil(&mut wrong, value);
            assert_wrong(&track.ask(wrong).await, field);
        }
    }
}
