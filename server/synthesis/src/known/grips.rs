//! Known grips, each with what tells soonest that it is in a giver's way.

use super::{
    entry::Entry,
    finger_subsets::FingerSubsets,
    inner_spheres::{farthest_by_first, first_spheres, in_way_by_first, second_spheres},
};
use crate::{
    base::pose::Pose,
    model::hand::rig::Rig,
    physical::{
        grip::GIVER_CLEARANCE,
        solids::{PreparedHand, Spheres, TrackedSolids},
    },
};

/// Grips, in the order of [`super::Atlas::entries`]. Whoever asks hands in the rig that they were made for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grips {
    entries: Vec<Entry>,
    /// The first balls inside each hand, side by side, so that looking at one mostly takes two lines of the cache.
    inner_spheres: Vec<Spheres>,
    /// Which fingers hold without the others.
    finger_subsets: Vec<FingerSubsets>,
}

impl Grips {
    /// Some grips of a rig.
    pub fn new(rig: &Rig, entries: Vec<Entry>) -> Self {
        let core = |entry: &Entry| first_spheres(&entry.solids(rig));
        Self {
            inner_spheres: entries.iter().map(core).collect(),
            finger_subsets: entries.iter().map(|entry| entry.finger_subsets).collect(),
            entries,
        }
    }

    /// The grips.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Adds a grip.
    pub(super) fn push(&mut self, rig: &Rig, entry: Entry) {
        self.inner_spheres.push(first_spheres(&entry.solids(rig)));
        self.finger_subsets.push(entry.finger_subsets);
        self.entries.push(entry);
    }

    /// Puts a grip in the place of another one.
    pub(super) fn replace(&mut self, rig: &Rig, index: usize, entry: Entry) {
        self.inner_spheres[index] = first_spheres(&entry.solids(rig));
        self.finger_subsets[index] = entry.finger_subsets;
        self.entries[index] = entry;
    }

    /// The solids of a grip, an index of [`Grips::entries`]; none only if it comes too near to a giver's hand, and not
    /// always then. Sooner told than exactly: mostly by some 20 ns of work.
    #[inline]
    pub fn unless_met(&self, entry: usize, rig: &Rig, giver: &PreparedHand) -> Option<Box<TrackedSolids>> {
        if giver.any_certainly_within(&self.inner_spheres[entry], GIVER_CLEARANCE) {
            return None;
        }
        self.unless_met_by_second(entry, rig, giver)
    }

    /// One in fifty that meet gets as far as the second balls, which are not kept for that.
    #[inline(never)]
    fn unless_met_by_second(
        &self,
        entry: usize,
        rig: &Rig,
        giver: &PreparedHand,
    ) -> Option<Box<TrackedSolids>> {
        let solids = self.entries[entry].tracked_solids(rig);
        let is_met = giver.any_certainly_within(&second_spheres(&solids.hand), GIVER_CLEARANCE);
        (!is_met).then(|| Box::new(solids))
    }

    /// False only if the giver's hand surely leaves too few digits of a grip to hold the object, or is too near to its palm or
    /// forearm; not always then. Mostly by some 20 ns of work.
    #[inline]
    pub fn may_hold_with_subset(&self, entry: usize, giver: &PreparedHand) -> bool {
        let sets = self.finger_subsets[entry];
        let is_too_much = |near| !sets.hold_without(in_way_by_first(near));
        let near = giver.which_certainly_within(&self.inner_spheres[entry], GIVER_CLEARANCE, is_too_much);
        !is_too_much(near)
    }

    /// What thumb, palm, forearm and those fingers of a grip that hold without the others are from the giver's hand at most, in
    /// metres, by the first balls inside alone.
    pub(super) fn clearance_upper_bound(&self, entry: usize, giver: &PreparedHand) -> f32 {
        self.core_clearance(entry, &self.inner_spheres[entry], giver)
    }

    /// The same for a grip that is moved.
    pub(crate) fn moved_clearance_upper_bound(&self, entry: usize, way: Pose, giver: &PreparedHand) -> f32 {
        self.core_clearance(entry, &self.inner_spheres[entry].transformed(way), giver)
    }

    fn core_clearance(&self, entry: usize, core: &Spheres, giver: &PreparedHand) -> f32 {
        let distances = giver.distance_upper_bounds(core);
        let (fingers, others) = farthest_by_first(&distances);
        let (_, of_fingers) = self.finger_subsets[entry].farthest(fingers);
        of_fingers.min(others)
    }

    /// Bytes that they take in memory.
    pub(super) fn bytes(&self) -> usize {
        self.entries.iter().map(Entry::bytes).sum::<usize>()
            + size_of_val(self.inner_spheres.as_slice())
            + size_of_val(self.finger_subsets.as_slice())
    }
}
