//! The ladder of the thesis' chapter 5 on the built-in holdouts: attempts, placements and time per valid grasp.
//!
//! `cargo run --release -p grasp-tests --example ladder -- [strategies] [grasps] [threads] [attempts]`
//!
//! strategies: letters of the ladder, such as ADF (all); grasps: valid grasps per holdout (25, as the thesis);
//! threads: workers of each search (1); attempts: when to give up on a holdout (10 million).

use std::{
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use grasp_assets::{hands, holdouts::holdouts};
use grasp_synthesis::{
    clock::Clock,
    hand::{Handedness, rig::Rig},
    holdout::Holdout,
    object::THESIS_FRICTION,
    rejection::Rejection,
    search::{SearchSettings, find_grasp},
    strategy::Strategy,
};

struct MonotonicClock(Instant);

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// What the command line asks for.
struct Wanted {
    strategies: Vec<Strategy>,
    grasps: u64,
    threads: usize,
    attempts: u64,
}

/// What some searches did together.
#[derive(Default)]
struct Totals {
    grasps: u64,
    attempts: u64,
    pruned: u64,
    rejections: [u64; 8],
    time: Duration,
}

impl Totals {
    fn add(&mut self, other: &Self) {
        self.grasps += other.grasps;
        self.attempts += other.attempts;
        self.pruned += other.pruned;
        self.time += other.time;
        for (sum, count) in self.rejections.iter_mut().zip(other.rejections) {
            *sum += count;
        }
    }

    fn print(&self, name: &str) {
        let (grasps, attempts) = (self.grasps as f64, self.attempts as f64);
        println!(
            "{name:20} {:7} {:14.0} {:14.3} {:12.2} {:14.1}",
            self.grasps,
            attempts / grasps,
            self.time.as_secs_f64() * 1e3 / grasps,
            self.time.as_secs_f64() * 1e6 / attempts,
            self.pruned as f64 / attempts,
        );
    }
}

fn main() {
    let wanted = wanted();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(wanted.threads)
        .build()
        .expect("threads can be started");
    let rig = &hands::hand("thesis", Handedness::Right)
        .expect("the thesis' hand is built in")
        .rig;
    for &strategy in &wanted.strategies {
        println!("\nStrategy {strategy:?}, {} threads", wanted.threads);
        println!("holdout               grasps attempts/grasp       ms/grasp   µs/attempt prunes/attempt");
        let mut all = Totals::default();
        let mut mean_rate = 0.0;
        for built_in in holdouts() {
            let holdout = built_in.to_holdout().expect("built-in holdouts are sound");
            let totals = search(&pool, &holdout, rig, strategy, &wanted);
            totals.print(&built_in.name);
            mean_rate += totals.attempts as f64 / totals.time.as_secs_f64() / holdouts().len() as f64;
            all.add(&totals);
        }
        all.print("all");
        println!("mean over holdouts: {mean_rate:.0} attempts per second");
        for kind in Rejection::ALL {
            let share = 100.0 * all.rejections[kind.index()] as f64 / all.attempts as f64;
            println!("  {:18} {share:6.2} %", format!("{kind:?}"));
        }
    }
}

/// Searches until there are enough grasps, each search going on where the last one ended.
fn search(
    pool: &rayon::ThreadPool,
    holdout: &Holdout,
    rig: &Rig,
    strategy: Strategy,
    wanted: &Wanted,
) -> Totals {
    let clock = MonotonicClock(Instant::now());
    let mut totals = Totals::default();
    while totals.grasps < wanted.grasps && totals.attempts < wanted.attempts {
        let settings = SearchSettings {
            seed: 20_180_612,
            strategy,
            bend_ratios: strategy.default_bend_ratios(),
            friction: THESIS_FRICTION,
            reproducible: false,
            // Attempts that another worker's grasp cut short are left out.
            first_attempt: totals.attempts + totals.grasps * wanted.threads as u64,
            max_attempts: wanted.attempts - totals.attempts,
            deadline: None,
            workers: wanted.threads,
            record_step_times: false,
        };
        let outcome = find_grasp(pool, holdout, rig, &settings, &clock, &AtomicBool::new(false));
        totals.grasps += u64::from(outcome.grasp.is_some());
        totals.attempts += outcome.report.attempts;
        totals.pruned += outcome.report.pruned_placements;
        for (sum, count) in totals.rejections.iter_mut().zip(outcome.report.rejections) {
            *sum += count;
        }
    }
    totals.time = clock.now();
    totals
}

fn wanted() -> Wanted {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: u64| {
        arguments
            .get(index)
            .map_or(default, |text| text.parse().expect("a whole number"))
    };
    let letters = arguments.first().map_or("ABCDEF", String::as_str);
    Wanted {
        strategies: Strategy::ALL
            .into_iter()
            .filter(|strategy| letters.contains(&format!("{strategy:?}")))
            .collect(),
        grasps: number(1, 25),
        threads: number(2, 1) as usize,
        attempts: number(3, 10_000_000),
    }
}
