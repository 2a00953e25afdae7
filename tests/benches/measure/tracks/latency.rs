//! Time from a frame to its answer, alternating with an echo of the same sizes. Each begins after the same pause: what follows
//! other work at once finds threads awake and caches warm.

use std::{
    fmt,
    time::{Duration, Instant},
};

use grasp_assets::holdouts::holdouts;
use grasp_proto::v1;
use grasp_tests::{TestServer, progress::bar, random_holdouts::ClientHoldout};
use prost::Message as _;
use serde::Serialize;
use tokio::time::{MissedTickBehavior, interval};

use crate::tracks::{
    RATE,
    echo::EchoStream,
    percentile,
    play::{Moving, Tracked, frame, moved},
};

/// Frames before measuring.
const WARM_UP: usize = 10;

/// Times in milliseconds.
#[derive(Debug, Serialize)]
pub(crate) struct Latency {
    /// Whether answers repeat only the wrist of a grasp that is kept.
    only_changes: bool,
    frames: usize,
    sent_bytes: usize,
    received_bytes: usize,
    track_median: f64,
    track_p99: f64,
    echo_median: f64,
    echo_p99: f64,
    /// From the arrival of a frame to its answer, as the server reports it.
    server_median: f64,
}

/// Tracks a built-in holdout whose giver walks.
pub(crate) async fn measure(frames: usize, only_changes: bool) -> Latency {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let built_in = holdouts()
        .iter()
        .find(|holdout| holdout.object == "remote")
        .expect("it is built in");
    let holdout = ClientHoldout::of_built_in(built_in);
    let mut track = v1::Track::new("objects/remote");
    track.output_mut().changes_only = only_changes;
    let mut track = Tracked::start_with(server.grasps().await, track).await;
    let mut echo = EchoStream::open().await;
    let mut clock = interval(Duration::from_secs_f64(0.5 / RATE));
    clock.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let bar = bar(frames, "frames and echoes in turn".to_owned());
    let (mut tracked, mut echoed, mut served) = (Vec::new(), Vec::new(), Vec::new());
    let mut sizes = (0, 0);
    for sequence in 0..frames + WARM_UP {
        clock.tick().await;
        let time = (sequence as f64 / RATE) as f32;
        let message = frame(
            sequence as u64,
            &moved(Moving::Walk, &holdout, &holdout.giver, time),
        );
        let sent = message.encoded_len();
        let start = Instant::now();
        let answer = track.ask(message).await;
        let took = start.elapsed();
        let received = answer.encoded_len();
        clock.tick().await;
        let start = Instant::now();
        echo.echo(sent, received).await;
        if sequence >= WARM_UP {
            tracked.push(took.as_secs_f64() * 1e3);
            served.push(answer.server_time().as_secs_f64() * 1e3);
            echoed.push(start.elapsed().as_secs_f64() * 1e3);
            sizes = (sent, received);
        }
        bar.inc(1);
    }
    server.stop().await;
    tracked.sort_by(f64::total_cmp);
    echoed.sort_by(f64::total_cmp);
    served.sort_by(f64::total_cmp);
    Latency {
        only_changes,
        frames,
        sent_bytes: sizes.0,
        received_bytes: sizes.1,
        track_median: percentile(&tracked, 0.5),
        track_p99: percentile(&tracked, 0.99),
        echo_median: percentile(&echoed, 0.5),
        echo_p99: percentile(&echoed, 0.99),
        server_median: percentile(&served, 0.5),
    }
}

impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a frame at 90 Hz is answered with {} in {:.2} ms at the median and {:.2} ms at p99; the echo of {} and {} bytes takes {:.2} and \
             {:.2} ms: {:.1} and {:.1} times as long; the server's share is {:.2} ms",
            if self.only_changes { "what changes" } else { "all" },
            self.track_median,
            self.track_p99,
            self.sent_bytes,
            self.received_bytes,
            self.echo_median,
            self.echo_p99,
            self.track_median / self.echo_median,
            self.track_p99 / self.echo_p99,
            self.server_median,
        )
    }
}
