//! The long search: runs the synthesis on the free objects and picks, among all valid grasps, those that look most like
//! the wished types. Its result is a list of seeds and attempts that the normal run replays.

use std::{
    cmp::Ordering,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
    },
    time::Duration,
};

use glam::Vec3;
use grasp_assets::hands::Hand;
use grasp_synthesis::{
    base::clock::Clock,
    base::mechanisms::Mechanisms,
    geometry::mesh_bvh::MeshBvh,
    known::{recent_grips::RecentGrips, seed_source::SeedSource},
    model::{
        bend_ratios::BendRatioChoice,
        constraints::Constraints,
        grasp::Grasp,
        hand::rig::Rig,
        holdout::Holdout,
        object::{GraspObject, THESIS_FRICTION},
        strategy::{Choice, Strategy},
    },
    search::{find_grasp, settings::SearchSettings},
};
use indicatif::{ProgressBar, ProgressStyle};

use super::{
    halton::halton,
    judge::{Figures, SurfacePoint, coverage, overlap, posed_skin, surface_points, uncovered},
    solids::Palm,
    specs::{Selected, Target},
    stance::stances,
    wish::{coverage_misfit, misfit},
};

/// The ladder's last step, as in the thesis' final algorithm.
pub(crate) const STRATEGY: Strategy = Strategy::F;

/// The bend ratios of that step.
pub(crate) const BEND_RATIOS: BendRatioChoice = BendRatioChoice::OneRandom;

/// The friction of the thesis.
pub(crate) const FRICTION: f32 = THESIS_FRICTION;

/// Attempts that are run with one seed, and with one direction of gravity, before the next one is taken.
const ATTEMPTS_PER_SEED: u64 = 200_000;

/// Candidates of each target that are looked at closely.
const SHORT_LIST: usize = 400;

/// Stances of a candidate that are offered to the synthesis before the candidate is given up.
const STANCES: usize = 60;

/// Points of the surface at which coverage and overlap are taken.
const SURFACE_POINTS: u32 = 1500;

/// A candidate's penalty for awkwardness 1, in the millimetres of the misfit.
const AWKWARDNESS: f32 = 8.0;

/// A clock for searches without a deadline.
pub(crate) struct NoClock;

impl Clock for NoClock {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

/// A free object with a direction of gravity.
fn free(object: &Arc<GraspObject>, up: Vec3) -> Holdout {
    Holdout {
        object: object.clone(),
        presenting_hand: None,
        up,
    }
}

/// The first valid grasp among `attempts` attempts from `first` on, and its index.
fn next_grasp(
    pool: &rayon::ThreadPool,
    holdout: &Holdout,
    rig: &Rig,
    seed: u64,
    first: u64,
    attempts: u64,
) -> Option<(u64, Grasp)> {
    let settings = SearchSettings {
        seed,
        strategy: STRATEGY,
        validity: grasp_synthesis::model::strategy::Validity::Thesis,
        bend_ratios: BEND_RATIOS,
        friction: FRICTION,
        reproducible: true,
        first_attempt: first,
        max_attempts: attempts,
        deadline: None,
        workers: 1,
        record_step_times: false,
        mechanisms: Mechanisms::ALL,
        constraints: Constraints::default(),
        choice: Choice::FirstValid,
        atlas: None,
        starts: SeedSource::Nothing,
        recent: RecentGrips::default(),
        known_tried: 0,
    };
    let outcome = find_grasp(pool, holdout, rig, &settings, &NoClock, &AtomicBool::new(false));
    outcome.report.attempt.zip(outcome.grasp)
}

/// A pool of one thread for searches that run side by side.
pub(crate) fn single_thread() -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread can be started")
}

/// Runs one attempt again.
pub(crate) fn replay(
    pool: &rayon::ThreadPool,
    object: &Arc<GraspObject>,
    rig: &Rig,
    up: Vec3,
    seed: u64,
    attempt: u64,
) -> Option<Grasp> {
    next_grasp(pool, &free(object, up), rig, seed, attempt, 1).map(|(_, grasp)| grasp)
}

