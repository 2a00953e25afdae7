//! The random stream of one attempt.

use glam::{Quat, Vec3};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// 2^-24: spacing of uniform numbers made from 24 random bits, the precision of an `f32` below 1.
const UNIT_24: f32 = 1.0 / (1 << 24) as f32;

/// 2^-20: spacing of numbers in [-1, 1) made from 21 random bits; three of them fit into one draw.
const SIGNED_21: f32 = 1.0 / (1 << 20) as f32;

/// The source of all randomness in one attempt.
///
/// The stream depends on the search's seed and the attempt's index alone: attempt i of a seed draws the same numbers on any
/// number of workers.
#[derive(Clone, Debug)]
pub struct AttemptStream {
    attempt: u64,
    generator: Xoshiro256PlusPlus,
}

impl AttemptStream {
    /// The stream of attempt number `attempt`.
    pub fn new(seed: u64, attempt: u64) -> Self {
        // For a given seed, indices map to states one to one: no two attempts of a search share a stream. Mixing the seed first
        // keeps seed 1 from being seed 0 shifted by one index.
        let state = mix(mix(seed).wrapping_add(attempt));
        Self {
            attempt,
            generator: Xoshiro256PlusPlus::seed_from_u64(state),
        }
    }

    /// The attempt's index.
    pub fn attempt(&self) -> u64 {
        self.attempt
    }

    /// A uniform number in [0, 1).
    #[inline]
    pub fn unit(&mut self) -> f32 {
        (self.generator.next_u64() >> 40) as f32 * UNIT_24
    }

    /// A uniform number from `min` to `max`, both included.
    #[inline]
    pub fn between(&mut self, min: f32, max: f32) -> f32 {
        // Rounding can push the sum just above `max`.
        (min + (max - min) * self.unit()).min(max)
    }

    /// A uniform integer in `0..count`; `count` is from 1 to 2^24.
    #[inline]
    pub fn below(&mut self, count: usize) -> usize {
        debug_assert!(
            count > 0 && count <= 1 << 24,
            "count {count} is not in 1 ..= 2^24"
        );
        ((self.unit() * count as f32) as usize).min(count - 1)
    }

    /// A uniform point of the cube [-1, 1)³.
    #[inline]
    pub fn in_cube(&mut self) -> Vec3 {
        let bits = self.generator.next_u64();
        let coordinate = |shift: u32| ((bits >> shift) & 0x1F_FFFF) as f32 * SIGNED_21 - 1.0;
        Vec3::new(coordinate(43), coordinate(22), coordinate(1))
    }

    /// A uniform point (x, y) of the open unit disk, never the centre, and its squared distance from the centre.
    #[inline]
    fn in_disk(&mut self) -> (f32, f32, f32) {
        loop {
            let bits = self.generator.next_u64();
            let x = (bits >> 40) as f32 * (2.0 * UNIT_24) - 1.0;
            let y = ((bits >> 16) & 0xFF_FFFF) as f32 * (2.0 * UNIT_24) - 1.0;
            let squared = x * x + y * y;
            if squared < 1.0 && squared > 0.0 {
                return (x, y, squared);
            }
        }
    }

    /// A uniform random rotation by Marsaglia's method for the unit quaternions ("Choosing a point from the surface of a sphere",
    /// Annals of Mathematical Statistics 43, 1972), without trigonometry.
    #[inline]
    pub fn rotation(&mut self) -> Quat {
        let (x, y, first) = self.in_disk();
        let (z, w, second) = self.in_disk();
        let scale = ((1.0 - first) / second).sqrt();
        Quat::from_xyzw(x, y, z * scale, w * scale)
    }

    /// Four non-negative shares that sum to one, from the flat Dirichlet distribution: the spacings of three sorted uniform
    /// numbers.
    #[inline]
    pub fn four_shares(&mut self) -> [f32; 4] {
        let (a, b, c) = (self.unit(), self.unit(), self.unit());
        let (low, high) = (a.min(b), a.max(b));
        let (first, middle) = (low.min(c), low.max(c));
        let (second, third) = (middle.min(high), middle.max(high));
        [first, second - first, third - second, 1.0 - third]
    }
}

/// The finaliser of `SplitMix64` (Steele, Lea, Flood, OOPSLA 2014), a bijection.
fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
