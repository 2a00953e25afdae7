//! How a hand is held while it closes, and how idle fingers rest.

use glam::{Quat, Vec3};

use super::{closing::ClosedDigit, flexing::Flexing, grip::Grip};
use crate::{
    base::{pose::Pose, random::AttemptStream},
    model::{
        bend_ratios::{BEND_RATIOS, BendRatioChoice, allowed_ratios},
        hand::{
            Digit,
            rig::{AngleRange, Rig},
        },
    },
};

/// Flexion in radians, of all three joints together, with which a hand at rest holds its fingers: about 25° for the
/// first two and two thirds of it for the last.
const RESTING_FLEXION: f32 = 1.15;

/// The least and the most of it beside digits that are less or more bent.
pub(super) const LEAST_RESTING_FLEXION: f32 = 0.5 * RESTING_FLEXION;
const MOST_RESTING_FLEXION: f32 = 1.5 * RESTING_FLEXION;

/// The same of fingers that are tucked away: about nine tenths of their way into the palm, which stops them before.
pub(super) const TUCKED_FLEXION: f32 = 3.8;

/// What an attempt draws of the hand: how the thumb stands, how far the fingers are spread, how the digits bend, and
/// which of them close on the object. The fingers share a spread and a bend ratio, as those of a person do; drawn one by
/// one, half of the hands have fingers that cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandShape {
    /// Where in its range the thumb's yaw is, from 0 to 1.
    pub thumb_yaw: f32,
    /// 0: fingers beside each other or as close as they go, 1: as far apart as they go.
    pub spread: f32,
    /// Degrees of the second joint for a degree of the first, of the thumb and of the fingers.
    pub bend_ratios: [f32; 2],
    /// Which digits close, thumb first; the others rest.
    pub closing: [bool; 5],
    /// How far thumb and fingers are shaped to the object before they close on it: the share of their way from opened to
    /// closed, from 0 to 1. A hand that is shaped already does not meet with what only an opened one would.
    pub preshape: [f32; 2],
    /// Are fingers that do not close tucked into the palm, instead of resting beside those that do?
    pub tucks: bool,
}

impl HandShape {
    /// A shape as the strategies of chapter 5 draw it: every digit closes.
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
            closing: [true; 5],
            preshape: [0.0; 2],
            tucks: false,
        }
    }

    /// The shape that a known grip was closed from, as far as its hand shows that: not how it was shaped to the object
    /// before.
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
            closing: grip.bend_ratios.map(|ratio| ratio.is_some()),
            preshape: [0.0; 2],
            tucks: false,
        }
    }

    /// Where in its range a digit's yaw is: spread fingers fan out from between middle and ring finger.
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

    /// The flexion of a digit that touches nothing: that of the digits beside it that touch, at most a relaxed hand's and a
    /// half more; that of a relaxed hand if none does. A digit that is tucked away bends as far as it can.
    pub(super) fn resting_flexion(&self, closed: &[ClosedDigit; 5], digit: usize) -> f32 {
        if self.tucks && !self.closing[digit] {
            return TUCKED_FLEXION;
        }
        let neighbours = [digit.checked_sub(1).filter(|&other| other > 0), Some(digit + 1)];
        let mut sum = 0.0;
        let mut count = 0.0;
        for neighbour in neighbours
            .into_iter()
            .flatten()
            .filter_map(|other| closed.get(other))
        {
            if neighbour.touches_object() {
                sum += neighbour.flexion();
                count += 1.0;
            }
        }
        if count == 0.0 {
            RESTING_FLEXION
        } else {
            (sum / count).clamp(LEAST_RESTING_FLEXION, MOST_RESTING_FLEXION)
        }
    }

    /// How a digit of a hand of this shape bends.
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

/// How far beside a proposal another one's wrist lies at most, in metres and radians, …
const PERTURBATION: [f32; 2] = [0.006, 0.12];

/// … and how much the thumb's yaw and the fingers' spread differ, as shares of their ranges.
const SHAPE_PERTURBATION: f32 = 0.1;

/// A hand to be closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proposal {
    /// The wrist frame in the object's.
    pub object_from_wrist: Pose,
    /// How the hand is held.
    pub shape: HandShape,
    /// How far the hand goes along its +z, in metres, until the palm touches; 0 if it stays where it is. A palm that does
    /// not touch by then is no grip.
    pub advance: f32,
}

impl Proposal {
    /// One a little beside, of a hand that is a little different.
    #[must_use]
    pub fn perturbed(&self, stream: &mut AttemptStream) -> Self {
        self.perturbed_about(self.object_from_wrist.position, PERTURBATION, stream)
    }

    /// The same, turned about a pivot in the object's frame, and shifted, by other limits than those: metres, radians.
    #[must_use]
    pub fn perturbed_about(&self, pivot: Vec3, [shift, turn]: [f32; 2], stream: &mut AttemptStream) -> Self {
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
