//! Current grasps are kept while they are valid.

use grasp_synthesis::{
    model::hand::joints::thesis_from_openxr_frame, physical::barriers::OBSTACLE_CLEARANCE,
    search::current::Grace,
};

use super::{after, current, settled, way};
use crate::prelude::*;

/// The pose after its way to a client and back.
fn through_the_wire(pose: &HandPose) -> HandPose {
    let joint = openxr_from_thesis_frame(pose.frame_from_wrist);
    HandPose {
        frame_from_wrist: thesis_from_openxr_frame(joint),
        ..*pose
    }
}

#[test]
fn keeps_the_grasp_found_on_every_built_in_holdout() {
    let mut cases = 0;
    for (holdout, built_in) in tracked_holdouts().zip(holdouts()) {
        let name = &built_in.name;
        let atlas = shipped_atlas(&built_in.object);
        let known = guided(&holdout).atlas(&atlas);
        let fresh = (0..3).map(|seed| guided(&holdout).seed(seed).max_attempts(3_000));
        for search in std::iter::once(known).chain(fresh) {
            let Some(grasp) = search.grasp() else { continue };
            cases += 1;
            // Rounding on the way to a client and back changes nothing.
            for sent in [grasp.pose, through_the_wire(&grasp.pose)] {
                let (outcome, verdict) = settled(after(&holdout, &atlas, current(sent)).settle());
                assert_eq!(verdict.failed_check, None, "{name}");
                assert_eq!(verdict.status, CurrentGraspStatus::Kept, "{name}");
                assert_eq!(outcome.end, SearchEnd::Found);
                assert_eq!(outcome.report.source, Some(GraspSource::Current));
                let kept = outcome.grasp.expect("it is kept");
                assert_eq!(kept.pose, sent);
                assert!((score(&kept) - score(&grasp)).abs() < 0.01, "{name}");
                let way = verdict.way.expect("the hands are the same");
                assert_eq!((way.distance, way.angle, way.fingertips), (0.0, 0.0, 0.0));
            }
        }
    }
    assert!(cases >= 55, "{cases}");
}

