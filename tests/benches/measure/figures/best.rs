//! The best grasp within a budget of 5 ms, and requests for the best that name no budget.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::figures::{
    Row,
    requests::{Answer, assert_some_found, search_times, share, wire_duration},
    setting::{Setting, TestObject},
    table::{Line, Spread, Target, Unit, time},
};

/// The budget, equal to what a search for the best spends on comparing where the request names none. Without a named
/// budget, a search without a grasp by then goes on to the first; with one, it ends.
const BUDGET: Duration = Duration::from_millis(5);

/// Target: grasps compared, at the median.
const CANDIDATES: f64 = 500.0;

/// Target: p99 of the time a search takes beyond its budget, in seconds.
const OVERSHOOT: f64 = 0.5e-3;

/// Limit on requests per object, because each takes the whole budget.
const MAX_REQUESTS: usize = 400;

pub(crate) fn measure(setting: &Setting, server: &TestServer, test_objects: &[TestObject]) -> Vec<Line> {
    let best = |request| v1::FindGraspRequest {
        choice: v1::Choice::BestWithinBudget.into(),
        ..request
    };
    let within_budget = |request| v1::FindGraspRequest {
        budget: wire_duration(BUDGET),
        ..best(request)
    };
    let mut without = Vec::new();
    let mut send = |what: &str, mut requests: Vec<v1::FindGraspRequest>| {
        requests.truncate(MAX_REQUESTS);
        let asked = requests.iter().cloned().map(within_budget);
        let answers = setting.send_all(server, &format!("best, {what}"), asked);
        let answered = requests.into_iter().zip(&answers);
        without.extend(answered.filter_map(|(request, answer)| (!answer.found).then_some(request)));
        answers
    };
    let mut all = send("the 15 holdouts", setting.built_in_requests());
    assert_some_found(&all);
    let mut lines = vec![candidates("the 15 holdouts", &all)];
    for test_object in test_objects {
        let answers = send(test_object.id(), test_object.requests());
        lines.push(candidates(&format!("random {}", test_object.id()), &answers));
        all.extend(answers);
    }
    let spread = candidates_of(&all);
    lines.push(candidates("all", &all).target(Target::at_least(
        "median",
        Unit::Count,
        spread.median,
        CANDIDATES,
    )));
    lines.extend(overshoot(&all));
    if !without.is_empty() {
        let again = setting.send_all(server, "best, without a budget", without.into_iter().map(best));
        let in_time = share(&again, Answer::is_in_time);
        let found = share(&again, |answer| answer.found);
        lines.push(
            Line::new(
                Row::Best,
                "those without a grasp, no budget named",
                Unit::Seconds,
                search_times(&again),
            )
            .remark(format!(
                "{:.0} % answered in 50 ms, {:.0} % within the server's default",
                100.0 * in_time,
                100.0 * found
            )),
        );
    }
    lines
}

fn candidates_of(answers: &[Answer]) -> Spread {
    let ranked: Vec<f64> = answers.iter().map(|answer| answer.candidates as f64).collect();
    Spread::of(&ranked)
}

fn candidates(what: &str, answers: &[Answer]) -> Line {
    let least = answers.iter().map(|answer| answer.candidates).min().unwrap_or(0);
    Line::new(
        Row::Best,
        format!("candidates, {what}"),
        Unit::Count,
        candidates_of(answers),
    )
    .remark(format!(
        "least {least}, {:.1} % without a grasp",
        100.0 * share(answers, |answer| !answer.found)
    ))
}

/// Time beyond the budget, as the server reports it and as the client sees it.
fn overshoot(answers: &[Answer]) -> [Line; 2] {
    let beyond = |taken: fn(&Answer) -> f64| {
        let beyond: Vec<f64> = answers
            .iter()
            .map(|answer| taken(answer) - answer.budget.as_secs_f64())
            .collect();
        Spread::of(&beyond)
    };
    let budget = answers[0].budget.as_secs_f64();
    let in_server = beyond(|answer| answer.search_time.as_secs_f64());
    let in_client = beyond(|answer| answer.round_trip.as_secs_f64());
    let line = Line::new(Row::Best, "overshoot, search", Unit::Seconds, in_server);
    [
        match in_server.p99 {
            Some(p99) => line.target(Target::at_most("p99", Unit::Seconds, p99, OVERSHOOT)),
            None => line,
        }
        .remark(format!(
            "budget {}, counted from the call's arrival",
            time(budget)
        )),
        Line::new(Row::Best, "overshoot, round trip", Unit::Seconds, in_client)
            .remark("includes the wire and writing the answer"),
    ]
}
