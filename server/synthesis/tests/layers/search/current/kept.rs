//! Valid grasps are kept: the answers of searches, the grips of atlases, hands that hang or have few fingers.

use std::sync::Arc;

use grasp_synthesis::{
    model::{
        check::Check,
        grasp::Grasp,
        hand::{
            Digit, HandPose,
            joints::{openxr_from_thesis_frame, thesis_from_openxr_frame},
        },
        holdout::Holdout,
        requirements::{DigitSet, Requirements},
    },
    search::{
        GraspSource, SearchEnd,
        current::{CurrentGraspStatus, Settlement},
    },
};

use super::{after, current, score, settled, valid_grips};
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
            let (outcome, verdict) = settled(after(&holdout, &atlas, current(grasp.pose)).settle());
            assert_eq!(
                (verdict.status, verdict.failed_check),
                (CurrentGraspStatus::Kept, None),
                "{name}"
            );
            assert_eq!(outcome.end, SearchEnd::Found);
            assert_eq!(outcome.report.source, Some(GraspSource::Current));
            let kept = outcome.grasp.expect("it is kept");
            assert_eq!(kept.pose, grasp.pose);
            assert!((score(&kept) - score(&grasp)).abs() < 0.01, "{name}");
            let clearance = |grasp: &Grasp| grasp.margins.and_then(|margins| margins.giver_clearance);
            assert_eq!(clearance(&kept), clearance(&grasp));
            let way = verdict.way.expect("the hands are the same");
            assert_eq!((way.distance, way.angle, way.fingertips), (0.0, 0.0, 0.0));
            // Rounding on the way to a client and back changes nothing.
            let sent = through_the_wire(&grasp.pose);
            let (outcome, verdict) = settled(after(&holdout, &atlas, current(sent)).settle());
            assert_eq!(
                verdict.status,
                CurrentGraspStatus::Kept,
                "{name}: {:?}",
                verdict.failed_check
            );
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
        let (_, verdict) = settled(after(&holdout, &atlas, current(through_the_wire(&grasp.pose))).settle());
        kept += usize::from(verdict.status == CurrentGraspStatus::Kept);
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
        current: Some(current(grasp.pose)),
        ..search
    };
    let (outcome, verdict) = settled(again.settle());
    assert_eq!(
        verdict.status,
        CurrentGraspStatus::Kept,
        "{:?}",
        verdict.failed_check
    );
    assert_eq!(outcome.grasp.map(|kept| kept.pose), Some(grasp.pose));

    let holdout = floating(lunch_box(0.03));
    let hooking = Search {
        requirements: Requirements {
            must_not_touch: DigitSet::from_iter([Digit::Thumb]),
            ..Requirements::default()
        },
        max_attempts: 3_000,
        ..Search::guided(&holdout, right())
    };
    let grasp = hooking.run().grasp.expect("it hangs in fingers");
    assert!(grasp.hangs);
    let again = Search {
        current: Some(current(grasp.pose)),
        ..hooking
    };
    let (outcome, verdict) = settled(again.settle());
    assert_eq!(
        verdict.status,
        CurrentGraspStatus::Kept,
        "{:?}",
        verdict.failed_check
    );
    let kept = outcome.grasp.expect("it is kept");
    assert!(kept.hangs && kept.pose == grasp.pose);
    assert_eq!(kept.classification, grasp.classification);
    // Turned over, it falls out.
    let turned = Holdout {
        up: -holdout.up,
        ..holdout.clone()
    };
    let failed = Search {
        holdout: &turned,
        ..again
    };
    let Settlement::Failed(failed) = failed.settle() else {
        panic!("nothing hangs upward")
    };
    assert!(
        matches!(failed.check, Check::Closure | Check::Balance),
        "{failed:?}"
    );
    assert!(failed.figure.is_some_and(f32::is_finite) && failed.bound.is_some());
}
