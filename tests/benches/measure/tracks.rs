//! Tracks of moving givers: latency of frames, cost of opening, and how many a server holds.

use std::time::{Duration, Instant};

use glam::{Quat, Vec3};
use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient, track_holdout_request::Message};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout};
use prost::Message as _;
use tokio::{
    sync::mpsc,
    task::JoinSet,
    time::{MissedTickBehavior, interval, interval_at},
};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Streaming, transport::Channel};

use crate::{
    echo::EchoClient,
    setting::{Setting, bar},
    table::{Line, Spread, Unit, time},
};

/// Frames per second of a headset.
const RATE: f64 = 90.0;

/// Frames that are measured, and frames before them.
const FRAMES: usize = 1800;
const BRIEF_FRAMES: usize = 20;
const FRAMES_BEFORE: usize = 10;

/// Tracks that are opened.
const OPENED: usize = 200;
const BRIEF_OPENED: usize = 2;

/// With whole answers, and with answers that repeat only the wrist of a grasp that is kept.
pub(crate) fn measure_latency(setting: &Setting) -> Vec<Line> {
    let measure = |changes_only| setting.serving.block_on(frames(setting, changes_only));
    [false, true].map(measure).concat()
}

/// Tracks a built-in holdout whose giver walks. Frames and echoes each begin after the same pause: straight after other work,
/// threads are awake and caches warm.
async fn frames(setting: &Setting, changes_only: bool) -> Vec<Line> {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let built_in = holdouts().iter().find(|holdout| holdout.object == "remote");
    let holdout = ClientHoldout::of_built_in(built_in.expect("it is built in"));
    let mut track = v1::Track::new("objects/remote");
    track.output_mut().changes_only = changes_only;
    let mut track = Tracked::start(server.grasps().await, track).await;
    let mut echo = EchoClient::start().await.open().await;
    let mut clock = interval(Duration::from_secs_f64(0.5 / RATE));
    clock.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let count = FRAMES_BEFORE + if setting.is_brief { BRIEF_FRAMES } else { FRAMES };
    let bar = bar(count, "frames and echoes in turn".to_owned());
    let (mut tracked, mut echoed, mut served) = (Vec::new(), Vec::new(), Vec::new());
    let mut sizes = (0, 0);
    for sequence in 0..count {
        clock.tick().await;
        let time = (sequence as f64 / RATE) as f32;
        let message = frame(sequence as u64, &moved(Moving::Walk, &holdout, time));
        let sent = message.encoded_len();
        let start = Instant::now();
        let answer = track.ask(message).await;
        let took = start.elapsed();
        sizes = (sent, answer.encoded_len());
        clock.tick().await;
        let start = Instant::now();
        echo.echo(sizes.0, sizes.1).await;
        if sequence >= FRAMES_BEFORE {
            tracked.push(took);
            served.push(answer.server_time());
            echoed.push(start.elapsed());
        }
        bar.inc(1);
    }
    server.stop().await;
    let (tracked, echoed) = (Spread::of_times(tracked), Spread::of_times(echoed));
    let p99 = match (tracked.p99, echoed.p99) {
        (Some(tracked), Some(echoed)) => format!(", {:.1} at p99", tracked / echoed),
        _ => String::new(),
    };
    let answers = if changes_only { "changes" } else { "whole answers" };
    vec![
        Line::new(format!("tracks, echo, {answers}"), Unit::Seconds, echoed)
            .remark(format!("{} bytes sent and {} received", sizes.0, sizes.1)),
        Line::new(format!("tracks, a frame, {answers}"), Unit::Seconds, tracked).remark(format!(
            "{:.1} echoes at the median{p99}; {} of the median in the server",
            tracked.median / echoed.median,
            time(Spread::of_times(served).median)
        )),
    ]
}

