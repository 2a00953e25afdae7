//! What queries that look for the nearest keep on their stacks.

use super::wide_bvh::{Child, ChildRef, WIDTH};

/// A child that waits, and a bound of how near anything in it can be above it in one number, so that sorting needs no
/// branches: the bits of floats that are not negative sort like the floats. 0, a place that the root never takes, stands
/// for no child.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Waiting(u64);

impl Waiting {
    /// A child and its bound, which is not negative.
    pub(super) fn new(bound: f32, child: ChildRef) -> Self {
        Self(u64::from(bound.to_bits()) << 32 | u64::from(child.to_bits()))
    }

    /// The bound.
    pub(super) fn bound(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    /// The child.
    pub(super) fn child(self) -> Child {
        ChildRef::from_bits(self.0 as u32).child()
    }
}

/// Sorts four children, the farthest first, by the shortest sorting network.
#[inline]
pub(super) fn sorted_falling(mut children: [Waiting; WIDTH]) -> [Waiting; WIDTH] {
    for (i, j) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        (children[i], children[j]) = (children[i].max(children[j]), children[i].min(children[j]));
    }
    children
}
