//! The fingers that a grip can do without, and spheres inside a hand that quickly tell which fingers a barrier obstructs.

use crate::{
    model::hand::Digit,
    physical::solids::{HandSolids, SPHERES, Spheres},
};

/// Number of fingers, the thumb not included.
const FINGERS: usize = 4;

/// The finger subsets that hold by themselves. Bit `s` represents subset `s`, in which bit `f` represents finger `f`, counted from
/// the index finger. The thumb is part of every subset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FingerSubsets(u16);

impl FingerSubsets {
    /// All fingers that hold, and those of their subsets that have enough closure by themselves according to `closes`, which
    /// takes digits, thumb first. Subsets of a set that does not close are not tested: removing a contact hardly ever adds
    /// closure.
    pub fn of(holding: [bool; 5], mut closes: impl FnMut([bool; 5]) -> bool) -> Self {
        let whole = number(holding);
        let mut sets = Self::whole(holding);
        // A superset with one more finger has a higher number.
        for set in (1..whole).rev().filter(|set| set & !whole == 0) {
            let others = (0..FINGERS).map(|finger| 1 << finger);
            let mut supersets = others
                .filter(|finger| finger & whole & !set != 0)
                .map(|finger| finger | set);
            if supersets.all(|more| sets.has(more)) && closes(digits(set)) {
                sets.0 |= 1 << set;
            }
        }
        sets
    }

    /// The fingers that hold, and no smaller subset.
    pub fn whole(holding: [bool; 5]) -> Self {
        Self(1 << number(holding))
    }

    /// From bits; `None` if a subset has fingers that do not hold, or if the set of all that hold is missing.
    pub(super) fn from_bits(bits: u16, holding: [bool; 5]) -> Option<Self> {
        let whole = number(holding);
        let are_subsets = (0..=15_u8).all(|set| bits >> set & 1 == 0 || set & !whole == 0);
        (are_subsets && bits >> whole & 1 == 1).then_some(Self(bits))
    }

    pub(super) fn to_bits(self) -> u16 {
        self.0
    }

    /// True if these digits, thumb first, hold by themselves.
    pub fn contains(self, kept: [bool; 5]) -> bool {
        kept[Digit::Thumb.index()] && self.has(number(kept))
    }

    /// The subset whose nearest finger is farthest away, as digits, thumb first, and the distance of that finger; infinite for
    /// the thumb alone. `distances` are those of the fingers, from the index finger.
    pub fn farthest(self, distances: [f32; FINGERS]) -> ([bool; 5], f32) {
        let nearest_of = |set: u8| {
            let fingers = distances
                .iter()
                .enumerate()
                .filter(|(finger, _)| set >> finger & 1 == 1);
            fingers.fold((0, f32::INFINITY), |nearest, (finger, &distance)| {
                if distance < nearest.1 {
                    (finger, distance)
                } else {
                    nearest
                }
            })
        };
        // Removing the nearest finger may increase the distance. If the rest does not hold, no smaller subset does.
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

    fn whole_number(self) -> u8 {
        self.0.checked_ilog2().unwrap_or(0) as u8
    }

    fn has(self, set: u8) -> bool {
        self.0 >> set & 1 == 1
    }
}

fn number(digits: [bool; 5]) -> u8 {
    let fingers = digits[1..].iter().enumerate();
    fingers.map(|(finger, &is_in)| u8::from(is_in) << finger).sum()
}

fn digits(set: u8) -> [bool; 5] {
    std::array::from_fn(|digit| digit == 0 || set >> (digit - 1) & 1 == 1)
}

/// Spheres inside a hand: a barrier too close to one of them is too close to the hand.
pub(super) type InnerSpheres = [(usize, f32); SPHERES];

/// Chosen once by a greedy cover, as `assets/PROVENANCE.md` says; they miss 6.4 % of the collisions of known grips and givers.
pub(super) const FIRST: InnerSpheres = [
    (2, 0.5),
    (7, 0.5),
    (12, 0.9),
    (5, 0.1),
    (11, 0.9),
    (25, 0.7),
    (22, 0.9),
    (3, 0.9),
];

/// With these as well, 2.2 % are missed.
pub(super) const SECOND: InnerSpheres = [
    (8, 0.9),
    (14, 0.9),
    (29, 0.1),
    (2, 0.9),
    (5, 0.9),
    (30, 0.7),
    (3, 0.1),
    (1, 0.7),
];

/// Solids per digit; the digits come first in [`HandSolids::iter`].
const LINKS: usize = 3;

/// The inner spheres of a hand.
#[inline]
pub(super) fn spheres(solids: &HandSolids, inner_spheres: &InnerSpheres) -> Spheres {
    Spheres::new(|i| {
        let (index, along) = inner_spheres[i];
        let solid = solids.solid(index);
        (solid.at(along), solid.radius_at(along))
    })
}

/// The inner spheres of some digits, palm and forearm; those of the others are near nothing.
pub(super) fn of_digits(solids: &HandSolids, inner_spheres: &InnerSpheres, digits: [bool; 5]) -> Spheres {
    let counts = |i: usize| digits.get(inner_spheres[i].0 / LINKS);
    spheres(solids, inner_spheres).kept(|i| counts(i).is_none_or(|&counts| counts))
}

/// Upper bounds of the distances of the fingers, from the index finger, and of thumb, palm and forearm together, by those of the
/// spheres.
#[inline]
pub(super) fn upper_bounds(
    inner_spheres: &InnerSpheres,
    distances: &[f32; SPHERES],
) -> ([f32; FINGERS], f32) {
    let (mut fingers, mut others) = ([f32::INFINITY; FINGERS], f32::INFINITY);
    for (sphere, &distance) in inner_spheres.iter().zip(distances) {
        let owner = match (sphere.0 / LINKS).checked_sub(1) {
            Some(finger) if finger < FINGERS => &mut fingers[finger],
            _ => &mut others,
        };
        *owner = owner.min(distance);
    }
    (fingers, others)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn farthest_matches_exhaustive_search() {
        let mut numbers = (1..).map(|number: u32| number.wrapping_mul(2_654_435_761) >> 24);
        for case in 0..250_u8 {
            let holding = digits(1 + case % 15);
            // Any monotone predicate will do, as closure is one.
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
}
