//! How much friction a grip's forces use under each direction of gravity, in two bits.

use super::gravity::DIRECTIONS;
use crate::physical::immobility::FrictionUse;

// A bit for each direction.
const _: () = assert!(DIRECTIONS == 64);

/// A use of friction for each of [`DIRECTIONS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrictionUses {
    /// Directions in which they use more than sparingly, a bit each.
    more: u64,
    /// Of those, the ones in which they use all.
    all: u64,
}

impl FrictionUses {
    /// From bits: the directions in which forces use more than sparingly, and those of them in which they use all. None if
    /// the latter are not among the former.
    pub(super) fn from_bits([more, all]: [u64; 2]) -> Option<Self> {
        (all & !more == 0).then_some(Self { more, all })
    }

    /// The bits of [`FrictionUses::from_bits`].
    pub(super) fn to_bits(self) -> [u64; 2] {
        [self.more, self.all]
    }

    /// That of a direction.
    pub fn get(self, direction: usize) -> FrictionUse {
        match (self.more >> direction & 1, self.all >> direction & 1) {
            (0, _) => FrictionUse::Low,
            (_, 0) => FrictionUse::Moderate,
            _ => FrictionUse::Full,
        }
    }

    /// Sets that of a direction.
    pub fn set(&mut self, direction: usize, friction_use: FrictionUse) {
        let bit = 1_u64 << direction;
        let put = |bits: u64, is_set: bool| if is_set { bits | bit } else { bits & !bit };
        self.more = put(self.more, friction_use != FrictionUse::Low);
        self.all = put(self.all, friction_use == FrictionUse::Full);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_direction_has_its_own() {
        let of = |direction: usize| FrictionUse::ALL[direction * 7 % 11 % 3];
        let mut uses = FrictionUses::default();
        // Another one before, so that setting takes bits away, too.
        for direction in (0..DIRECTIONS).chain(0..DIRECTIONS).rev() {
            uses.set(direction, FrictionUse::Full);
            uses.set(direction, of(direction));
        }
        for direction in 0..DIRECTIONS {
            assert_eq!(uses.get(direction), of(direction), "direction {direction}");
        }
        assert_eq!(FrictionUses::from_bits(uses.to_bits()), Some(uses));
        assert_eq!(FrictionUses::from_bits([0, 1]), None);
    }
}
