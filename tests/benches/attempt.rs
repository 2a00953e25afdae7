//! How long an attempt takes with each strategy, and how long finding a grasp takes at each holdout.
//!
//! `cargo bench -p grasp-tests --bench attempt`

use std::{
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use grasp_assets::{hands, holdouts::holdouts};
use grasp_synthesis::{
    clock::Clock,
    hand::{Handedness, rig::Rig},
    holdout::Holdout,
    object::THESIS_FRICTION,
    search::{SearchSettings, find_grasp},
    strategy::Strategy,
    synthesis::{
        attempt::{Attempt, Scene},
        random::AttemptStream,
        stopwatch::NoStopwatch,
    },
};

/// Seed of every search here.
const SEED: u64 = 20_180_612;

struct MonotonicClock(Instant);

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

fn receiving_rig() -> &'static Rig {
    &hands::hand("thesis", Handedness::Right)
        .expect("the thesis' hand is built in")
        .rig
}

fn built_in_holdouts() -> Vec<(String, Holdout)> {
    holdouts()
        .iter()
        .map(|built_in| {
            let holdout = built_in.to_holdout().expect("built-in holdouts are sound");
            (built_in.name.clone(), holdout)
        })
        .collect()
}

/// One attempt, prunes included, in turn over all holdouts.
fn attempt(criterion: &mut Criterion) {
    let holdouts = built_in_holdouts();
    let mut group = criterion.benchmark_group("attempt");
    group.throughput(Throughput::Elements(1));
    for strategy in Strategy::ALL {
        let scenes: Vec<Scene<'_>> = holdouts
            .iter()
            .map(|(_, holdout)| {
                let ratios = strategy.default_bend_ratios();
                Scene::new(holdout, receiving_rig(), strategy, ratios, THESIS_FRICTION)
            })
            .collect();
        let mut attempt = Attempt::default();
        let mut index = 0;
        group.bench_function(format!("{strategy:?}"), |bencher| {
            bencher.iter(|| {
                let scene = &scenes[index as usize % scenes.len()];
                index += 1;
                let mut stream = AttemptStream::new(SEED, index);
                attempt.try_synthesize_grasp(scene, &mut stream, &mut NoStopwatch, &|| false)
            });
        });
    }
    group.finish();
}

/// A valid grasp with strategy F on one and on two threads; every iteration searches on from where the last one ended.
fn find(criterion: &mut Criterion) {
    let clock = MonotonicClock(Instant::now());
    let stop = AtomicBool::new(false);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads can be started");
        let mut group = criterion.benchmark_group(format!("find/{threads}"));
        group.sample_size(10).measurement_time(Duration::from_secs(2));
        for (name, holdout) in built_in_holdouts() {
            let mut settings = SearchSettings {
                seed: SEED,
                strategy: Strategy::F,
                bend_ratios: Strategy::F.default_bend_ratios(),
                friction: THESIS_FRICTION,
                reproducible: false,
                first_attempt: 0,
                max_attempts: u64::MAX,
                deadline: None,
                workers: threads,
                record_step_times: false,
            };
            group.bench_function(name, |bencher| {
                bencher.iter(|| {
                    let outcome = find_grasp(&pool, &holdout, receiving_rig(), &settings, &clock, &stop);
                    settings.first_attempt += outcome.report.attempts;
                    outcome.grasp
                });
            });
        }
        group.finish();
    }
}

criterion_group!(benches, attempt, find);
criterion_main!(benches);
