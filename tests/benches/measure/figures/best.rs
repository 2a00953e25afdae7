//! The best grasp within a budget of 5 ms, and requests for the best that name no budget.

use std::{sync::Arc, time::Duration};

use grasp_proto::v1;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout};

use crate::figures::{
    Row,
    core::CoreSearcher,
    requests::{Answer, assert_some_found, search_times, share},
    setting::{Setting, TestObject, built_in_holdouts},
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
    let best = |mut request: v1::FindGraspRequest| {
        request.search_mut().choice = v1::GraspChoice::BestWithinBudget.into();
        request
    };
    let within_budget = |request| best(request).with_budget(BUDGET);
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
    for test_object in test_objects {
        all.extend(send(test_object.id(), test_object.requests()));
    }
    let mut lines = in_the_core(test_objects);
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

/// How many valid grasps a search of the core compares within the budget, with the atlases that the server has.
fn in_the_core(test_objects: &[TestObject]) -> Vec<Line> {
    let core = CoreSearcher::new();
    let built_in = built_in_holdouts();
    let (mut fixed, mut random) = (Vec::new(), Vec::new());
    for test_object in test_objects {
        let Some(atlas) = core.atlas(test_object.id(), &Setting::atlases(), &test_object.object) else {
            continue;
        };
        let compared = |(seed, holdout): (usize, &ClientHoldout)| {
            let holdout = ClientHoldout::holdout(holdout, Arc::clone(&test_object.object));
            core.compared(&holdout, &atlas, BUDGET, seed as u64)
        };
        let of_object = built_in.iter().filter(|(object, _)| *object == test_object.id());
        fixed.extend(of_object.map(|(_, holdout)| holdout).enumerate().map(compared));
        let holdouts = test_object.holdouts.iter().take(MAX_REQUESTS);
        random.extend(holdouts.enumerate().map(compared));
    }
    let all = [&fixed[..], &random].concat();
    let line = |what: &str, compared: &[u64]| {
        let counts: Vec<f64> = compared.iter().map(|&count| count as f64).collect();
        let least = compared.iter().min().copied().unwrap_or(0);
        let without = compared.iter().filter(|&&count| count == 0).count();
        let without = 100.0 * without as f64 / compared.len() as f64;
        let what = format!("core, candidates, {what}");
        Line::new(Row::Best, what, Unit::Count, Spread::of(&counts))
            .remark(format!("least {least}, {without:.1} % without a grasp"))
    };
    if random.is_empty() {
        return Vec::new();
    }
    let counts: Vec<f64> = all.iter().map(|&count| count as f64).collect();
    let median = Spread::of(&counts).median;
    vec![
        line("the 15 holdouts", &fixed),
        line("random", &random),
        line("all", &all).target(Target::at_least("median", Unit::Count, median, CANDIDATES)),
    ]
}

/// Time beyond the budget, as the server reports it and as the client sees it.
fn overshoot(answers: &[Answer]) -> [Line; 2] {
    let beyond = |taken: fn(&Answer) -> f64| {
        let beyond: Vec<f64> = answers
            .iter()
            .map(|answer| taken(answer) - BUDGET.as_secs_f64())
            .collect();
        Spread::of(&beyond)
    };
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
            time(BUDGET.as_secs_f64())
        )),
        Line::new(Row::Best, "overshoot, round trip", Unit::Seconds, in_client)
            .remark("includes the wire and writing the answer"),
    ]
}
