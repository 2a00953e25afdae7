//! The built-in hands: their rigs, skins and files.

mod description;
mod files;
mod frames;
mod kinematics;
mod opposition;
mod recorded;
mod skin;
mod skin_fit;
mod solids;

use grasp_assets::hands::{Hand, RIG_NAMES, hand};
use grasp_synthesis::model::hand::{DigitAngles, Handedness, rig::Rig};

/// All built-in hands.
fn all() -> impl Iterator<Item = &'static Hand> {
    RIG_NAMES.into_iter().flat_map(|rig| {
        [Handedness::Left, Handedness::Right].map(|side| hand(rig, side).expect("every rig has both hands"))
    })
}

/// A built-in hand.
fn built_in(rig: &str, handedness: Handedness) -> &'static Hand {
    hand(rig, handedness).expect("the rig is built in")
}

/// Repeatable numbers from 0 to 1 (Knuth's linear congruential generator).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u64 << 24) as f32
    }

    /// Angles of all digits within the limits.
    fn angles(&mut self, rig: &Rig) -> [DigitAngles; 5] {
        rig.digits.map(|digit| {
            let mut within = |min: f32, max: f32| min + self.next() * (max - min);
            let limits = digit.limits;
            DigitAngles {
                base_yaw: within(limits.base_yaw.min, limits.base_yaw.max),
                base_pitch: within(limits.base_pitch.min, limits.base_pitch.max),
                second_pitch: within(limits.second_pitch.min, limits.second_pitch.max),
                third_pitch: within(limits.third_pitch.min, limits.third_pitch.max),
            }
        })
    }
}
