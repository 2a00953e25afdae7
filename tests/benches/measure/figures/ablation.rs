//! What each mechanism of a default search contributes: all mechanisms on against each one switched off, in one
//! process.
//!
//! Every variant searches the same holdout with the same seed before the next holdout, in an order shuffled per
//! holdout, so that other load on the machine slows all variants alike. The variant with all mechanisms runs twice;
//! the difference between the two is noise. Budgets and times are in processor time, the time on an idle machine (see
//! [`processor_clock`]); wall times are kept too, because they show the cost of waking threads.

mod page;
mod processor_clock;
mod summary;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use grasp_assets::primitives::held_primitives;
use grasp_synthesis::{
    base::mechanisms::{Mechanism, Mechanisms},
    known::{atlas::Atlas, transferred_grips::TransferredGrips},
    model::{hand::Handedness, holdout::Holdout, score::Score},
    propose::prepared::PreparedRig,
    search::{LookUp, find_grasp, find_known_grasp, scene::Task},
};
use grasp_tests::{
    progress::bar,
    searches::{MonotonicClock, prepared},
};
use rand::{SeedableRng as _, seq::SliceRandom as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::ThreadPool;

use crate::figures::{
    Row,
    core::{CoreSearcher, KnownGrips, LOOK_UP_TIME, WORKERS, settings, thread_time},
    requests::ANSWERED_WITHIN,
    setting::{Setting, TestObject, built_in_holdouts, default_hand},
    table::{Line, Spread, Unit, time},
};
use processor_clock::ProcessorClock;
use summary::{Class, Results};

/// Seed of the order of variants.
const SEED: u64 = 20_180_613;

/// Holdouts per class searched before measuring, to fill caches.
const WARM_UP: usize = 3;

/// What searches know about the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Knowledge {
    /// A complete atlas.
    Warm,
    /// No atlas.
    Cold,
}

impl Knowledge {
    const ALL: [Self; 2] = [Self::Warm, Self::Cold];

    fn name(self) -> &'static str {
        match self {
            Self::Warm => "warm",
            Self::Cold => "cold",
        }
    }

    /// The mechanisms that run in such searches, except learned grips: no request repeats here.
    fn mechanisms(self) -> impl Iterator<Item = Mechanism> {
        let runs = move |mechanism: &Mechanism| match mechanism {
            Mechanism::LearnedGrips => false,
            Mechanism::AtlasLookUp
            | Mechanism::Shortlists
            | Mechanism::GravityOrder
            | Mechanism::CellOccupancy
            | Mechanism::FrictionUses
            | Mechanism::HeadStart
            | Mechanism::CallerLookUp
            | Mechanism::Seeds => self == Self::Warm,
            Mechanism::TransferredGrips | Mechanism::ClosureScreen => self == Self::Cold,
            Mechanism::InnerSpheres
            | Mechanism::GiverOrder
            | Mechanism::NearMisses
            | Mechanism::Oppositions
            | Mechanism::SuccessPrior
            | Mechanism::PlacementCache
            | Mechanism::RoomScreen
            | Mechanism::PalmPlacement
            | Mechanism::Preshape
            | Mechanism::Handles
            | Mechanism::TuckedFingers => true,
        };
        Mechanism::ALL.into_iter().filter(runs)
    }
}

/// The result of one search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchSample {
    /// Processor time: the duration on an idle machine.
    time: Duration,
    /// Wall time on this machine, including other load.
    wall_time: Duration,
    /// Score of the grasp, if one was found.
    score: Option<f32>,
}

impl SearchSample {
    fn is_in_time(&self) -> bool {
        self.score.is_some() && self.time <= ANSWERED_WITHIN
    }
}

/// A holdout and what is known about its object.
struct Case {
    holdout: Holdout,
    atlas: Arc<Atlas>,
    transferred: Arc<TransferredGrips>,
}

/// Searches as the server does: a look-up on the calling thread, then a race that another thread waits for.
struct Searcher {
    rig: &'static PreparedRig,
    coordinator: ThreadPool,
    workers: ThreadPool,
}

