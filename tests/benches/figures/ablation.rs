//! What each mechanism of a default search is worth: all of them against each one switched off, in one process.
//!
//! Every variant searches the same holdout with the same seed before the next holdout comes, in an order that is shuffled
//! for each, so that whatever else runs on the machine slows all of them alike. All mechanisms run twice: what the two
//! differ by is noise. Budgets and times are in processor time, as an idle machine would take it (see [`effort`]); wall
//! times are kept too, since they show what waking threads costs.

mod effort;
mod page;
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
use grasp_tests::searches::{MonotonicClock, prepared};
use rand::{SeedableRng as _, seq::SliceRandom as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::ThreadPool;

use crate::{
    Row,
    asking::ANSWERED_WITHIN,
    core::{Core, Knows, LOOK_UP_TIME, WORKERS, settings, thread_time},
    setting::{Setting, Thing, bar, built_in_holdouts, default_hand},
    table::{Line, Spread, Unit, time},
};
use effort::Effort;
use summary::{Class, Results};

/// Seed of the variants' order.
const SEED: u64 = 20_180_613;

/// Holdouts of each class that are searched before those that are measured, to fill caches.
const UNMEASURED: usize = 3;

/// What searches know of the object.
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

    /// The mechanisms that such searches run. Grips that recent searches found are left out: nobody asks twice here.
    fn mechanisms(self) -> impl Iterator<Item = Mechanism> {
        let runs = move |mechanism: &Mechanism| match mechanism {
            Mechanism::RecentGrips => false,
            Mechanism::AtlasLookUp
            | Mechanism::Shortlists
            | Mechanism::GravityOrder
            | Mechanism::CellOccupancy
            | Mechanism::FrictionUses
            | Mechanism::FingerSubsets
            | Mechanism::HeadStart
            | Mechanism::CallerLookUp
            | Mechanism::Seeds
            | Mechanism::OpenSeeds
            | Mechanism::NearestSeeds => self == Self::Warm,
            Mechanism::TransferredGrips | Mechanism::ClosureScreen => self == Self::Cold,
            Mechanism::InnerSpheres
            | Mechanism::GiverOrder
            | Mechanism::NearMisses
            | Mechanism::Oppositions
            | Mechanism::SuccessPrior
            | Mechanism::PlacementCache
            | Mechanism::FreeSurface
            | Mechanism::RoomScreen
            | Mechanism::PalmPlacement
            | Mechanism::Preshape
            | Mechanism::TuckedFingers => true,
        };
        Mechanism::ALL.into_iter().filter(runs)
    }
}

/// One search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Searched {
    /// Processor time, as the time that the search takes on an idle machine.
    time: Duration,
    /// Wall time on this machine, with what else it does.
    wall_time: Duration,
    /// The grasp's score, if there is a grasp.
    score: Option<f32>,
}

impl Searched {
    fn is_in_time(&self) -> bool {
        self.score.is_some() && self.time <= ANSWERED_WITHIN
    }
}

/// A holdout and what is known of its object.
struct Case {
    holdout: Holdout,
    atlas: Arc<Atlas>,
    borrowed: Arc<TransferredGrips>,
}

/// Searches as the server does: a look on the caller's thread, then a race that another thread waits for.
struct Searcher {
    rig: &'static PreparedRig,
    coordinator: ThreadPool,
    workers: ThreadPool,
}

impl Searcher {
    fn new() -> Self {
        let pool = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads can be had")
        };
        Self {
            rig: &default_hand(Handedness::Right).rig,
            coordinator: pool(1),
            workers: pool(WORKERS),
        }
    }

    fn search(&self, case: &Case, knowledge: Knowledge, mechanisms: Mechanisms, seed: u64) -> Searched {
        let holdout = &case.holdout;
        let known = match knowledge {
            Knowledge::Warm => Knows::Atlas(&case.atlas),
            Knowledge::Cold => Knows::Boxes((!case.borrowed.is_empty()).then_some(&case.borrowed)),
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
                    let clock = Effort::start(WORKERS);
                    let stop = AtomicBool::new(false);
                    let outcome = find_grasp(&self.workers, task, &settings, &clock, &stop);
                    (outcome, clock.total())
                })
            }
        };
        Searched {
            time: look_up_time + race_time,
            wall_time: start.elapsed(),
            score: outcome
                .grasp
                .map(|grasp| grasp.score.as_ref().map_or(0.0, Score::total)),
        }
    }
}

