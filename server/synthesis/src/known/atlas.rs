//! The atlas: the known grips of one hand on one object, with the data that screens them against barriers.

use std::cmp::Reverse;

use glam::Vec3;
use sha2::{Digest as _, Sha256};

use super::{
    entry::{Entry, SLIPS, nearest_direction},
    finger_subsets::{FIRST, SECOND, spheres, upper_bounds},
    seeds::nanometres,
};
use crate::{
    base::{
        pose::Pose,
        stop::{Stop, Stopped},
    },
    model::{hand::rig::Rig, score::Term},
    physical::{
        barriers::Barriers,
        grip::GIVER_CLEARANCE,
        solids::{Spheres, TrackedSolids},
    },
    propose::both_hands::Mirror,
    rating::assessment::GraspContext,
};

/// Steps of a score from 0 to 1, as entries store it, and those by which values are compared.
pub(crate) const QUANTA: f32 = 254.0;
const VALUE_STEPS: f32 = 1e6;

/// The known grips of one hand on one object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Atlas {
    grips: Grips,
    pub(super) complete: bool,
    stamp: u64,
    /// The plane about which these grips mirror another hand's, whose scores they keep.
    pub(super) mirror: Option<Mirror>,
}

impl Atlas {
    /// An atlas of some grips; `complete` if it will not grow any further.
    pub fn new(grips: Grips, complete: bool) -> Self {
        Self {
            stamp: stamp(grips.entries()),
            grips,
            complete,
            mirror: None,
        }
    }

    /// The atlas with a learned grip of the rig, from [`Entry::of_grasp`], without the oldest beyond `most`. A known hand
    /// becomes the newest, which is the last: reproducible requests find the same one repeatedly.
    #[must_use]
    pub fn with(&self, rig: &Rig, newest: Entry, most: usize) -> Self {
        let mut grips = self.grips.clone();
        let is_newest = |entry: &Entry| entry.grip.pose == newest.grip.pose;
        if let Some(place) = grips.entries().iter().position(is_newest) {
            grips.remove(place);
        }
        grips.push(rig, newest);
        while grips.entries().len() > most {
            grips.remove(0);
        }
        Self::new(grips, self.complete)
    }

    /// True if there are no grips.
    pub fn is_empty(&self) -> bool {
        self.entries().is_empty()
    }

    /// The place in an entry's scores of a direction `up`, a unit vector against gravity in the object's frame.
    pub(crate) fn direction(&self, up: Vec3) -> usize {
        nearest_direction(self.mirror.map_or(up, |mirror| mirror.direction(up)))
    }

    /// Indices into [`Atlas::entries`] by falling value under this gravity, grips that let the object slip last. `stance` rates the
    /// direction of a forearm for the receiver's position, 0 to 1. Takes some microseconds for hundreds of grips.
    pub fn by_value(&self, up: Vec3, stance: impl Fn(Vec3) -> f32) -> Vec<u16> {
        let direction = self.direction(up);
        let value = |&entry: &u16| {
            let value = match self.entries()[usize::from(entry)].scores[direction] {
                SLIPS => 0.0,
                score => {
                    let stance = stance(self.grips.forearms()[usize::from(entry)]);
                    f32::from(score) / QUANTA + Term::Stance.share() * stance
                }
            };
            (Reverse((value * VALUE_STEPS) as u32), entry)
        };
        let mut order: Vec<u16> = self.indices().collect();
        order.sort_by_cached_key(value);
        order
    }

    /// Indices into [`Atlas::entries`] by falling score for `up`, a unit vector against gravity in the object's frame. Grips that
    /// let the object slip come last.
    pub fn by_score(&self, up: Vec3) -> Vec<u16> {
        let direction = self.direction(up);
        let mut order: Vec<u16> = self.indices().collect();
        // Stable: equal scores keep the order of the entries.
        order.sort_by_key(|&entry| Reverse(self.entries()[usize::from(entry)].scores[direction]));
        order
    }