impl Searcher {
    fn new() -> Self {
        let pool = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads can be started")
        };
        Self {
            rig: &default_hand(Handedness::Right).rig,
            coordinator: pool(1),
            workers: pool(WORKERS),
        }
    }

    fn search(&self, case: &Case, knowledge: Knowledge, mechanisms: Mechanisms, seed: u64) -> SearchSample {
        let holdout = &case.holdout;
        let known = match knowledge {
            Knowledge::Warm => KnownGrips::Atlas(&case.atlas),
            Knowledge::Cold => KnownGrips::Boxes((!case.transferred.is_empty()).then_some(&case.transferred)),
        };
        let mut settings = settings(known, mechanisms, seed);
        let object = prepared(&holdout.object);
        let task = Task {
            holdout,
            object: &object,
            rig: self.rig,
        };
        let (start, look_up_start) = (Instant::now(), thread_time());
        let look = match knowledge {
            Knowledge::Warm => {
                let clock = MonotonicClock::default();
                find_known_grasp(task, &settings, &clock, LOOK_UP_TIME)
            }
            Knowledge::Cold => LookUp::NotFound { tried: 0 },
        };
        let look_up_time = thread_time().saturating_sub(look_up_start);
        let (outcome, race_time) = match look {
            LookUp::Found(outcome) => (*outcome, Duration::ZERO),
            LookUp::NotFound { tried } => {
                settings.known.tried = tried;
                settings.run.deadline = Some(ANSWERED_WITHIN.saturating_sub(look_up_time));
                self.coordinator.install(|| {
                    let clock = ProcessorClock::start(WORKERS);
                    let stop = AtomicBool::new(false);
                    let outcome = find_grasp(&self.workers, task, &settings, &clock, &stop);
                    (outcome, clock.total())
                })
            }
        };
        SearchSample {
            time: look_up_time + race_time,
            wall_time: start.elapsed(),
            score: outcome
                .grasp
                .map(|grasp| grasp.score.as_ref().map_or(0.0, Score::total)),
        }
    }
}

/// All mechanisms twice, then each mechanism of such searches switched off.
fn variants(knowledge: Knowledge) -> Vec<Option<Mechanism>> {
    [None, None]
        .into_iter()
        .chain(knowledge.mechanisms().map(Some))
        .collect()
}

/// The measurements of one class with one kind of knowledge.
struct Part<'a> {
    knowledge: Knowledge,
    variants: Vec<Option<Mechanism>>,
    class: Class,
    cases: &'a [Case],
    /// Samples per variant.
    searched: Vec<Vec<SearchSample>>,
}

impl Part<'_> {
    fn search(&self, searcher: &Searcher, case: usize, variant: usize, seed: u64) -> SearchSample {
        let mechanisms = self.variants[variant].map_or(Mechanisms::ALL, |off| Mechanisms::ALL.without(off));
        searcher.search(&self.cases[case], self.knowledge, mechanisms, seed)
    }
}

