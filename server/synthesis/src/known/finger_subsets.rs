//! Which fingers of a grip can be spared.

use crate::model::hand::Digit;

/// Fingers; the thumb is not one.
const FINGERS: usize = 4;

/// Sets of fingers that hold without the others: a bit for each of the sixteen, whose number has a bit for each finger from
/// the index finger on. The thumb always holds with them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FingerSubsets(u16);

/// What a giver's hand is in the way of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InWay {
    /// Fingers, a bit each from the index finger on.
    fingers: u8,
    /// What cannot be spared: thumb, palm or forearm.
    others: bool,
}

impl InWay {
    /// Nothing.
    pub const NOTHING: Self = Self {
        fingers: 0,
        others: false,
    };

    /// The digit of an index as well, thumb first; beyond the fingers, palm or forearm.
    pub(super) const fn and_of(self, digit: usize) -> Self {
        if digit == 0 || digit > FINGERS {
            Self { others: true, ..self }
        } else {
            Self {
                fingers: self.fingers | 1 << (digit - 1),
                ..self
            }
        }
    }
}

impl FingerSubsets {
    /// All fingers that hold, and those of them that have enough closure alone, as `closes` says of digits, thumb first. It
    /// is not asked of fewer fingers than do not close: every contact only adds to what can be resisted.
    pub fn of(holding: [bool; 5], mut closes: impl FnMut([bool; 5]) -> bool) -> Self {
        let whole = number(holding);
        let mut sets = Self::whole(holding);
        // Sets with one finger more have higher numbers.
        for set in (1..whole).rev().filter(|set| set & !whole == 0) {
            let others = (0..FINGERS).map(|finger| 1 << finger);
            let mut with_one_more = others
                .filter(|finger| finger & whole & !set != 0)
                .map(|finger| finger | set);
            if with_one_more.all(|more| sets.has(more)) && closes(digits(set)) {
                sets.0 |= 1 << set;
            }
        }
        sets
    }

    /// Those that hold, of which none can be spared.
    pub fn whole(holding: [bool; 5]) -> Self {
        Self(1 << number(holding))
    }

    /// From bits; none if they are not sets of digits that hold, or if all of those are not among them.
    pub(super) fn from_bits(bits: u16, holding: [bool; 5]) -> Option<Self> {
        let whole = number(holding);
        let are_of_whole = (0..=15_u8).all(|set| bits >> set & 1 == 0 || set & !whole == 0);
        (are_of_whole && bits >> whole & 1 == 1).then_some(Self(bits))
    }

    /// The bits of [`FingerSubsets::from_bits`].
    pub(super) fn to_bits(self) -> u16 {
        self.0
    }

    /// True if some digits, thumb first, hold alone.
    pub fn contains(self, kept: [bool; 5]) -> bool {
        kept[Digit::Thumb.index()] && self.has(number(kept))
    }

    /// True if what a giver leaves holds.
    #[inline]
    pub fn hold_without(self, in_way: InWay) -> bool {
        !in_way.others && self.has(self.whole_number() & !in_way.fingers)
    }

    /// The fingers that hold without the others of which the nearest to something is farthest from it, with the thumb, thumb
    /// first; and that one's distance, infinite for none. `distances` are the fingers', from the index finger on.
    pub fn farthest(self, distances: [f32; FINGERS]) -> ([bool; 5], f32) {
        let nearest_of = |set: u8| {
            let fingers = distances
                .iter()
                .enumerate()
                .filter(|(finger, _)| set >> finger & 1 == 1);
            fingers.fold((0, f32::INFINITY), |least, (finger, &distance)| {
                if distance < least.1 {
                    (finger, distance)
                } else {
                    least
                }
            })
        };
        // Without the nearest one, others may be farther; if those do not hold, no fewer of them do.
        let mut set = self.whole_number();
        loop {
            let (nearest, distance) = nearest_of(set);
            let without = set & !(1 << nearest);
            if without == set || !self.has(without) {
                return (digits(set), distance);
            }
            set = without;
        }
    }

    /// All digits that hold, thumb first.
    pub fn holding(self) -> [bool; 5] {
        digits(self.whole_number())
    }

