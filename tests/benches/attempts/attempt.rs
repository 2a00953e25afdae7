//! Time per attempt with each strategy, and time to a grasp at each holdout.
//!
//! `cargo bench -p grasp-tests --bench attempts`

use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group};
use grasp_synthesis::{
    base::{random::AttemptStream, stop::Stop, stopwatch::Stopwatch},
    model::strategy::{Strategy, Validity},
    rating::taxonomy::classify,
    search::{
        attempt::Attempt,
        scene::{Scene, Task},
        settings::{Query, SearchSettings},
    },
};
use grasp_tests::searches::{Bench, prepared};

/// Seed of every search here.
const SEED: u64 = 20_180_612;

/// One attempt, early rejections included, cycling over all holdouts.
fn attempt(criterion: &mut Criterion) {
    let bench = Bench::new(1);
    let mut group = criterion.benchmark_group("attempt");
    group.throughput(Throughput::Elements(1));
    for strategy in Strategy::LADDER {
        let settings = SearchSettings {
            query: Query {
                strategy,
                validity: Validity::Thesis,
                bend_ratios: strategy.default_bend_ratios(),
                ..Query::default()
            },
            ..SearchSettings::default()
        };
        let holdouts = bench.holdouts.iter();
        let objects: Vec<_> = holdouts.map(|(_, holdout)| prepared(&holdout.object)).collect();
        let scenes: Vec<Scene<'_>> = bench
            .holdouts
            .iter()
            .zip(&objects)
            .map(|((_, holdout), object)| {
                let task = Task {
                    holdout,
                    object,
                    rig: bench.rig,
                };
                Scene::new(task, &settings)
            })
            .collect();
        let mut attempt = Attempt::default();
        let mut index = 0;
        group.bench_function(format!("{strategy:?}"), |bencher| {
            bencher.iter(|| {
                let scene = &scenes[index as usize % scenes.len()];
                index += 1;
                let mut stream = AttemptStream::new(SEED, index);
                attempt.run(scene, &mut stream, &mut Stopwatch::off(), Stop::NEVER)
            });
        });
    }
    group.finish();
}

/// Time to a valid grasp with strategy F on one and two threads. Each iteration continues where the last one ended.
fn find(criterion: &mut Criterion) {
    for threads in [1, 2] {
        let bench = Bench::new(threads);
        let mut group = criterion.benchmark_group(format!("find/{threads}"));
        group.sample_size(10).measurement_time(Duration::from_secs(2));
        for (holdout, (built_in, _)) in bench.holdouts.iter().enumerate() {
            let mut first_attempt = 0;
            group.bench_function(built_in.name.as_str(), |bencher| {
                bencher.iter(|| {
                    let outcome = bench.search(holdout, Strategy::F, SEED, first_attempt, u64::MAX);
                    first_attempt += outcome.report.attempts;
                    outcome.grasp
                });
            });
        }
        group.finish();
    }
}

/// Time to classify a grasp, cycling over one grasp per holdout.
fn classification(criterion: &mut Criterion) {
    let bench = Bench::new(1);
    let grasps: Vec<_> = (0..bench.holdouts.len())
        .filter_map(|holdout| {
            let grasp = bench.search(holdout, Strategy::F, SEED, 0, u64::MAX).grasp?;
            Some((grasp, &bench.holdouts[holdout].1.object.local_shape))
        })
        .collect();
    let mut next = grasps.iter().cycle();
    criterion.bench_function("classification", |bencher| {
        bencher.iter(|| {
            next.next()
                .map(|(grasp, shape)| classify(bench.rig, &grasp.pose, &grasp.contacts, shape))
        });
    });
}

criterion_group!(benches, attempt, find, classification);