/// Processor time of client and server together to create and delete a track, next to that of a search; one after the other, on
/// one connection.
pub(crate) fn measure_opens(setting: &Setting) -> Line {
    let server = setting.server(|config| config.builder_threads = 1);
    let opened = if setting.is_brief { BRIEF_OPENED } else { OPENED };
    let (mut opening, mut finding) = (Vec::new(), Vec::new());
    setting.calling.block_on(async {
        let mut client = server.grasps().await;
        let request = v1::FindGraspRequest::new("objects/remote");
        // The first round prepares the object.
        for round in 0..=opened {
            let start = process_time();
            let track = client.create_track(v1::Track::from(request.clone())).await;
            let name = track.expect("the track is right").into_inner().name;
            let delete = v1::DeleteTrackRequest { name };
            client.delete_track(delete).await.expect("the track is there");
            let middle = process_time();
            let found = client.find_grasp(request.clone()).await;
            found.expect("the request is right");
            if round > 0 {
                opening.push(middle.saturating_sub(start));
                finding.push(process_time().saturating_sub(middle));
            }
        }
    });
    setting.stop(server);
    let finding = time(Spread::of_times(finding).median);
    Line::of_times("tracks, opening one, processor time", opening)
        .remark(format!("a grasp is found in {finding}, at the median"))
}

/// Numbers of tracks, and how long each plays, in seconds.
const CROWDS: (&[usize], u64) = (&[50, 100, 200], 10);
const BRIEF_CROWDS: (&[usize], u64) = (&[3], 1);

/// Tracks that share a connection.
const PER_CONNECTION: usize = 25;

/// Time in which frames are to be answered.
const FRAME: Duration = Duration::from_millis(11);

/// How long a server prepares the built-in objects after the first call for each.
const PREPARING: Duration = Duration::from_secs(5);

pub(crate) fn measure_crowds(setting: &Setting) -> Vec<Line> {
    let (crowds, seconds) = if setting.is_brief { BRIEF_CROWDS } else { CROWDS };
    let of = |&tracks: &usize| setting.serving.block_on(crowd(tracks, seconds));
    crowds.iter().map(of).collect()
}

/// Runs a number of tracks for some seconds.
async fn crowd(tracks: usize, seconds: u64) -> Line {
    let server = TestServer::start_with(|config| {
        config.builder_threads = 1;
        // They are of one client, which leaves some to others.
        config.streams.tracks = (2 * tracks).try_into().expect("there are tracks");
    })
    .await;
    let frames = (seconds as f64 * RATE) as u64;
    let mut playing = JoinSet::new();
    let mut client = server.grasps().await;
    warm_up(&mut client).await;
    for place in 0..tracks {
        if place % PER_CONNECTION == 0 {
            client = server.grasps().await;
        }
        let all = holdouts();
        let built_in = &all[place % all.len()];
        let holdout = ClientHoldout::of_built_in(built_in);
        let object = format!("objects/{}", built_in.object);
        let track = Tracked::start(client.clone(), v1::Track::new(object)).await;
        playing.spawn(play(track, holdout, place, frames));
    }
    let times: Vec<Duration> = playing.join_all().await.concat();
    server.stop().await;
    let frames = tracks * frames as usize;
    let percent = |count: usize| 100.0 * count as f64 / frames as f64;
    let in_time = times.iter().filter(|&&time| time <= FRAME).count();
    // Overtaken frames are not answered.
    let remark = format!(
        "{:.2} % of {frames} frames answered, {:.2} % within 11 ms",
        percent(times.len()),
        percent(in_time)
    );
    Line::of_times(format!("{tracks} tracks at 90 Hz"), times).remark(remark)
}

/// Requests every built-in holdout until the server has read its atlases and prepared its objects, as after some seconds of
/// service.
async fn warm_up(client: &mut GraspServiceClient<Channel>) {
    for built_in in holdouts() {
        let object = format!("objects/{}", built_in.object);
        let holdout = ClientHoldout::of_built_in(built_in);
        loop {
            let answer = client.find_grasp(holdout.request(&object)).await;
            let answer = answer.expect("the request is right").into_inner();
            if answer.origin.is_some_and(|origin| !origin.atlases.is_empty()) {
                break;
            }
        }
    }
    tokio::time::sleep(PREPARING).await;
}

