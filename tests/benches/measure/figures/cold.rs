//! Cold: requests without an atlas.

use grasp_assets::objects::objects;
use grasp_proto::v1;
use grasp_tests::{TestServer, progress::bar};

use crate::figures::{
    Row,
    requests::{Answer, assert_some_found, search_times, send, share},
    setting::{Setting, TestObject, copy_of},
    table::{Line, Unit},
};

/// Targets for median and p99, in seconds.
const MEDIAN: f64 = 2e-3;
const P99: f64 = 33e-3;

/// Limit on requests per kind: one without an answer takes a second.
const MAX_REQUESTS: usize = 400;

/// Copies registered per object, each asked for once: enough for a p99 over all three, and few enough for the
/// server's cache.
const REGISTERED: usize = 40;

/// Measures a server that neither has nor builds atlases.
pub(crate) fn measure(setting: &Setting, test_objects: &[TestObject]) -> Vec<Line> {
    let server = setting.server(|_| {});
    let send_all = |what: &str, requests: Vec<v1::FindGraspRequest>| {
        let requests = requests.into_iter().take(MAX_REQUESTS).map(without_atlas);
        setting.send_all(&server, &format!("cold, {what}"), requests)
    };
    let mut all = send_all("the 15 holdouts", setting.built_in_requests());
    assert_some_found(&all);
    let mut lines = vec![line("the 15 holdouts", &all)];
    for test_object in test_objects {
        let answers = send_all(test_object.id(), test_object.requests());
        lines.push(line(&format!("random {}", test_object.id()), &answers));
        all.extend(answers);
    }
    lines.push(line("all", &all));
    lines.push(line(
        "very first calls of new objects",
        &first_calls(setting, &server, test_objects),
    ));
    setting.serving.block_on(server.stop());
    lines
}

/// The same request, to be answered without an atlas.
pub(crate) fn without_atlas(mut request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    request.search_mut().ignore_atlas = true;
    request
}

fn line(what: &str, answers: &[Answer]) -> Line {
    Line::new(Row::Cold, what, Unit::Seconds, search_times(answers))
        .limits(MEDIAN, P99, None)
        .remark(format!(
            "{:.1} % answered in 50 ms, {:.1} % in a second",
            100.0 * share(answers, Answer::is_in_time),
            100.0 * share(answers, |answer| answer.found)
        ))
}

/// Copies of the built-in objects, each registered and asked for once.
fn first_calls(setting: &Setting, server: &TestServer, test_objects: &[TestObject]) -> Vec<Answer> {
    let copies = if setting.quick { 1 } else { REGISTERED };
    let bar = bar(
        copies * test_objects.len(),
        "first calls of new objects".to_owned(),
    );
    setting.calling.block_on(async {
        let mut registry = server.objects().await;
        let mut client = server.grasps().await;
        let mut answers = Vec::new();
        for (test_object, built_in) in test_objects.iter().zip(objects()) {
            for (number, holdout) in test_object.holdouts.iter().take(copies).enumerate() {
                let id = format!("{}-{number}", test_object.id());
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