#[test]
fn the_nearest_learned_grip_follows_where_the_atlas_has_none() {
    let known = shipped_atlas("scissors");
    let empty = Arc::new(Atlas::default());
    let mut followed = 0;
    for giver in (0..known.entries().len()).step_by(11) {
        let holdout = scissors_held_by(&known, giver);
        // The hand is where the giver's is.
        let failed = known.entries()[giver].grip.pose;
        let valid: Vec<Grasp> = valid_grips(&holdout, &known)
            .into_iter()
            .flatten()
            .take(40)
            .collect();
        if valid.len() < 2 {
            continue;
        }
        let search = after(&holdout, &empty, current(failed))
            .learned(learned(&valid))
            .reproducible(false);
        let (outcome, verdict) = settled(search.settle());
        assert_eq!(verdict.status, CurrentGraspStatus::Replanned);
        assert!(matches!(outcome.report.source, Some(GraspSource::Learned(_))));
        let of = |grasp: &Grasp| way(failed.frame_from_wrist, grasp.pose.frame_from_wrist);
        let nearest = valid.iter().map(of).fold(f32::INFINITY, f32::min);
        let answer = outcome.grasp.expect("there is one");
        assert!(of(&answer) <= 1.25 * nearest + 1e-5);
        followed += 1;
        // A valid grip of the atlas replaces it, however far it is.
        let with_atlas = after(&holdout, &known, current(failed))
            .learned(learned(&valid))
            .reproducible(false);
        let (outcome, _) = settled(with_atlas.settle());
        assert!(matches!(outcome.report.source, Some(GraspSource::Atlas(_))));
    }
    assert!(followed > 3, "{followed}");
}

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
    let mut counts = [[0; 2]; 2];
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
            let gap = |hand: &HandPose| pair_distance(tracked(hand).iter(), std::iter::once(&ball));
            let (outcome, verdict) = settled(after(&holdout, &atlas, current(grasp.pose)).settle());
            let failed = verdict.failed_check.expect("the ball is in the way");
            assert_eq!(failed.check, Check::ObstacleClearance);
            assert!(
                (failed.figure.unwrap() - gap(&grasp.pose)).abs() < 1e-5,
                "{failed:?}"
            );
            let is_adjusted = verdict.status == CurrentGraspStatus::Adjusted;
            counts[usize::from(holds)][usize::from(is_adjusted)] += 1;
            if !is_adjusted {
                continue;
            }
            let adjusted = outcome.grasp.expect("it is adjusted");
            assert_eq!(outcome.report.source, Some(GraspSource::Current));
            assert_eq!(verdict.moved, Digit::ALL.map(|other| other == digit));
            let mut unmoved = adjusted.pose;
            unmoved.digits[digit.index()] = grasp.pose.digits[digit.index()];
            assert_eq!(unmoved, grasp.pose);
            let clear = gap(&adjusted.pose);
            assert!(clear >= OBSTACLE_CLEARANCE - 1e-6, "{clear}");
            let margins = adjusted.margins.expect("it is physical");
            assert!((margins.obstacle_clearance.unwrap() - clear).abs() < 1e-5);
            assert!(margins.penetration <= 0.002 && margins.epsilon > 0.0);
            let holding = adjusted.bend_ratios.map(|ratio| ratio.is_some());
            assert_eq!(
                holding,
                if holds {
                    without
                } else {
                    entry.grip.holding_digits()
                }
            );
            // The adjusted grasp is kept as it is.
            let (_, verdict) = settled(after(&holdout, &atlas, current(adjusted.pose)).settle());
            assert_eq!(verdict.status, CurrentGraspStatus::Kept);
        }
    }
    let [[stuck, idle], [_, lifted]] = counts;
    assert!(idle > 20 && stuck * 4 < idle && lifted > 20, "{counts:?}");
}

/// Least distance of a replacement from the recent places of hands.
const STEADY: f32 = GIVER_CLEARANCE + 0.002;

/// Rounding of distances, in metres.
const ROUNDING: f32 = 1e-5;

fn giver_of(holdout: &Holdout) -> HandJoints {
    let giver = holdout.presenting_hand.as_ref();
    giver
        .and_then(|giver| giver.shape.joints())
        .expect("the giver has joints")
        .clone()
}

/// The holdout with the giver moved towards a hand until it is this far from it.
fn approached(holdout: &Holdout, hand: &HandPose, wanted: f32) -> Holdout {
    let giver = giver_of(holdout);
    let way = hand.frame_from_wrist.position - giver.joints[1].pose.position;
    let at = |share: f32| {
        let moved = giver.transformed(Pose::from_position(way * share));
        Holdout {
            presenting_hand: Some(PresentingHand::of_joints(moved)),
            ..holdout.clone()
        }
    };
    let gap = |holdout: &Holdout| pair_distance(tracked(hand).iter(), giver_solids(holdout).iter());
    let (mut far, mut near) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (far + near);
        *if gap(&at(middle)) > wanted {
            &mut far
        } else {
            &mut near
        } = middle;
    }
    at(far)
}

