//! Known grips without the fingers that a giver is in the way of, where those can be spared.

use super::{
    entry::Entry,
    inner_spheres::{in_way_by_second, second_spheres},
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

/// The grasp that a known grip is without the fingers that the giver is in the way of, which rest elsewhere; none if it does
/// not hold so, or if the giver is in the way of no finger.
pub fn subset_grasp(
    entry: &Entry,
    around: &GraspContext<'_>,
    giver: &PreparedHand,
    gripper: &mut Gripper,
) -> Option<Box<Grasp>> {
    spared_with(Mechanisms::ALL, entry, around, giver, gripper)
}

/// [`subset_grasp`] by some of the mechanisms.
pub(crate) fn spared_with(
    mechanisms: Mechanisms,
    entry: &Entry,
    around: &GraspContext<'_>,
    giver: &PreparedHand,
    gripper: &mut Gripper,
) -> Option<Box<Grasp>> {
    let solids = entry.solids(around.rig);
    if mechanisms.has(Mechanism::InnerSpheres) && is_too_near(entry, &solids, giver) {
        return None;
    }
    let kept = kept(entry, &solids, giver)?;
    let tracked = TrackedSolids::of_rig(around.rig, entry.grip.pose.frame_from_wrist, &solids);
    if is_met(giver, tracked.still()) {
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

/// True only if spheres inside show that the giver leaves too few digits of a grip to hold; not always then.
fn is_too_near(entry: &Entry, solids: &HandSolids, giver: &PreparedHand) -> bool {
    let is_too_much = |near| !entry.finger_subsets.hold_without(in_way_by_second(near));
    is_too_much(giver.which_certainly_within(&second_spheres(solids), GIVER_CLEARANCE, is_too_much))
}

/// Which digits hold that the giver is not in the way of, thumb first; none if they do not without the others or leave out
/// one between them, if the thumb or its ball comes too near to the giver, or if no digit does.
fn kept(entry: &Entry, solids: &HandSolids, giver: &PreparedHand) -> Option<[bool; 5]> {
    let sets = entry.finger_subsets;
    let holding = sets.holding();
    if is_met(giver, solids.thenar.iter()) {
        return None;
    }
    let is_in_way: [bool; 5] = std::array::from_fn(|digit| is_met(giver, solids.phalanges[digit].iter()));
    let kept = std::array::from_fn(|digit| holding[digit] && !is_in_way[digit]);
    let does = is_in_way.contains(&true) && sets.contains(kept) && (kept == holding || are_neighbours(kept));
    does.then_some(kept)
}

/// True if the fingers among some digits, thumb first, lie side by side: nobody lifts a finger between two that hold.
fn are_neighbours(digits: [bool; 5]) -> bool {
    let runs = digits[1..].chunk_by(|a, b| a == b).filter(|run| run[0]);
    runs.count() == 1
}

fn is_met<'a>(giver: &PreparedHand, solids: impl Iterator<Item = &'a TaperedCapsule> + Clone) -> bool {
    giver.comes_within(solids, GIVER_CLEARANCE)
}
