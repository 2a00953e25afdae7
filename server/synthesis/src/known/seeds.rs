//! Hands beside known grips, for a giver of whom no known grip keeps clear.
//!
//! A grip that a giver is in the way of by some millimetres holds the object; what is to be found is one like it that is
//! turned out of the giver's way about what it touches.

use std::{cmp::Reverse, collections::BinaryHeap};

use glam::Vec3;

use super::{
    entry::Entry,
    grips::Grips,
    inner_spheres::{farthest_by_second, first_of_digits, first_spheres, second_of_digits, second_spheres},
};
use crate::{
    base::mechanisms::{Mechanism, Mechanisms},
    base::{pose::Pose, random::AttemptStream},
    model::{grasp::Contact, hand::rig::Rig, object::GraspObject},
    physical::{
        grip::{FORBIDDEN_CLEARANCE, GIVER_CLEARANCE},
        shape::{HandShape, Proposal},
        solids::{HandSolids, PreparedHand, Spheres, TaperedCapsule},
    },
    propose::proposal::ProposalContext,
};

/// Grips to start from. With fewer, fewer givers are answered at all; more are farther from keeping clear, and hold less
/// often.
const SEEDS: usize = 32;

/// Hands beside a grip that are looked at until one keeps clear, first by balls inside alone. More find one more often
/// beside grips that are deep in the giver: of 31 holdouts of the built-in scalpel that the atlas does not answer, 22 had a
/// hand that holds among 9,000 tries with 24 of them, and 26 with 48.
const DRAWS: usize = 48;

/// How far the hand is shifted along each axis at most, in metres: farther ones miss what they touched.
const SHIFT: f32 = 0.003;

/// How far it is turned about what it touches at most, in radians. Less does not get out of some givers' way, more finds
/// fewer hands that hold.
const TURN: f32 = 0.5;

/// From where a known grip touched, when it is moved, to where the surface still is, in metres: those that are off by more
/// mostly miss it.
const TOUCHING: f32 = 0.003;

/// Grips that are compared with the giver between two looks at the clock: at most some forty microseconds' worth.
const AT_ONCE: usize = 4;

/// The same where they are compared by balls alone.
const BOUNDED_AT_ONCE: usize = 64;

/// A known grip to start from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seed {
    /// Which of the entries it is.
    pub entry: u16,
    /// The digits that are to hold, thumb first; others that the giver is in the way of are spared.
    pub kept: [bool; 5],
}

/// The known grips that are least in a giver's way, by its clearance of palm, forearm, thumb and those fingers that are
/// farthest from it of those that hold without the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Seeds(Vec<Seed>);

impl Seeds {
    /// Those of `candidates`, indices of the entries of `known`; of those that keep clear, the first. None if interrupted.
    pub fn of(
        known: &Grips,
        rig: &Rig,
        candidates: impl Iterator<Item = u16>,
        giver: Option<&PreparedHand>,
        interrupted: impl Fn() -> bool,
    ) -> Option<Self> {
        Self::of_with(Mechanisms::ALL, known, rig, candidates, giver, interrupted)
    }

