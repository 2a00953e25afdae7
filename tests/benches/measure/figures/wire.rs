//! Whole calls over gRPC on loopback, alternating with an echo of the same sizes.

use grasp_tests::{TestServer, progress::bar};

use crate::figures::{
    Row,
    echo::EchoServer,
    requests::{Answer, round_trips, search_times, send, within_50_ms},
    setting::{Setting, TestObject},
    table::{Line, Spread, Target, Unit, time},
};

/// Target: median round trip over the echo's median.
const MAX_RATIO: f64 = 1.5;

/// Pairs of calls before measuring, to warm up connections and caches.
const WARM_UP: usize = 30;

pub(crate) fn measure(setting: &Setting, server: &TestServer, test_objects: &[TestObject]) -> Vec<Line> {
    let mut requests = setting.built_in_requests();
    requests.extend(test_objects.iter().flat_map(TestObject::requests));
    let warm_up = requests.len().min(WARM_UP);
    let requests: Vec<_> = requests[..warm_up]
        .iter()
        .chain(&requests)
        .cloned()
        .map(within_50_ms)
        .collect();
    let bar = bar(requests.len(), "round trips and echoes in turn".to_owned());

    let echo_server = setting.serving.block_on(EchoServer::start());
    let mut answers: Vec<Answer> = Vec::new();
    let mut echoes = Vec::new();
    setting.calling.block_on(async {
        let mut client = server.grasps().await;
        let mut echo = echo_server.client().await;
        for request in requests {
            let answer = send(&mut client, request).await;
            echoes.push(echo.time(answer.sent_bytes, answer.received_bytes).await);
            answers.push(answer);
            bar.inc(1);
        }
    });
    let (answers, echoes) = (answers.split_off(warm_up), echoes.split_off(warm_up));

    let (round_trip, echo) = (round_trips(&answers), Spread::of_times(echoes));
    let median_of = |bytes: fn(&Answer) -> usize| {
        let bytes: Vec<f64> = answers.iter().map(|answer| bytes(answer) as f64).collect();
        Spread::of(&bytes).median
    };
    let times = round_trip.median / echo.median;
    let in_search = search_times(&answers).median;
    vec![
        Line::new(Row::Wire, "echo", Unit::Seconds, echo).remark(format!(
            "{} bytes sent and {} received, at the median",
            median_of(|answer| answer.sent_bytes),
            median_of(|answer| answer.received_bytes)
        )),
        Line::new(Row::Wire, "FindGrasp, all holdouts", Unit::Seconds, round_trip)
            .target(Target::at_most(
                "median, in echoes",
                Unit::Times,
                times,
                MAX_RATIO,
            ))
            .remark(format!(
                "of the median, {} are the search, {} the echo, {} the rest",
                time(in_search),
                time(echo.median),
                time(round_trip.median - echo.median - in_search)
            )),
    ]
}
