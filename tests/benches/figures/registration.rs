//! From a mesh to an object that is called, an atlas that is of use, and a complete one; and what others notice of it.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use grasp_tests::{TestServer, recorded::object_of};
use tonic::transport::Channel;

use crate::{
    Row,
    asking::{Answer, ask, round_trips, search_times, share, within_50_ms},
    ellipsoid::ellipsoid,
    setting::{Setting, Thing, atlas_state, bar},
    table::{Line, Spread, Target, Unit, time},
};

/// Limits in seconds.
const CALLABLE: f64 = 0.05;
const USEFUL: f64 = 5.0;
const COMPLETE: f64 = 120.0;

/// The share of random holdouts that a useful atlas answers.
const USEFUL_SHARE: f64 = 0.9;

/// How many times the idle p99 the p99 may be while an atlas grows.
const MOST_TIMES: f64 = 2.0;

/// The objects' mass in kilograms.
const MASS: f32 = 0.1;

/// Random holdouts by which an atlas is judged each time that it has grown: enough to tell nine of ten from eight.
/// Builders wait while searches run, so more make it look slower.
const JUDGED_BY: usize = 60;

/// How often it is looked whether an atlas has grown: the error of the times to a useful and a complete one.
const LOOKS_EVERY: Duration = Duration::from_millis(20);

/// How long a complete atlas is waited for.
const PATIENCE: Duration = Duration::from_mins(10);

/// Registrations that are timed until they are answered.
const REGISTRATIONS: usize = 20;

/// Time between two requests of a client while others are served: those of some players together. Without a pause
/// builders would always wait.
const PACE: Duration = Duration::from_millis(5);

/// Requests before those that are measured.
const UNMEASURED: usize = 30;

pub(crate) fn measure(setting: &Setting, others: &[Thing]) -> Vec<Line> {
    // The atlases of the others, which must not grow meanwhile, and none of these meshes.
    let others: Vec<&Thing> = others.iter().collect();
    let complete = setting.server_with_atlases(&others);
    setting.serving.block_on(complete.stop());
    let folder = setting.copied_atlases();
    let start = || {
        setting.server(|config| {
            config.builder_threads = 1;
            config.atlas_directory = Some(folder.clone());
        })
    };
    let server = start();
    let mut lines = growth(setting, &server);
    // What it builds next must not be noticed by the others.
    setting.serving.block_on(server.stop());
    let server = start();
    lines.extend(meanwhile(setting, &server, others[0]));
    setting.serving.block_on(server.stop());
    lines.push(callable(setting));
    lines
}

fn create(number: u8) -> v1::CreateObjectRequest {
    v1::CreateObjectRequest {
        object_id: format!("ellipsoid-{number}"),
        obj: ellipsoid(number).into_bytes(),
        mass_kg: MASS,
        ..Default::default()
    }
}

/// How long `CreateObject` takes, where nothing else goes on.
fn callable(setting: &Setting) -> Line {
    let server = setting.server(|_| {});
    let registrations = if setting.quick { 1 } else { REGISTRATIONS };
    let (times, triangles) = setting.calling.block_on(async {
        let mut client = server.objects().await;
        let mut times = Vec::new();
        let mut triangles = 0;
        for number in 0..registrations {
            let request = v1::CreateObjectRequest {
                object_id: format!("copy-{number}"),
                ..create(0)
            };
            let start = Instant::now();
            let answer = client.create_object(request).await.expect("the mesh is sound");
            times.push(start.elapsed());
            let object = answer.into_inner().object.expect("an answer has the object");
            assert!(
                object.warnings.is_empty(),
                "the mesh is odd: {:?}",
                object.warnings
            );
            triangles = object.triangle_count;
        }
        (times, triangles)
    });
    setting.serving.block_on(server.stop());
    let spread = Spread::of_times(times);
    line("callable", spread)
        .target(Target::at_most("median", Unit::Seconds, spread.median, CALLABLE))
        .remark(format!("{triangles} triangles"))
}

