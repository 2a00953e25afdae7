//! How a digit's three joints bend together, object or not.

use crate::model::hand::{
    DigitAngles,
    rig::{AngleRange, DigitRig},
};

/// A digit that bends: its second joint so many degrees for a degree of the first, its third two thirds of that.
#[derive(Clone, Copy, Debug)]
pub struct Flexing<'a> {
    /// The digit.
    pub digit: &'a DigitRig,
    /// ψ1 in radians.
    pub base_yaw: f32,
    /// Degrees of the second joint for a degree of the first.
    pub bend_ratio: f32,
}

/// Which of the three joints bend, and where they start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    pub(super) start: DigitAngles,
    /// Radians of each joint for a radian of the sweep.
    pub(super) rates: [f32; 3],
}

impl Flexing<'_> {
    /// The opened pose: every joint at the lower end of its range, but not bent backward.
    pub fn opened(&self) -> DigitAngles {
        let limits = &self.digit.limits;
        let straight = |range: AngleRange| range.min.max(0.0_f32.min(range.max));
        DigitAngles {
            base_yaw: self.base_yaw,
            base_pitch: limits.base_pitch.min,
            second_pitch: straight(limits.second_pitch),
            third_pitch: straight(limits.third_pitch),
        }
    }

    /// The pose after a share of the way from opened to closed as far as the joints go.
    pub fn closed_by(&self, share: f32) -> DigitAngles {
        let sweep = self.sweep();
        self.angles_at(&sweep, share * self.whole_way(&sweep))
    }

    /// All joints from the opened pose.
    pub(super) fn sweep(&self) -> Sweep {
        Sweep {
            start: self.opened(),
            rates: std::array::from_fn(|joint| self.rate(joint)),
        }
    }

    /// Radians of a joint for a radian of a sweep.
    pub(super) fn rate(&self, joint: usize) -> f32 {
        match joint {
            0 => 1.0,
            1 => self.bend_ratio,
            _ => self.bend_ratio * DigitAngles::THIRD_PITCH_SHARE,
        }
    }

    /// The angles after a sweep, none beyond its limit.
    pub(super) fn angles_at(&self, sweep: &Sweep, way: f32) -> DigitAngles {
        let limits = &self.digit.limits;
        DigitAngles {
            base_yaw: self.base_yaw,
            base_pitch: (sweep.start.base_pitch + sweep.rates[0] * way).min(limits.base_pitch.max),
            second_pitch: (sweep.start.second_pitch + sweep.rates[1] * way).min(limits.second_pitch.max),
            third_pitch: (sweep.start.third_pitch + sweep.rates[2] * way).min(limits.third_pitch.max),
        }
    }

    /// The way after which all joints that move are at their limits.
    pub(super) fn whole_way(&self, sweep: &Sweep) -> f32 {
        let limits = &self.digit.limits;
        let way = |rate: f32, start: f32, max: f32| {
            if rate > 0.0 {
                ((max - start) / rate).max(0.0)
            } else {
                0.0
            }
        };
        way(sweep.rates[0], sweep.start.base_pitch, limits.base_pitch.max)
            .max(way(
                sweep.rates[1],
                sweep.start.second_pitch,
                limits.second_pitch.max,
            ))
            .max(way(
                sweep.rates[2],
                sweep.start.third_pitch,
                limits.third_pitch.max,
            ))
    }
}
