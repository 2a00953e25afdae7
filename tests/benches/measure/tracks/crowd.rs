//! Many tracks at a time, each at 90 Hz.

use std::time::{Duration, Instant};

use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::grasp_service_client::GraspServiceClient;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout};
use tokio::{
    task::JoinSet,
    time::{MissedTickBehavior, interval_at},
};
use tonic::transport::Channel;

use crate::{
    setting::Setting,
    table::Line,
    tracks::{
        RATE,
        play::{Moving, Tracked, frame, moved},
    },
};

/// Numbers of tracks, and how long each plays, in seconds.
const CROWDS: (&[usize], u64) = (&[50, 100, 200], 10);
const BRIEF_CROWDS: (&[usize], u64) = (&[3], 1);

/// Tracks that share a connection.
const PER_CONNECTION: usize = 25;

/// Time in which frames are to be answered.
const FRAME: Duration = Duration::from_millis(11);

/// How long a server prepares the built-in objects after the first call for each.
const PREPARING: Duration = Duration::from_secs(5);

pub(crate) fn measure(setting: &Setting) -> Vec<Line> {
    let (crowds, seconds) = if setting.is_brief { BRIEF_CROWDS } else { CROWDS };
    let of = |&tracks: &usize| setting.serving.block_on(crowd(tracks, seconds));
    crowds.iter().map(of).collect()
}

/// Runs so many tracks for some seconds.
async fn crowd(tracks: usize, seconds: u64) -> Line {
    let server = TestServer::start_with(|config| {
        config.builder_threads = 1;
        config.streams.tracks = tracks.try_into().expect("there are tracks");
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
        let track = Tracked::start(client.clone(), &object).await;
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

/// Asks for every built-in holdout until the server has read its atlases and prepared its objects, as a server has that has run for
/// some seconds.
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
