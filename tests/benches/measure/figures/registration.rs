//! From a mesh to a callable object, a useful atlas and a complete one; and the effect on other calls meanwhile.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use grasp_tests::{TestServer, progress::bar, recorded::object_of};
use tonic::transport::Channel;

use crate::figures::{
    Row,
    ellipsoid::ellipsoid,
    requests::{Answer, round_trips, search_times, send, share, within_50_ms},
    setting::{Setting, TestObject, atlas_state, is_complete},
    table::{Line, Spread, Target, Unit, time},
};

/// Targets in seconds.
const CALLABLE: f64 = 0.05;
const USEFUL: f64 = 5.0;
const COMPLETE: f64 = 120.0;

/// Share of random holdouts that a useful atlas answers.
const USEFUL_SHARE: f64 = 0.9;

/// Target: p99 while an atlas grows over the idle p99.
const MAX_RATIO: f64 = 2.0;

/// Mass of the objects in kilograms.
const MASS: f32 = 0.1;

/// Random holdouts that probe an atlas each time it has grown: enough to distinguish nine in ten from eight. Builders wait
/// while searches run, so more make growth look slower.
const PROBES: usize = 60;

/// Interval between checks for growth: the error of the times to a useful and a complete atlas.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Longest wait for a complete atlas.
const ATLAS_TIMEOUT: Duration = Duration::from_mins(10);

/// Timed registrations.
const REGISTRATIONS: usize = 20;

/// Time between two requests of a client while others are served: the rate of a few players together. Without a
/// pause, builders would always wait.
const PACE: Duration = Duration::from_millis(5);

/// Requests sent before measuring.
const WARM_UP: usize = 30;

pub(crate) fn measure(setting: &Setting, others: &[TestObject]) -> Vec<Line> {
    // Complete atlases of the other objects, which must not grow meanwhile, and none of the new meshes.
    let others: Vec<&TestObject> = others.iter().collect();
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
    // Measure the effect on other calls from a fresh start.
    setting.serving.block_on(server.stop());
    let server = start();
    lines.extend(while_growing(setting, &server, others[0]));
    setting.serving.block_on(server.stop());
    lines.push(callable(setting));
    lines
}

fn ellipsoid_id(number: u8) -> String {
    format!("ellipsoid-{number}")
}

fn create(number: u8) -> v1::CreateObjectRequest {
    v1::CreateObjectRequest::new(ellipsoid_id(number), ellipsoid(number), MASS)
}

