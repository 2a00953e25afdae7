//! Everyday objects that nobody holds out: what the first call on a new object answers, and later calls without an atlas.

use grasp_everyday::{EverydayObject, Hands, everyday_objects};
use grasp_proto::v1;

use grasp_tests::progress::bar;

use crate::figures::{
    Row,
    cold::without_atlas,
    requests::{Answer, assert_some_found, search_times, send, share, within_50_ms},
    setting::{Setting, forbidden},
    table::{Line, Target, Unit},
};

/// Share of the objects that should be answered in time.
const IN_TIME: f64 = 0.95;

/// Calls on an object after the first.
const LATER_CALLS: u64 = 10;

/// Objects in a quick run.
const QUICK_OBJECTS: usize = 3;

/// Measures a server that neither has nor builds atlases, on all that one hand can hold.
pub(crate) fn measure(setting: &Setting) -> Vec<Line> {
    let mut objects = everyday_objects();
    objects.retain(|object| object.hands == Hands::One);
    if setting.quick {
        objects.truncate(QUICK_OBJECTS);
    }
    let server = setting.server(|_| {});
    let bar = bar(objects.len(), "everyday objects".to_owned());
    let answers: Vec<Vec<Answer>> = setting.calling.block_on(async {
        let mut registry = server.objects().await;
        let mut client = server.grasps().await;
        let mut all = Vec::new();
        for object in &objects {
            let created = registry.create_object(create(object)).await;
            created.expect("everyday objects are sound");
            let mut answers = Vec::new();
            for seed in 0..=LATER_CALLS {
                answers.push(send(&mut client, request(object, seed)).await);
            }
            all.push(answers);
            bar.inc(1);
        }
        all
    });
    setting.serving.block_on(server.stop());
    let first: Vec<Answer> = answers.iter().map(|answers| answers[0]).collect();
    let later: Vec<Answer> = answers
        .iter()
        .flat_map(|answers| &answers[1..])
        .copied()
        .collect();
    assert_some_found(&first);
    let missing = |calls: &dyn Fn(&[Answer]) -> Vec<Answer>| {
        let of_objects = objects.iter().zip(&answers);
        let missed = of_objects.filter_map(|(object, answers)| {
            let calls = calls(answers);
            let missed = calls.iter().filter(|answer| !answer.is_in_time()).count();
            (missed > 0).then(|| format!("{} {missed}", object.name))
        });
        missed.collect::<Vec<_>>().join(", ")
    };
    vec![
        line("first calls", &first, &missing(&|answers| vec![answers[0]])),
        line("later calls", &later, &missing(&|answers| answers[1..].to_vec())),
    ]
}

fn line(what: &str, answers: &[Answer], missing: &str) -> Line {
    let in_time = share(answers, Answer::is_in_time);
    Line::new(Row::Everyday, what, Unit::Seconds, search_times(answers))
        .target(Target::at_least("in 50 ms", Unit::Share, in_time, IN_TIME))
        .remark(format!("missed: {missing}"))
}

fn create(object: &EverydayObject) -> v1::CreateObjectRequest {
    let mut request = v1::CreateObjectRequest::new(object.name, object.obj(), object.mass_kg() as f32);
    let new = request.object_mut();
    new.center_of_mass = object.centre_of_mass().map(|centre| centre.as_vec3().into());
    new.friction = Some(object.surface.friction() as f32);
    new.regions = forbidden(object.forbidden.iter().map(|&group| group.to_owned()).collect());
    request
}

fn request(object: &EverydayObject, seed: u64) -> v1::FindGraspRequest {
    let request = v1::FindGraspRequest::new(format!("objects/{}", object.name));
    without_atlas(within_50_ms(request.with_seed(seed)))
}
