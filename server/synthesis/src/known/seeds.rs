//! Hands perturbed from known grips, for barriers that obstruct all known grips.
//!
//! A grip that is a few millimetres too close to a barrier does hold the object. So hands are searched that are rotated about its
//! contacts until they clear the barriers.

use std::{
    cmp::Reverse,
    collections::BinaryHeap,
    sync::{Arc, OnceLock},
};

use super::{
    atlas::{Atlas, Grips},
    entry::Entry,
    finger_subsets::{FIRST, SECOND, of_digits, spheres, upper_bounds},
    moved_grips::way_with_contacts,
    primitives::TransferredGrips,
};
use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        stop::{Stop, Stopped},
    },
    model::{grasp::Contact, hand::rig::Rig, object::GraspObject},
    physical::{
        barriers::Barriers,
        grip::{FORBIDDEN_CLEARANCE, GIVER_CLEARANCE},
        presented::Presented,
        receiver::SUITABLE,
        shape::{HandShape, Proposal},
        solids::{HandSolids, Spheres, TaperedCapsule},
    },
    propose::proposal::{ANYWHERE_EVERY, ProposalContext},
    rating::{assessment::GraspContext, scoring::middle},
};

/// Number of seeds. Fewer answer fewer givers; more include grips that are farther from clear and hold less often.
const SEEDS: usize = 32;

/// Perturbed hands drawn per proposal until one is clear, first by inner spheres alone.
const MAX_DRAWS: usize = 48;

/// Largest displacement along each axis, in metres. Larger ones lose the contacts.
const MAX_SHIFT: f32 = 0.003;

/// Largest rotation about the contacts, in radians. Less does not clear some givers; more finds fewer hands that hold.
const MAX_TURN: f32 = 0.5;

/// Largest distance of a displaced contact from the surface, in metres. Hands with larger ones mostly miss the object.
const CONTACT_TOLERANCE: f32 = 0.003;

/// Grips compared exactly with one giver between two clock checks: up to forty microseconds of work.
const EXACT_PER_CHECK: usize = 4;

/// Grips compared by inner spheres between two clock checks.
const BOUNDS_PER_CHECK: usize = 64;

/// A known grip to perturb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seed {
    /// Its index among the entries.
    pub entry: u16,
    /// The digits that have to hold, thumb first. Fingers that a barrier obstructs are left out.
    pub kept: [bool; 5],
}

/// The known grips that are nearest to being clear of the barriers, by the clearance of palm, forearm, thumb and the finger
/// subset that is farthest from them.
#[derive(Clone, Debug, PartialEq)]
pub struct Seeds(pub Vec<Seed>);

