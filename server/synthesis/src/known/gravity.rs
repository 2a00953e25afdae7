//! The directions that gravity is quantized to, and how much friction the forces of a grip use under each.

use std::sync::LazyLock;

use glam::Vec3;

use crate::physical::immobility::FrictionUse;

/// Number of directions that gravity is quantized to, about 18° apart. More order the grips more exactly, and
/// cost 2 bytes and one balance computation per grip each.
pub const DIRECTIONS: usize = 64;

/// A direction: a point of a Fibonacci lattice on the sphere (R. Swinbank and R. J. Purser, "Fibonacci
/// grids", 2006).
pub fn direction(index: usize) -> Vec3 {
    let golden_angle = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let z = 1.0 - (2 * index + 1) as f32 / DIRECTIONS as f32;
    let (sin, cos) = (golden_angle * index as f32).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

/// All directions, by coordinate. Computing their sines would take as long as trying a grip.
static COORDINATES: LazyLock<[[f32; DIRECTIONS]; 3]> =
    LazyLock::new(|| std::array::from_fn(|axis| std::array::from_fn(|index| direction(index)[axis])));

/// The index of the direction nearest to a unit vector.
pub fn nearest_direction(up: Vec3) -> usize {
    let [xs, ys, zs] = &*COORDINATES;
    let mut cosines = [0.0; DIRECTIONS];
    for i in 0..DIRECTIONS {
        cosines[i] = xs[i] * up.x + ys[i] * up.y + zs[i] * up.z;
    }
    let highest = cosines.iter().fold(f32::MIN, |a, &b| if b > a { b } else { a });
    cosines.iter().position(|&cosine| cosine == highest).unwrap_or(0)
}

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
    /// From bits: directions with more than sparing use, and those with full use. `None` if the latter are not
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
