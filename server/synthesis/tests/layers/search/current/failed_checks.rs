//! Why a grasp fails, with the figure that decides, and why nothing follows it.

use std::sync::Arc;

use glam::Vec3;
use grasp_synthesis::{
    model::{
        check::Check,
        hand::{Digit, HandPose},
        holdout::Holdout,
        obstacle::Obstacle,
        requirements::{ApproachCone, DigitSet, Reach, Requirements, approach_direction},
    },
    physical::solids::TaperedCapsule,
    search::{
        SearchEnd,
        current::{CurrentGrasp, CurrentGraspStatus},
    },
};

use super::{after, current, distance, settled, tracked, valid_grips};
use crate::fixtures::{
    atlases::shipped_atlas,
    holdouts::{floating, giver_solids, held_by},
    objects::object,
    searches::Search,
};

#[test]
fn a_giver_on_the_palm_is_reported_with_its_distance() {
    let atlas = shipped_atlas("scissors");
    let mut committed = 0;
    for entry in atlas.entries().iter().step_by(29) {
        let hand = entry.grip.pose;
        let mut giver = hand;
        giver.frame_from_wrist.position += Vec3::new(0.01, 0.005, 0.02);
        let holdout = held_by("scissors", &giver);
        let expected = distance(tracked(&hand).iter(), giver_solids(&holdout).iter());
        let current = CurrentGrasp {
            is_committed: true,
            min_score_gain: Some(0.0),
            ..current(hand)
        };
        let (outcome, verdict) = settled(after(&holdout, &atlas, current).settle());
        committed += 1;
        assert_eq!(verdict.status, CurrentGraspStatus::Aborted);
        assert_eq!((outcome.end, outcome.grasp), (SearchEnd::Aborted, None));
        let failed = verdict.failed_check.expect("it failed a check");
        assert_eq!(failed.check, Check::GiverClearance);
        assert!(
            (failed.figure.unwrap() - expected).abs() < 1e-5,
            "{failed:?} {expected}"
        );
        assert!(failed.to_string().contains("another person's hand"), "{failed}");
        // The open hand is drawn back.
        let back = verdict.withdrawal.expect("there is a pose");
        let way = back.frame_from_wrist.position - hand.frame_from_wrist.position;
        assert!((way.length() - 0.12).abs() < 1e-4, "{way}");
        assert!(way.dot(approach_direction(hand.frame_from_wrist)) < 0.0);
        assert_eq!(
            back.frame_from_wrist.orientation,
            hand.frame_from_wrist.orientation
        );
        let bend = |pose: &HandPose| pose.digits[1].base_pitch + pose.digits[1].second_pitch;
        assert!(bend(&back) < bend(&hand) || bend(&hand) < 0.1);
    }
    assert!(committed > 5);
}

#[test]
fn requirements_that_a_grasp_violates_are_named() {
    let atlas = shipped_atlas("remote");
    let holdout = floating(Arc::clone(object("remote")));
    let valid = valid_grips(&holdout, &atlas);
    let grasp = valid.iter().flatten().next().expect("the remote can be held");
    let wrist = grasp.pose.frame_from_wrist;
    let none = Requirements::default();
    let shoulder = wrist.position + Vec3::new(0.0, 0.6, 0.0);
    let violated = [
        (
            Check::Reach,
            Requirements {
                reach: Some(Reach {
                    shoulder,
                    distance: 0.5,
                }),
                ..none
            },
        ),
        (
            Check::Approach,
            Requirements {
                approach: Some(ApproachCone {
                    axis: -approach_direction(wrist),
                    half_angle: 0.3,
                }),
                ..none
            },
        ),
        (
            Check::Digits,
            Requirements {
                must_not_touch: DigitSet::from_iter([Digit::Thumb]),
                ..none
            },
        ),
        (
            Check::Comfort,
            Requirements {
                worst_comfort: Some(0.9 * grasp.comfort),
                ..none
            },
        ),
    ];
    for (reason, requirements) in violated {
        let current = CurrentGrasp {
            is_committed: true,
            ..current(grasp.pose)
        };
        let search = Search {
            requirements,
            ..after(&holdout, &atlas, current)
        };
        let (_, verdict) = settled(search.settle());
        let failed = verdict.failed_check.expect("it failed a check");
        assert_eq!(failed.check, reason);
        if reason == Check::Reach {
            assert!((failed.figure.unwrap() - 0.6).abs() < 1e-5 && failed.bound == Some(0.5));
        }
    }
}

#[test]
fn hands_that_sink_in_or_hold_nothing_are_named_with_their_figures() {
    let atlas = shipped_atlas("remote");
    let holdout = floating(Arc::clone(object("remote")));
    let grasp = valid_grips(&holdout, &atlas)
        .into_iter()
        .flatten()
        .next()
        .expect("a grip");
    let fall_of = |moved: Vec3| {
        let mut hand = grasp.pose;
        hand.frame_from_wrist.position += moved;
        let current = CurrentGrasp {
            is_committed: true,
            ..current(hand)
        };
        let (_, verdict) = settled(after(&holdout, &atlas, current).settle());
        verdict.failed_check.expect("it failed a check")
    };
    let palm = grasp.pose.frame_from_wrist.transform_vector(Vec3::Z);
    let sunken = fall_of(palm * 0.01);
    assert_eq!((sunken.check, sunken.bound), (Check::Penetration, Some(0.002)));
    assert!(sunken.figure > Some(0.002), "{sunken:?}");
    let away = fall_of(Vec3::new(0.0, 0.0, 1.0));
    assert_eq!((away.check, away.figure), (Check::Closure, Some(0.0)));
    assert!(away.bound.is_some(), "{away:?}");
}

#[test]
fn the_absence_of_a_grasp_is_explained_by_limits_or_by_what_known_grips_fail() {
    let atlas = shipped_atlas("scissors");
    let holdout = floating(Arc::clone(object("scissors")));
    let hand = atlas.entries()[0].grip.pose;
    let far = Requirements {
        reach: Some(Reach {
            shoulder: Vec3::new(0.0, 3.0, 0.0),
            distance: 0.5,
        }),
        ..Requirements::default()
    };
    let reason = |holdout: &Holdout, requirements: Requirements| {
        let search = Search {
            requirements,
            ..after(holdout, &atlas, current(hand))
        };
        search.no_grasp_reason()
    };
    assert_eq!(reason(&holdout, far), Check::Reach);
    assert_eq!(reason(&holdout, Requirements::default()), Check::Time);
    // A pole through everything.
    let pole = TaperedCapsule::new(Vec3::new(0.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0), 0.2, 0.2);
    let buried = Holdout {
        obstacles: vec![Obstacle::Capsule(pole)],
        ..holdout.clone()
    };
    assert_eq!(reason(&buried, Requirements::default()), Check::GiverClearance);
    let heavy = Holdout {
        object: Arc::new(
            holdout
                .object
                .with_properties(200.0, Vec3::ZERO, None, &[])
                .expect("it is sound"),
        ),
        ..holdout
    };
    assert_eq!(reason(&heavy, Requirements::default()), Check::Holdable);
}
