//! Warm: requests that an atlas may answer, first valid, in the server.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout};

use crate::{
    Row,
    asking::{Answer, assert_some_found, search_times, share, wire_duration, within_50_ms},
    core::{Core, Taken},
    setting::{Setting, Thing, built_in_holdouts},
    table::{Line, Spread, Target, Unit, time},
};

/// Limits of median, p99 and p99.9 in seconds.
const MEDIAN: f64 = 20e-6;
const P99: f64 = 0.5e-3;
const P999: f64 = 2e-3;

/// Unanswered requests of an object that are asked again, and with which budget: the server's default would not tell a
/// hard one from an impossible one.
const ASKED_AGAIN: usize = 20;
const PATIENCE: Duration = Duration::from_secs(3);

/// Requests before those that are measured, to fill caches: of random holdouts others than those, as what their searches
/// find is known from then on. Of few requests, half.
const UNMEASURED: usize = 30;

pub(crate) fn measure(setting: &Setting, server: &TestServer, things: &[Thing]) -> Vec<Line> {
    let mut lines = in_the_server(setting, server, things);
    lines.extend(in_the_core(setting, things));
    lines
}

/// What the server's own reports say.
fn in_the_server(setting: &Setting, server: &TestServer, things: &[Thing]) -> Vec<Line> {
    let ask = |message: &str, requests: &[v1::FindGraspRequest]| {
        let requests = requests.iter().cloned();
        let unmeasured = UNMEASURED.min(requests.len() / 2);
        setting
            .ask_all(server, message, requests.map(within_50_ms))
            .split_off(unmeasured)
    };
    let built_in = ask("warm, the 15 holdouts", &setting.built_in_requests());
    assert_some_found(&built_in);
    let mut lines = vec![line("server, the 15 holdouts", &built_in, "").limits(MEDIAN, P99, Some(P999))];
    let mut all = Vec::new();
    for thing in things {
        let requests = thing.requests();
        let answers = ask(&format!("warm, {}", thing.id()), &requests);
        let unmeasured = requests.len() - answers.len();
        let late = requests.into_iter().skip(unmeasured).zip(&answers);
        let late = late.filter(|(_, answer)| !answer.is_in_time());
        let again = ask_again(setting, server, late.map(|(request, _)| request).collect());
        let line = line(&format!("server, random {}", thing.id()), &answers, &again);
        lines.push(line.target(answered(&answers)));
        all.extend(answers);
    }
    let line = line("server, random, all", &all, "").target(answered(&all));
    lines.push(line.limits(MEDIAN, P99, Some(P999)));
    lines
}

/// Asks once more, with patience, for some that were not answered: a giver may leave nothing to be grasped. In words.
fn ask_again(setting: &Setting, server: &TestServer, late: Vec<v1::FindGraspRequest>) -> String {
    let some = late.len().min(ASKED_AGAIN);
    if some == 0 || setting.quick {
        return String::new();
    }
    let patient = late.into_iter().take(some).map(|request| v1::FindGraspRequest {
        budget: wire_duration(PATIENCE),
        ..request
    });
    let answers = setting.ask_all(server, "asking again", patient);
    let found = answers.iter().filter(|answer| answer.found).count();
    format!(
        "; {found} of {some} late ones answered in {}",
        time(PATIENCE.as_secs_f64())
    )
}

fn answered(answers: &[Answer]) -> Target {
    Target::at_least("in 50 ms", Unit::Share, share(answers, Answer::is_in_time), 1.0)
}

fn line(what: &str, answers: &[Answer], about_late: &str) -> Line {
    let late = answers.iter().filter(|answer| !answer.is_in_time()).count();
    let of_atlas = share(answers, |answer| answer.from_atlas);
    let of_recent = share(answers, |answer| answer.from_recent);
    let in_time: Vec<Answer> = answers.iter().copied().filter(Answer::is_in_time).collect();
    let p99 = (!in_time.is_empty())
        .then(|| search_times(&in_time).p99)
        .flatten();
    let p99 = p99.map_or_else(String::new, |p99| format!(", the others' p99 is {}", time(p99)));
    Line::new(Row::Warm, what, Unit::Seconds, search_times(answers)).remark(format!(
        "{:.1} % answered by the atlas, {:.1} % by what was found for others, {late} of {} unanswered in 50 ms{p99}{about_late}",
        100.0 * of_atlas,
        100.0 * of_recent,
        answers.len()
    ))
}

/// The same holdouts without a server.
fn in_the_core(setting: &Setting, things: &[Thing]) -> Vec<Line> {
    let core = Core::new(setting.mechanisms);
    let built_in = built_in_holdouts();
    let mut searches = Vec::new();
    let mut look_ups = Vec::new();
    for thing in things {
        let Some(atlas) = core.atlas(thing.id(), &Setting::atlases(), &thing.object) else {
            continue;
        };
        let of_thing = built_in.iter().filter(|(object, _)| *object == thing.id());
        let fixed = of_thing.map(|(_, holdout)| holdout);
        let repeated: Vec<_> = fixed.cycle().take(setting.holdouts.div_ceil(3)).collect();
        let random: Vec<_> = thing.holdouts.iter().collect();
        for (is_random, holdouts) in [(false, repeated), (true, random)] {
            for (seed, holdout) in holdouts.into_iter().enumerate() {
                let holdout = ClientHoldout::holdout(holdout, thing.object.clone());
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
            let taken: Vec<Taken> = of_kind.map(|(_, taken)| *taken).collect();
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