impl Seeds {
    /// Selects from `candidates`, indices into the entries of `known`; earlier ones win ties. Without
    /// barriers, the first ones.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of(
        known: &Grips,
        rig: &Rig,
        candidates: impl Iterator<Item = u16>,
        barriers: Barriers<'_>,
        stop: Stop<'_>,
    ) -> Result<Self, Stopped> {
        if barriers.is_empty() {
            let whole = |entry: u16| Seed {
                entry,
                kept: known.entries()[usize::from(entry)].grip.holding_digits(),
            };
            return Ok(Self(candidates.take(SEEDS).map(whole).collect()));
        }
        let bounds_per_check = barriers.comparisons_per_check(BOUNDS_PER_CHECK);
        let exact_per_check = barriers.comparisons_per_check(EXACT_PER_CHECK);
        // Inner spheres give an upper bound of the clearance. Candidates are compared exactly by falling bound, until none can
        // beat those selected.
        let mut by_upper_bound = Vec::new();
        for (count, index) in candidates.enumerate() {
            stop.check_every(bounds_per_check, count)?;
            let clearance = known.clearance_upper_bound(usize::from(index), None, barriers);
            by_upper_bound.push((nanometres(clearance.min(GIVER_CLEARANCE)), Reverse(count), index));
        }
        // A heap, because sorting would take longer than the interval between clock checks.
        let mut by_upper_bound = BinaryHeap::from(by_upper_bound);
        // By falling clearance.
        let mut nearest: Vec<(f32, Seed)> = Vec::with_capacity(SEEDS + 1);
        let mut count = 0_usize;
        while let Some((bound, _, index)) = by_upper_bound.pop() {
            stop.check_every(exact_per_check, count)?;
            count += 1;
            let min_clearance = nearest
                .get(SEEDS - 1)
                .map_or(f32::NEG_INFINITY, |(min_clearance, _)| *min_clearance);
            if bound <= nanometres(min_clearance) {
                break;
            }
            let entry = &known.entries()[usize::from(index)];
            let Some((clearance, kept)) = clearance(entry, rig, barriers, min_clearance) else {
                continue;
            };
            let rank = nearest.partition_point(|&(other, _)| other >= clearance);
            nearest.insert(rank, (clearance, Seed { entry: index, kept }));
            nearest.truncate(SEEDS);
        }
        Ok(Self(nearest.into_iter().map(|(_, seed)| seed).collect()))
    }

    /// Draws a perturbed hand that may be clear of the barriers: near any seed if `evenly`, which serves many givers, else more
    /// often near the first. `entries` are those that the seeds index.
    pub fn propose(
        &self,
        entries: &[Entry],
        evenly: bool,
        place: &ProposalContext<'_>,
        stream: &mut AttemptStream,
    ) -> Option<Proposal> {
        let count = self.0.len();
        let rank = match count {
            0 if evenly => return None,
            _ if evenly => stream.below(count),
            // The first of 32 is drawn six times as often as under a uniform choice.
            _ => (stream.unit().powi(2) * count as f32) as usize,
        };
        Self::perturbed(*self.0.get(rank)?, entries, place, stream)
    }

    /// Perturbs a known grip; `None` if no drawn hand may be clear of the barriers.
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
                // The pose of fingers that do not hold is discarded: they may be the ones obstructed.
                tucks: stream.unit() < 0.5,
                closing: kept,
                ..HandShape::of_grip(place.rig, &entry.grip)
            },
            advance: 0.0,
        };
        let solids = entry.solids(place.rig);
        let inside = [FIRST, SECOND].map(|inner_spheres| of_digits(&solids, &inner_spheres, kept));
        let contacts = entry.contacts.iter();
        let contacts: Vec<Contact> = contacts
            .filter(|contact| contact.part.is_palm_or_in(kept))
            .copied()
            .collect();
        // Thumb and opposing fingers stay at the object, while palm and forearm swing away from the giver.
        let pivot = middle(contacts.iter());
        (0..MAX_DRAWS).find_map(|_| {
            let perturbed = known.perturbed_about(pivot, [MAX_SHIFT, MAX_TURN], stream);
            let displacement = perturbed.object_from_wrist * known.object_from_wrist.inverse();
            let nears = |spheres: &Spheres| {
                let moved = spheres.transformed(displacement);
                place.barriers.any_certainly_within(&moved, GIVER_CLEARANCE)
            };
            if !place.barriers.is_empty() && inside.iter().any(nears) {
                return None;
            }
            let moved = solids.transformed(displacement);
            let is_promising = !place
                .barriers
                .comes_within(solids_of(kept, &moved), GIVER_CLEARANCE)
                && still_touches(&contacts, place.object, displacement)
                && solids_of(kept, &moved)
                    .all(|part| !place.object.is_forbidden_within(part, FORBIDDEN_CLEARANCE));
            is_promising.then_some(perturbed)
        })
    }
}

/// A distance in metres as a number that can be sorted.
pub(crate) fn nanometres(distance: f32) -> i32 {
    (distance * 1e9) as i32
}

