//! How a digit's three joints bend together.

use crate::model::hand::{
    DigitAngles,
    rig::{AngleRange, DigitRig},
};

/// A bending digit: its second joint turns `bend_ratio` times as far as the first, its third two thirds as far as the
/// second.
#[derive(Clone, Copy, Debug)]
pub struct Flexing<'a> {
    /// The digit.
    pub digit: &'a DigitRig,
    /// ψ1, in radians.
    pub base_yaw: f32,
    /// Degrees of the second joint per degree of the first.
    pub bend_ratio: f32,
}

/// A sweep of the three joints: start angles and rates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    pub(super) start: DigitAngles,
    /// Radians of each joint per radian of the sweep.
    pub(super) rates: [f32; 3],
}

impl Flexing<'_> {
    /// The opened pose: every joint at the lower end of its range, the outer two not bent backward.
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

    /// The pose at a fraction of full closure: 0 is opened, 1 is closed to the joint limits.
    pub fn closed_by(&self, closure: f32) -> DigitAngles {
        let sweep = self.sweep();
        self.angles_at(&sweep, closure * self.full_sweep(&sweep))
    }

    /// The fraction of full closure at which the first joint is at `base_pitch` radians, if its limits allow that.
    pub fn closure_at(&self, base_pitch: f32) -> f32 {
        let sweep = self.sweep();
        (base_pitch - sweep.start.base_pitch) / self.full_sweep(&sweep).max(f32::MIN_POSITIVE)
    }

    /// A sweep of all joints from the opened pose.
    pub(super) fn sweep(&self) -> Sweep {
        Sweep {
            start: self.opened(),
            rates: std::array::from_fn(|joint| self.rate(joint)),
        }
    }

    /// Radians of a joint per radian of a sweep.
    pub(super) fn rate(&self, joint: usize) -> f32 {
        match joint {
            0 => 1.0,
            1 => self.bend_ratio,
            _ => self.bend_ratio * DigitAngles::THIRD_PITCH_SHARE,
        }
    }

    /// The joint angles after `swept` radians of a sweep, clamped to the limits.
    pub(super) fn angles_at(&self, sweep: &Sweep, swept: f32) -> DigitAngles {
        let limits = &self.digit.limits;
        DigitAngles {
            base_yaw: self.base_yaw,
            base_pitch: (sweep.start.base_pitch + sweep.rates[0] * swept).min(limits.base_pitch.max),
            second_pitch: (sweep.start.second_pitch + sweep.rates[1] * swept).min(limits.second_pitch.max),
            third_pitch: (sweep.start.third_pitch + sweep.rates[2] * swept).min(limits.third_pitch.max),
        }
    }

    /// Radians of a sweep until every moving joint is at its limit.
    pub(super) fn full_sweep(&self, sweep: &Sweep) -> f32 {
        let limits = &self.digit.limits;
        let length = |rate: f32, start: f32, max: f32| {
            if rate > 0.0 {
                ((max - start) / rate).max(0.0)
            } else {
                0.0
            }
        };
        length(sweep.rates[0], sweep.start.base_pitch, limits.base_pitch.max)
            .max(length(
                sweep.rates[1],
                sweep.start.second_pitch,
                limits.second_pitch.max,
            ))
            .max(length(
                sweep.rates[2],
                sweep.start.third_pitch,
                limits.third_pitch.max,
            ))
    }
}