/// Duration of `CreateObject` on an idle server.
fn callable(setting: &Setting) -> Line {
    let server = setting.server(|_| {});
    let registrations = if setting.quick { 1 } else { REGISTRATIONS };
    let (times, triangles) = setting.calling.block_on(async {
        let mut client = server.objects().await;
        let mut times = Vec::new();
        let mut triangles = 0;
        for number in 0..registrations {
            let request = v1::CreateObjectRequest::new(format!("copy-{number}"), ellipsoid(0), MASS);
            let start = Instant::now();
            let answer = client.create_object(request).await.expect("the mesh is sound");
            times.push(start.elapsed());
            let object = answer.into_inner();
            assert!(
                object.warnings.is_empty(),
                "the mesh has warnings: {:?}",
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
    let object = Arc::new(object_of(&request.mesh, MASS));
    let test_object = setting.test_object(&ellipsoid_id(1), object, Some(request.clone()));
    let probes: Vec<_> = test_object.requests().into_iter().take(PROBES).collect();
    let bar = bar(0, "an atlas grows".to_owned());
    setting.calling.block_on(async {
        let mut client = server.grasps().await;
        let start = Instant::now();
        let created = server.objects().await.create_object(request).await;
        created.expect("the mesh is sound");
        let mut useful = None;
        let mut stamp = String::new();
        loop {
            let state = atlas_state(server, &test_object.name).await;
            let grown = start.elapsed();
            if state.stamp != stamp && useful.is_none() {
                stamp.clone_from(&state.stamp);
                let answers = probe(&mut client, &probes).await;
                let by_atlas = share(&answers, |answer| answer.from_atlas);
                if by_atlas >= USEFUL_SHARE {
                    useful = Some((
                        grown,
                        format!(
                            "{} grips answer {:.0} % of {}",
                            state.entry_count,
                            100.0 * by_atlas,
                            probes.len()
                        ),
                    ));
                }
            }
            bar.set_message(format!("an atlas grows: {} grips", state.entry_count));
            let is_over =
                is_complete(&state) || grown > ATLAS_TIMEOUT || (setting.quick && !stamp.is_empty());
            if is_over {
                return growth_lines(useful, &state, grown);
            }
            tokio::time::sleep(POLL_INTERVAL).await;
        }
    })
}

async fn probe(client: &mut GraspServiceClient<Channel>, probes: &[v1::FindGraspRequest]) -> Vec<Answer> {
    let mut answers = Vec::with_capacity(probes.len());
    for request in probes {
        answers.push(send(client, within_50_ms(request.clone())).await);
    }
    answers
}

fn growth_lines(useful: Option<(Duration, String)>, last: &v1::Atlas, grown: Duration) -> Vec<Line> {
    let once = |what: &str, time: Duration, limit: f64, came: bool| {
        let seconds = time.as_secs_f64();
        let target = Target::at_most("time", Unit::Seconds, seconds, limit).failed_if(!came);
        line(what, Spread::of(&[seconds])).target(target)
    };
    let is_useful = useful.is_some();
    let (time_to_use, use_remark) = useful.unwrap_or_else(|| {
        let remark = format!("not yet: {} grips answer too few", last.entry_count);
        (grown, remark)
    });
    let came = is_complete(last);
    let end = if came { "" } else { "not complete yet: " };
    vec![
        once("atlas useful", time_to_use, USEFUL, is_useful).remark(use_remark),
        once("atlas complete", grown, COMPLETE, came).remark(format!("{end}{} grips", last.entry_count)),
    ]
}

/// Calls for another object at a steady pace, first on an idle server, then while an object is registered and its
/// atlas grows.
fn while_growing(setting: &Setting, server: &TestServer, other: &TestObject) -> Vec<Line> {
    let requests = other.requests();
    let (idle, busy, state) = setting.calling.block_on(async {
        let mut client = server.grasps().await;
        paced(&mut client, &requests[..requests.len().min(WARM_UP)]).await;
        let idle = paced(&mut client, &requests).await;
        let request = create(2);
        let name = format!("objects/{}", ellipsoid_id(2));
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
    let remark = |answers: &[Answer]| format!("search: {}", median_and_p99(search_times(answers)));
    let busy_line = line("serving while an atlas grows, round trip", busy_trips).remark(format!(
        "{}; the atlas had {} grips at the end{}",
        remark(&busy),
        state.entry_count,
        if is_complete(&state) {
            " and was complete before the end"
        } else {
            ""
        }
    ));
    vec![
        line("serving while idle, round trip", idle_trips).remark(remark(&idle)),
        match (idle_trips.p99, busy_trips.p99) {
            (Some(idle), Some(busy)) => busy_line.target(Target::at_most(
                "p99 over idle p99",
                Unit::Times,
                busy / idle,
                MAX_RATIO,
            )),
            _ => busy_line,
        },
    ]
}

/// Median and p99 as text.
fn median_and_p99(spread: Spread) -> String {
    let p99 = spread.p99.map_or_else(|| "–".to_owned(), time);
    format!("median {}, p99 {p99}", time(spread.median))
}

async fn paced(client: &mut GraspServiceClient<Channel>, requests: &[v1::FindGraspRequest]) -> Vec<Answer> {
    let mut ticks = tokio::time::interval(PACE);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut answers = Vec::with_capacity(requests.len());
    for request in requests {
        ticks.tick().await;
        answers.push(send(client, request.clone()).await);
    }
    answers
}

fn line(what: &str, spread: Spread) -> Line {
    Line::new(Row::Registration, what, Unit::Seconds, spread)
}
