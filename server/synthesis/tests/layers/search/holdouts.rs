//! Searches on whole holdouts.

use grasp_synthesis::search::{
    LookUp,
    evaluation::{HINDRANCES, SIDES},
};

use crate::prelude::*;

/// A look-up under a clock that advances by a microsecond per reading.
fn look_up(search: &Search<'_>, within: Duration) -> LookUp {
    search.look_up(&FakeClock::ticking(1_000), within)
}

#[test]
fn a_resumed_look_up_finds_the_same_as_an_uninterrupted_one() {
    let known = complete_atlas("scissors");
    let pool = pool(1);
    let few = every(90, "scissors");
    let (mut cut, mut nothing) = (0, 0);
    let givers = 0..known.entries().len();
    let of_all = givers.clone().step_by(71).map(|giver| (giver, &known));
    for (giver, atlas) in of_all.chain(givers.step_by(4).map(|giver| (giver, &few))) {
        let holdout = scissors_held_by(&known, giver);
        let mut search = guided(&holdout).atlas(atlas).reproducible(false);
        let whole = look_up(&search, Duration::from_secs(1));
        let mut last = None;
        let in_parts = loop {
            match look_up(&search, Duration::from_micros(3)) {
                LookUp::Found(outcome) => break Some(*outcome),
                LookUp::NotFound { tried } => {
                    if last == Some(tried) {
                        break None;
                    }
                    assert!(tried > last.unwrap_or(0), "giver {giver}: {tried} after {last:?}");
                    // A search resumes there, too.
                    search.settings.known.tried = tried;
                    last = Some(tried);
                }
            }
        };
        let by_search = search.run_on(&pool);
        let tried = match whole {
            LookUp::NotFound { tried } => Some(tried),
            LookUp::Found(_) => None,
        };
        let [whole, in_parts] = [whole.found(), in_parts]
            .map(|found| found.map(|outcome| (outcome.grasp, outcome.report.source)));
        assert_eq!(in_parts, whole, "giver {giver}");
        assert_eq!(
            (by_search.grasp, by_search.report.source),
            whole.unwrap_or_default()
        );
        if tried.is_none() {
            cut += usize::from(last.is_some());
        } else {
            assert_eq!(last, tried);
            nothing += 1;
        }
    }
    assert!(cut >= 10 && nothing >= 3, "{cut} {nothing}");
}

/// The first thing in the way, by the verdicts. The order of two barriers does not follow from the nearest alone.
fn in_the_way(judged: &Judgement) -> Option<Check> {
    // Verdicts allow for rounding in the client's frame.
    let fails = |check: Check| {
        let verdict = judged.verdicts.iter().find(|verdict| verdict.check == check);
        verdict.is_some_and(|verdict| {
            let bounded = verdict.figure.zip(verdict.bound);
            !verdict.passed || is_barrier(check) && bounded.is_some_and(|(figure, bound)| figure < bound)
        })
    };
    let unbalanced = fails(Check::Balance) || fails(Check::Closure);
    [
        (Check::GiverClearance, fails(Check::GiverClearance)),
        (Check::ObstacleClearance, fails(Check::ObstacleClearance)),
        (Check::Reach, fails(Check::Reach)),
        (Check::Balance, unbalanced),
        (Check::Requirements, !judged.is_valid()),
    ]
    .into_iter()
    .find_map(|(check, is_failed)| is_failed.then_some(check))
}

fn is_barrier(check: Check) -> bool {
    matches!(check, Check::GiverClearance | Check::ObstacleClearance)
}

fn with_surroundings(holdout: Holdout) -> Holdout {
    let (centre, up) = (holdout.object.centre_of_mass, holdout.up);
    let table = Pose::new(centre - up * 0.55, Quat::from_rotation_arc(Vec3::Y, up));
    let shoulder = centre + up * 0.2 + up.any_orthonormal_vector() * 0.35;
    Holdout {
        obstacles: vec![Obstacle::Box(oriented_box(table, Vec3::new(1.0, 0.5, 1.0)))],
        stance: Stance::At(arm(shoulder, 0.3, 0.26)),
        ..holdout
    }
}

#[test]
fn ratings_count_what_verdicts_say_of_every_known_grip() {
    let mut causes = [0; 6];
    for (place, holdout) in tracked_holdouts().enumerate().step_by(4) {
        let atlas = every(10, name_of(&holdout.object));
        for holdout in [holdout.clone(), with_surroundings(holdout)] {
            let search = guided(&holdout).atlas(&atlas);
            let evaluation = search.evaluate(Stop::NEVER);
            let mut expected = [0; 6];
            let (mut valid, mut best) = ([0; 6], 0.0_f32);
            for entry in atlas.entries() {
                let judged = search.judge(&entry.grip.pose);
                let from = entry.grip.pose.frame_from_wrist.transform_vector(Vec3::NEG_Z);
                let side = (0..6).max_by(|&a, &b| SIDES[a].dot(from).total_cmp(&SIDES[b].dot(from)));
                if let Some(what) = in_the_way(&judged) {
                    let place = HINDRANCES.iter().position(|&other| other == what);
                    expected[place.expect("it is one of these")] += 1;
                } else {
                    valid[side.expect("there are sides")] += 1;
                    best = best.max(judged.grasp.score.map_or(0.0, |score| score.total()));
                }
            }
            assert_eq!(evaluation.known() as usize, atlas.entries().len());
            assert_eq!(evaluation.hindered, expected, "holdout {place}");
            assert_eq!(evaluation.sides.map(|side| side.valid), valid, "holdout {place}");
            assert!((evaluation.best_score() - best).abs() < 1e-4, "holdout {place}");
            for (sum, count) in causes.iter_mut().zip(expected) {
                *sum += count;
            }
        }
    }
    let [presenting, others, obstacles, reach, ..] = causes;
    assert!(
        presenting > 0 && others == 0 && obstacles > 0 && reach > 0,
        "{causes:?}"
    );
}

#[test]
fn a_stopped_rating_counts_what_it_has_checked() {
    use std::sync::atomic::{AtomicUsize, Ordering};
    let holdout = tracked_holdouts().next().expect("there are holdouts");
    let search = guided(&holdout).atlas(&every(10, name_of(&holdout.object)));
    let asked = AtomicUsize::new(0);
    let is_over = || asked.fetch_add(1, Ordering::Relaxed) >= 10;
    assert_eq!(search.evaluate(Stop::when(&is_over)).known(), 10);
}