#[test]
fn within_its_grace_a_grasp_is_kept_with_its_shortfall() {
    let atlas = shipped_atlas("scissors");
    let mut cases = 0;
    for giver in (0..atlas.entries().len()).step_by(61) {
        let holdout = scissors_held_by(&atlas, giver);
        let Some(grasp) = valid_grips(&holdout, &atlas).into_iter().flatten().next() else {
            continue;
        };
        let hand = grasp.pose;
        for (wanted, kept_by) in [(0.0015, 0.0), (0.0004, 0.001), (-0.01, f32::INFINITY)] {
            let nearer = approached(&holdout, &hand, wanted);
            for grace in [0.0, 0.001, f32::INFINITY] {
                for is_committed in [false, true] {
                    let current = CurrentGrasp {
                        grace: Grace {
                            always: grace,
                            alone: 0.0,
                        },
                        is_committed,
                        ..current(hand)
                    };
                    let Settlement::Settled(settled) = after(&nearer, &atlas, current).settle() else {
                        assert!(grace < kept_by, "{wanted} {grace}");
                        continue;
                    };
                    let (outcome, verdict) = *settled;
                    cases += 1;
                    if grace < kept_by {
                        assert_ne!(verdict.status, CurrentGraspStatus::Kept, "{wanted} {grace}");
                        continue;
                    }
                    assert_eq!(verdict.status, CurrentGraspStatus::Kept, "{wanted} {grace}");
                    let kept = outcome.grasp.expect("it is kept");
                    assert_eq!((kept.pose, kept.contacts.len()), (hand, grasp.contacts.len()));
                    let figure = verdict.failed_check.and_then(|failed| {
                        assert_eq!(failed.check, Check::GiverClearance);
                        failed.figure
                    });
                    assert_eq!(figure.is_some(), wanted < GIVER_CLEARANCE);
                    assert!(
                        figure.is_none_or(|figure| (figure - wanted).abs() < 1e-4),
                        "{figure:?}"
                    );
                }
            }
        }
    }
    assert!(cases > 50, "{cases}");
}

#[test]
fn a_replacement_keeps_clear_of_where_the_giver_was_if_a_known_grip_does() {
    let atlas = shipped_atlas("scissors");
    let (mut steady, mut spared) = (0, 0);
    for giver in (0..atlas.entries().len()).step_by(9) {
        let held = scissors_held_by(&atlas, giver);
        let hand = atlas.entries()[giver].grip.pose;
        let joints = giver_of(&held);
        let moved = |way: Vec3| joints.transformed(Pose::from_position(way));
        let recent: Vec<HandJoints> = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO]
            .into_iter()
            .flat_map(|way| [moved(way * 0.008), moved(way * -0.008)])
            .collect();
        let keeps = |pose: &HandPose, least: f32| {
            recent.iter().all(|giver| {
                let solids = TrackedSolids::of_joints(giver);
                pair_distance(tracked(pose).iter(), solids.iter()) >= least
            })
        };
        let is_steady = |pose: &HandPose| keeps(pose, STEADY - ROUNDING);
        let plain = after(&held, &atlas, current(hand));
        let swaying = plain
            .clone()
            .recent_hands(recent.iter().cloned().map(Arc::new).collect());
        let valid = valid_grips(&held, &atlas);
        let any = valid.iter().flatten().any(|grasp| is_steady(&grasp.pose));
        if any
            && !valid
                .iter()
                .flatten()
                .any(|grasp| keeps(&grasp.pose, STEADY + ROUNDING))
        {
            continue;
        }
        match (plain.settle(), swaying.settle()) {
            (Settlement::Settled(plain), settlement) => {
                let (outcome, verdict) = settled(settlement);
                assert_eq!(verdict.status, CurrentGraspStatus::Replanned);
                let follower = outcome.grasp.expect("a grip is valid").pose;
                assert_eq!(is_steady(&follower), any, "giver {giver}");
                // The grasp itself is kept only if no steady grip replaces it.
                let patient = CurrentGrasp {
                    grace: Grace {
                        always: 0.0,
                        alone: f32::INFINITY,
                    },
                    ..current(hand)
                };
                let patient = swaying.current(patient);
                let (_, verdict) = settled(patient.settle());
                assert_eq!(verdict.status == CurrentGraspStatus::Replanned, any, "{giver}");
                steady += usize::from(any);
                let nearest = plain.0.grasp.expect("a grip is valid").pose;
                spared += usize::from(any && !is_steady(&nearest));
            }
            (Settlement::Failed(_), Settlement::Failed(_)) => assert!(!any),
            (plain, swaying) => panic!("{plain:?} {swaying:?}"),
        }
    }
    assert!(steady > 20 && spared > 5, "{steady} {spared}");
}
