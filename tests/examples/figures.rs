//! The figures of the README: attempts per second for each strategy, and attempts and time per valid grasp for each
//! holdout and strategy, on one and on two threads, beside the thesis'.
//!
//! `cargo run --release -p grasp-tests --example figures [GRASPS]`; GRASPS valid grasps per holdout and strategy, 25
//! unless said, as in the thesis. For the machine at hand build with `RUSTFLAGS="-C target-cpu=native"`.

use std::time::Instant;

use grasp_synthesis::strategy::Strategy;
use grasp_tests::searches::Bench;

/// Average attempts and milliseconds per valid grasp of strategy D on one thread (thesis, Figure 5.16a), by holdout.
const THESIS_D: [(&str, f64, f64); 15] = [
    ("remote-genhold1", 11_964.0, 9_806.0),
    ("remote-genhold2", 90_882.0, 77_770.0),
    ("remote-genhold3", 4_186.0, 3_605.0),
    ("remote-hold1", 71_477.0, 50_009.0),
    ("remote-hold2", 3_986.0, 2_611.0),
    ("scalpel-genhold1", 17_350.0, 11_319.0),
    ("scalpel-genhold2", 2_316.0, 1_538.0),
    ("scalpel-genhold3", 118.0, 90.0),
    ("scalpel-hold1", 24_933.0, 14_910.0),
    ("scalpel-hold2", 457.0, 245.0),
    ("scissors-genhold1", 250.0, 148.0),
    ("scissors-genhold2", 133.0, 106.0),
    ("scissors-genhold3", 464.0, 327.0),
    ("scissors-hold1", 194.0, 140.0),
    ("scissors-hold2", 2_433.0, 1_086.0),
];

/// Attempts on each holdout for the attempt rate.
const ATTEMPTS: u64 = 20_000;

struct Cell {
    /// Mean attempts per valid grasp.
    attempts: f64,
    /// Mean milliseconds per valid grasp.
    mean_ms: f64,
    /// Median milliseconds per valid grasp.
    median_ms: f64,
}

fn measure(bench: &Bench, holdout: usize, strategy: Strategy, grasps: u64) -> Cell {
    let mut times = Vec::new();
    let mut attempts = 0;
    for seed in 0..grasps {
        let started = Instant::now();
        attempts += bench.search(holdout, strategy, seed, 0, u64::MAX).report.attempts;
        times.push(started.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Cell {
        attempts: attempts as f64 / grasps as f64,
        mean_ms: times.iter().sum::<f64>() / grasps as f64,
        median_ms: times[times.len() / 2],
    }
}

fn main() {
    let grasps = std::env::args().nth(1).map_or(25, |argument| {
        argument
            .parse()
            .ok()
            .filter(|&grasps| grasps > 0)
            .unwrap_or_else(|| {
                eprintln!("GRASPS is {argument}; it must be a whole number of at least 1");
                std::process::exit(2);
            })
    });
    let benches = [Bench::new(1), Bench::new(2)];

    println!("attempts per second and thread, mean over the holdouts ({ATTEMPTS} each)\n");
    println!("| strategy | attempts/s | µs per attempt |\n|---|---|---|");
    for strategy in Strategy::ALL {
        let started = Instant::now();
        for holdout in 0..benches[0].holdouts.len() {
            benches[0].run_attempts(holdout, strategy, 1, ATTEMPTS);
        }
        let attempts = (ATTEMPTS * benches[0].holdouts.len() as u64) as f64;
        let seconds = started.elapsed().as_secs_f64();
        println!(
            "| {strategy:?} | {:.0} | {:.2} |",
            attempts / seconds,
            seconds * 1e6 / attempts
        );
    }

    println!(
        "\nper valid grasp, {grasps} a cell: attempts; mean (median) ms on one thread; on two threads\n"
    );
    println!(
        "| holdout | {} | thesis D |",
        Strategy::ALL.map(|s| format!("{s:?}")).join(" | ")
    );
    println!("|---|{}", "---|".repeat(Strategy::ALL.len() + 1));
    let mut sums = [[0.0; 3]; Strategy::ALL.len()];
    for (index, (built_in, _)) in benches[0].holdouts.iter().enumerate() {
        print!("| {} |", built_in.name);
        for (sum, strategy) in sums.iter_mut().zip(Strategy::ALL) {
            let [one, two] = [0, 1].map(|b| measure(&benches[b], index, strategy, grasps));
            print!(
                " {:.0}; {:.2} ({:.2}); {:.2} ({:.2}) |",
                one.attempts, one.mean_ms, one.median_ms, two.mean_ms, two.median_ms
            );
            *sum = [sum[0] + one.attempts, sum[1] + one.mean_ms, sum[2] + two.mean_ms];
        }
        match THESIS_D.iter().find(|(name, ..)| *name == built_in.name) {
            Some((_, attempts, ms)) => println!(" {attempts:.0}; {ms:.0} |"),
            None => println!(" – |"),
        }
    }
    print!("| **mean** |");
    let count = benches[0].holdouts.len() as f64;
    for [attempts, one, two] in sums {
        print!(
            " {:.0}; {:.2}; {:.2} |",
            attempts / count,
            one / count,
            two / count
        );
    }
    println!(" 15,410; 11,581 (F: about 15,000; 5,000) |");
}
