//! Measures the holdouts and prints a table of what pictures do not show.

use grasp_assets::{
    hands::{Hand, hand},
    holdouts::BuiltInHoldout,
};
use grasp_synthesis::{
    base::stop::Stop,
    model::{
        hand::{Digit, HandPose, Handedness, Phalanx},
        holdout::Holdout,
        strategy::{Strategy, Validity},
    },
    propose::prepared::PreparedObject,
    search::{
        find_grasp,
        scene::Task,
        settings::{Query, Run, SearchSettings},
    },
};

use super::{
    attempt_search::{FRICTION, NoClock},
    hand_capsules::Palm,
    hold_figures::{Figures, coverage, overlap, surface_points},
};

/// Surface points at which coverage and overlap are measured.
const SURFACE_POINTS: u32 = 3000;

/// Largest distance between a touching link's skin and the surface, in metres.
const TOUCHES: f32 = 0.003;

/// Valid grasps over which the number of attempts is averaged.
const GRASPS: u64 = 10;

/// Attempts after which the search for a grasp is abandoned.
const MAX_ATTEMPTS: u64 = 3_000_000;

/// Prints a line for each holdout.
pub(crate) fn report(holdouts: &[BuiltInHoldout]) {
    println!(
        "{:18} {:24} {:>7} {:>9} {:>9} {:>8} {:>8} {:22} attempts/valid",
        "holdout", "type", "covered", "skin in", "in skin", "palm", "self", "touching"
    );
    for holdout in holdouts {
        let giver = hand(&holdout.giver_rig, holdout.giver_handedness).expect("the rigs are built in");
        let held = holdout.to_holdout().expect("built-in holdouts can be made ready");
        let attempts = attempts_per_grasp(&held, holdout.prepared_object())
            .map_or("none".to_owned(), |mean| format!("{mean:.0}"));
        println!("{} {attempts}", line(holdout, giver, &held));
    }
}

fn line(holdout: &BuiltInHoldout, giver: &Hand, held: &Holdout) -> String {
    let surface = &held.object.surface;
    let points = surface_points(surface.mesh(), SURFACE_POINTS);
    let skin = held
        .presenting_hand
        .as_ref()
        .and_then(|hand| hand.surface())
        .expect("a giver with a skin holds every holdout");
    let pose = HandPose {
        frame_from_wrist: holdout.world_from_object.inverse() * holdout.world_from_giver_wrist,
        digits: holdout.giver_digits,
    };
    let figures = Figures::of(giver, &Palm::of(giver), surface, &points, &pose);
    let (vertex, sample) = overlap(surface, &points, skin);
    let mm = |metres: f32| format!("{:.1} mm", 1e3 * metres);
    format!(
        "{:18} {:24} {:>6.0}% {:>9} {:>9} {:>8} {:>8} {:22}",
        holdout.name,
        holdout.grasp_type,
        100.0 * coverage(&points, skin),
        mm(vertex),
        mm(sample),
        mm(figures.palm),
        mm(figures.self_overlap),
        touching(&figures),
    )
}

/// The touching links, as "T3 I13" for the thumb's third link and the index finger's first and third.
fn touching(figures: &Figures) -> String {
    let mut words = Vec::new();
    for (digit, letter) in Digit::ALL.into_iter().zip("TIMRL".chars()) {
        let mut word = String::from(letter);
        for phalanx in Phalanx::ALL {
            if figures.links[digit.index()][phalanx.index()].clearance <= TOUCHES {
                word.push_str(&(phalanx.index() + 1).to_string());
            }
        }
        if word.len() > 1 {
            words.push(word);
        }
    }
    words.join(" ")
}

/// Mean number of attempts that a receiver's right hand needs with strategy F; none if no grasp was found.
fn attempts_per_grasp(held: &Holdout, object: &PreparedObject) -> Option<f64> {
    let receiver = hand("thesis", Handedness::Right).expect("the rigs are built in");
    let pool = rayon::ThreadPoolBuilder::new()
        .build()
        .expect("threads can be started");
    let (mut attempts, mut grasps) = (0, 0_u32);
    for seed in 1..=GRASPS {
        let settings = SearchSettings {
            query: Query {
                strategy: Strategy::F,
                validity: Validity::Thesis,
                bend_ratios: Strategy::F.default_bend_ratios(),
                friction: Some(FRICTION),
                ..Query::default()
            },
            run: Run {
                seed,
                reproducible: true,
                max_attempts: MAX_ATTEMPTS,
                workers: pool.current_num_threads(),
                ..Run::default()
            },
            ..SearchSettings::default()
        };
        let task = Task {
            holdout: held,
            object,
            rig: &receiver.rig,
        };
        let outcome = find_grasp(&pool, task, &settings, &NoClock, Stop::NEVER);
        // Indices start at 0.
        attempts += outcome.report.attempt.map_or(MAX_ATTEMPTS, |attempt| attempt + 1);
        grasps += u32::from(outcome.grasp.is_some());
    }
    (grasps > 0).then(|| attempts as f64 / f64::from(grasps))
}
