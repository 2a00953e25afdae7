//! Known grips, each with what tells soonest that it is in a giver's way.

use super::{
    cores::{first_balls, first_of_digits, second_balls},
    entry::Entry,
};
use crate::{
    hand::rig::Rig,
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
    /// Which digits hold, thumb first.
    holding: Vec<[bool; 5]>,
}

impl Grips {
    /// Some grips of a rig.
    pub fn new(rig: &Rig, entries: Vec<Entry>) -> Self {
        let core = |entry: &Entry| first_balls(&entry.solids(rig));
        Self {
            cores: entries.iter().map(core).collect(),
            holding: entries.iter().map(Entry::holding_digits).collect(),
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
        self.holding.push(entry.holding_digits());
        self.entries.push(entry);
    }

    /// Puts a grip in the place of another one.
    pub(super) fn replace(&mut self, rig: &Rig, index: usize, entry: Entry) {
        self.cores[index] = first_balls(&entry.solids(rig));
        self.holding[index] = entry.holding_digits();
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

    /// What the digits that hold, palm and forearm of a grip are from the giver's hand at most, in metres, by the first balls
    /// inside alone.
    pub(super) fn clearance_at_most(&self, entry: usize, giver: &PreparedHand) -> f32 {
        giver.distance_at_most(&first_of_digits(self.cores[entry], self.holding[entry]))
    }

    /// Bytes that they take in memory.
    pub(super) fn bytes(&self) -> usize {
        self.entries.iter().map(Entry::bytes).sum::<usize>()
            + size_of_val(self.cores.as_slice())
            + size_of_val(self.holding.as_slice())
    }
}