/// Plays one track; returns the times of its answers.
async fn play(mut track: Tracked, holdout: ClientHoldout, place: usize, frames: u64) -> Vec<Duration> {
    // Headsets do not capture all at once.
    let start = Instant::now() + Duration::from_micros(200 * place as u64 % 11_111);
    let mut clock = interval_at(start.into(), Duration::from_secs_f64(1.0 / RATE));
    clock.set_missed_tick_behavior(MissedTickBehavior::Burst);
    let moving = Moving::ALL[place % Moving::ALL.len()];
    let mut sent: Vec<Instant> = Vec::new();
    let mut times = Vec::new();
    let mut last = None;
    while last != Some(frames - 1) {
        tokio::select! {
            _ = clock.tick(), if (sent.len() as u64) < frames => {
                let sequence = sent.len() as u64;
                let message = frame(sequence, &moved(moving, &holdout, (sequence as f64 / RATE) as f32));
                sent.push(Instant::now());
                track.send(message);
            }
            answer = track.next() => {
                last = Some(answer.sequence);
                times.push(sent[answer.sequence as usize].elapsed());
            }
        }
    }
    times
}

/// An open track.
struct Tracked {
    frames: mpsc::Sender<v1::TrackHoldoutRequest>,
    answers: Streaming<v1::TrackAnswer>,
}

impl Tracked {
    /// Starts a track.
    async fn start(mut client: GraspServiceClient<Channel>, track: v1::Track) -> Self {
        let (frames, sent) = mpsc::channel(64);
        let first = v1::TrackHoldoutRequest {
            message: Some(Message::Track(track)),
        };
        frames.send(first).await.expect("there is room");
        let answers = client.track_holdout(ReceiverStream::new(sent)).await;
        Self {
            frames,
            answers: answers.expect("the track is right").into_inner(),
        }
    }

    /// Sends a frame, unless too many wait.
    fn send(&self, frame: v1::TrackFrame) {
        let message = Some(Message::Frame(frame));
        let _ = self.frames.try_send(v1::TrackHoldoutRequest { message });
    }

    /// The next answer.
    async fn next(&mut self) -> v1::TrackAnswer {
        let answer = self.answers.message().await.expect("the frames are right");
        answer.expect("the track goes on")
    }

    /// The answer to a frame.
    async fn ask(&mut self, frame: v1::TrackFrame) -> v1::TrackAnswer {
        self.send(frame);
        self.next().await
    }
}

/// How a giver moves with the object.
#[derive(Clone, Copy, Debug)]
enum Moving {
    Walk,
    Turn,
    Shake,
}

impl Moving {
    const ALL: [Self; 3] = [Self::Walk, Self::Turn, Self::Shake];
}

/// A holdout at a time in seconds.
fn moved(moving: Moving, holdout: &ClientHoldout, time: f32) -> ClientHoldout {
    let wave = |per_second: f32, phase: f32| (std::f32::consts::TAU * (per_second * time + phase)).sin();
    let waves = |per_second: f32| {
        Vec3::new(
            wave(per_second, 0.0),
            wave(1.3 * per_second, 0.3),
            wave(0.8 * per_second, 0.7),
        )
    };
    let origin = holdout.client_from_object.position;
    let about_object = |turn: Quat| Pose::new(origin - turn * origin, turn);
    let together = |by: Pose| ClientHoldout {
        client_from_object: by * holdout.client_from_object,
        giver: holdout.giver.transformed(by),
    };
    match moving {
        Moving::Walk => {
            let way = Vec3::new(0.4 * wave(0.1, 0.0), 0.015 * wave(1.8, 0.0), 0.1 * wave(0.2, 0.0));
            together(Pose::from_position(way) * about_object(Quat::from_rotation_y(0.4 * wave(0.1, 0.0))))
        }
        Moving::Turn => together(about_object(Quat::from_rotation_z(1.5 * wave(0.12, 0.0)))),
        Moving::Shake => {
            let turn = Quat::from_scaled_axis(0.03 * waves(7.0));
            together(Pose::from_position(0.006 * waves(8.0)) * about_object(turn))
        }
    }
}

/// A frame of a track.
fn frame(sequence: u64, holdout: &ClientHoldout) -> v1::TrackFrame {
    let holdout = v1::Holdout {
        object: String::new(),
        ..holdout.request("objects/any").holdout.expect("it is set")
    };
    v1::TrackFrame::of(sequence, holdout).captured_at(Duration::from_secs_f64(sequence as f64 / RATE))
}

/// Processor time of all threads of this process.
#[cfg(target_os = "linux")]
fn process_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::try_from(time).expect("a process' time is positive")
}

/// Wall time, on systems without such a clock.
#[cfg(not(target_os = "linux"))]
fn process_time() -> Duration {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed()
}
