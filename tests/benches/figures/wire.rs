//! The same over gRPC on loopback, beside an echo of the same sizes.

use grasp_tests::TestServer;

use crate::{
    Row,
    asking::{Answer, ask, round_trips, search_times, within_50_ms},
    echo::EchoServer,
    setting::{Setting, Thing, bar},
    table::{Line, Spread, Target, Unit, time},
};

/// How many times the echo's median a round trip's may be.
const MOST_TIMES: f64 = 1.5;

/// Pairs of calls before those that are measured: connections and caches warm up.
const UNMEASURED: usize = 30;

pub(crate) fn measure(setting: &Setting, server: &TestServer, things: &[Thing]) -> Vec<Line> {
    let mut requests = setting.built_in_requests();
    requests.extend(things.iter().flat_map(Thing::requests));
    let unmeasured = requests.len().min(UNMEASURED);
    let requests: Vec<_> = requests[..unmeasured]
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
            let answer = ask(&mut client, request).await;
            echoes.push(echo.time(answer.sent_bytes, answer.received_bytes).await);
            answers.push(answer);
            bar.inc(1);
        }
    });
    let (answers, echoes) = (answers.split_off(unmeasured), echoes.split_off(unmeasured));

    let (round_trip, echo) = (round_trips(&answers), Spread::of_times(echoes));
    let median_of = |bytes: fn(&Answer) -> usize| {
        let bytes: Vec<f64> = answers.iter().map(|answer| bytes(answer) as f64).collect();
        Spread::of(&bytes).median
    };
    let times = round_trip.median / echo.median;
    let in_search = search_times(&answers).median;
    vec![
        Line::new(Row::Wire, "echo", Unit::Seconds, echo).remark(format!(
            "{} bytes there and {} back, at the median",
            median_of(|answer| answer.sent_bytes),
            median_of(|answer| answer.received_bytes)
        )),
        Line::new(Row::Wire, "FindGrasp, all holdouts", Unit::Seconds, round_trip)
            .target(Target::at_most(
                "median, in echoes",
                Unit::Times,
                times,
                MOST_TIMES,
            ))
            .remark(format!(
                "of the median, {} are the search's, {} the echo's, {} all else",
                time(in_search),
                time(echo.median),
                time(round_trip.median - echo.median - in_search)
            )),
    ]
}
