//! Valid grasps are kept: the answers of searches, the grips of atlases, hands that hang or have few fingers.

use grasp_synthesis::model::hand::joints::thesis_from_openxr_frame;

use super::{after, current, settled};
use crate::prelude::*;

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

/// The grasp that a search finds is kept.
fn assert_keeps_own(search: &Search<'_>) -> Grasp {
    let grasp = search.grasp().expect("something holds it");
    let (outcome, verdict) = settled(search.clone().current(current(grasp.pose)).settle());
    assert_eq!(
        verdict.status,
        CurrentGraspStatus::Kept,
        "{:?}",
        verdict.failed_check
    );
    let kept = outcome.grasp.expect("it is kept");
    assert_eq!((kept.pose, kept.hangs), (grasp.pose, grasp.hangs));
    assert_eq!(kept.classification, grasp.classification);
    grasp
}

#[test]
fn keeps_hands_with_few_fingers_and_hands_that_hang() {
    let few = adult_with(&[Digit::Index, Digit::Middle], right().handedness);
    let holdout = floating(Arc::clone(object("remote")));
    assert_keeps_own(&guided(&holdout).rig(&few).max_attempts(3_000));

    let holdout = floating(lunch_box(0.03));
    let hooking = guided(&holdout).requirements(without_thumb()).max_attempts(3_000);
    let grasp = assert_keeps_own(&hooking);
    assert!(grasp.hangs);
    // Turned over, it falls out.
    let turned = Holdout {
        up: -holdout.up,
        ..holdout.clone()
    };
    let again = hooking.current(current(grasp.pose)).holdout(&turned);
    let Settlement::Failed(failed) = again.settle() else {
        panic!("nothing hangs upward")
    };
    let reasons = [FailedCheckReason::NotClosed, FailedCheckReason::Unbalanced];
    assert!(reasons.contains(&failed.reason), "{failed:?}");
    assert!(failed.figure.is_some_and(f32::is_finite) && failed.bound.is_some());
}
