//! How much friction a grip's forces use under each direction of gravity, in two bits.

use super::gravity::DIRECTIONS;
use crate::physical::immobility::FrictionUse;

// One bit per direction.
const _: () = assert!(DIRECTIONS == 64);

/// The friction use for each of [`DIRECTIONS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrictionUses {
    /// Directions with more than sparing use, one bit each.
    more: u64,
    /// Those of them with full use.
    all: u64,
}

impl FrictionUses {
    /// From bits: directions with more than sparing use, and those with full use. None if the latter are not
    /// a subset of the former.
    pub(super) fn from_bits([more, all]: [u64; 2]) -> Option<Self> {
        (all & !more == 0).then_some(Self { more, all })
    }

    /// The bits of [`FrictionUses::from_bits`].
    pub(super) fn to_bits(self) -> [u64; 2] {
        [self.more, self.all]
    }

    /// The friction use for a direction.
    pub fn get(self, direction: usize) -> FrictionUse {
        match (self.more >> direction & 1, self.all >> direction & 1) {
            (0, _) => FrictionUse::Low,
            (_, 0) => FrictionUse::Moderate,
            _ => FrictionUse::Full,
        }
    }

    /// Sets the friction use for a direction.
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
    fn set_overwrites_one_direction_only() {
        let of = |direction: usize| FrictionUse::ALL[direction * 7 % 11 % 3];
        let mut uses = FrictionUses::default();
        // Sets another value first, so that clearing bits is tested, too.
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
