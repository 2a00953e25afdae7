//! Digits that make way for what comes too close.

use grasp_synthesis::physical::barriers::OBSTACLE_CLEARANCE;

use super::{after, current, settled};
use crate::prelude::*;

/// A ball that touches one link of a grasp's digit and no other solid of the hand, if there is such a place.
fn ball_on(hand: &HandPose, digit: Digit) -> Option<TaperedCapsule> {
    let solids = tracked(hand);
    let tip = solids.hand.phalanges[digit.index()][2];
    let others: Vec<TaperedCapsule> = solids
        .iter()
        .enumerate()
        .filter(|(place, _)| place / 3 != digit.index())
        .map(|(_, solid)| *solid)
        .collect();
    let around = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    around.into_iter().find_map(|direction| {
        let centre = tip.end + direction * (tip.end_radius + 0.003);
        let ball = TaperedCapsule::new(centre, centre, 0.004, 0.004);
        (pair_distance(others.iter(), std::iter::once(&ball)) > 0.004).then_some(ball)
    })
}

#[test]
fn digits_make_way_while_the_rest_of_the_hand_holds_on() {
    let atlas = shipped_atlas("remote");
    let free = floating(Arc::clone(object("remote")));
    let (mut idle, mut lifted, mut tried) = ([0, 0], 0, 0);
    for (grasp, entry) in valid_grips(&free, &atlas).into_iter().zip(atlas.entries()) {
        let Some(grasp) = grasp else { continue };
        for digit in Digit::ALL {
            let holds = grasp.bend_ratios[digit.index()].is_some();
            let mut without = entry.grip.holding_digits();
            without[digit.index()] = false;
            let may_go = !holds || (digit != Digit::Thumb && entry.finger_subsets.contains(without));
            let Some(ball) = ball_on(&grasp.pose, digit).filter(|_| may_go) else {
                continue;
            };
            let holdout = Holdout {
                obstacles: vec![Obstacle::Capsule(ball)],
                ..free.clone()
            };
            tried += 1;
            let settlement = after(&holdout, &atlas, current(grasp.pose)).settle();
            let (outcome, verdict) = settled(settlement);
            let failed = verdict.failed_check.expect("the ball is in the way");
            assert_eq!(failed.check, Check::ObstacleClearance);
            let true_distance = pair_distance(tracked(&grasp.pose).iter(), std::iter::once(&ball));
            assert!(
                (failed.figure.unwrap() - true_distance).abs() < 1e-5,
                "{failed:?}"
            );
            if verdict.status != CurrentGraspStatus::Adjusted {
                idle[1] += usize::from(!holds);
                continue;
            }
            if holds {
                lifted += 1;
            } else {
                idle[0] += 1;
            }
            let adjusted = outcome.grasp.expect("it is adjusted");
            assert_eq!(outcome.report.source, Some(GraspSource::Current));
            assert_eq!(verdict.moved, Digit::ALL.map(|other| other == digit));
            assert_eq!(adjusted.pose.frame_from_wrist, grasp.pose.frame_from_wrist);
            for other in Digit::ALL.into_iter().filter(|&other| other != digit) {
                assert_eq!(
                    adjusted.pose.digits[other.index()],
                    grasp.pose.digits[other.index()]
                );
            }
            let clear = pair_distance(tracked(&adjusted.pose).iter(), std::iter::once(&ball));
            assert!(clear >= OBSTACLE_CLEARANCE - 1e-6, "{clear}");
            let margins = adjusted.margins.expect("it is physical");
            assert!((margins.obstacle_clearance.unwrap() - clear).abs() < 1e-5);
            assert!(margins.penetration <= 0.002 && margins.epsilon > 0.0);
            assert_eq!(
                adjusted.bend_ratios.map(|ratio| ratio.is_some()),
                if holds {
                    without
                } else {
                    entry.grip.holding_digits()
                }
            );
            // Now it is kept as it is.
            let (_, verdict) = settled(after(&holdout, &atlas, current(adjusted.pose)).settle());
            assert_eq!(verdict.status, CurrentGraspStatus::Kept);
        }
    }
    assert!(
        idle[0] > 20 && idle[1] * 4 < idle[0] && lifted > 20,
        "{idle:?} {lifted} of {tried}"
    );
}
