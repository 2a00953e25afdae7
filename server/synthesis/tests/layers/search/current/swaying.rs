//! Hands that sway: how long a grasp is kept that they come too close to, and what follows it.

use grasp_synthesis::search::current::Grace;

use super::{after, current, settled};
use crate::prelude::*;

/// Least distance of what follows a grasp from where hands were lately.
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

fn with_giver(holdout: &Holdout, giver: HandJoints) -> Holdout {
    Holdout {
        presenting_hand: Some(PresentingHand::of_joints(giver)),
        ..holdout.clone()
    }
}

fn gap(holdout: &Holdout, hand: &HandPose) -> f32 {
    pair_distance(tracked(hand).iter(), giver_solids(holdout).iter())
}

/// The holdout with the giver moved towards a hand until it is this far from it.
fn approached(holdout: &Holdout, hand: &HandPose, wanted: f32) -> Holdout {
    let giver = giver_of(holdout);
    let way = hand.frame_from_wrist.position - giver.joints[1].pose.position;
    let at = |share: f32| with_giver(holdout, giver.transformed(Pose::from_position(way * share)));
    let (mut far, mut near) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (far + near);
        if gap(&at(middle), hand) > wanted {
            far = middle;
        } else {
            near = middle;
        }
    }
    at(far)
}

#[test]
fn within_its_grace_a_grasp_is_kept_with_what_it_is_short_of() {
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
fn what_follows_keeps_clear_of_where_the_giver_was_if_a_known_grip_does() {
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
                // Only where nothing steady follows is the grasp itself kept.
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
