//! Many tracks at a time, each at 90 Hz.

use std::{
    fmt,
    time::{Duration, Instant},
};

use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::grasp_service_client::GraspServiceClient;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout};
use serde::Serialize;
use tokio::{
    task::JoinSet,
    time::{MissedTickBehavior, interval_at},
};
use tonic::transport::Channel;

use crate::tracks::{
    RATE, percentile,
    play::{Moving, Tracked, frame, moved},
};

/// Tracks that share a connection.
const PER_CONNECTION: usize = 25;

/// Time in which frames are to be answered.
const FRAME: f64 = 11.0;

/// What a number of tracks got.
#[derive(Debug, Serialize)]
pub(crate) struct Crowd {
    tracks: usize,
    frames: usize,
    answered: usize,
    /// Milliseconds from a frame to its answer.
    median: f64,
    p99: f64,
    /// Share of all frames answered within a frame's time; overtaken ones are not.
    within_a_frame: f64,
}

/// Runs so many tracks for some seconds.
pub(crate) async fn measure(tracks: usize, seconds: u64) -> Crowd {
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
    let mut times: Vec<f64> = Vec::new();
    while let Some(played) = playing.join_next().await {
        times.extend(played.expect("no track fails"));
    }
    server.stop().await;
    times.sort_by(f64::total_cmp);
    let in_time = times.iter().filter(|&&time| time <= FRAME).count();
    Crowd {
        tracks,
        frames: tracks * frames as usize,
        answered: times.len(),
        median: percentile(&times, 0.5),
        p99: percentile(&times, 0.99),
        within_a_frame: in_time as f64 / (tracks as f64 * frames as f64),
    }
}

/// How long a server prepares the built-in objects after the first call for each.
const PREPARING: Duration = Duration::from_secs(5);

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

/// Plays one track; returns the times of its answers in milliseconds.
async fn play(mut track: Tracked, holdout: ClientHoldout, place: usize, frames: u64) -> Vec<f64> {
    // Headsets do not capture all at once.
    let start = Instant::now() + Duration::from_micros(200 * place as u64 % 11_111);
    let mut clock = interval_at(start.into(), Duration::from_secs_f64(1.0 / RATE));
    clock.set_missed_tick_behavior(MissedTickBehavior::Burst);
    let moving = Moving::ALL[place % 3];
    let mut sent: Vec<Instant> = Vec::new();
    let mut times = Vec::new();
    let mut last = None;
    while last != Some(frames - 1) {
        tokio::select! {
            _ = clock.tick(), if (sent.len() as u64) < frames => {
                let sequence = sent.len() as u64;
                let time = (sequence as f64 / RATE) as f32;
                let message = frame(sequence, &moved(moving, &holdout, &holdout.giver, time));
                sent.push(Instant::now());
                track.send(message);
            }
            answer = track.next() => {
                last = Some(answer.sequence);
                times.push(sent[answer.sequence as usize].elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    times
}

impl fmt::Display for Crowd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} tracks at 90 Hz: {:.2} % of {} frames answered, {:.2} % within 11 ms; median {:.2} ms, p99 {:.2} ms",
            self.tracks,
            100.0 * self.answered as f64 / self.frames as f64,
            self.frames,
            100.0 * self.within_a_frame,
            self.median,
            self.p99,
        )
    }
}