/// A valid grasp with its place in the search.
#[derive(Clone, Debug)]
struct Candidate {
    misfit: f32,
    seed: u64,
    attempt: u64,
    grasp: Grasp,
}

impl Candidate {
    /// Best first; ties by place, so that the order does not depend on threads.
    fn order(&self, other: &Self) -> Ordering {
        self.misfit
            .total_cmp(&other.misfit)
            .then(self.seed.cmp(&other.seed))
            .then(self.attempt.cmp(&other.attempt))
    }
}

/// The best candidates of one target.
#[derive(Default)]
struct ShortList(Vec<Candidate>);

impl ShortList {
    fn offer(&mut self, candidate: Candidate) {
        let full = self.0.len() == SHORT_LIST;
        if full && self.0.last().is_some_and(|last| last.order(&candidate).is_le()) {
            return;
        }
        let at = self.0.partition_point(|other| other.order(&candidate).is_lt());
        self.0.insert(at, candidate);
        self.0.truncate(SHORT_LIST);
    }
}

/// What a search of one object needs.
struct Bench<'a> {
    hand: &'a Hand,
    palm: Palm,
    object: &'a Arc<GraspObject>,
    points: Vec<SurfacePoint>,
}

/// Searches with `seeds` seeds an object and returns the best grasp of each target whose name contains `only`.
pub(crate) fn search(hand: &Hand, targets: &[Target], seeds: u64, only: &str) -> Vec<Selected> {
    let mut selected = Vec::new();
    for built_in in grasp_assets::objects::objects() {
        let targets: Vec<&Target> = targets
            .iter()
            .filter(|target| target.object == built_in.name && target.name.contains(only))
            .collect();
        if targets.is_empty() {
            continue;
        }
        let bench = Bench {
            hand,
            palm: Palm::of(hand),
            object: &built_in.object,
            points: surface_points(built_in.object.surface.mesh(), SURFACE_POINTS),
        };
        let lists = bench.short_lists(built_in.name, &targets, seeds);
        for (target, list) in targets.iter().zip(lists) {
            selected.extend(bench.choose(target, &list));
        }
    }
    selected
}

