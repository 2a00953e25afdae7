//! The current grasp: when it is kept, adjusted, replaced or aborted, and by what it is followed.

mod agreement;
mod failed_checks;
mod kept;
mod learned;
mod making_way;
mod replans;
mod swaying;

use std::sync::Arc;

use grasp_synthesis::{
    base::pose::Pose,
    known::{atlas::Atlas, recheck::GripChecker},
    model::{grasp::Grasp, hand::HandPose, holdout::Holdout, strategy::Validity},
    physical::{
        grip::Gripper,
        scene::{ObjectScene, Presented},
        solids::{HandSolids, TaperedCapsule, TrackedSolids},
    },
    search::{
        SearchOutcome,
        current::{CurrentGrasp, CurrentGraspVerdict, Grace, METRES_PER_RADIAN, Settlement},
    },
};

use crate::fixtures::{hands::right, searches::Search};

/// A grasp to keep, with the hand at it.
fn current(hand: HandPose) -> CurrentGrasp {
    CurrentGrasp {
        hand,
        present: hand,
        min_score_gain: None,
        is_committed: false,
        grace: Grace::default(),
    }
}

/// A search after a current grasp.
fn after<'a>(holdout: &'a Holdout, atlas: &Arc<Atlas>, current: CurrentGrasp) -> Search<'a> {
    Search {
        atlas: Some(Arc::clone(atlas)),
        current: Some(current),
        ..Search::guided(holdout, right())
    }
}

fn settled(settlement: Settlement) -> (SearchOutcome, CurrentGraspVerdict) {
    match settlement {
        Settlement::Settled(settled) => *settled,
        other => panic!("{other:?}"),
    }
}

fn score(grasp: &Grasp) -> f32 {
    grasp.score.expect("it is rated").total()
}

fn tracked(hand: &HandPose) -> TrackedSolids {
    let solids = HandSolids::of_pose(right(), hand);
    TrackedSolids::of_rig(right(), hand.frame_from_wrist, &solids)
}

/// The smallest distance between two sets of solids, pair by pair.
fn distance<'a>(
    ours: impl Iterator<Item = &'a TaperedCapsule>,
    theirs: impl Iterator<Item = &'a TaperedCapsule>,
) -> f32 {
    let theirs: Vec<&TaperedCapsule> = theirs.collect();
    let pairs = ours.flat_map(|our| theirs.iter().map(|their| our.distance(their)));
    pairs.fold(f32::INFINITY, f32::min)
}

/// What every grip of an atlas is in a holdout: the grasp if it is valid.
fn valid_grips(holdout: &Holdout, atlas: &Atlas) -> Vec<Option<Grasp>> {
    let friction = holdout.object.friction_under(Validity::Physical);
    let scene = ObjectScene::new(&holdout.object, friction);
    let presented = Presented::of(holdout);
    let checker = GripChecker::new(&scene, right(), &presented);
    let mut gripper = Gripper::default();
    let entries = atlas.entries().iter();
    entries
        .map(|entry| checker.check(entry, &entry.tracked_solids(right()), &mut gripper))
        .collect()
}

/// The way between two wrists: metres, and a tenth of a metre per radian.
fn way(from: Pose, to: Pose) -> f32 {
    let cosine = from.orientation.dot(to.orientation).abs().min(1.0);
    from.position.distance(to.position) + METRES_PER_RADIAN * 2.0 * cosine.acos()
}
