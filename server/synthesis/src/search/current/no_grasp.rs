//! Why there is no grasp to follow a current one.

use crate::{
    physical::grip::clear_of_barriers,
    search::{
        limits::{Limit, LimitKind},
        scene::Scene,
        settings::SearchSettings,
    },
};

/// Why there is no grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoGraspReason {
    /// Barriers are in the way of most known grips that would hold, or the giver leaves no room.
    GiverInTheWay,
    /// One hand cannot hold the object.
    CannotBeHeld,
    /// The receiver's arm does not reach most known grips, or the object.
    OutOfReach,
    /// A longer search may find one.
    NotFoundInTime,
}

/// Why no grasp was found: by what limits the holdout or, without a limit, by what most known grips fail that would hold.
pub fn no_grasp_reason(scene: &Scene<'_>, settings: &SearchSettings, limits: &[Limit]) -> NoGraspReason {
    let is_limited_by = |kind: LimitKind| limits.iter().any(|limit| limit.kind == kind);
    let unholdable = [
        LimitKind::Mass,
        LimitKind::Torque,
        LimitKind::Width,
        LimitKind::Forbidden,
    ];
    if unholdable.into_iter().any(is_limited_by) {
        NoGraspReason::CannotBeHeld
    } else if is_limited_by(LimitKind::Giver) {
        NoGraspReason::GiverInTheWay
    } else if is_limited_by(LimitKind::Reach) {
        NoGraspReason::OutOfReach
    } else {
        of_known_grips(scene, settings)
    }
}

fn of_known_grips(scene: &Scene<'_>, settings: &SearchSettings) -> NoGraspReason {
    let (Some((_, presented)), Some(atlas)) = (scene.physical(), settings.known.atlas.as_deref()) else {
        return NoGraspReason::NotFoundInTime;
    };
    let (mut blocked, mut unreached, mut others) = (0_usize, 0_usize, 0_usize);
    for index in atlas.holding_under(presented.up) {
        let entry = &atlas.entries()[usize::from(index)];
        let wrist = entry.grip.pose.frame_from_wrist;
        let is_within = scene.requirements().reaches(wrist);
        let is_clear =
            || clear_of_barriers(&entry.tracked_solids(scene.rig()), presented.barriers()).is_some();
        if !is_within || !presented.receiver.reaches(scene.rig(), wrist) {
            unreached += 1;
        } else if !is_clear() {
            blocked += 1;
        } else {
            others += 1;
        }
    }
    if blocked > unreached.max(others) {
        NoGraspReason::GiverInTheWay
    } else if unreached > blocked.max(others) {
        NoGraspReason::OutOfReach
    } else {
        NoGraspReason::NotFoundInTime
    }
}
