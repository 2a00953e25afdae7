//! Warm: requests that an atlas can answer, first valid grasp, in the server and in the core.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout};

use crate::figures::{
    Row,
    core::{CoreSearcher, Timing},
    requests::{Answer, assert_some_found, search_times, share, within_50_ms},
    setting::{Setting, TestObject, built_in_holdouts},
    table::{Line, Spread, Target, Unit, time},
};

/// Targets for median, p99 and p99.9, in seconds.
const MEDIAN: f64 = 20e-6;
const P99: f64 = 0.5e-3;
const P999: f64 = 2e-3;

/// Unanswered requests per object that are retried, and their budget: with the server's default, hard and impossible
/// ones would look alike.
const MAX_RETRIES: usize = 20;
const RETRY_BUDGET: Duration = Duration::from_secs(3);

/// Requests sent before measuring, to fill caches; half of them if there are few. Random ones use other holdouts than
/// the measured ones, because the server remembers the grips found.
const WARM_UP: usize = 30;

pub(crate) fn measure(setting: &Setting, server: &TestServer, test_objects: &[TestObject]) -> Vec<Line> {
    let mut lines = in_the_server(setting, server, test_objects);
    lines.extend(in_the_core(setting, test_objects));
    lines
}

/// From the server's own reports.
fn in_the_server(setting: &Setting, server: &TestServer, test_objects: &[TestObject]) -> Vec<Line> {
    let send = |message: &str, requests: &[v1::FindGraspRequest]| {
        let requests = requests.iter().cloned();
        let warm_up = WARM_UP.min(requests.len() / 2);
        setting
            .send_all(server, message, requests.map(within_50_ms))
            .split_off(warm_up)
    };
    let built_in = send("warm, the 15 holdouts", &setting.built_in_requests());
    assert_some_found(&built_in);
    let mut lines = vec![line("server, the 15 holdouts", &built_in, "").limits(MEDIAN, P99, Some(P999))];
    let mut all = Vec::new();
    for test_object in test_objects {
        let requests = test_object.requests();
        let answers = send(&format!("warm, {}", test_object.id()), &requests);
        let warm_up = requests.len() - answers.len();
        let late = requests.into_iter().skip(warm_up).zip(&answers);
        let late = late.filter(|(_, answer)| !answer.is_in_time());
        let again = retry_late(setting, server, late.map(|(request, _)| request).collect());
        let line = line(&format!("server, random {}", test_object.id()), &answers, &again);
        lines.push(line.target(answered(&answers)));
        all.extend(answers);
    }
    let line = line("server, random, all", &all, "").target(answered(&all));
    lines.push(line.limits(MEDIAN, P99, Some(P999)));
    lines
}

/// Retries some unanswered requests with a longer budget, because a giver may leave nothing to grasp. Returns the
/// result as text.
fn retry_late(setting: &Setting, server: &TestServer, late: Vec<v1::FindGraspRequest>) -> String {
    let some = late.len().min(MAX_RETRIES);
    if some == 0 || setting.quick {
        return String::new();
    }
    let late = late.into_iter().take(some);
    let patient = late.map(|request| request.with_budget(RETRY_BUDGET));
    let answers = setting.send_all(server, "retrying late ones", patient);
    let found = answers.iter().filter(|answer| answer.found).count();
    format!(
        "; {found} of {some} late ones answered in {}",
        time(RETRY_BUDGET.as_secs_f64())
    )
}

fn answered(answers: &[Answer]) -> Target {
    Target::at_least("in 50 ms", Unit::Share, share(answers, Answer::is_in_time), 1.0)
}

fn line(what: &str, answers: &[Answer], about_late: &str) -> Line {
    let late = answers.iter().filter(|answer| !answer.is_in_time()).count();
    let of_atlas = share(answers, |answer| answer.from_atlas);
    let of_learned = share(answers, |answer| answer.from_learned);
    let in_time: Vec<Answer> = answers.iter().copied().filter(Answer::is_in_time).collect();
    let p99 = (!in_time.is_empty())
        .then(|| search_times(&in_time).p99)
        .flatten();
    let p99 = p99.map_or_else(String::new, |p99| format!(", p99 of the others {}", time(p99)));
    Line::new(Row::Warm, what, Unit::Seconds, search_times(answers)).remark(format!(
        "{:.1} % answered by the atlas, {:.1} % by learned grips, {late} of {} unanswered in 50 ms{p99}{about_late}",
        100.0 * of_atlas,
        100.0 * of_learned,
        answers.len()
    ))
}

/// The same holdouts without a server.
fn in_the_core(setting: &Setting, test_objects: &[TestObject]) -> Vec<Line> {
    let core = CoreSearcher::new();
    let built_in = built_in_holdouts();
    let mut searches = Vec::new();
    let mut look_ups = Vec::new();
    for test_object in test_objects {
        let Some(atlas) = core.atlas(test_object.id(), &Setting::atlases(), &test_object.object) else {
            continue;
        };
        let of_object = built_in.iter().filter(|(object, _)| *object == test_object.id());
        let fixed = of_object.map(|(_, holdout)| holdout);
        let repeated: Vec<_> = fixed.cycle().take(setting.holdouts.div_ceil(3)).collect();
        let random: Vec<_> = test_object.holdouts.iter().collect();
        for (is_random, holdouts) in [(false, repeated), (true, random)] {
            for (seed, holdout) in holdouts.into_iter().enumerate() {
                let holdout = ClientHoldout::holdout(holdout, test_object.object.clone());
                searches.push((is_random, core.search(&holdout, &atlas, seed as u64)));
                look_ups.push((is_random, core.look_up(&holdout, &atlas)));
            }
        }
    }
    let mut lines = Vec::new();
    for (what, taken) in [
        ("core, as the server searches", searches),
        ("core, look-up alone, processor time", look_ups),
    ] {
        for (of, is_random) in [("the 15 holdouts", false), ("random, all", true)] {
            let of_kind = taken.iter().filter(|(random, _)| *random == is_random);
            let taken: Vec<Timing> = of_kind.map(|(_, taken)| *taken).collect();
            if taken.is_empty() {
                continue;
            }
            let missed = taken.iter().filter(|taken| !taken.found).count();
            let spread = Spread::of_times(taken.iter().map(|taken| taken.time));
            let line = Line::new(Row::Warm, format!("{what}, {of}"), Unit::Seconds, spread);
            lines.push(line.remark(format!("{missed} without a grasp")));
        }
    }
    lines
}