    /// The part of [`Atlas::by_score`] that holds the object.
    pub fn holding_under(&self, up: Vec3) -> Vec<u16> {
        let direction = self.direction(up);
        let mut order = self.by_score(up);
        order.retain(|&entry| self.entries()[usize::from(entry)].scores[direction] != SLIPS);
        order
    }

    fn indices(&self) -> impl Iterator<Item = u16> + use<> {
        0..self.entries().len() as u16
    }

    /// The grips, in the order found; once complete, by falling score.
    pub fn entries(&self) -> &[Entry] {
        self.grips.entries()
    }

    /// The same grips with the data that screens them against barriers.
    pub fn grips(&self) -> &Grips {
        &self.grips
    }

    /// The grips alone.
    pub fn into_grips(self) -> Grips {
        self.grips
    }

    /// True if the atlas will not grow any further.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Identifies the grips: equal for the same grips in the same order.
    pub fn stamp(&self) -> u64 {
        self.stamp
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        self.grips.bytes()
    }
}

/// The first eight bytes of a hash of the hand poses and their scores.
pub(super) fn stamp(entries: &[Entry]) -> u64 {
    let mut hash = Sha256::new();
    for entry in entries {
        let pose = &entry.grip.pose;
        let wrist = pose.frame_from_wrist;
        let angles = pose.digits.iter().flat_map(|digit| {
            [
                digit.base_yaw,
                digit.base_pitch,
                digit.second_pitch,
                digit.third_pitch,
            ]
        });
        let numbers = wrist.position.to_array().into_iter();
        for number in numbers.chain(wrist.orientation.to_array()).chain(angles) {
            hash.update(number.to_le_bytes());
        }
        hash.update(entry.scores);
    }
    let digest = hash.finalize();
    digest
        .iter()
        .take(8)
        .fold(0, |stamp, &byte| stamp << 8 | u64::from(byte))
}

/// Largest number of moved grips selected for a holdout, the ones farthest from its barriers by inner spheres.
const MAX_SELECTED: usize = 96;

/// Grips compared with one giver by inner spheres between two checks of the stop.
const BOUNDS_PER_CHECK: usize = 128;

/// Grips moved to the object between two checks of the stop.
const MOVES_PER_CHECK: usize = 32;

/// Grips, in the order of [`super::atlas::Atlas::entries`]. Callers pass the rig that the grips were made for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grips {
    entries: Vec<Entry>,
    /// The first inner spheres of each hand, contiguous: screening a grip mostly touches two cache lines.
    inner_spheres: Vec<Spheres>,
    /// Direction of each forearm from wrist to elbow, a unit vector.
    forearms: Vec<Vec3>,
}

impl Grips {
    /// Known grips of a rig.
    pub fn new(rig: &Rig, entries: Vec<Entry>) -> Self {
        let spheres = |entry: &Entry| spheres(&entry.solids(rig), &FIRST);
        Self {
            inner_spheres: entries.iter().map(spheres).collect(),
            forearms: entries.iter().map(Entry::forearm).collect(),
            entries,
        }
    }

