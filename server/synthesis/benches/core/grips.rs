//! Time per grip: to check an atlas entry against a giver, to find the first entry that holds, to close a proposed
//! hand, and to grow an atlas entry. In batches of fixed queries: divide by the batch size, or read the throughput.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group};
use grasp_assets::{hands, holdouts, objects};
use grasp_synthesis::{
    base::{random::AttemptStream, stop::Stop, stopwatch::Stopwatch},
    known::{atlas::Atlas, entry::Entry, growth::Growth, recheck::GripChecker},
    model::{hand::Handedness, object::GraspObject, strategy::Validity},
    physical::{
        barriers::Barriers,
        grip::Gripper,
        presented::{ObjectScene, Presented},
    },
    propose::{
        prepared::{PreparedObject, PreparedRig},
        proposal::{ProposalContext, propose},
    },
};

/// Built-in objects: a light, thin one and a box.
const OBJECTS: [&str; 2] = ["scissors", "remote"];

/// Entries of the searched atlases.
const ENTRIES: usize = 400;

/// Entries grown per iteration.
const GROWN: usize = 20;

/// Proposals per batch.
const PROPOSALS: u64 = 1000;

fn rig() -> &'static PreparedRig {
    &hands::hand("adult", Handedness::Right)
        .expect("the hand is built in")
        .rig
}

fn object(name: &str) -> &'static PreparedObject {
    &objects::object(name).expect("the object is built in").prepared
}

fn scene(object: &GraspObject) -> ObjectScene<'_> {
    ObjectScene::new(object, object.friction_under(Validity::Physical))
}

fn grown(object: &PreparedObject, entries: usize) -> Atlas {
    let mut growth = Growth::new(object, rig());
    let mut gripper = Gripper::default();
    while growth.len() < entries && !growth.is_complete() {
        growth.round(&mut gripper);
    }
    growth.atlas()
}

fn presented(name: &str) -> Vec<Presented> {
    let of_object = holdouts::holdouts()
        .iter()
        .filter(|holdout| holdout.object == name);
    of_object
        .map(|holdout| Presented::of(&holdout.to_holdout().expect("the holdout is sound")))
        .collect()
}

fn holds(criterion: &mut Criterion) {
    let mut gripper = Gripper::default();
    for name in OBJECTS {
        let (scene, atlas, presented) = (scene(object(name)), grown(object(name), ENTRIES), presented(name));
        let mut holds = |entry: &Entry, presented: &Presented| {
            GripChecker::new(&scene, rig(), presented)
                .check(entry, &entry.tracked_solids(rig()), &mut gripper)
                .is_some()
        };
        let pairs = presented
            .iter()
            .flat_map(|presented_case| atlas.entries().iter().map(move |entry| (entry, presented_case)));
        let (accepted, rejected): (Vec<_>, Vec<_>) =
            pairs.partition(|(entry, presented_case)| holds(entry, presented_case));

        let mut group = criterion.benchmark_group(format!("hold/{name}"));
        for (verdict, pairs) in [("accepted", accepted), ("rejected", rejected)] {
            group.throughput(Throughput::Elements(pairs.len() as u64));
            group.bench_function(verdict, |bencher| {
                bencher.iter(|| {
                    for (entry, presented_case) in &pairs {
                        black_box(holds(black_box(entry), presented_case));
                    }
                });
            });
        }
        group.throughput(Throughput::Elements(presented.len() as u64));
        group.bench_function("first valid", |bencher| {
            bencher.iter(|| {
                for presented_case in &presented {
                    let mut order = atlas.by_score(presented_case.up).into_iter();
                    black_box(
                        order.find(|&index| holds(&atlas.entries()[usize::from(index)], presented_case)),
                    );
                }
            });
        });
        group.finish();
    }
}

fn proposals(criterion: &mut Criterion) {
    let mut gripper = Gripper::default();
    let mut group = criterion.benchmark_group("proposal");
    group.throughput(Throughput::Elements(PROPOSALS));
    for name in OBJECTS {
        let scene = scene(object(name));
        let place = ProposalContext {
            object: scene.object,
            surface: object(name).surface_pairs(),
            barriers: Barriers::NONE,
            chooses: None,
            rig: rig(),
            placements: None,
        };
        let proposals: Vec<_> = (0..PROPOSALS)
            .filter_map(|index| propose(&place, &mut AttemptStream::new(1, index), Stop::NEVER))
            .collect();
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for proposal in &proposals {
                    let proposal = black_box(proposal);
                    let grip =
                        gripper.grip(&scene, rig(), proposal, None, &mut Stopwatch::off(), Stop::NEVER);
                    black_box(grip.is_ok());
                }
            });
        });
    }
    group.finish();
}

fn growth(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("growth");
    group.throughput(Throughput::Elements(GROWN as u64));
    for name in OBJECTS {
        group.bench_function(name, |bencher| bencher.iter(|| grown(object(name), GROWN)));
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = holds, proposals, growth
}
