//! Ratings of holdouts, against verdicts about every known grip.

use grasp_synthesis::search::{
    evaluation::{HINDRANCES, SIDES},
    verdicts::Against,
};

use crate::prelude::*;

/// The first thing in the way, by the verdicts. The order of two barriers does not follow from the nearest alone.
fn in_the_way(judged: &Judgement) -> Option<Check> {
    let fails = |check: Check| {
        let mut verdicts = judged.verdicts.iter();
        let verdict = verdicts.find(|verdict| verdict.check == check)?;
        // Verdicts allow for rounding in the client's frame.
        let is_below = matches!(check, Check::GiverClearance | Check::ObstacleClearance)
            && verdict
                .figure
                .zip(verdict.bound)
                .is_some_and(|(figure, bound)| figure < bound);
        (!verdict.passed || is_below).then_some(verdict)
    };
    if let Some(giver) = fails(Check::GiverClearance) {
        let Some(Against::Barrier(_)) = giver.against else {
            panic!("{giver:?}")
        };
        Some(Check::GiverClearance)
    } else if fails(Check::ObstacleClearance).is_some() {
        Some(Check::ObstacleClearance)
    } else if fails(Check::Reach).is_some() {
        Some(Check::Reach)
    } else if fails(Check::Balance).is_some() || fails(Check::Closure).is_some() {
        Some(Check::Balance)
    } else if judged.is_valid() {
        None
    } else {
        Some(Check::Requirements)
    }
}

fn with_surroundings(mut holdout: Holdout) -> Holdout {
    // A table below, and a receiver beside the giver.
    let up = holdout.up;
    holdout.obstacles = vec![Obstacle::Box(oriented_box(
        Pose::new(
            holdout.object.centre_of_mass - up * 0.55,
            glam::Quat::from_rotation_arc(Vec3::Y, up),
        ),
        Vec3::new(1.0, 0.5, 1.0),
    ))];
    holdout.stance = Stance::At(arm(
        holdout.object.centre_of_mass + up * 0.2 + up.any_orthonormal_vector() * 0.35,
        0.3,
        0.26,
    ));
    holdout
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