    /// The grips that meet the requirements and are farthest from the barriers, moved to the object by `entry`; the first ones
    /// win ties.
    pub(super) fn farthest<T: Copy>(
        candidates: impl Iterator<Item = T>,
        clearance: impl Fn(T, Barriers<'_>) -> f32,
        entry: impl Fn(T) -> Entry,
        around: &GraspContext<'_>,
        stop: Stop<'_>,
    ) -> Result<Self, Stopped> {
        let barriers = around.presented.barriers();
        let bounds_per_check = barriers.comparisons_per_check(BOUNDS_PER_CHECK);
        let mut by_clearance: Vec<(Reverse<i32>, usize, T)> = Vec::new();
        for (place, candidate) in candidates.enumerate() {
            stop.check_every(bounds_per_check, place)?;
            let clearance = if barriers.is_empty() {
                GIVER_CLEARANCE
            } else {
                clearance(candidate, barriers).min(GIVER_CLEARANCE)
            };
            by_clearance.push((Reverse(nanometres(clearance)), place, candidate));
        }
        by_clearance.sort_unstable_by_key(|&(clearance, place, _)| (clearance, place));
        let mut entries = Vec::with_capacity(MAX_SELECTED);
        for (count, (_, _, candidate)) in by_clearance.into_iter().enumerate() {
            if entries.len() == MAX_SELECTED {
                break;
            }
            stop.check_every(MOVES_PER_CHECK, count)?;
            let entry = entry(candidate);
            if entry.meets(around.requirements) {
                entries.push(entry);
            }
        }
        Ok(Self::new(around.rig, entries))
    }

    /// The grips.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Direction of the forearm of each grip from wrist to elbow, a unit vector.
    pub fn forearms(&self) -> &[Vec3] {
        &self.forearms
    }

    pub(super) fn push(&mut self, rig: &Rig, entry: Entry) {
        self.inner_spheres.push(spheres(&entry.solids(rig), &FIRST));
        self.forearms.push(entry.forearm());
        self.entries.push(entry);
    }

    pub(super) fn remove(&mut self, index: usize) {
        self.inner_spheres.remove(index);
        self.forearms.remove(index);
        self.entries.remove(index);
    }

    pub(super) fn replace(&mut self, rig: &Rig, index: usize, entry: Entry) {
        self.inner_spheres[index] = spheres(&entry.solids(rig), &FIRST);
        self.forearms[index] = entry.forearm();
        self.entries[index] = entry;
    }

    /// The solids of a grip, unless its inner spheres show that it is too close to a barrier.
    pub(crate) fn screen(
        &self,
        entry: usize,
        rig: &Rig,
        barriers: Barriers<'_>,
    ) -> Option<Box<TrackedSolids>> {
        if !self.may_be_clear(entry, barriers) {
            return None;
        }
        self.screen_by_second_spheres(entry, rig, barriers)
    }

    /// False if the first inner spheres of grip `entry`, an index into [`Grips::entries`], show that it is too close to a
    /// barrier. Conservative: a grip that passes may still collide. Takes about 20 ns.
    #[inline]
    pub fn may_be_clear(&self, entry: usize, barriers: Barriers<'_>) -> bool {
        !barriers.any_certainly_within(&self.inner_spheres[entry], GIVER_CLEARANCE)
    }

    /// The solids of a grip, unless its second inner spheres show that it is too close to a barrier. They are computed on demand:
    /// one in fifty colliding grips gets here.
    #[inline(never)]
    pub fn screen_by_second_spheres(
        &self,
        entry: usize,
        rig: &Rig,
        barriers: Barriers<'_>,
    ) -> Option<Box<TrackedSolids>> {
        let solids = self.entries[entry].tracked_solids(rig);
        let collides = barriers.any_certainly_within(&spheres(&solids.hand, &SECOND), GIVER_CLEARANCE);
        (!collides).then(|| Box::new(solids))
    }

    /// Upper bound of the barriers' distance, in metres, from thumb, palm, forearm and the best finger subset of a grip, which may be
    /// displaced, by its first inner spheres.
    pub(super) fn clearance_upper_bound(
        &self,
        entry: usize,
        displacement: Option<Pose>,
        barriers: Barriers<'_>,
    ) -> f32 {
        let spheres = &self.inner_spheres[entry];
        let distances = match displacement {
            Some(displacement) => barriers.distance_upper_bounds(&spheres.transformed(displacement)),
            None => barriers.distance_upper_bounds(spheres),
        };
        let (fingers, others) = upper_bounds(&FIRST, &distances);
        let (_, of_fingers) = self.entries[entry].finger_subsets.farthest(fingers);
        of_fingers.min(others)
    }

    /// Memory use in bytes.
    pub(super) fn bytes(&self) -> usize {
        self.entries.iter().map(Entry::bytes).sum::<usize>()
            + size_of_val(self.inner_spheres.as_slice())
            + size_of_val(self.forearms.as_slice())
    }
}