/// Registers an object and watches its atlas grow.
fn growth(setting: &Setting, server: &TestServer) -> Vec<Line> {
    let request = create(1);
    let object = Arc::new(object_of(&request.obj, MASS));
    let thing = setting.thing(&request.object_id.clone(), object, Some(request.clone()));
    let judges: Vec<_> = thing.requests().into_iter().take(JUDGED_BY).collect();
    let bar = bar(0, "an atlas grows".to_owned());
    setting.calling.block_on(async {
        let mut client = server.grasps().await;
        let start = Instant::now();
        let created = server.objects().await.create_object(request).await;
        created.expect("the mesh is sound");
        let mut useful = None;
        let mut stamp = String::new();
        loop {
            let state = atlas_state(server, &thing.name).await;
            let grown = start.elapsed();
            if state.stamp != stamp && useful.is_none() {
                stamp.clone_from(&state.stamp);
                let answers = judge(&mut client, &judges).await;
                let by_atlas = share(&answers, |answer| answer.from_atlas);
                if by_atlas >= USEFUL_SHARE {
                    useful = Some((
                        grown,
                        format!(
                            "{} grips answer {:.0} % of {}",
                            state.entries,
                            100.0 * by_atlas,
                            judges.len()
                        ),
                    ));
                }
            }
            bar.set_message(format!("an atlas grows: {} grips", state.entries));
            let is_over = state.complete || grown > PATIENCE || (setting.quick && !stamp.is_empty());
            if is_over {
                return growth_lines(useful, &state, grown);
            }
            tokio::time::sleep(LOOKS_EVERY).await;
        }
    })
}

async fn judge(client: &mut GraspServiceClient<Channel>, judges: &[v1::FindGraspRequest]) -> Vec<Answer> {
    let mut answers = Vec::with_capacity(judges.len());
    for request in judges {
        answers.push(ask(client, within_50_ms(request.clone())).await);
    }
    answers
}

fn growth_lines(useful: Option<(Duration, String)>, last: &v1::AtlasState, grown: Duration) -> Vec<Line> {
    let once = |what: &str, time: Duration, limit: f64, came: bool| {
        let seconds = time.as_secs_f64();
        let target = Target::at_most("time", Unit::Seconds, seconds, limit).unless_given_up(!came);
        line(what, Spread::of(&[seconds])).target(target)
    };
    let is_useful = useful.is_some();
    let (time_to_use, use_told) = useful.unwrap_or_else(|| {
        let told = format!("not by then: {} grips answer too few", last.entries);
        (grown, told)
    });
    let end = if last.complete {
        ""
    } else {
        "not complete by then: "
    };
    vec![
        once("atlas useful", time_to_use, USEFUL, is_useful).remark(use_told),
        once("atlas complete", grown, COMPLETE, last.complete).remark(format!("{end}{} grips", last.entries)),
    ]
}

/// Asks for another object at a steady pace, first in peace, then while an object is registered and its atlas grows.
fn meanwhile(setting: &Setting, server: &TestServer, other: &Thing) -> Vec<Line> {
    let requests = other.requests();
    let (idle, busy, state) = setting.calling.block_on(async {
        let mut client = server.grasps().await;
        paced(&mut client, &requests[..requests.len().min(UNMEASURED)]).await;
        let idle = paced(&mut client, &requests).await;
        let request = create(2);
        let name = format!("objects/{}", request.object_id);
        let mut objects = server.objects().await;
        let registering = setting
            .serving
            .spawn(async move { objects.create_object(request).await });
        let busy = paced(&mut client, &requests).await;
        let registered = registering.await.expect("the call does not panic");
        registered.expect("the mesh is sound");
        (idle, busy, atlas_state(server, &name).await)
    });
    let (idle_trips, busy_trips) = (round_trips(&idle), round_trips(&busy));
    let told = |answers: &[Answer]| format!("search: {}", outer(search_times(answers)));
    let busy_line = line("serving meanwhile, round trip", busy_trips).remark(format!(
        "{}; the atlas had {} grips at the end{}",
        told(&busy),
        state.entries,
        if state.complete {
            ", and had not grown all the time"
        } else {
            ""
        }
    ));
    vec![
        line("serving in peace, round trip", idle_trips).remark(told(&idle)),
        match (idle_trips.p99, busy_trips.p99) {
            (Some(idle), Some(busy)) => busy_line.target(Target::at_most(
                "p99, in those of peace",
                Unit::Times,
                busy / idle,
                MOST_TIMES,
            )),
            _ => busy_line,
        },
    ]
}

/// Median and p99 in words.
fn outer(spread: Spread) -> String {
    let p99 = spread.p99.map_or_else(|| "–".to_owned(), time);
    format!("median {}, p99 {p99}", time(spread.median))
}

async fn paced(client: &mut GraspServiceClient<Channel>, requests: &[v1::FindGraspRequest]) -> Vec<Answer> {
    let mut ticks = tokio::time::interval(PACE);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut answers = Vec::with_capacity(requests.len());
    for request in requests {
        ticks.tick().await;
        answers.push(ask(client, request.clone()).await);
    }
    answers
}

fn line(what: &str, spread: Spread) -> Line {
    Line::new(Row::Registration, what, Unit::Seconds, spread)
}
