//! Stack entries of nearest-first traversals.

use super::wide_bvh::{Child, ChildRef, WIDTH};

/// A child still to be visited and, in the upper 32 bits, a lower bound of the distance to anything in it. Entries
/// sort by bound without branches, because the bits of non-negative floats sort like the floats. 0 marks an empty
/// slot.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct StackEntry(u64);

impl StackEntry {
    /// An entry for a child; `bound` must not be negative.
    pub(super) fn new(bound: f32, child: ChildRef) -> Self {
        Self(u64::from(bound.to_bits()) << 32 | u64::from(child.to_bits()))
    }

    /// The lower bound of the distance.
    pub(super) fn bound(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    /// The child.
    pub(super) fn child(self) -> Child {
        ChildRef::from_bits(self.0 as u32).child()
    }
}

/// Sorts four entries, farthest first, by the shortest sorting network for four.
#[inline]
pub(super) fn sorted_farthest_first(mut entries: [StackEntry; WIDTH]) -> [StackEntry; WIDTH] {
    for (i, j) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        (entries[i], entries[j]) = (entries[i].max(entries[j]), entries[i].min(entries[j]));
    }
    entries
}