    /// [`Seeds::of`] by some of the mechanisms.
    pub(crate) fn of_with(
        mechanisms: Mechanisms,
        known: &Grips,
        rig: &Rig,
        candidates: impl Iterator<Item = u16>,
        giver: Option<&PreparedHand>,
        interrupted: impl Fn() -> bool,
    ) -> Option<Self> {
        let screens = mechanisms.has(Mechanism::InnerSpheres);
        let Some(giver) = giver else {
            let whole = |entry: u16| Seed {
                entry,
                kept: known.entries()[usize::from(entry)].grip.holding_digits(),
            };
            return Some(Self(candidates.take(SEEDS).map(whole).collect()));
        };
        // What is found by balls alone is never too little: those for which it is most are looked at first, until no other can
        // have more.
        let mut at_most = Vec::new();
        for (count, index) in candidates.enumerate() {
            if count.is_multiple_of(BOUNDED_AT_ONCE) && interrupted() {
                return None;
            }
            let clearance = if screens {
                known.clearance_upper_bound(usize::from(index), giver)
            } else {
                GIVER_CLEARANCE
            };
            at_most.push((nanometres(clearance.min(GIVER_CLEARANCE)), Reverse(count), index));
        }
        // Not sorted, as that would take longer than between two looks at the clock.
        let mut at_most = BinaryHeap::from(at_most);
        // By falling clearance.
        let mut nearest: Vec<(f32, Seed)> = Vec::with_capacity(SEEDS + 1);
        let mut count = 0_usize;
        while let Some((most, _, index)) = at_most.pop() {
            if count.is_multiple_of(AT_ONCE) && interrupted() {
                return None;
            }
            count += 1;
            let least = nearest
                .get(SEEDS - 1)
                .map_or(f32::NEG_INFINITY, |(least, _)| *least);
            if most <= nanometres(least) {
                break;
            }
            let entry = &known.entries()[usize::from(index)];
            let Some((clearance, kept)) = clearance(entry, rig, giver, least, screens) else {
                continue;
            };
            let place = nearest.partition_point(|&(other, _)| other >= clearance);
            nearest.insert(place, (clearance, Seed { entry: index, kept }));
            nearest.truncate(SEEDS);
        }
        Some(Self(nearest.into_iter().map(|(_, start)| start).collect()))
    }

    /// Which they are, by falling clearance.
    pub fn all(&self) -> &[Seed] {
        &self.0
    }

    /// A hand beside one of them that may keep clear of the giver, more often beside the first; none if none was drawn.
    /// `entries` are those that they are of.
    pub fn propose(
        &self,
        entries: &[Entry],
        place: &ProposalContext<'_>,
        stream: &mut AttemptStream,
    ) -> Option<Proposal> {
        // The first of 32 comes six times as often as if all did alike. Of 44 holdouts that atlases of the built-in objects do
        // not answer, 27 are answered sooner so and 17 later: in four fifths of the time where it takes less than 5 ms,
        // elsewhere in as much.
        let rank = (stream.unit().powi(2) * self.0.len() as f32) as usize;
        Self::perturbed(*self.0.get(rank)?, entries, place, stream)
    }

    /// The same, beside one as often as beside another: what is to be known for many givers is not to lie beside few.
    pub fn propose_evenly(
        &self,
        entries: &[Entry],
        place: &ProposalContext<'_>,
        stream: &mut AttemptStream,
    ) -> Option<Proposal> {
        if self.0.is_empty() {
            return None;
        }
        Self::perturbed(self.0[stream.below(self.0.len())], entries, place, stream)
    }

    /// A hand beside a known grip that may keep clear of the giver, if one is drawn.
    fn perturbed(
        Seed { entry, kept }: Seed,
        entries: &[Entry],
        place: &ProposalContext<'_>,
        stream: &mut AttemptStream,
    ) -> Option<Proposal> {
        let entry = &entries[usize::from(entry)];
        let known = Proposal {
            object_from_wrist: entry.grip.pose.frame_from_wrist,
            shape: HandShape {
                // What fingers that do not hold did is of no use: they may be what is in the way.
                tucks: stream.unit() < 0.5,
                closing: kept,
                ..HandShape::of_grip(place.rig, &entry.grip)
            },
            advance: 0.0,
        };
        let screens = place.mechanisms.has(Mechanism::InnerSpheres);
        let solids = entry.solids(place.rig);
        let inside = [
            first_of_digits(first_spheres(&solids), kept),
            second_of_digits(second_spheres(&solids), kept),
        ];
        let contacts = entry.contacts.iter();
        let contacts: Vec<Contact> = contacts
            .filter(|contact| contact.part.is_palm_or_in(kept))
            .copied()
            .collect();
        let pivot = middle_of(&contacts);
        (0..DRAWS).find_map(|_| {
            let perturbed = known.perturbed_about(pivot, [SHIFT, TURN], stream);
            let way = perturbed.object_from_wrist * known.object_from_wrist.inverse();
            let is_met = |giver: &PreparedHand| {
                let nears = |spheres: &Spheres| {
                    giver.any_certainly_within(&spheres.transformed(way), GIVER_CLEARANCE)
                };
                inside.iter().any(nears)
            };
            if screens && place.giver.is_some_and(is_met) {
                return None;
            }
            let moved = solids.transformed(way);
            let keeps_clear = place
                .giver
                .is_none_or(|giver| !giver.comes_within(solids_of(kept, &moved), GIVER_CLEARANCE));
            let is_likely = keeps_clear
                && still_touch(&contacts, place.object, way)
                && keeps_off(kept, place.object, &moved);
            is_likely.then_some(perturbed)
        })
    }
}

