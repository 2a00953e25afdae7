//! What stands is kept: the answers of searches, the grips of atlases, hands that hang or have few fingers.

use std::sync::Arc;

use grasp_synthesis::{
    model::{
        constraints::{Constraints, DigitSet},
        grasp::Grasp,
        hand::{
            Digit, HandPose,
            joints::{openxr_from_thesis_frame, thesis_from_openxr_frame},
        },
        holdout::Holdout,
    },
    search::{
        GraspSource, SearchEnd,
        standing::{FallReason, Stand, StandingStatus},
    },
};

use super::{after, score, settled, standing, valid_grips};
use crate::fixtures::{
    atlases::shipped_atlas,
    hands::{adult_with, right},
    holdouts::{floating, tracked_holdouts},
    objects::{lunch_box, object},
    searches::Search,
};

/// The pose as it returns from a client.
fn through_the_wire(pose: &HandPose) -> HandPose {
    let joint = openxr_from_thesis_frame(pose.frame_from_wrist);
    HandPose {
        frame_from_wrist: thesis_from_openxr_frame(joint),
        ..*pose
    }
}

#[test]
fn keeps_what_a_search_found_on_every_built_in_holdout() {
    let names = grasp_assets::holdouts::holdouts()
        .iter()
        .map(|built_in| &built_in.object);
    let mut cases = 0;
    for (holdout, name) in tracked_holdouts().zip(names) {
        let atlas = shipped_atlas(name);
        let known = Search {
            atlas: Some(Arc::clone(&atlas)),
            ..Search::guided(&holdout, right())
        };
        let fresh = (0..3).map(|seed| Search {
            seed,
            max_attempts: 3_000,
            ..Search::guided(&holdout, right())
        });
        for search in std::iter::once(known).chain(fresh) {
            let Some(grasp) = search.run().grasp else { continue };
            cases += 1;
            let (outcome, verdict) = settled(after(&holdout, &atlas, standing(grasp.pose)).stand());
            assert_eq!(
                (verdict.status, verdict.fall),
                (StandingStatus::Kept, None),
                "{name}"
            );
            assert_eq!(outcome.end, SearchEnd::Found);
            assert_eq!(outcome.report.source, Some(GraspSource::Standing));
            let kept = outcome.grasp.expect("it is kept");
            assert_eq!(kept.pose, grasp.pose);
            assert!((score(&kept) - score(&grasp)).abs() < 0.01, "{name}");
            let clearance = |grasp: &Grasp| grasp.margins.and_then(|margins| margins.giver_clearance);
            assert_eq!(clearance(&kept), clearance(&grasp));
            let way = verdict.way.expect("the hands are the same");
            assert_eq!((way.distance, way.angle, way.fingertips), (0.0, 0.0, 0.0));
            // Rounding on the way to a client and back changes nothing.
            let sent = through_the_wire(&grasp.pose);
            let (outcome, verdict) = settled(after(&holdout, &atlas, standing(sent)).stand());
            assert_eq!(verdict.status, StandingStatus::Kept, "{name}: {:?}", verdict.fall);
            assert_eq!(outcome.grasp.map(|grasp| grasp.pose), Some(sent));
        }
    }
    assert!(cases >= 55, "{cases}");
}

#[test]
fn keeps_the_grips_of_an_atlas_that_hold() {
    let atlas = shipped_atlas("scissors");
    let holdout = floating(Arc::clone(object("scissors")));
    let (mut held, mut kept) = (0, 0);
    for grasp in valid_grips(&holdout, &atlas).into_iter().flatten() {
        held += 1;
        let (_, verdict) = settled(after(&holdout, &atlas, standing(through_the_wire(&grasp.pose))).stand());
        kept += usize::from(verdict.status == StandingStatus::Kept);
    }
    assert!(held > 100 && kept == held, "{kept} of {held}");
}

#[test]
fn keeps_hands_with_few_fingers_and_hands_that_hang() {
    let few = adult_with(&[Digit::Index, Digit::Middle], right().handedness);
    let holdout = floating(Arc::clone(object("remote")));
    let search = Search {
        max_attempts: 3_000,
        ..Search::guided(&holdout, &few)
    };
    let grasp = search.run().grasp.expect("three digits hold it");
    let again = Search {
        standing: Some(standing(grasp.pose)),
        ..search
    };
    let (outcome, verdict) = settled(again.stand());
    assert_eq!(verdict.status, StandingStatus::Kept, "{:?}", verdict.fall);
    assert_eq!(outcome.grasp.map(|kept| kept.pose), Some(grasp.pose));

    let holdout = floating(lunch_box(0.03));
    let hooking = Search {
        constraints: Constraints {
            must_not_touch: DigitSet::from_iter([Digit::Thumb]),
            ..Constraints::default()
        },
        max_attempts: 3_000,
        ..Search::guided(&holdout, right())
    };
    let grasp = hooking.run().grasp.expect("it hangs in fingers");
    assert!(grasp.hangs);
    let again = Search {
        standing: Some(standing(grasp.pose)),
        ..hooking
    };
    let (outcome, verdict) = settled(again.stand());
    assert_eq!(verdict.status, StandingStatus::Kept, "{:?}", verdict.fall);
    let kept = outcome.grasp.expect("it is kept");
    assert!(kept.hangs && kept.pose == grasp.pose);
    assert_eq!(kept.classification, grasp.classification);
    // Turned over, it falls out.
    let turned = Holdout {
        up: -holdout.up,
        ..holdout.clone()
    };
    let fallen = Search {
        holdout: &turned,
        ..again
    };
    let Stand::Fallen(fall) = fallen.stand() else {
        panic!("nothing hangs upward")
    };
    assert!(
        matches!(fall.reason, FallReason::NotClosed | FallReason::Unbalanced),
        "{fall:?}"
    );
    assert!(fall.figure.is_some_and(f32::is_finite) && fall.bound.is_some());
}
