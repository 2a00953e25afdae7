//! The long search: runs the synthesis on the free objects and picks the valid grasps that fit the templates best. Its
//! result is a list of seeds and attempts, which a normal run replays.

use std::{
    cmp::Ordering,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    time::Duration,
};

use glam::Vec3;
use grasp_assets::hands::Hand;
use grasp_synthesis::{
    base::{clock::Clock, stop::Stop},
    geometry::mesh_bvh::MeshBvh,
    model::{
        bend_ratios::BendRatioChoice,
        grasp::Grasp,
        holdout::Holdout,
        plain_object::THESIS_FRICTION,
        receiver::Stance,
        strategy::{Strategy, Validity},
    },
    propose::prepared::{PreparedObject, PreparedRig},
    search::{
        find_grasp,
        scene::Task,
        settings::{Query, Run, SearchSettings},
    },
};
use indicatif::{ProgressBar, ProgressStyle};

use super::{
    giver_orientation::giver_orientations,
    grasp_template::{coverage_misfit, misfit},
    halton::halton,
    hand_capsules::Palm,
    hold_figures::{Figures, SurfacePoint, coverage, overlap, posed_skin, surface_points, uncovered},
    specs::{Selected, Target},
};

/// The ladder's last step, as in the thesis' final algorithm.
pub(crate) const STRATEGY: Strategy = Strategy::F;

/// The bend ratios of that step.
pub(crate) const BEND_RATIOS: BendRatioChoice = BendRatioChoice::OneRandom;

/// The friction of the thesis.
pub(crate) const FRICTION: f32 = THESIS_FRICTION;

/// Attempts per seed, all with the same direction of gravity.
const ATTEMPTS_PER_SEED: u64 = 200_000;

/// Candidates per target that are examined closely.
const SHORT_LIST: usize = 400;

/// Orientations per candidate that are tried before the candidate is dropped.
const ORIENTATIONS: usize = 60;

/// Surface points at which coverage and overlap are measured.
const SURFACE_POINTS: u32 = 1500;

/// Penalty for an awkwardness of 1, in the unit of the misfit (about millimetres).
const AWKWARDNESS: f32 = 8.0;

/// A clock for searches without a deadline.
pub(crate) struct NoClock;

impl Clock for NoClock {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

/// A free object with a direction of gravity.
fn free(object: &Arc<PreparedObject>, up: Vec3) -> Holdout {
    Holdout {
        object: object.object().clone(),
        presenting_hand: None,
        other_hands: Vec::new(),
        obstacles: Vec::new(),
        stance: Stance::default(),
        up,
    }
}

/// The first valid grasp among `attempts` attempts from `first` on, and its index.
fn next_grasp(
    pool: &rayon::ThreadPool,
    task: Task<'_>,
    seed: u64,
    first: u64,
    attempts: u64,
) -> Option<(u64, Grasp)> {
    let settings = SearchSettings {
        query: Query {
            strategy: STRATEGY,
            validity: Validity::Thesis,
            bend_ratios: BEND_RATIOS,
            friction: Some(FRICTION),
            ..Query::default()
        },
        run: Run {
            seed,
            reproducible: true,
            first_attempt: first,
            max_attempts: attempts,
            ..Run::default()
        },
        ..SearchSettings::default()
    };
    let outcome = find_grasp(pool, task, &settings, &NoClock, Stop::NEVER);
    outcome.report.attempt.zip(outcome.grasp)
}

/// A pool of one thread, for searches that run in parallel.
pub(crate) fn single_thread() -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread can be started")
}

/// Runs one attempt again.
pub(crate) fn replay(
    pool: &rayon::ThreadPool,
    object: &Arc<PreparedObject>,
    rig: &PreparedRig,
    up: Vec3,
    seed: u64,
    attempt: u64,
) -> Option<Grasp> {
    let task = Task {
        holdout: &free(object, up),
        object,
        rig,
    };
    next_grasp(pool, task, seed, attempt, 1).map(|(_, grasp)| grasp)
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

/// The inputs of a search for one object.
struct ObjectSearch<'a> {
    hand: &'a Hand,
    palm: Palm,
    object: &'a Arc<PreparedObject>,
    points: Vec<SurfacePoint>,
}

/// Searches with `seeds` seeds per object and returns the best grasp of each target whose name contains `only`.
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
        let search = ObjectSearch {
            hand,
            palm: Palm::of(hand),
            object: &built_in.prepared,
            points: surface_points(built_in.object.surface.mesh(), SURFACE_POINTS),
        };
        let lists = search.short_lists(built_in.name, &targets, seeds);
        for (target, list) in targets.iter().zip(lists) {
            selected.extend(search.choose(target, &list));
        }
    }
    selected
}

impl ObjectSearch<'_> {
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
                                    misfit: misfit(&target.template, &figures, pose),
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
            let task = Task {
                holdout: &holdout,
                object: self.object,
                rig: &self.hand.rig,
            };
            let Some((attempt, grasp)) = next_grasp(pool, task, seed, first, left) else {
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

    /// The best candidate of a short list, with the object turned so that a giver could hold it out.
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
                candidate.misfit + coverage_misfit(&target.template, covered) + 1.5 * (sunk - 2.0).max(0.0);
            let offered = target
                .offered
                .map_or_else(|| self.free_direction(&skin), Vec3::from);
            for orientation in giver_orientations(pose, offered).into_iter().take(ORIENTATIONS) {
                let score = shape + AWKWARDNESS * orientation.awkwardness;
                if best.as_ref().is_some_and(|(best, ..)| score >= *best) {
                    break;
                }
                let up = orientation.world_from_object.conjugate() * Vec3::Y;
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
                        world_from_object: orientation.world_from_object,
                    };
                    let story = format!(
                        "misfit {:.1}, covered {covered:.2}, sunk {sunk:.1} mm, awkwardness {:.2}",
                        candidate.misfit, orientation.awkwardness
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

    /// The direction from the centre of the object to the centre of the surface that the hand leaves free.
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