    /// All fingers that hold have the highest number.
    fn whole_number(self) -> u8 {
        self.0.checked_ilog2().unwrap_or(0) as u8
    }

    fn has(self, set: u8) -> bool {
        self.0 >> set & 1 == 1
    }
}

/// The number of the set of fingers among some digits.
fn number(digits: [bool; 5]) -> u8 {
    let fingers = digits[1..].iter().enumerate();
    fingers.map(|(finger, &is_in)| u8::from(is_in) << finger).sum()
}

/// The digits of a set, thumb included.
fn digits(set: u8) -> [bool; 5] {
    std::array::from_fn(|digit| digit == 0 || set >> (digit - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hand that closes with three fingers, or with index and little finger.
    fn closes(digits: [bool; 5]) -> bool {
        let fingers = digits[1..].iter().filter(|finger| **finger).count();
        fingers >= 3 || (digits[1] && digits[4])
    }

    #[test]
    fn sets_are_those_that_close_of_fingers_that_hold() {
        let all = FingerSubsets::of([true; 5], closes);
        for set in 0..16 {
            assert_eq!(all.contains(digits(set)), closes(digits(set)), "{set:04b}");
        }
        assert_eq!(all.holding(), [true; 5]);
        let without_ring = [true, true, true, false, true];
        let sets = FingerSubsets::of(without_ring, closes);
        assert!(sets.contains(without_ring) && sets.contains(digits(0b1001)));
        assert!(!sets.contains(digits(0b0111)), "the ring finger does not hold");
        assert_eq!(sets.holding(), without_ring);
        assert!(
            !sets.contains([false, true, true, false, true]),
            "the thumb is not subset_grasp"
        );
    }

    #[test]
    fn the_farthest_fingers_are_those_of_all_sets() {
        let mut numbers = (1..).map(|number: u32| number.wrapping_mul(2_654_435_761) >> 24);
        for case in 0..250_u8 {
            let holding = digits(1 + case % 15);
            // Any that grows by fingers, as closure does.
            let weights = numbers.next().unwrap();
            let sets = FingerSubsets::of(holding, |kept| {
                let weight_of = |finger: u32| weights >> (2 * finger) & 3;
                (0..4)
                    .filter(|&finger| kept[1 + finger as usize])
                    .map(weight_of)
                    .sum::<u32>()
                    >= 3
            });
            let distances: [f32; 4] = std::array::from_fn(|_| numbers.next().unwrap() as f32);
            let nearest = |set: u8| {
                let of_set = (0..4).filter(|finger| set >> finger & 1 == 1);
                of_set
                    .map(|finger| distances[finger])
                    .fold(f32::INFINITY, f32::min)
            };
            let best = (1..16)
                .filter(|&set| sets.contains(digits(set)))
                .map(nearest)
                .fold(0.0, f32::max);
            let (kept, distance) = sets.farthest(distances);
            assert!(sets.contains(kept), "case {case}");
            assert_eq!((nearest(number(kept)), distance), (best, best), "case {case}");
        }
    }

    #[test]
    fn fewer_fingers_than_do_not_close_are_not_asked_about() {
        let mut asked = Vec::new();
        FingerSubsets::of([true, true, true, true, false], |digits| {
            asked.push(number(digits));
            number(digits) == 0b110
        });
        assert_eq!(
            asked,
            [0b110, 0b101, 0b011],
            "no single finger, as each is part of a pair that fails"
        );
    }

    #[test]
    fn bits_come_again_and_others_are_refused() {
        let holding = [true, true, false, true, true];
        let sets = FingerSubsets::of(holding, closes);
        assert_eq!(FingerSubsets::from_bits(sets.to_bits(), holding), Some(sets));
        assert_eq!(
            FingerSubsets::from_bits(sets.to_bits(), [true; 5]),
            None,
            "not all"
        );
        assert_eq!(
            FingerSubsets::from_bits(sets.to_bits() | 1 << 0b0010, holding),
            None,
            "the middle finger"
        );
        assert_eq!(FingerSubsets::from_bits(0, holding), None);
    }
}
