//! Time per decision about a current grasp, by what becomes of it. In batches: divide by their size, or read the throughput.
//!
//! `cargo bench -p grasp-synthesis -- current`

use std::{hint::black_box, sync::Arc, time::Duration};

use criterion::{Criterion, Throughput, criterion_group};
use glam::Vec3;
use grasp_assets::{atlases, hands, holdouts, objects};
use grasp_synthesis::{
    base::{clock::Clock, pose::Pose, stop::Stop},
    known::{atlas::Atlas, codec::decode},
    model::{
        hand::{HandPose, Handedness},
        holdout::{Holdout, Obstacle, PresentingHand},
    },
    physical::solids::{HandSolids, TaperedCapsule},
    propose::prepared::{PreparedObject, PreparedRig},
    search::{
        SearchOutcome,
        current::{CurrentGrasp, CurrentGraspStatus, Grace, Settlement, settle},
        find_grasp, prepare,
        scene::{Scene, Task},
        settings::{Known, Query, Run, SearchSettings},
    },
};

/// Searches of each holdout.
const SEARCHES: u64 = 2;

/// Every how many grips of an atlas one is a current grasp.
const EVERY: usize = 17;

/// Nothing here waits for a time.
struct NoTime;

impl Clock for NoTime {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

/// A current grasp in a holdout.
struct Case {
    holdout: Holdout,
    object: &'static PreparedObject,
    settings: SearchSettings,
}

impl Case {
    fn new(holdout: &Holdout, object: &'static str, atlas: &Arc<Atlas>, hand: HandPose) -> Self {
        Self {
            holdout: holdout.clone(),
            object: &objects::object(object).expect("the object is built in").prepared,
            settings: SearchSettings {
                query: Query {
                    current: Some(CurrentGrasp {
                        hand,
                        present: hand,
                        min_score_gain: None,
                        is_committed: false,
                        grace: Grace::default(),
                    }),
                    ..Query::default()
                },
                known: Known {
                    atlas: Some(Arc::clone(atlas)),
                    ..Known::default()
                },
                ..SearchSettings::default()
            },
        }
    }

    fn task(&self) -> Task<'_> {
        Task {
            holdout: &self.holdout,
            object: self.object,
            rig: rig(),
        }
    }

    fn scene(&self) -> Scene<'_> {
        prepare(self.task(), &self.settings)
    }

    fn settle(&self, scene: &Scene<'_>) -> Settlement {
        settle(scene, &self.settings, Stop::NEVER).expect("the settings have a current grasp")
    }

    fn status(&self) -> Option<CurrentGraspStatus> {
        match self.settle(&self.scene()) {
            Settlement::Settled(settled) => Some(settled.1.status),
            Settlement::Failed(_) | Settlement::Stopped => None,
        }
    }
}

fn rig() -> &'static PreparedRig {
    &hands::hand("adult", Handedness::Right)
        .expect("the hand is built in")
        .rig
}

/// A hand that attempts find, which the atlas lacks.
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
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let task = Task {
        holdout,
        object,
        rig: rig(),
    };
    let pool = pool.expect("a thread can be started");
    let SearchOutcome { grasp, .. } = find_grasp(&pool, task, &settings, &NoTime, Stop::NEVER);
    grasp.map(|grasp| grasp.pose)
}

/// A ball that touches the tip of a finger from behind.
fn with_ball(holdout: &Holdout, hand: &HandPose, finger: usize) -> Holdout {
    let solids = HandSolids::of_pose(rig(), hand);
    let tip = solids.phalanges[finger][2];
    let palm = hand.frame_from_wrist.transform_vector(Vec3::Z);
    let centre = tip.end - palm * (tip.end_radius + 0.003);
    Holdout {
        obstacles: vec![Obstacle::Capsule(TaperedCapsule::new(
            centre, centre, 0.004, 0.004,
        ))],
        ..holdout.clone()
    }
}

/// The giver where the hand is.
fn with_giver(holdout: &Holdout, hand: &HandPose) -> Holdout {
    let giver = holdout
        .presenting_hand
        .as_ref()
        .and_then(|giver| giver.shape.joints());
    let joints = giver.expect("the giver has joints");
    let way = hand.frame_from_wrist.position - joints.joints[1].pose.position;
    let moved = joints.transformed(Pose::from_position(0.9 * way));
    Holdout {
        presenting_hand: Some(PresentingHand::of_joints(moved)),
        ..holdout.clone()
    }
}

/// All cases whose verdict is this one.
fn batch(cases: impl Iterator<Item = Case>, status: CurrentGraspStatus) -> Vec<Case> {
    cases.filter(|case| case.status() == Some(status)).collect()
}

fn current(criterion: &mut Criterion) {
    let mut hands: Vec<(Holdout, &'static str, Arc<Atlas>, HandPose)> = Vec::new();
    let mut known = Vec::new();
    for built_in in holdouts::holdouts() {
        let name = built_in.object.as_str();
        let object = &objects::object(name).expect("the object is built in").prepared;
        let shipped = atlases::shipped_atlas(name, rig()).expect("its grips ship");
        let read = decode(shipped, object.object(), rig()).expect("they are sound");
        let holdout = built_in.to_holdout().expect("the holdout is sound");
        let poses = read.atlas.entries().iter().step_by(EVERY);
        for entry in poses {
            known.push((holdout.clone(), name, Arc::clone(&read.atlas), entry.grip.pose));
        }
        for seed in 0..SEARCHES {
            if let Some(pose) = found(&holdout, object, seed) {
                hands.push((holdout.clone(), name, Arc::clone(&read.atlas), pose));
            }
        }
    }
    let case = |(holdout, name, atlas, hand): &(Holdout, &'static str, Arc<Atlas>, HandPose)| {
        Case::new(holdout, name, atlas, *hand)
    };
    let in_the_way = |(holdout, name, atlas, hand): &(Holdout, &'static str, Arc<Atlas>, HandPose)| {
        (1..5)
            .map(|finger| Case::new(&with_ball(holdout, hand, finger), name, atlas, *hand))
            .collect::<Vec<_>>()
    };
    let blocked = |(holdout, name, atlas, hand): &(Holdout, &'static str, Arc<Atlas>, HandPose)| {
        Case::new(&with_giver(holdout, hand), name, atlas, *hand)
    };
    let batches = [
        (
            "kept, known",
            batch(known.iter().map(case), CurrentGraspStatus::Kept),
        ),
        (
            "kept, found",
            batch(hands.iter().map(case), CurrentGraspStatus::Kept),
        ),
        (
            "adjusted",
            batch(hands.iter().flat_map(in_the_way), CurrentGraspStatus::Adjusted),
        ),
        (
            "replanned",
            batch(hands.iter().map(blocked), CurrentGraspStatus::Replanned),
        ),
    ];
    let mut group = criterion.benchmark_group("current");
    for (name, cases) in &batches {
        assert!(!cases.is_empty(), "{name}");
        group.throughput(Throughput::Elements(cases.len() as u64));
        let scenes: Vec<Scene<'_>> = cases.iter().map(Case::scene).collect();
        group.bench_function(*name, |bencher| {
            bencher.iter(|| {
                for (case, scene) in cases.iter().zip(&scenes) {
                    black_box(case.settle(black_box(scene)));
                }
            });
        });
    }
    group.throughput(Throughput::Elements(hands.len() as u64));
    let cases: Vec<Case> = hands.iter().map(case).collect();
    group.bench_function("scene alone", |bencher| {
        bencher.iter(|| {
            for case in &cases {
                black_box(case.scene());
            }
        });
    });
    group.finish();
}

criterion_group!(benches, current);
