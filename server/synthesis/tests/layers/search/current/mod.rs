//! The current grasp: when it is kept, adjusted, replaced or aborted, and by what it is followed.

mod agreement;
mod kept;
mod replans;
mod swaying;

use grasp_synthesis::search::current::{CurrentGraspVerdict, Grace, METRES_PER_RADIAN};

use crate::prelude::*;

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
    guided(holdout).atlas(atlas).current(current)
}

fn settled(settlement: Settlement) -> (SearchOutcome, CurrentGraspVerdict) {
    match settlement {
        Settlement::Settled(settled) => *settled,
        other => panic!("{other:?}"),
    }
}

/// The way between two wrists: metres, and a tenth of a metre per radian.
fn way(from: Pose, to: Pose) -> f32 {
    let cosine = from.orientation.dot(to.orientation).abs().min(1.0);
    from.position.distance(to.position) + METRES_PER_RADIAN * 2.0 * cosine.acos()
}