/// A distance in metres as a number that can be ordered.
pub(crate) fn nanometres(distance: f32) -> i32 {
    (distance * 1e9) as i32
}

/// What a grip is turned about: the thumb and what is opposed to it stay where the object is, while palm and arm swing out of
/// the giver's way.
fn middle_of(contacts: &[Contact]) -> Vec3 {
    let sum: Vec3 = contacts.iter().map(|contact| contact.position).sum();
    sum / contacts.len().max(1) as f32
}

/// True if thumb and a finger of a grip are still near to the object when they are moved: others do not touch it any more.
fn still_touch(contacts: &[Contact], object: &GraspObject, way: Pose) -> bool {
    let is_near = |contact: &Contact| {
        let place = way.transform_point(contact.position);
        object.surface.closest_point_within(place, TOUCHING).is_some()
    };
    let touches = |is_thumb: bool| {
        let of_part = |contact: &&Contact| contact.part.is_thumb() == Some(is_thumb);
        contacts.iter().filter(of_part).any(is_near)
    };
    touches(true) && touches(false)
}

/// True if a moved hand keeps off forbidden surfaces.
fn keeps_off(kept: [bool; 5], object: &GraspObject, moved: &HandSolids) -> bool {
    solids_of(kept, moved).all(|part| !object.is_forbidden_within(part, FORBIDDEN_CLEARANCE))
}

/// How far a grip is from a giver's hand without the fingers that are nearest to it and can be spared, up to
/// [`GIVER_CLEARANCE`], and which digits hold then; none if it is less than `least`.
fn clearance(
    entry: &Entry,
    rig: &Rig,
    giver: &PreparedHand,
    least: f32,
    screens: bool,
) -> Option<(f32, [bool; 5])> {
    let solids = entry.solids(rig);
    let sets = entry.finger_subsets;
    if screens {
        let (fingers, others) = farthest_by_second(&giver.distance_upper_bounds(&second_spheres(&solids)));
        if sets.farthest(fingers).1.min(others) < least {
            return None;
        }
    }
    let no_fingers = [true, false, false, false, false];
    let others = giver.least_distance(solids_of(no_fingers, &solids), GIVER_CLEARANCE, least)?;
    let distances = std::array::from_fn(|finger| {
        let links = solids.phalanges[1 + finger].iter();
        let distance = giver.least_distance(links, GIVER_CLEARANCE, least);
        distance.unwrap_or(f32::NEG_INFINITY)
    });
    let (kept, of_fingers) = sets.farthest(distances);
    (of_fingers >= least).then_some((of_fingers.min(others), kept))
}

/// A hand's solids but those of fingers that do not hold: they rest where there is room.
fn solids_of(kept: [bool; 5], solids: &HandSolids) -> impl Iterator<Item = &TaperedCapsule> + Clone {
    let HandSolids {
        phalanges,
        palm,
        thenar,
        forearm,
    } = solids;
    let digits = phalanges.iter().zip(kept);
    digits
        .filter_map(|(links, holds)| holds.then_some(links))
        .flatten()
        .chain(palm)
        .chain(thenar)
        .chain(forearm)
}