/// True if the thumb and a finger are still near the object after the displacement.
fn still_touches(contacts: &[Contact], object: &GraspObject, displacement: Pose) -> bool {
    let is_near = |contact: &Contact| {
        let place = displacement.transform_point(contact.position);
        object
            .surface
            .closest_point_within(place, CONTACT_TOLERANCE)
            .is_some()
    };
    let touches = |is_thumb: bool| {
        let of_part = |contact: &&Contact| contact.part.is_thumb() == Some(is_thumb);
        contacts.iter().filter(of_part).any(is_near)
    };
    touches(true) && touches(false)
}

/// A grip's clearance from the barriers, up to [`GIVER_CLEARANCE`], with its best finger subset, and the digits of that subset;
/// `None` if it is less than `min_clearance`.
fn clearance(
    entry: &Entry,
    rig: &Rig,
    barriers: Barriers<'_>,
    min_clearance: f32,
) -> Option<(f32, [bool; 5])> {
    let solids = entry.solids(rig);
    let sets = entry.finger_subsets;
    let bounds = barriers.distance_upper_bounds(&spheres(&solids, &SECOND));
    let (fingers, others) = upper_bounds(&SECOND, &bounds);
    if sets.farthest(fingers).1.min(others) < min_clearance {
        return None;
    }
    let no_fingers = [true, false, false, false, false];
    let others = barriers.least_distance(solids_of(no_fingers, &solids), GIVER_CLEARANCE, min_clearance)?;
    let distances = std::array::from_fn(|finger| {
        let links = solids.phalanges[1 + finger].iter();
        let distance = barriers.least_distance(links, GIVER_CLEARANCE, min_clearance);
        distance.unwrap_or(f32::NEG_INFINITY)
    });
    let (kept, of_fingers) = sets.farthest(distances);
    (of_fingers >= min_clearance).then_some((of_fingers.min(others), kept))
}

/// A hand's solids without the fingers that do not hold, which rest elsewhere.
fn solids_of(kept: [bool; 5], solids: &HandSolids) -> impl Iterator<Item = &TaperedCapsule> + Clone {
    let digits = solids.phalanges.iter().zip(kept);
    digits
        .filter_map(|(links, holds)| holds.then_some(links))
        .flatten()
        .chain(&solids.palm)
        .chain(&solids.thenar)
        .chain(&solids.forearm)
}

/// The source of seeds.
#[derive(Clone, Debug, Default)]
pub enum SeedSource {
    /// Nowhere.
    #[default]
    Nothing,
    /// Known grips of the object.
    Atlas(Arc<Atlas>),
    /// Grips transferred from similar boxes, for an object without an atlas.
    Transferred(Arc<TransferredGrips>),
    /// Known grips of the object at another size.
    Resized(ResizedGrips),
}

impl SeedSource {
    /// The atlas, if seeds come from one.
    pub fn atlas(&self) -> Option<&Arc<Atlas>> {
        match self {
            Self::Atlas(atlas) => Some(atlas),
            Self::Resized(grips) => Some(&grips.atlas),
            Self::Nothing | Self::Transferred(_) => None,
        }
    }

    /// Whether an attempt takes its seeds from the more promising grips: those whose forearms come from the receiver or, of
    /// transferred grips, those that pass the closure screen.
    fn prefers(&self, attempt: u64, presented: &Presented) -> bool {
        match self {
            Self::Nothing => false,
            Self::Transferred(_) => attempt.is_multiple_of(2),
            Self::Atlas(_) | Self::Resized(_) => {
                !attempt.is_multiple_of(ANYWHERE_EVERY) && presented.receiver.is_expected()
            }
        }
    }

