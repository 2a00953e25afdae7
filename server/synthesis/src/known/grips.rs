//! Known grips with the data that screens them against barriers.

use std::cmp::Reverse;

use glam::Vec3;

use super::{
    entry::Entry,
    finger_subsets::FingerSubsets,
    inner_spheres::{first_spheres, second_spheres, upper_bounds_from_first},
    seeds::nanometres,
};
use crate::{
    base::{
        pose::Pose,
        stop::{Stop, Stopped},
    },
    model::{hand::rig::Rig, requirements::Requirements},
    physical::{
        barriers::Barriers,
        grip::GIVER_CLEARANCE,
        solids::{Spheres, TrackedSolids},
    },
};

/// Largest number of moved grips selected for a holdout, the ones farthest from its barriers by inner spheres. Fewer
/// answer fewer givers, more delay answers.
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
    /// The finger subsets that hold, for each grip.
    finger_subsets: Vec<FingerSubsets>,
    /// Direction of each forearm from wrist to elbow, a unit vector.
    forearms: Vec<Vec3>,
}

impl Grips {
    /// Known grips of a rig.
    pub fn new(rig: &Rig, entries: Vec<Entry>) -> Self {
        let spheres = |entry: &Entry| first_spheres(&entry.solids(rig));
        Self {
            inner_spheres: entries.iter().map(spheres).collect(),
            finger_subsets: entries.iter().map(|entry| entry.finger_subsets).collect(),
            forearms: entries.iter().map(Entry::forearm).collect(),
            entries,
        }
    }

    /// The grips that meet the requirements and are farthest from the barriers, moved to the object by `entry`; the first ones win
    /// ties. `clearance` bounds the distance from the barriers from above, in metres.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn farthest<T: Copy>(
        rig: &Rig,
        candidates: impl Iterator<Item = T>,
        clearance: impl Fn(T) -> f32,
        entry: impl Fn(T) -> Entry,
        (barriers, requirements): (Barriers<'_>, &Requirements),
        stop: Stop<'_>,
    ) -> Result<Self, Stopped> {
        let bounds_per_check = barriers.comparisons_per_check(BOUNDS_PER_CHECK);
        let mut by_clearance: Vec<(Reverse<i32>, usize, T)> = Vec::new();
        for (place, candidate) in candidates.enumerate() {
            stop.check_every(bounds_per_check, place)?;
            let clearance = if barriers.is_empty() {
                GIVER_CLEARANCE
            } else {
                clearance(candidate).min(GIVER_CLEARANCE)
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
            if entry.meets(requirements) {
                entries.push(entry);
            }
        }
        Ok(Self::new(rig, entries))
    }

    /// The grips.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Direction of the forearm of each grip from wrist to elbow, a unit vector.
    pub fn forearms(&self) -> &[Vec3] {
        &self.forearms
    }

    /// Appends a grip.
    pub(super) fn push(&mut self, rig: &Rig, entry: Entry) {
        self.inner_spheres.push(first_spheres(&entry.solids(rig)));
        self.finger_subsets.push(entry.finger_subsets);
        self.forearms.push(entry.forearm());
        self.entries.push(entry);
    }

    /// Removes a grip, and moves those after it up.
    pub(super) fn remove(&mut self, index: usize) {
        self.inner_spheres.remove(index);
        self.finger_subsets.remove(index);
        self.forearms.remove(index);
        self.entries.remove(index);
    }

    /// Replaces a grip.
    pub(super) fn replace(&mut self, rig: &Rig, index: usize, entry: Entry) {
        self.inner_spheres[index] = first_spheres(&entry.solids(rig));
        self.finger_subsets[index] = entry.finger_subsets;
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
        let may_be_clear = self.may_be_clear(entry, barriers);
        may_be_clear
            .then(|| self.screen_by_second_spheres(entry, rig, barriers))
            .flatten()
    }

    /// False if the first inner spheres of grip `entry`, an index into [`Grips::entries`], show that it is too close to a
    /// barrier. Conservative: a grip that passes may still collide. Takes about 20 ns.
    #[inline]
    pub fn may_be_clear(&self, entry: usize, barriers: Barriers<'_>) -> bool {
        !barriers.any_certainly_within(&self.inner_spheres[entry], GIVER_CLEARANCE)
    }

    /// The solids of a grip, unless its second inner spheres show that it is too close to a barrier. They are computed on
    /// demand: one in fifty colliding grips gets here.
    #[inline(never)]
    pub fn screen_by_second_spheres(
        &self,
        entry: usize,
        rig: &Rig,
        barriers: Barriers<'_>,
    ) -> Option<Box<TrackedSolids>> {
        let solids = self.entries[entry].tracked_solids(rig);
        let collides = barriers.any_certainly_within(&second_spheres(&solids.hand), GIVER_CLEARANCE);
        (!collides).then(|| Box::new(solids))
    }

    /// Upper bound of the barriers' distance, in metres, from thumb, palm, forearm and the best finger subset
    /// of a grip, by its first inner spheres.
    pub(super) fn clearance_upper_bound(&self, entry: usize, barriers: Barriers<'_>) -> f32 {
        self.spheres_upper_bound(entry, &self.inner_spheres[entry], barriers)
    }

    /// The same for a displaced grip.
    pub(crate) fn moved_clearance_upper_bound(
        &self,
        entry: usize,
        displacement: Pose,
        barriers: Barriers<'_>,
    ) -> f32 {
        self.spheres_upper_bound(
            entry,
            &self.inner_spheres[entry].transformed(displacement),
            barriers,
        )
    }

    fn spheres_upper_bound(&self, entry: usize, spheres: &Spheres, barriers: Barriers<'_>) -> f32 {
        let distances = barriers.distance_upper_bounds(spheres);
        let (fingers, others) = upper_bounds_from_first(&distances);
        let (_, of_fingers) = self.finger_subsets[entry].farthest(fingers);
        of_fingers.min(others)
    }

    /// Memory use in bytes.
    pub(super) fn bytes(&self) -> usize {
        self.entries.iter().map(Entry::bytes).sum::<usize>()
            + size_of_val(self.inner_spheres.as_slice())
            + size_of_val(self.finger_subsets.as_slice())
            + size_of_val(self.forearms.as_slice())
    }
}