/// Runs the ablation and writes table and page.
pub(crate) fn measure(
    setting: &Setting,
    test_objects: &[TestObject],
    longest: Option<Duration>,
) -> Vec<Line> {
    let load_before = crate::figures::load_average();
    let classes = classes(setting, test_objects);
    let searcher = Searcher::new();
    let mut parts: Vec<Part<'_>> = Vec::new();
    for knowledge in Knowledge::ALL {
        for (class, cases) in &classes {
            let variants = variants(knowledge);
            parts.push(Part {
                knowledge,
                searched: vec![Vec::new(); variants.len()],
                variants,
                class: *class,
                cases,
            });
        }
    }
    for part in &parts {
        for case in 0..WARM_UP.min(part.cases.len()) {
            for variant in 0..part.variants.len() {
                part.search(&searcher, case, variant, u64::MAX);
            }
        }
    }
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let start = Instant::now();
    let bar = bar(setting.holdouts, "ablation, holdouts of each class".to_owned());
    // The parts take turns: bursts of load spread over all of them, and a run cut short has samples of each.
    for number in 0..setting.holdouts {
        if number > 0 && longest.is_some_and(|longest| start.elapsed() >= longest) {
            break;
        }
        for part in &mut parts {
            let mut order: Vec<usize> = (0..part.variants.len()).collect();
            order.shuffle(&mut random);
            for variant in order {
                let searched = part.search(&searcher, number, variant, number as u64);
                part.searched[variant].push(searched);
            }
        }
        bar.inc(1);
    }
    let all: Vec<Results> = parts
        .into_iter()
        .map(|part| Results::of(part.knowledge, part.class, &part.variants, &part.searched))
        .collect();
    let folder = results_folder(setting);
    fs::create_dir_all(&folder).expect("the results folder can be created");
    let write = |name: &str, text: String| {
        fs::write(folder.join(name), text).expect("the results can be written");
    };
    write("ablation.csv", page::csv(&all));
    let loads = [load_before, crate::figures::load_average()];
    write("README.md", page::page(&all, setting, &loads));
    all.iter().map(line).collect()
}

/// The folder of the results. Those of a quick run are meaningless and go elsewhere.
fn results_folder(setting: &Setting) -> PathBuf {
    if setting.quick {
        setting.folder().join("ablation")
    } else {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("results/ablation")
    }
}

/// The built-in holdouts, repeated, and random ones of each object.
fn classes(setting: &Setting, test_objects: &[TestObject]) -> Vec<(Class, Vec<Case>)> {
    let core = CoreSearcher::new(Mechanisms::ALL);
    let rig = &default_hand(Handedness::Right).rig;
    let (_, held) = held_primitives()
        .iter()
        .find(|(hand, _)| hand.rig == *rig)
        .expect("the default hand has grips on primitives");
    let known: Vec<_> = test_objects
        .iter()
        .map(|test_object| {
            let atlas = core.atlas(test_object.id(), &Setting::atlases(), &test_object.object);
            let atlas = atlas.expect("built-in objects come with an atlas");
            assert!(
                atlas.is_complete(),
                "the atlas of {} is still growing",
                test_object.id()
            );
            (
                test_object,
                atlas,
                Arc::new(TransferredGrips::of(&test_object.object, held)),
            )
        })
        .collect();
    let case = |id: &str, holdout: &grasp_tests::random_holdouts::ClientHoldout| {
        let of_object = known.iter().find(|(test_object, ..)| test_object.id() == id);
        let (test_object, atlas, transferred) = of_object.expect("its object is built in");
        Case {
            holdout: holdout.holdout(Arc::clone(&test_object.object)),
            atlas: Arc::clone(atlas),
            transferred: Arc::clone(transferred),
        }
    };
    let built_in = built_in_holdouts();
    let repeated = built_in.iter().cycle().take(setting.holdouts);
    let fifteen = repeated.map(|(object, holdout)| case(object, holdout));
    let mut classes = vec![(Class::Fifteen, fifteen.collect())];
    for test_object in test_objects {
        let class = Class::random(test_object.id());
        let cases = test_object
            .holdouts
            .iter()
            .map(|holdout| case(test_object.id(), holdout));
        classes.push((class, cases.collect()));
    }
    classes
}

/// All mechanisms on, for the table on the terminal.
fn line(results: &Results) -> Line {
    let what = format!("{}, {}", results.knowledge.name(), results.class.name());
    let spread = Spread::of_times(results.all_on().map(|searched| searched.time));
    let noise = results.noise();
    Line::new(Row::Ablation, what, Unit::Seconds, spread).remark(format!(
        "all on; repeated: median {:.3} ×, p99 {:.3} ×, answered {:+.2} points",
        noise.median.value, noise.p99.value, noise.answered.value
    ))
}

/// A duration for readers.
fn shown(seconds: f64) -> String {
    time(seconds)
}
