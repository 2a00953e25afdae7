//! Time per grip: to check an atlas entry against a giver, to find the first entry that holds, to close a proposed
//! hand, and to grow an atlas entry. In batches of fixed queries: divide by the batch size, or read the throughput.

use std::{hint::black_box, sync::Arc, time::Duration};

use criterion::{Criterion, Throughput, criterion_group};
use glam::Vec3;
use grasp_assets::{atlases, hands, holdouts, objects};
use grasp_synthesis::{
    base::{clock::Clock, pose::Pose, random::AttemptStream, stop::Stop, stopwatch::Stopwatch},
    known::{atlas::Atlas, codec::decode, entry::Entry, growth::Growth, recheck::GripChecker},
    model::{
        hand::{HandPose, Handedness},
        holdout::{Holdout, Obstacle, PresentingHand},
        object::GraspObject,
        requirements::Requirements,
        strategy::Validity,
    },
    physical::{
        barriers::Barriers,
        grip::Gripper,
        presented::{ObjectScene, Presented},
        solids::{HandSolids, TaperedCapsule},
    },
    propose::{
        prepared::{PreparedObject, PreparedRig},
        proposal::{ProposalContext, propose},
    },
    rating::assessment::GraspContext,
    search::{
        current::{CurrentGrasp, CurrentGraspStatus, Grace, Settlement, settle},
        find_grasp,
        scene::{Scene, Task},
        settings::{Run, SearchSettings},
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
        let requirements = Requirements::default();
        let mut holds = |entry: &Entry, presented: &Presented| {
            let around = GraspContext {
                object: scene,
                presented,
                rig: rig(),
                requirements: &requirements,
            };
            GripChecker::new(around, None)
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
            surface: &object(name).surface_pairs,
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

/// Searches of each holdout.
const SEARCHES: u64 = 2;

/// Stride through the grips of an atlas to select current grasps.
const EVERY: usize = 17;

/// A clock that is always at zero: no search here has a deadline.
struct NoTime;

impl Clock for NoTime {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

/// A current grasp in a holdout.
#[derive(Clone)]
struct Case {
    holdout: Holdout,
    object: &'static PreparedObject,
    settings: SearchSettings,
    hand: HandPose,
}

impl Case {
    fn new(holdout: &Holdout, object: &'static PreparedObject, atlas: &Arc<Atlas>, hand: HandPose) -> Self {
        let mut settings = SearchSettings::default();
        settings.known.atlas = Some(Arc::clone(atlas));
        settings.query.current = Some(CurrentGrasp {
            hand,
            present: hand,
            min_score_gain: None,
            is_committed: false,
            grace: Grace::default(),
        });
        Self {
            holdout: holdout.clone(),
            object,
            settings,
            hand,
        }
    }

    fn scene(&self) -> Scene<'_> {
        let task = Task {
            holdout: &self.holdout,
            object: self.object,
            rig: rig(),
        };
        Scene::new(task, &self.settings)
    }

    fn settle(&self, scene: &Scene<'_>) -> Settlement {
        settle(scene, &self.settings, Stop::NEVER).expect("the settings have a current grasp")
    }

    fn becomes(&self, status: CurrentGraspStatus) -> bool {
        let settlement = self.settle(&self.scene());
        matches!(settlement, Settlement::Settled(settled) if settled.1.status == status)
    }

    /// With a ball that touches the tip of a finger from behind.
    fn with_ball(&self, finger: usize) -> Self {
        let tip = HandSolids::of_pose(rig(), &self.hand).phalanges[finger][2];
        let palm = self.hand.frame_from_wrist.transform_vector(Vec3::Z);
        let centre = tip.end - palm * (tip.end_radius + 0.003);
        let mut case = self.clone();
        let ball = TaperedCapsule::new(centre, centre, 0.004, 0.004);
        case.holdout.obstacles = vec![Obstacle::Capsule(ball)];
        case
    }

    /// With the giver's hand near the receiving one.
    fn with_giver(&self) -> Self {
        let giver = self.holdout.presenting_hand.as_ref();
        let joints = giver.and_then(|giver| giver.shape.joints());
        let joints = joints.expect("the giver has joints");
        let way = self.hand.frame_from_wrist.position - joints.joints[1].pose.position;
        let moved = joints.transformed(Pose::from_position(0.9 * way));
        let mut case = self.clone();
        case.holdout.presenting_hand = Some(PresentingHand::of_joints(moved));
        case
    }
}

/// A hand found by attempts, which the atlas lacks.
fn found(holdout: &Holdout, object: &PreparedObject, seed: u64) -> Option<HandPose> {
    let settings = SearchSettings {
        run: Run {
            seed,
            reproducible: true,
            max_attempts: 3_000,
            ..Run::default()
        },
        ..SearchSettings::default()
    };
    let task = Task {
        holdout,
        object,
        rig: rig(),
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.expect("a thread can be started");
    let outcome = find_grasp(
        &pool,
        &Scene::new(task, &settings),
        &settings,
        &NoTime,
        Stop::NEVER,
    );
    outcome.grasp.map(|grasp| grasp.pose)
}

/// Decisions about a current grasp, by outcome.
fn current(criterion: &mut Criterion) {
    let (mut attempted, mut known) = (Vec::new(), Vec::new());
    for built_in in holdouts::holdouts() {
        let object = object(&built_in.object);
        let shipped = atlases::shipped_atlas(&built_in.object, rig()).expect("its grips ship");
        let atlas = decode(shipped, object.object(), rig())
            .expect("they are sound")
            .atlas;
        let holdout = built_in.to_holdout().expect("the holdout is sound");
        let case = |hand| Case::new(&holdout, object, &atlas, hand);
        let poses = atlas.entries().iter().step_by(EVERY).map(|entry| entry.grip.pose);
        known.extend(poses.map(case));
        let poses = (0..SEARCHES).filter_map(|seed| found(&holdout, object, seed));
        attempted.extend(poses.map(case));
    }
    let balls = |case: &Case| [1, 2, 3, 4].map(|finger| case.with_ball(finger));
    let in_the_way: Vec<Case> = attempted.iter().flat_map(balls).collect();
    let blocked: Vec<Case> = attempted.iter().map(Case::with_giver).collect();
    let mut group = criterion.benchmark_group("current");
    for (name, cases, status) in [
        ("kept, known", &known, CurrentGraspStatus::Kept),
        ("kept, found", &attempted, CurrentGraspStatus::Kept),
        ("adjusted", &in_the_way, CurrentGraspStatus::Adjusted),
        ("replanned", &blocked, CurrentGraspStatus::Replanned),
    ] {
        let cases: Vec<&Case> = cases.iter().filter(|case| case.becomes(status)).collect();
        assert!(!cases.is_empty(), "{name}");
        group.throughput(Throughput::Elements(cases.len() as u64));
        let scenes: Vec<Scene<'_>> = cases.iter().map(|case| case.scene()).collect();
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for (case, scene) in cases.iter().zip(&scenes) {
                    black_box(case.settle(black_box(scene)));
                }
            });
        });
    }
    group.throughput(Throughput::Elements(attempted.len() as u64));
    group.bench_function("scene alone", |bencher| {
        bencher.iter(|| {
            for case in &attempted {
                black_box(case.scene());
            }
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = holds, proposals, growth, current
}
