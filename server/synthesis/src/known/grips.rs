//! Known grips, each with what tells soonest that it is in a giver's way.

use super::{
    entry::Entry,
    finger_subsets::FingerSets,
    inner_spheres::{farthest_by_first, first_balls, in_way_by_first, second_balls},
};
use crate::{
    base::pose::Pose,
    model::hand::rig::Rig,
    physical::{
        grip::GIVER_CLEARANCE,
        solids::{Balls, PreparedHand, ToldSolids},
    },
};

/// Grips, in the order of [`super::Atlas::entries`]. Whoever asks hands in the rig that they were made for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grips {
    entries: Vec<Entry>,
    /// The first balls inside each hand, side by side, so that looking at one mostly takes two lines of the cache.
    cores: Vec<Balls>,
    /// Which fingers hold without the others.
    finger_sets: Vec<FingerSets>,
}

impl Grips {
    /// Some grips of a rig.
    pub fn new(rig: &Rig, entries: Vec<Entry>) -> Self {
        let core = |entry: &Entry| first_balls(&entry.solids(rig));
        Self {
            cores: entries.iter().map(core).collect(),
            finger_sets: entries.iter().map(|entry| entry.finger_sets).collect(),
            entries,
        }
    }

    /// The grips.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Adds a grip.
    pub(super) fn push(&mut self, rig: &Rig, entry: Entry) {
        self.cores.push(first_balls(&entry.solids(rig)));
        self.finger_sets.push(entry.finger_sets);
        self.entries.push(entry);
    }

    /// Puts a grip in the place of another one.
    pub(super) fn replace(&mut self, rig: &Rig, index: usize, entry: Entry) {
        self.cores[index] = first_balls(&entry.solids(rig));
        self.finger_sets[index] = entry.finger_sets;
        self.entries[index] = entry;
    }

    /// The solids of a grip, an index of [`Grips::entries`]; none only if it comes too near to a giver's hand, and not
    /// always then. Sooner told than exactly: mostly by some 20 ns of work.
    #[inline]
    pub fn unless_met(&self, entry: usize, rig: &Rig, giver: &PreparedHand) -> Option<Box<ToldSolids>> {
        if giver.surely_nears_any(&self.cores[entry], GIVER_CLEARANCE) {
            return None;
        }
        self.unless_met_by_second(entry, rig, giver)
    }

    /// One in fifty that meet gets as far as the second balls, which are not kept for that.
    #[inline(never)]
    fn unless_met_by_second(&self, entry: usize, rig: &Rig, giver: &PreparedHand) -> Option<Box<ToldSolids>> {
        let solids = self.entries[entry].told_solids(rig);
        let is_met = giver.surely_nears_any(&second_balls(&solids.hand), GIVER_CLEARANCE);
        (!is_met).then(|| Box::new(solids))
    }

    /// False only if the giver's hand surely leaves too few digits of a grip to hold the object, or is too near to its palm or
    /// forearm; not always then. Mostly by some 20 ns of work.
    #[inline]
    pub fn may_spare(&self, entry: usize, giver: &PreparedHand) -> bool {
        let sets = self.finger_sets[entry];
        let is_too_much = |near| !sets.hold_beside(in_way_by_first(near));
        let near = giver.surely_near(&self.cores[entry], GIVER_CLEARANCE, is_too_much);
        !is_too_much(near)
    }

    /// What thumb, palm, forearm and those fingers of a grip that hold without the others are from the giver's hand at most, in
    /// metres, by the first balls inside alone.
    pub(super) fn clearance_at_most(&self, entry: usize, giver: &PreparedHand) -> f32 {
        self.core_clearance(entry, &self.cores[entry], giver)
    }

    /// The same for a grip that is moved.
    pub(crate) fn moved_clearance_at_most(&self, entry: usize, way: Pose, giver: &PreparedHand) -> f32 {
        self.core_clearance(entry, &self.cores[entry].transformed(way), giver)
    }

    fn core_clearance(&self, entry: usize, core: &Balls, giver: &PreparedHand) -> f32 {
        let distances = giver.distances_at_most(core);
        let (fingers, others) = farthest_by_first(&distances);
        let (_, of_fingers) = self.finger_sets[entry].farthest(fingers);
        of_fingers.min(others)
    }

    /// Bytes that they take in memory.
    pub(super) fn bytes(&self) -> usize {
        self.entries.iter().map(Entry::bytes).sum::<usize>()
            + size_of_val(self.cores.as_slice())
            + size_of_val(self.finger_sets.as_slice())
    }
}
