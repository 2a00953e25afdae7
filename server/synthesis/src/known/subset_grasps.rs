//! Known grips without the fingers that a giver obstructs, if the others hold.

use super::{
    entry::Entry,
    inner_spheres::{obstruction_from_second, second_spheres},
};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    base::stopwatch::NoStopwatch,
    model::grasp::Grasp,
    physical::{
        finger_subset::KnownGrip,
        grip::{GIVER_CLEARANCE, Gripper},
        solids::{HandSolids, PreparedHand, TaperedCapsule, TrackedSolids},
    },
    rating::assessment::GraspContext,
};

/// The grasp of a known grip without the fingers that the giver obstructs, which rest elsewhere. None if no
/// finger is obstructed or the rest does not hold.
pub fn subset_grasp(
    entry: &Entry,
    around: &GraspContext<'_>,
    giver: &PreparedHand,
    gripper: &mut Gripper,
) -> Option<Box<Grasp>> {
    subset_grasp_with(Mechanisms::ALL, entry, around, giver, gripper)
}

/// [`subset_grasp`] with some mechanisms switched off.
pub(crate) fn subset_grasp_with(
    mechanisms: Mechanisms,
    entry: &Entry,
    around: &GraspContext<'_>,
    giver: &PreparedHand,
    gripper: &mut Gripper,
) -> Option<Box<Grasp>> {
    let solids = entry.solids(around.rig);
    if mechanisms.has(Mechanism::InnerSpheres) && screen_excludes(entry, &solids, giver) {
        return None;
    }
    let kept = kept_digits(entry, &solids, giver)?;
    let tracked = TrackedSolids::of_rig(around.rig, entry.grip.pose.frame_from_wrist, &solids);
    if collides(giver, tracked.still()) {
        return None;
    }
    let known = KnownGrip {
        grip: &entry.grip,
        contacts: &entry.contacts,
        solids: &solids,
    };
    let (grip, solids) = gripper
        .keep_fingers(&around.object, around.rig, &known, kept, giver)
        .ok()?;
    around.assess(&grip, &solids, gripper, &mut NoStopwatch).ok()
}

/// True only if inner spheres show that the giver leaves too few digits to hold. Conservative: false does not
/// mean that enough are left.
fn screen_excludes(entry: &Entry, solids: &HandSolids, giver: &PreparedHand) -> bool {
    let excludes_grip = |near| !entry.finger_subsets.hold_despite(obstruction_from_second(near));
    excludes_grip(giver.which_certainly_within(&second_spheres(solids), GIVER_CLEARANCE, excludes_grip))
}

/// The holding digits that the giver does not obstruct, thumb first. None if they do not hold by themselves,
/// if they would leave a gap between two holding fingers, if thumb or thenar are obstructed, or if no digit
/// is.
fn kept_digits(entry: &Entry, solids: &HandSolids, giver: &PreparedHand) -> Option<[bool; 5]> {
    let sets = entry.finger_subsets;
    let holding = sets.holding();
    if collides(giver, solids.thenar.iter()) {
        return None;
    }
    let is_obstructed: [bool; 5] =
        std::array::from_fn(|digit| collides(giver, solids.phalanges[digit].iter()));
    let kept = std::array::from_fn(|digit| holding[digit] && !is_obstructed[digit]);
    let is_usable =
        is_obstructed.contains(&true) && sets.contains(kept) && (kept == holding || are_adjacent(kept));
    is_usable.then_some(kept)
}

/// True if the fingers among these digits, thumb first, are adjacent: people do not lift a finger between two
/// that hold.
fn are_adjacent(digits: [bool; 5]) -> bool {
    let runs = digits[1..].chunk_by(|a, b| a == b).filter(|run| run[0]);
    runs.count() == 1
}

fn collides<'a>(giver: &PreparedHand, solids: impl Iterator<Item = &'a TaperedCapsule> + Clone) -> bool {
    giver.comes_within(solids, GIVER_CLEARANCE)
}
