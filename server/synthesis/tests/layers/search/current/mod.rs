//! The current grasp: when it is kept, adjusted, replaced or aborted, and its replacement.

mod agreement;
mod kept;

use grasp_synthesis::search::current::{CurrentGraspVerdict, Grace, METRES_PER_RADIAN};

use crate::prelude::*;

fn current(hand: HandPose) -> CurrentGrasp {
    CurrentGrasp {
        hand,
        present: hand,
        min_score_gain: None,
        is_committed: false,
        grace: Grace::default(),
    }
}

fn after<'a>(holdout: &'a Holdout, atlas: &Arc<Atlas>, current: CurrentGrasp) -> Search<'a> {
    guided(holdout).atlas(atlas).current(current)
}

fn settled(settlement: Settlement) -> (SearchOutcome, CurrentGraspVerdict) {
    match settlement {
        Settlement::Settled(settled) => *settled,
        other => panic!("{other:?}"),
    }
}

/// The way between two wrists: metres, and a tenth of a metre per radian.
fn way(from: Pose, to: Pose) -> f32 {
    let cosine = from.orientation.dot(to.orientation).abs().min(1.0);
    from.position.distance(to.position) + METRES_PER_RADIAN * 2.0 * cosine.acos()
}

#[test]
fn replans_go_to_the_nearest_valid_known_grip_or_one_nearly_as_near() {
    let atlas = shipped_atlas("scissors");
    let mut random = Random::new(31);
    let (mut replanned, mut failed, mut nearest_taken) = (0, 0, 0);
    for giver in (0..atlas.entries().len()).step_by(5) {
        let holdout = scissors_held_by(&atlas, giver);
        // The hand is where the giver's is, and has since moved on.
        let hand = atlas.entries()[giver].grip.pose;
        let mut present = hand;
        let turn = Quat::from_axis_angle(random.direction(), random.between(0.0, 0.6));
        present.frame_from_wrist.position += random.direction() * random.between(0.0, 0.08);
        present.frame_from_wrist.orientation = (turn * present.frame_from_wrist.orientation).normalize();
        let current = CurrentGrasp {
            present,
            ..current(hand)
        };
        let valid = valid_grips(&holdout, &atlas);
        let ways = valid
            .iter()
            .flatten()
            .map(|grasp| way(present.frame_from_wrist, grasp.pose.frame_from_wrist));
        let least = ways.fold(f32::INFINITY, f32::min);
        match after(&holdout, &atlas, current).settle() {
            Settlement::Failed(check) => {
                failed += 1;
                assert_eq!(check.check, Check::GiverClearance);
                assert!(least.is_infinite(), "giver {giver}: {least}");
            }
            Settlement::Settled(settled) => {
                replanned += 1;
                let (outcome, verdict) = *settled;
                assert_eq!(verdict.status, CurrentGraspStatus::Replanned);
                let Some(GraspSource::Atlas(index)) = outcome.report.source else {
                    panic!("{:?}", outcome.report)
                };
                let chosen = valid[usize::from(index)].as_ref().expect("it is valid");
                assert_eq!(outcome.grasp.as_ref().map(|grasp| grasp.pose), Some(chosen.pose));
                let length = way(present.frame_from_wrist, chosen.pose.frame_from_wrist);
                assert!(length <= 1.251 * least + 1e-4, "giver {giver}: {length} {least}");
                nearest_taken += usize::from(length <= least + 1e-4);
                let reported = verdict.way.expect("it is of the same hand");
                let sum = reported.distance + METRES_PER_RADIAN * reported.angle;
                assert!((sum - length).abs() < 1e-3, "{reported:?} {length}");
            }
            Settlement::Stopped => panic!("there is no limit"),
        }
    }
    assert!(
        replanned > 40 && nearest_taken > replanned / 4,
        "{replanned} {failed} {nearest_taken}"
    );
}

#[test]
fn only_a_grip_that_is_better_by_enough_replaces_a_valid_grasp() {
    let atlas = shipped_atlas("remote");
    let (mut kept, mut replaced) = (0, 0);
    for holdout in tracked_holdouts().filter(|holdout| Arc::ptr_eq(&holdout.object, object("remote"))) {
        let valid = valid_grips(&holdout, &atlas);
        let best = valid.iter().flatten().map(score).fold(0.0, f32::max);
        for grasp in valid.iter().flatten().step_by(7) {
            let own = {
                let (outcome, _) = settled(after(&holdout, &atlas, current(grasp.pose)).settle());
                score(&outcome.grasp.expect("it is valid"))
            };
            for min_score_gain in [0.0, 0.05, 0.2, 1.0] {
                let current = CurrentGrasp {
                    min_score_gain: Some(min_score_gain),
                    ..current(grasp.pose)
                };
                let (outcome, verdict) = settled(after(&holdout, &atlas, current).settle());
                let answer = outcome.grasp.expect("a grasp");
                if best - own > min_score_gain + 1e-4 {
                    replaced += 1;
                    assert_eq!(verdict.status, CurrentGraspStatus::Replanned);
                    assert!((score(&answer) - best).abs() < 1e-5, "{} {best}", score(&answer));
                    let failed = verdict.failed_check.expect("it is replaced");
                    assert_eq!((failed.check, failed.bound), (Check::Score, Some(min_score_gain)));
                    assert!((failed.figure.unwrap() - (best - own)).abs() < 1e-4);
                } else if best - own < min_score_gain - 1e-4 {
                    kept += 1;
                    assert_eq!(verdict.status, CurrentGraspStatus::Kept);
                    assert_eq!(answer.pose, grasp.pose);
                }
                let committed = CurrentGrasp {
                    is_committed: true,
                    ..current
                };
                let (_, verdict) = settled(after(&holdout, &atlas, committed).settle());
                assert_eq!(verdict.status, CurrentGraspStatus::Kept);
            }
        }
    }
    assert!(kept > 50 && replaced > 50, "{kept} kept, {replaced} replaced");
}

#[test]
fn attempts_after_a_failed_grasp_find_nearer_hands_whatever_the_number_of_workers() {
    let atlas = shipped_atlas("scissors");
    let (mut near, mut far, mut cases) = (0.0, 0.0, 0);
    for giver in (0..atlas.entries().len()).step_by(31) {
        let holdout = scissors_held_by(&atlas, giver);
        let valid = valid_grips(&holdout, &atlas);
        let Some(present) = valid.iter().flatten().next().map(|grasp| grasp.pose) else {
            continue;
        };
        let plain = guided(&holdout).max_attempts(2_000);
        let after = |workers| plain.clone().current(current(present)).workers(workers);
        let found = [1, 3].map(|workers| after(workers).grasp().expect("a grasp"));
        assert_eq!(found[0], found[1]);
        let length = |grasp: &Grasp| way(present.frame_from_wrist, grasp.pose.frame_from_wrist);
        near += length(&found[0]);
        far += length(&plain.grasp().expect("a grasp"));
        cases += 1;
    }
    assert!(cases > 5 && near < 0.7 * far, "{near} {far} of {cases}");
}