    fn select(&self, prefers: bool, around: &GraspContext<'_>, stop: Stop<'_>) -> Result<SeedSet, Stopped> {
        let barriers = around.presented.barriers();
        let moved = match self {
            Self::Nothing => Grips::default(),
            Self::Atlas(atlas) => {
                let meets = |entry: &u16| atlas.entries()[usize::from(*entry)].meets(around.requirements);
                let candidates = candidates(atlas, prefers, around.presented).filter(meets);
                let seeds = Seeds::of(atlas.grips(), around.rig, candidates, barriers, stop)?;
                return Ok(SeedSet { moved: None, seeds });
            }
            Self::Resized(resized) => resized.away_from(
                candidates(&resized.atlas, prefers, around.presented),
                around,
                stop,
            )?,
            Self::Transferred(transferred) => transferred.away_from(prefers, around, stop)?,
        };
        let all = 0..moved.entries().len() as u16;
        let seeds = Seeds::of(&moved, around.rig, all, barriers, stop)?;
        let moved = Some(moved);
        Ok(SeedSet { moved, seeds })
    }
}

/// The entries of an atlas that hold under this gravity, by falling score, and suit the receiver if required.
fn candidates<'a>(
    atlas: &'a Atlas,
    suit_receiver: bool,
    presented: &'a Presented,
) -> impl Iterator<Item = u16> + 'a {
    let holding = atlas.holding_under(presented.up).into_iter();
    holding.filter(move |&entry| {
        let forearm = atlas.grips().forearms()[usize::from(entry)];
        !suit_receiver || presented.receiver.suits_forearm(forearm) >= SUITABLE
    })
}

/// An atlas of an object that is held out at another size or mass. Its grips are known to hold only the original.
#[derive(Clone, Debug)]
pub struct ResizedGrips {
    /// The atlas.
    pub atlas: Arc<Atlas>,
    /// Size of the object relative to that of the atlas.
    pub scale: f32,
}

impl ResizedGrips {
    /// The grips of some entries of the atlas that meet the requirements and are farthest from the barriers, on the object at
    /// its new size; the first entries win ties. The grips were made for the hand of `around`.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn away_from(
        &self,
        entries: impl Iterator<Item = u16>,
        around: &GraspContext<'_>,
        stop: Stop<'_>,
    ) -> Result<Grips, Stopped> {
        let entry = |index: u16| &self.atlas.entries()[usize::from(index)];
        let clearance = |index: u16, barriers: Barriers<'_>| {
            let way = way_with_contacts(&entry(index).contacts, self.scale);
            let grips = self.atlas.grips();
            grips.clearance_upper_bound(usize::from(index), Some(way), barriers)
        };
        let resized = |index: u16| entry(index).on_resized(self.scale);
        Grips::farthest(entries, clearance, resized, around, stop)
    }
}

/// Seeds and the grips that they index, unless these are an atlas'.
#[derive(Clone, Debug)]
struct SeedSet {
    moved: Option<Grips>,
    seeds: Seeds,
}

/// The seeds for a holdout: from all grips, and from preferred ones, each computed on first use.
#[derive(Clone, Debug, Default)]
pub struct SeedSets {
    source: SeedSource,
    sets: [OnceLock<SeedSet>; 2],
}

impl SeedSets {
    /// No set is computed yet.
    pub fn new(source: SeedSource) -> Self {
        Self {
            source,
            ..Self::default()
        }
    }

    /// True if there are no seeds.
    pub fn is_empty(&self) -> bool {
        matches!(self.source, SeedSource::Nothing)
    }

    /// The seeds of an attempt and the grips they index. Those of an atlas hold under this gravity and meet
    /// the requirements, apart from the barriers.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of_attempt(
        &self,
        attempt: u64,
        around: &GraspContext<'_>,
        stop: Stop<'_>,
    ) -> Result<(&Seeds, &[Entry]), Stopped> {
        let prefers = self.source.prefers(attempt, around.presented);
        let place = &self.sets[usize::from(prefers)];
        let set = if let Some(set) = place.get() {
            set
        } else {
            let selected = self.source.select(prefers, around, stop)?;
            // Another worker may have computed the same set meanwhile.
            place.get_or_init(|| selected)
        };
        let of_atlas = || self.source.atlas().map_or(&[][..], |atlas| atlas.entries());
        let entries = set.moved.as_ref().map_or_else(of_atlas, Grips::entries);
        Ok((&set.seeds, entries))
    }
}
