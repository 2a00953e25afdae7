//! Calls at a steady pace, whoever is late.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_proto::v1;
use grasp_tests::{TestServer, progress::bar};
use rand::SeedableRng as _;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;
use tokio::task::JoinSet;

use crate::studio::{objects::Studio, resident_megabytes};

/// Time within which a call counts as answered in time.
const IN_TIME: Duration = Duration::from_millis(50);

/// What is random about the calls.
const SEED: u64 = 0x4341_4c4c;

/// What was measured in a span of time.
#[derive(Debug, Serialize)]
pub(crate) struct Interval {
    /// Its start, since the first call.
    pub(crate) from_seconds: f64,
    /// Number of calls, and of grasps found.
    pub(crate) calls: usize,
    pub(crate) found: usize,
    /// Shares of the calls.
    pub(crate) share_from_atlases: f64,
    pub(crate) share_in_time: f64,
    /// Times of the search, as the server reports them.
    pub(crate) median_milliseconds: f64,
    pub(crate) p99_milliseconds: f64,
    /// Resident memory at its end.
    pub(crate) megabytes: f64,
}

struct Answer {
    interval: usize,
    found: bool,
    from_atlas: bool,
    search_time: Duration,
}

/// Asks for the objects, and measures each of `count` intervals.
pub(crate) async fn ask(
    server: &TestServer,
    studio: &Studio,
    pace: Duration,
    length: Duration,
    count: u32,
) -> Vec<Interval> {
    let client = Arc::new(server.grasps().await);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut ticks = tokio::time::interval(pace);
    let mut calls: JoinSet<Answer> = JoinSet::new();
    let mut answers = Vec::new();
    let mut memory = Vec::new();
    let start = Instant::now();
    let bar = bar(count as usize, "asking".to_owned());
    for interval in 0..count {
        while start.elapsed() < length * (interval + 1) {
            ticks.tick().await;
            let request = studio.draw(&mut random);
            let mut client = (*client).clone();
            calls.spawn(async move {
                let start = Instant::now();
                let answered = client.find_grasp(request).await.ok();
                // A refused call counts as answered without a grasp.
                let took = start.elapsed();
                let answered = answered.as_ref().map(tonic::Response::get_ref);
                Answer {
                    interval: interval as usize,
                    found: answered.is_some_and(|answer| answer.outcome() == v1::Outcome::Found),
                    from_atlas: answered.is_some_and(|answer| answer.source() == v1::GraspSource::Atlas),
                    search_time: answered.map_or(took, v1::FindGraspResponse::search_time),
                }
            });
            while let Some(answer) = calls.try_join_next() {
                answers.push(answer.expect("a call does not panic"));
            }
        }
        memory.push(resident_megabytes());
        bar.inc(1);
    }
    while let Some(answer) = calls.join_next().await {
        answers.push(answer.expect("a call does not panic"));
    }
    bar.finish_and_clear();
    let of = |interval: usize| answers.iter().filter(move |answer| answer.interval == interval);
    let measured = memory.iter().enumerate().map(|(interval, &megabytes)| {
        let answers: Vec<&Answer> = of(interval).collect();
        measure(&answers, (length * interval as u32).as_secs_f64(), megabytes)
    });
    measured.collect()
}

fn measure(answers: &[&Answer], from_seconds: f64, megabytes: f64) -> Interval {
    let share = |is: &dyn Fn(&Answer) -> bool| {
        answers.iter().filter(|answer| is(answer)).count() as f64 / answers.len().max(1) as f64
    };
    let mut times: Vec<Duration> = answers.iter().map(|answer| answer.search_time).collect();
    times.sort_unstable();
    let quantile = |part: f64| {
        let place = (part * times.len() as f64) as usize;
        let time = times.get(place.min(times.len().saturating_sub(1)));
        time.map_or(f64::NAN, |time| time.as_secs_f64() * 1e3)
    };
    Interval {
        from_seconds,
        calls: answers.len(),
        found: answers.iter().filter(|answer| answer.found).count(),
        share_from_atlases: share(&|answer| answer.from_atlas),
        share_in_time: share(&|answer| answer.found && answer.search_time <= IN_TIME),
        median_milliseconds: quantile(0.5),
        p99_milliseconds: quantile(0.99),
        megabytes,
    }
}
