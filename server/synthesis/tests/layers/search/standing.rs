//! The standing grasp: when it is kept, adjusted, replaced or aborted, and by what it is followed.

use std::sync::Arc;

use glam::{Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    known::recheck::GripChecker,
    model::{
        constraints::{Constraints, DigitSet},
        grasp::Grasp,
        hand::{
            Digit, HandPose,
            joints::{openxr_from_thesis_frame, thesis_from_openxr_frame},
        },
        holdout::Holdout,
        obstacle::Obstacle,
    },
    physical::{
        grip::{GIVER_CLEARANCE, Gripper},
        scene::{ObjectScene, Presented},
        solids::{HandSolids, TaperedCapsule, TrackedSolids},
    },
    search::{
        GraspSource, SearchEnd, SearchOutcome,
        standing::{
            FallReason, METRES_PER_RADIAN, NoGraspReason, Stand, Standing, StandingStatus, StandingVerdict,
        },
    },
};

use crate::fixtures::{
    atlases::{complete_atlas, scissors_held_by},
    hands::right,
    holdouts::{floating, giver_solids, held_by, tracked_holdouts},
    objects::lunch_box,
    searches::Search,
};

/// A grasp to keep, with the hand at it.
fn standing(hand: HandPose) -> Standing {
    Standing {
        hand,
        present: hand,
        better_by: None,
        is_committed: false,
    }
}

/// A search after a standing grasp, with the object's atlas.
fn after<'a>(holdout: &'a Holdout, object: &str, standing: Standing) -> Search<'a> {
    Search {
        atlas: Some(complete_atlas(object)),
        standing: Some(standing),
        ..Search::guided(holdout, right())
    }
}

fn settled(stand: Stand) -> (SearchOutcome, StandingVerdict) {
    match stand {
        Stand::Settled(settled) => *settled,
        other => panic!("{other:?}"),
    }
}

/// Grasps for every built-in holdout: the atlas' answer, and some of attempts.
fn found_on_built_in_holdouts() -> Vec<(Holdout, String, Grasp)> {
    let names = grasp_assets::holdouts::holdouts()
        .iter()
        .map(|built_in| built_in.object.clone());
    let mut found = Vec::new();
    for (holdout, name) in tracked_holdouts().zip(names) {
        let search = Search {
            max_attempts: 3_000,
            ..Search::guided(&holdout, right())
        };
        let with_atlas = Search {
            atlas: Some(complete_atlas(&name)),
            ..search.clone()
        };
        let by_attempts = (0..3).map(|seed| Search {
            seed,
            ..search.clone()
        });
        let grasps: Vec<Grasp> = std::iter::once(with_atlas)
            .chain(by_attempts)
            .filter_map(|search| search.run().grasp)
            .collect();
        found.extend(
            grasps
                .into_iter()
                .map(|grasp| (holdout.clone(), name.clone(), grasp)),
        );
    }
    found
}

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
    let found = found_on_built_in_holdouts();
    assert!(found.len() > 45, "{}", found.len());
    for (case, (holdout, name, grasp)) in found.iter().enumerate() {
        let (outcome, verdict) = settled(after(holdout, name, standing(grasp.pose)).stand());
        assert_eq!(
            verdict.status,
            StandingStatus::Kept,
            "{case} {name}: {:?}",
            verdict.fall
        );
        let kept = outcome.grasp.expect("it is kept");
        assert_eq!(outcome.report.source, Some(GraspSource::Standing));
        assert_eq!(kept.pose, grasp.pose);
        let (kept_score, score) = (kept.score.unwrap().total(), grasp.score.unwrap().total());
        assert!(
            (kept_score - score).abs() < 0.02,
            "{case} {name}: {kept_score} {score}"
        );
        assert_eq!(
            kept.margins.unwrap().giver_clearance,
            grasp.margins.unwrap().giver_clearance
        );
        // Rounding on the way to a client and back changes nothing.
        let sent = through_the_wire(&grasp.pose);
        let (outcome, verdict) = settled(after(holdout, name, standing(sent)).stand());
        assert_eq!(
            verdict.status,
            StandingStatus::Kept,
            "{case} {name}: {:?}",
            verdict.fall
        );
        assert_eq!(outcome.grasp.map(|grasp| grasp.pose), Some(sent));
    }
}
