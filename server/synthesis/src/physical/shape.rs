//! The shape a hand closes from, how its joints bend together, how idle fingers rest, and proposals of where to close.

use glam::{Quat, Vec3};

use super::{closing::ClosedDigit, grip::Grip};
use crate::{
    base::{pose::Pose, random::AttemptStream},
    model::{
        hand::{
            Digit, DigitAngles,
            rig::{AngleRange, DigitRig, Rig},
        },
        strategy::{BEND_RATIOS, BendRatioChoice, allowed_ratios},
    },
};

/// Total flexion of a relaxed finger in radians: about 25° in each of the first two joints and two thirds of that in the last.
const RESTING_FLEXION: f32 = 1.15;

/// Bounds of the total flexion of an idle finger next to straighter or more bent ones, in radians.
const MIN_RESTING_FLEXION: f32 = 0.5 * RESTING_FLEXION;
const MAX_RESTING_FLEXION: f32 = 1.5 * RESTING_FLEXION;

/// Total flexion aimed at by tucked fingers, in radians: about nine tenths of full closure.
pub(super) const TUCKED_FLEXION: f32 = 3.8;

/// The shape an attempt draws: thumb yaw, finger spread, bend ratios, and which digits close. Fingers share one
/// spread and one bend ratio; drawn one by one, they would often cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandShape {
    /// The thumb's yaw as a share of its range, from 0 to 1.
    pub thumb_yaw: f32,
    /// Spread of the fingers, from 0 (side by side) to 1 (as far apart as they go).
    pub spread: f32,
    /// Degrees of the second joint per degree of the first: for the thumb, and for the fingers.
    pub bend_ratios: [f32; 2],
    /// Which digits close, thumb first; the others rest. Fingers that close without the thumb are a hook, in which the
    /// load has to hang.
    pub closing: [bool; 5],
    /// Fraction of full closure, from 0 to 1, that thumb and fingers start from. A preshaped hand avoids obstacles that only
    /// an opened one would meet.
    pub preshape: [f32; 2],
    /// Whether fingers that do not close are tucked into the palm instead of resting next to those that do.
    pub tucks: bool,
}

impl HandShape {
    /// All digits close from the opened pose, with bend ratios of 1.
    pub(super) const ALL_CLOSE: Self = Self {
        thumb_yaw: 0.5,
        spread: 0.5,
        bend_ratios: [1.0; 2],
        closing: [true; 5],
        preshape: [0.0; 2],
        tucks: false,
    };

    /// A shape drawn as the strategies of chapter 5 do: every digit closes.
    pub fn draw(choice: BendRatioChoice, stream: &mut AttemptStream) -> Self {
        let mut draw_ratio = |digit: Digit| {
            let allowed = allowed_ratios(choice, digit.index());
            BEND_RATIOS[allowed[stream.below(allowed.len())]]
        };
        let bend_ratios = [draw_ratio(Digit::Thumb), draw_ratio(Digit::Index)];
        Self {
            thumb_yaw: stream.unit(),
            spread: stream.unit(),
            bend_ratios,
            ..Self::ALL_CLOSE
        }
    }

    /// The shape a known grip was closed from, as far as its pose shows; the preshape is lost.
    pub fn of_grip(rig: &Rig, grip: &Grip) -> Self {
        let yaw_share = |digit: Digit| {
            let AngleRange { min, max } = rig.digit(digit).limits.base_yaw;
            (grip.pose.digits[digit.index()].base_yaw - min) / (max - min).max(f32::MIN_POSITIVE)
        };
        let [thumb, fingers @ ..] = grip.bend_ratios;
        let of_any = |ratios: &[Option<f32>]| ratios.iter().flatten().copied().next();
        Self {
            thumb_yaw: yaw_share(Digit::Thumb),
            spread: (1.0 - 2.0 * yaw_share(Digit::Index)).clamp(0.0, 1.0),
            bend_ratios: [of_any(&[thumb]), of_any(&fingers)].map(|ratio| ratio.unwrap_or(BEND_RATIOS[1])),
            closing: grip.holding_digits(),
            ..Self::ALL_CLOSE
        }
    }

    /// A digit's yaw as a share of its range. Spread fingers fan out about the gap between middle and ring finger.
    fn yaw_share(&self, digit: Digit) -> f32 {
        let fan = match digit {
            Digit::Thumb => return self.thumb_yaw,
            Digit::Index => -0.5,
            Digit::Middle => -1.0 / 6.0,
            Digit::Ring => 1.0 / 6.0,
            Digit::Little => 0.5,
        };
        0.5 + fan * self.spread
    }