impl Bench<'_> {
    fn short_lists(&self, name: &str, targets: &[&Target], seeds: u64) -> Vec<ShortList> {
        let progress = ProgressBar::new(seeds).with_style(
            ProgressStyle::with_template("{prefix:10} {wide_bar} {pos}/{len} seeds {msg} {eta}")
                .expect("the template is valid"),
        );
        progress.set_prefix(name.to_owned());
        let lists: Mutex<Vec<ShortList>> = Mutex::new(targets.iter().map(|_| ShortList::default()).collect());
        let (next_seed, valid) = (AtomicU64::new(1), AtomicU64::new(0));
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    let pool = single_thread();
                    loop {
                        let seed = next_seed.fetch_add(1, Relaxed);
                        if seed > seeds {
                            break;
                        }
                        self.run_seed(&pool, seed, &mut |candidate| {
                            valid.fetch_add(1, Relaxed);
                            let pose = &candidate.grasp.pose;
                            let surface = &self.object.surface;
                            let figures = Figures::of(self.hand, &self.palm, surface, &self.points, pose);
                            let mut lists = lists.lock().expect("no thread panicked");
                            for (target, list) in targets.iter().zip(lists.iter_mut()) {
                                list.offer(Candidate {
                                    misfit: misfit(&target.wish, &figures, pose),
                                    ..candidate.clone()
                                });
                            }
                        });
                        progress.set_message(format!("{} valid", valid.load(Relaxed)));
                        progress.inc(1);
                    }
                });
            }
        });
        progress.finish();
        lists.into_inner().expect("no thread panicked")
    }

    /// Every valid grasp of a seed.
    fn run_seed(&self, pool: &rayon::ThreadPool, seed: u64, found: &mut dyn FnMut(Candidate)) {
        let holdout = free(self.object, spread_direction(seed));
        let mut first = 0;
        while first < ATTEMPTS_PER_SEED {
            let left = ATTEMPTS_PER_SEED - first;
            let Some((attempt, grasp)) = next_grasp(pool, &holdout, &self.hand.rig, seed, first, left) else {
                break;
            };
            first = attempt + 1;
            found(Candidate {
                misfit: 0.0,
                seed,
                attempt,
                grasp,
            });
        }
    }

    /// The best of a short list once the object is turned so that a giver could hold it out.
    fn choose(&self, target: &Target, list: &ShortList) -> Option<Selected> {
        let pool = single_thread();
        let mut best: Option<(f32, Selected, String)> = None;
        for candidate in &list.0 {
            if best
                .as_ref()
                .is_some_and(|(score, ..)| candidate.misfit >= *score)
            {
                break;
            }
            let pose = &candidate.grasp.pose;
            let Some(skin) = posed_skin(self.hand, pose) else {
                continue;
            };
            let covered = coverage(&self.points, &skin);
            let (vertex, sample) = overlap(&self.object.surface, &self.points, &skin);
            let sunk = 1e3 * vertex.max(sample);
            let shape =
                candidate.misfit + coverage_misfit(&target.wish, covered) + 1.5 * (sunk - 2.0).max(0.0);
            let offered = target
                .offered
                .map_or_else(|| self.free_direction(&skin), Vec3::from);
            for stance in stances(pose, offered).into_iter().take(STANCES) {
                let score = shape + AWKWARDNESS * stance.awkwardness;
                if best.as_ref().is_some_and(|(best, ..)| score >= *best) {
                    break;
                }
                let up = stance.world_from_object.conjugate() * Vec3::Y;
                let again = replay(
                    &pool,
                    self.object,
                    &self.hand.rig,
                    up,
                    candidate.seed,
                    candidate.attempt,
                );
                if again.is_some_and(|grasp| grasp.pose == *pose) {
                    let selected = Selected {
                        name: target.name.clone(),
                        seed: candidate.seed,
                        attempt: candidate.attempt,
                        world_from_object: stance.world_from_object,
                    };
                    let story = format!(
                        "misfit {:.1}, covered {covered:.2}, sunk {sunk:.1} mm, awkwardness {:.2}",
                        candidate.misfit, stance.awkwardness
                    );
                    best = Some((score, selected, story));
                    break;
                }
            }
        }
        match &best {
            Some((score, _, story)) => println!("{}: {score:.1} ({story})", target.name),
            None => println!("{}: nothing found", target.name),
        }
        best.map(|(_, selected, _)| selected)
    }

    /// From the middle of the object to the middle of what the hand leaves free.
    fn free_direction(&self, skin: &MeshBvh) -> Vec3 {
        let free = uncovered(&self.points, skin);
        let mean = |points: &mut dyn Iterator<Item = Vec3>| {
            let (sum, count) = points.fold((Vec3::ZERO, 0_u16), |(sum, count), p| (sum + p, count + 1));
            sum / f32::from(count.max(1))
        };
        let free_centre = mean(&mut free.iter().map(|p| p.0));
        let all = mean(&mut self.points.iter().map(|p| p.0));
        (free_centre - all).normalize_or(Vec3::Z)
    }
}

/// Evenly spread directions.
fn spread_direction(index: u64) -> Vec3 {
    let index = index as u32;
    let z = 1.0 - 2.0 * halton(index, 2);
    let angle = std::f64::consts::TAU * halton(index, 3);
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new((r * angle.cos()) as f32, (r * angle.sin()) as f32, z as f32).normalize_or(Vec3::Y)
}
