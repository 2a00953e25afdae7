//! Requests without an atlas, of servers that neither have nor build any: at holdouts, and of everyday objects that nobody holds.

use grasp_assets::objects::objects;
use grasp_everyday::{EverydayObject, Hands, everyday_objects};
use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::{
    setting::{
        Answer, Setting, assert_some_found, bar, copy_of, forbidden, search_times, send, share, within_50_ms,
        without_atlas,
    },
    table::{Line, Unit},
};

/// Targets for median and p99 at holdouts, in seconds.
const MEDIAN: f64 = 2e-3;
const P99: f64 = 33e-3;

/// Limit on requests per kind: one without an answer takes a second.
const MAX_REQUESTS: usize = 400;

/// Copies registered per object, each requested once: enough for a p99 over all three, and few enough for the
/// server's cache.
const REGISTERED: usize = 40;

/// Share of the everyday objects that should be answered in time.
const IN_TIME: f64 = 0.95;

/// Calls on an everyday object after the first.
const LATER_CALLS: u64 = 10;

/// Everyday objects in a brief run.
const BRIEF_OBJECTS: usize = 3;

/// At holdouts.
pub(crate) fn measure(setting: &Setting) -> Vec<Line> {
    let server = setting.server(|_| {});
    let send_all = |what: &str, requests: Vec<v1::FindGraspRequest>| {
        let requests = requests.into_iter().take(MAX_REQUESTS).map(without_atlas);
        setting.send_all(&server, &format!("cold, {what}"), requests)
    };
    let mut all = send_all("the 15 holdouts", setting.built_in_requests());
    assert_some_found(&all);
    let mut lines = vec![line("the 15 holdouts", &all)];
    for test_object in setting.test_objects() {
        let answers = send_all(&test_object.id, test_object.requests());
        lines.push(line(&format!("random {}", test_object.id), &answers));
        all.extend(answers);
    }
    lines.push(line("all", &all));
    lines.push(line(
        "very first calls of new objects",
        &first_calls(setting, &server),
    ));
    setting.stop(server);
    lines
}

fn line(what: &str, answers: &[Answer]) -> Line {
    Line::new(format!("cold, {what}"), Unit::Seconds, search_times(answers))
        .limits(MEDIAN, P99, None)
        .remark(format!(
            "{:.1} % answered in 50 ms, {:.1} % in a second",
            100.0 * share(answers, Answer::is_in_time),
            100.0 * share(answers, |answer| answer.found)
        ))
}

/// Copies of the built-in objects, each registered and requested once.
fn first_calls(setting: &Setting, server: &TestServer) -> Vec<Answer> {
    let copies = if setting.is_brief { 1 } else { REGISTERED };
    let bar = bar(copies * objects().len(), "first calls of new objects".to_owned());
    setting.calling.block_on(async {
        let mut registry = server.objects().await;
        let mut client = server.grasps().await;
        let mut answers = Vec::new();
        for (test_object, built_in) in setting.test_objects().iter().zip(objects()) {
            for (number, holdout) in test_object.holdouts.iter().take(copies).enumerate() {
                let id = format!("{}-{number}", test_object.id);
                let created = registry.create_object(copy_of(built_in, &id)).await;
                created.expect("a built-in object can be registered again");
                let request = without_atlas(holdout.request(&format!("objects/{id}")));
                answers.push(send(&mut client, request).await);
                bar.inc(1);
            }
        }
        answers
    })
}

/// The first and later calls of all everyday objects that one hand can hold.
pub(crate) fn measure_everyday(setting: &Setting) -> Vec<Line> {
    let mut objects = everyday_objects();
    objects.retain(|object| object.hands == Hands::One);
    if setting.is_brief {
        objects.truncate(BRIEF_OBJECTS);
    }
    let server = setting.server(|_| {});
    let bar = bar(objects.len(), "everyday objects".to_owned());
    let answers: Vec<Vec<Answer>> = setting.calling.block_on(async {
        let mut registry = server.objects().await;
        let mut client = server.grasps().await;
        let mut all = Vec::new();
        for object in &objects {
            let created = registry.create_object(creation(object)).await;
            created.expect("everyday objects are sound");
            let mut answers = Vec::new();
            for seed in 0..=LATER_CALLS {
                let request = v1::FindGraspRequest::new(format!("objects/{}", object.name));
                let request = without_atlas(within_50_ms(request.with_seed(seed)));
                answers.push(send(&mut client, request).await);
            }
            all.push(answers);
            bar.inc(1);
        }
        all
    });
    setting.stop(server);
    let line = |what: &str, calls: &dyn Fn(&Vec<Answer>) -> Vec<Answer>| {
        let all: Vec<Answer> = answers.iter().flat_map(calls).collect();
        assert_some_found(&all);
        let of_objects = objects.iter().zip(&answers);
        let missed = of_objects.filter_map(|(object, answers)| {
            let missed = calls(answers)
                .iter()
                .filter(|answer| !answer.is_in_time())
                .count();
            (missed > 0).then(|| format!("{} {missed}", object.name))
        });
        let missed: Vec<String> = missed.collect();
        Line::new(format!("everyday, {what}"), Unit::Seconds, search_times(&all))
            .at_least("in 50 ms", Unit::Share, share(&all, Answer::is_in_time), IN_TIME)
            .remark(format!("missed: {}", missed.join(", ")))
    };
    vec![
        line("first calls", &|answers| vec![answers[0]]),
        line("later calls", &|answers| answers[1..].to_vec()),
    ]
}

/// The request that registers an everyday object.
fn creation(object: &EverydayObject) -> v1::CreateObjectRequest {
    let mut request = v1::CreateObjectRequest::new(object.name, object.obj(), object.mass_kg() as f32);
    let new = request.object_mut();
    new.center_of_mass = object.centre_of_mass().map(|centre| centre.as_vec3().into());
    new.friction = Some(object.surface.friction() as f32);
    new.regions = forbidden(object.forbidden.iter().map(|&group| group.to_owned()).collect());
    request
}