    /// Total flexion in radians of a digit that touches nothing: the mean of its touching neighbours, within bounds,
    /// or that of a relaxed finger if none touches. A tucked digit bends as far as it can.
    pub(super) fn resting_flexion(&self, closed: &[ClosedDigit; 5], digit: usize) -> f32 {
        if self.tucks && !self.closing[digit] {
            return TUCKED_FLEXION;
        }
        let neighbours = [digit.checked_sub(1).filter(|&other| other > 0), Some(digit + 1)];
        let others = neighbours
            .into_iter()
            .flatten()
            .filter_map(|other| closed.get(other));
        let (sum, count) = others
            .filter(|other| other.touches_object())
            .fold((0.0, 0.0), |(sum, count), other| {
                (sum + other.flexion(), count + 1.0)
            });
        if count == 0.0 {
            RESTING_FLEXION
        } else {
            (sum / count).clamp(MIN_RESTING_FLEXION, MAX_RESTING_FLEXION)
        }
    }

    /// True if the load has to hang in the fingers.
    pub(crate) fn is_hook(&self) -> bool {
        !self.closing[Digit::Thumb.index()]
    }

    /// How a digit of this shape bends.
    pub fn flexing<'a>(&self, rig: &'a Rig, digit: Digit) -> Flexing<'a> {
        let digit_rig = rig.digit(digit);
        let AngleRange { min, max } = digit_rig.limits.base_yaw;
        Flexing {
            digit: digit_rig,
            base_yaw: min + (max - min) * self.yaw_share(digit),
            bend_ratio: self.bend_ratios[usize::from(digit != Digit::Thumb)],
        }
    }
}

/// Largest shift (metres, per axis) and turn (radians) of a perturbed wrist, …
const PERTURBATION: [f32; 2] = [0.006, 0.12];

/// … and largest change of the thumb's yaw and the fingers' spread, as shares of their ranges.
const SHAPE_PERTURBATION: f32 = 0.1;

/// A hand pose to close from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proposal {
    /// Wrist pose in the object's frame.
    pub object_from_wrist: Pose,
    /// The shape the hand closes from.
    pub shape: HandShape,
    /// Largest distance, in metres, that the hand advances along its +z until the palm touches; 0 if it stays put. A
    /// palm that does not touch within it is rejected.
    pub advance: f32,
}

impl Proposal {
    /// A proposal nearby, with a slightly different shape.
    #[must_use]
    pub fn perturbed(&self, stream: &mut AttemptStream) -> Self {
        self.perturbed_about(self.object_from_wrist.position, PERTURBATION, stream)
    }

    /// [`Proposal::perturbed`], turned about `pivot` (object frame) and shifted, with given limits in metres and radians.
    #[must_use]
    pub(crate) fn perturbed_about(
        &self,
        pivot: Vec3,
        [shift, turn]: [f32; 2],
        stream: &mut AttemptStream,
    ) -> Self {
        let Pose {
            position,
            orientation,
        } = self.object_from_wrist;
        let axis = stream.in_cube().normalize_or(Vec3::X);
        let turn = Quat::from_axis_angle(axis, stream.between(-turn, turn));
        let position = pivot + turn * (position - pivot) + stream.in_cube() * shift;
        let mut differing =
            |share: f32| (share + stream.between(-SHAPE_PERTURBATION, SHAPE_PERTURBATION)).clamp(0.0, 1.0);
        Self {
            object_from_wrist: Pose::new(position, (turn * orientation).normalize()),
            shape: HandShape {
                thumb_yaw: differing(self.shape.thumb_yaw),
                spread: differing(self.shape.spread),
                ..self.shape
            },
            ..*self
        }
    }
}

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
    fn sweep(&self) -> Sweep {
        Sweep {
            start: self.opened(),
            rates: self.rates(),
        }
    }

    /// Radians of the joints per radian of a sweep.
    pub(super) fn rates(&self) -> [f32; 3] {
        let ratio = self.bend_ratio;
        [1.0, ratio, ratio * DigitAngles::THIRD_PITCH_SHARE]
    }

    /// The joint angles after `swept` radians of a sweep, clamped to the limits.
    pub(super) fn angles_at(&self, sweep: &Sweep, swept: f32) -> DigitAngles {
        let (start, max) = (sweep.start.pitches(), self.digit.limits.max_pitches());
        let at = |joint: usize| (start[joint] + sweep.rates[joint] * swept).min(max[joint]);
        DigitAngles::from_array([self.base_yaw, at(0), at(1), at(2)])
    }

    /// Radians of a sweep until every moving joint is at its limit.
    pub(super) fn full_sweep(&self, sweep: &Sweep) -> f32 {
        let (start, max) = (sweep.start.pitches(), self.digit.limits.max_pitches());
        let length = |joint: usize| {
            let rate = sweep.rates[joint];
            if rate > 0.0 {
                ((max[joint] - start[joint]) / rate).max(0.0)
            } else {
                0.0
            }
        };
        length(0).max(length(1)).max(length(2))
    }
}
