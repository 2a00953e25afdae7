//! Time from a frame to its answer, alternating with an echo of the same sizes, and what opening a track costs.

use std::time::{Duration, Instant};

use grasp_assets::holdouts::holdouts;
use grasp_proto::v1;
use grasp_tests::{progress::bar, random_holdouts::ClientHoldout};
use prost::Message as _;
use tokio::time::{MissedTickBehavior, interval};

use crate::{
    core::process_time,
    echo::EchoClient,
    setting::Setting,
    table::{Line, Spread, Unit, time},
    tracks::{
        RATE,
        play::{Moving, Tracked, frame, moved},
    },
};

/// Frames that are measured, and frames before them.
const FRAMES: usize = 1800;
const BRIEF_FRAMES: usize = 20;
const WARM_UP: usize = 10;

/// Tracks that are opened.
const OPENED: usize = 200;
const BRIEF_OPENED: usize = 2;

/// With whole answers, and with answers that repeat only the wrist of a grasp that is kept.
pub(crate) fn measure(setting: &Setting) -> Vec<Line> {
    let measure = |changes_only| setting.serving.block_on(frames(setting, changes_only));
    [false, true].map(measure).concat()
}

/// Tracks a built-in holdout whose giver walks. Frames and echoes each begin after the same pause: what follows other work at once
/// finds threads awake and caches warm.
async fn frames(setting: &Setting, changes_only: bool) -> Vec<Line> {
    let server = grasp_tests::TestServer::start_with(|config| config.builder_threads = 1).await;
    let built_in = holdouts().iter().find(|holdout| holdout.object == "remote");
    let holdout = ClientHoldout::of_built_in(built_in.expect("it is built in"));
    let mut track = v1::Track::new("objects/remote");
    track.output_mut().changes_only = changes_only;
    let mut track = Tracked::start_with(server.grasps().await, track).await;
    let mut echo = EchoClient::start().await.open().await;
    let mut clock = interval(Duration::from_secs_f64(0.5 / RATE));
    clock.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let count = WARM_UP + if setting.is_brief { BRIEF_FRAMES } else { FRAMES };
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
        if sequence >= WARM_UP {
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
