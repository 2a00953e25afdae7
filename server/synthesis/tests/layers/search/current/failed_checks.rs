//! Why a grasp fails, with the figure that decides, and why nothing follows it.

use super::{after, current, settled};
use crate::prelude::*;

#[test]
fn a_committed_hand_that_a_giver_meets_is_opened_and_drawn_back() {
    let atlas = shipped_atlas("scissors");
    for entry in atlas.entries().iter().step_by(29) {
        let hand = entry.grip.pose;
        let mut giver = hand;
        giver.frame_from_wrist.position += Vec3::new(0.01, 0.005, 0.02);
        let holdout = held_by("scissors", &giver);
        let current = CurrentGrasp {
            is_committed: true,
            min_score_gain: Some(0.0),
            ..current(hand)
        };
        let (outcome, verdict) = settled(after(&holdout, &atlas, current).settle());
        assert_eq!(verdict.status, CurrentGraspStatus::Aborted);
        assert_eq!((outcome.end, outcome.grasp), (SearchEnd::Aborted, None));
        let failed = verdict.failed_check.expect("it failed a check");
        assert!(failed.to_string().contains("another person's hand"), "{failed}");
        let back = verdict.withdrawal.expect("there is a pose");
        let [there, here] = [&back, &hand].map(|pose| pose.frame_from_wrist);
        let way = there.position - here.position;
        assert!((way.length() - 0.12).abs() < 1e-4, "{way}");
        assert!(way.dot(approach_direction(here)) < 0.0);
        assert_eq!(there.orientation, here.orientation);
        let bend = |pose: &HandPose| pose.digits[1].base_pitch + pose.digits[1].second_pitch;
        assert!(bend(&back) < bend(&hand) || bend(&hand) < 0.1);
    }
}

#[test]
fn the_absence_of_a_grasp_is_explained_by_limits_or_by_what_known_grips_fail() {
    let atlas = shipped_atlas("scissors");
    let free = floating(Arc::clone(object("scissors")));
    let none = Requirements::default();
    let far = within_reach(Vec3::Y * 3.0, 0.5);
    // A pole through everything.
    let pole = TaperedCapsule::new(Vec3::NEG_Y, Vec3::Y, 0.2, 0.2);
    let buried = Holdout {
        obstacles: vec![Obstacle::Capsule(pole)],
        ..free.clone()
    };
    let heavy = free.object.with_properties(200.0, Vec3::ZERO, None, &[]);
    let heavy = floating(heavy.expect("it is sound"));
    for (holdout, requirements, expected) in [
        (&free, far, Check::Reach),
        (&free, none, Check::Time),
        (&buried, none, Check::GiverClearance),
        (&heavy, none, Check::Holdable),
    ] {
        let search = after(holdout, &atlas, current(atlas.entries()[0].grip.pose));
        assert_eq!(search.requirements(requirements).no_grasp_reason(), expected);
    }
}
