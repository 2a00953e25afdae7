//! Known grips without the fingers that a giver is in the way of, where those can be spared.

use super::{
    cores::{in_way_by_second, second_balls},
    entry::Entry,
};
use crate::{
    grasp::Grasp,
    physical::{
        attempt::Surroundings,
        grip::{GIVER_CLEARANCE, Gripper},
        solids::{PreparedHand, TaperedCapsule, ToldSolids},
        sparing::KnownGrip,
    },
    synthesis::stopwatch::NoStopwatch,
};

/// The grasp that a known grip is without the fingers that the giver is in the way of, which rest elsewhere; none if it does
/// not hold so, or if the giver is in the way of no finger.
pub fn spared(
    entry: &Entry,
    around: &Surroundings<'_>,
    giver: &PreparedHand,
    gripper: &mut Gripper,
) -> Option<Box<Grasp>> {
    let told = entry.told_solids(around.rig);
    let known = KnownGrip {
        grip: &entry.grip,
        contacts: &entry.contacts,
        solids: &told.hand,
    };
    let kept = kept(entry, &told, giver)?;
    let (grip, solids) = gripper
        .spare(&around.object, around.rig, &known, kept, giver)
        .ok()?;
    around.hold_with(&grip, &solids, gripper, &mut NoStopwatch).ok()
}

/// Which digits hold that the giver is not in the way of, thumb first; none if they do not without the others, if palm or
/// forearm come too near to the giver, or if no digit does.
pub fn kept(entry: &Entry, told: &ToldSolids, giver: &PreparedHand) -> Option<[bool; 5]> {
    let sets = entry.finger_sets;
    let holding = sets.holding();
    let solids = &told.hand;
    let is_too_much = |near| !sets.hold_beside(in_way_by_second(near));
    let near = giver.surely_near(&second_balls(solids), GIVER_CLEARANCE, is_too_much);
    if is_too_much(near) || is_met(giver, told.still().chain(&solids.thenar)) {
        return None;
    }
    let is_in_way: [bool; 5] = std::array::from_fn(|digit| is_met(giver, solids.phalanges[digit].iter()));
    let kept = std::array::from_fn(|digit| holding[digit] && !is_in_way[digit]);
    (is_in_way.contains(&true) && sets.contains(kept)).then_some(kept)
}

fn is_met<'a>(giver: &PreparedHand, solids: impl Iterator<Item = &'a TaperedCapsule> + Clone) -> bool {
    giver.is_neared_by(solids, GIVER_CLEARANCE)
}
