//! Requests that an atlas can answer: the first valid grasp by the server's own reports, and whole calls over gRPC.

use std::time::Instant;

use grasp_proto::v1;

use crate::{
    echo::EchoClient,
    setting::{
        Answer, Setting, TestObject, assert_some_found, bar, round_trips, search_times, send, share,
        within_50_ms,
    },
    table::{Line, Spread, Unit, time},
};

/// Targets for median, p99 and p99.9, in seconds.
const MEDIAN: f64 = 20e-6;
const P99: f64 = 0.5e-3;
const P999: f64 = 2e-3;

/// Target: median round trip over the echo's median.
const MAX_RATIO: f64 = 1.5;

/// Requests sent before measuring, to fill caches; half of them if there are few. Random ones use other holdouts than
/// the measured ones, because the server remembers the grips found.
const WARM_UP: usize = 30;

/// The first valid grasp.
pub(crate) fn measure(setting: &Setting) -> Vec<Line> {
    let server = setting.server_with_atlases();
    let send = |what: &str, requests: Vec<v1::FindGraspRequest>| {
        let warm_up = WARM_UP.min(requests.len() / 2);
        setting
            .send_all(
                &server,
                &format!("warm, {what}"),
                requests.into_iter().map(within_50_ms),
            )
            .split_off(warm_up)
    };
    let built_in = send("the 15 holdouts", setting.built_in_requests());
    assert_some_found(&built_in);
    let mut lines = vec![line("the 15 holdouts", &built_in).limits(MEDIAN, P99, Some(P999))];
    let mut all = Vec::new();
    for test_object in setting.test_objects() {
        let answers = send(&test_object.id, test_object.requests());
        lines.push(in_time(
            line(&format!("random {}", test_object.id), &answers),
            &answers,
        ));
        all.extend(answers);
    }
    lines.push(in_time(line("random, all", &all), &all).limits(MEDIAN, P99, Some(P999)));
    setting.stop(server);
    lines
}

fn in_time(line: Line, answers: &[Answer]) -> Line {
    line.at_least("in 50 ms", Unit::Share, share(answers, Answer::is_in_time), 1.0)
}

fn line(what: &str, answers: &[Answer]) -> Line {
    let in_time: Vec<Answer> = answers.iter().copied().filter(Answer::is_in_time).collect();
    let p99 = search_times(&in_time).p99;
    let p99 = p99.map_or_else(String::new, |p99| format!(", p99 of the others {}", time(p99)));
    let what = format!("warm, {what}");
    Line::new(what, Unit::Seconds, search_times(answers)).remark(format!(
        "{:.1} % answered by the atlas, {:.1} % by learned grips, {} of {} unanswered in 50 ms{p99}",
        100.0 * share(answers, |answer| answer.from_atlas),
        100.0 * share(answers, |answer| answer.from_learned),
        answers.len() - in_time.len(),
        answers.len()
    ))
}

/// Whole calls over gRPC on loopback, alternating with an echo of the same sizes.
pub(crate) fn measure_wire(setting: &Setting) -> Vec<Line> {
    let server = setting.server_with_atlases();
    let mut requests = setting.built_in_requests();
    requests.extend(setting.test_objects().iter().flat_map(TestObject::requests));
    let warm_up = requests.len().min(WARM_UP);
    let requests: Vec<_> = requests[..warm_up]
        .iter()
        .chain(&requests)
        .cloned()
        .map(within_50_ms)
        .collect();
    let bar = bar(requests.len(), "round trips and echoes in turn".to_owned());
    let (mut answers, mut echoes) = (Vec::new(), Vec::new());
    let mut echo = setting.serving.block_on(EchoClient::start());
    setting.calling.block_on(async {
        let mut client = server.grasps().await;
        for request in requests {
            let answer = send(&mut client, request).await;
            let start = Instant::now();
            echo.call(answer.sent_bytes, answer.received_bytes).await;
            echoes.push(start.elapsed());
            answers.push(answer);
            bar.inc(1);
        }
    });
    setting.stop(server);
    let (answers, echoes) = (answers.split_off(warm_up), echoes.split_off(warm_up));

    let (round_trip, echo) = (round_trips(&answers), Spread::of_times(echoes));
    let median_of = |bytes: fn(&Answer) -> usize| {
        let bytes: Vec<f64> = answers.iter().map(|answer| bytes(answer) as f64).collect();
        Spread::of(&bytes).median
    };
    let in_search = search_times(&answers).median;
    vec![
        Line::new("wire, echo", Unit::Seconds, echo).remark(format!(
            "{} bytes sent and {} received, at the median",
            median_of(|answer| answer.sent_bytes),
            median_of(|answer| answer.received_bytes)
        )),
        Line::new("wire, FindGrasp, all holdouts", Unit::Seconds, round_trip)
            .at_most(
                "median, in echoes",
                Unit::Times,
                round_trip.median / echo.median,
                MAX_RATIO,
            )
            .remark(format!(
                "of the median, {} are the search, {} the echo, {} the rest",
                time(in_search),
                time(echo.median),
                time(round_trip.median - echo.median - in_search)
            )),
    ]
}