/// All mechanisms twice, then each one off that such searches run.
fn variants(knowledge: Knowledge) -> Vec<Option<Mechanism>> {
    [None, None]
        .into_iter()
        .chain(knowledge.mechanisms().map(Some))
        .collect()
}

/// What is measured of one class with the same knowledge.
struct Part<'a> {
    knowledge: Knowledge,
    variants: Vec<Option<Mechanism>>,
    class: Class,
    cases: &'a [Case],
    /// For each variant.
    searched: Vec<Vec<Searched>>,
}

impl Part<'_> {
    fn search(&self, searcher: &Searcher, case: usize, variant: usize, seed: u64) -> Searched {
        let mechanisms = self.variants[variant].map_or(Mechanisms::ALL, |off| Mechanisms::ALL.without(off));
        searcher.search(&self.cases[case], self.knowledge, mechanisms, seed)
    }
}

/// Measures, and writes the table and the page.
pub(crate) fn measure(setting: &Setting, things: &[Thing], longest: Option<Duration>) -> Vec<Line> {
    let load_before = crate::load_average();
    let classes = classes(setting, things);
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
        for case in 0..UNMEASURED.min(part.cases.len()) {
            for variant in 0..part.variants.len() {
                part.search(&searcher, case, variant, u64::MAX);
            }
        }
    }
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let start = Instant::now();
    let bar = bar(setting.holdouts, "ablation, holdouts of each class".to_owned());
    // All parts take turns: what the machine is busy with passes, and a run that is cut short has some of each.
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
    fs::create_dir_all(&folder).expect("the folder can be made");
    let write = |name: &str, text: String| {
        fs::write(folder.join(name), text).expect("the results can be written");
    };
    write("ablation.csv", page::csv(&all));
    let loads = [load_before, crate::load_average()];
    write("README.md", page::page(&all, setting, &loads));
    all.iter().map(line).collect()
}

/// Where the results are kept; those of a quick run say nothing.
fn results_folder(setting: &Setting) -> PathBuf {
    if setting.quick {
        setting.folder().join("ablation")
    } else {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("results/ablation")
    }
}

/// The built-in holdouts, again and again, and random ones of each object.
fn classes(setting: &Setting, things: &[Thing]) -> Vec<(Class, Vec<Case>)> {
    let core = Core::new(Mechanisms::ALL);
    let rig = &default_hand(Handedness::Right).rig;
    let (_, held) = held_primitives()
        .iter()
        .find(|(hand, _)| std::ptr::eq(&raw const hand.rig, rig))
        .expect("the default hand knows boxes");
    let known: Vec<_> = things
        .iter()
        .map(|thing| {
            let atlas = core.atlas(thing.id(), &Setting::atlases(), &thing.object);
            let atlas = atlas.expect("built-in objects come with an atlas");
            assert!(atlas.is_complete(), "the atlas of {} still grows", thing.id());
            (thing, atlas, Arc::new(TransferredGrips::of(&thing.object, held)))
        })
        .collect();
    let case = |id: &str, holdout: &grasp_tests::random_holdouts::ClientHoldout| {
        let of_object = known.iter().find(|(thing, ..)| thing.id() == id);
        let (thing, atlas, borrowed) = of_object.expect("its object is built in");
        Case {
            holdout: holdout.holdout(Arc::clone(&thing.object)),
            atlas: Arc::clone(atlas),
            borrowed: Arc::clone(borrowed),
        }
    };
    let built_in = built_in_holdouts();
    let repeated = built_in.iter().cycle().take(setting.holdouts);
    let fifteen = repeated.map(|(object, holdout)| case(object, holdout));
    let mut classes = vec![(Class::Fifteen, fifteen.collect())];
    for thing in things {
        let class = Class::random(thing.id());
        let cases = thing.holdouts.iter().map(|holdout| case(thing.id(), holdout));
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
        "all on; the same again: median {:.3} ×, p99 {:.3} ×, answered {:+.2} points",
        noise.median.value, noise.p99.value, noise.answered.value
    ))
}

/// A time for people.
fn shown(seconds: f64) -> String {
    time(seconds)
}
