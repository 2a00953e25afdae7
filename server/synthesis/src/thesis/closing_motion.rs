//! The closing motion of a digit, tabulated (thesis 4.4).
//!
//! Once its yaw is fixed, a digit moves in a plane: all three pitches turn about the same axis. What closing needs of
//! forward kinematics is therefore two-dimensional and the same in every attempt, so it is computed once a search:
//! the touch segments of the outer links for every step of the bend angle, in the plane of the first link ([`Curl`]),
//! and the turn of the first link itself ([`BaseStep`]). The slow forward kinematics of [`crate::model::hand::kinematics`]
//! are the oracle of these tables.
//!
//! The bend angle counts from the lower end of the base pitch's range: `θ1 = θ1.min + angle`,
//! `θ2 = θ2.min + ratio · angle` (the thumb's starts at -45°), `θ3 = 2/3 θ2`, each kept inside its limits.

use glam::{Vec2, Vec3};

use crate::model::{
    bend_ratios::BEND_RATIOS,
    bend_ratios::BendRatioChoice,
    hand::{
        DigitAngles,
        rig::{AngleRange, DigitRig, Rig},
    },
};

/// `angleStep` of Algorithm 4 in degrees (thesis 4.4). A larger step closes faster and sinks deeper into the object.
pub const ANGLE_STEP_DEGREES: f32 = 5.0;

/// The touch segments lie this share of a link's diameter W from the bone: on the skin. The thesis prints the whole
/// width, which floats half a finger's width off the skin of its Eq. 4.1.
pub const TOUCH_OFFSET_SHARE: f32 = 0.5;

/// Room in metres by which something must be out of reach before it is culled: far more than rounding.
pub const REACH_SLACK: f32 = 1e-5;

/// A line segment in a digit's plane: x along the first link, y out of its pad, in metres from the base joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneSegment {
    /// A: at the joint.
    pub start: Vec2,
    /// B: at the far end.
    pub end: Vec2,
}

impl PlaneSegment {
    /// The largest distance of its points from the base joint.
    fn radius(&self) -> f32 {
        self.start.length().max(self.end.length())
    }
}

/// A step of the base joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseStep {
    /// θ1 in radians.
    pub pitch: f32,
    /// Sine of θ1.
    pub sin: f32,
    /// Cosine of θ1.
    pub cos: f32,
}

/// A step of the second and third joint, seen from the first link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curl {
    /// θ2 in radians.
    pub second_pitch: f32,
    /// θ3 in radians.
    pub third_pitch: f32,
    /// Touch segment of the second link.
    pub second_touch: PlaneSegment,
    /// Touch segment of the third link.
    pub third_touch: PlaneSegment,
    /// How far the second touch segment reaches from the base joint, in metres.
    pub second_radius: f32,
    /// How far the third touch segment reaches from the base joint, in metres.
    pub third_radius: f32,
    /// Where the third joint is.
    pub third_joint: Vec2,
    /// Where the tip is.
    pub tip: Vec2,
}

/// The closing of one digit.
#[derive(Clone, Debug, PartialEq)]
pub struct DigitMotion {
    /// The base joint in the wrist frame, in metres.
    pub base: Vec3,
    /// Axes of the stretched digit's base frame in the wrist frame: x, the pitch axis, …
    pub axis_x: Vec3,
    /// … y, along the link, …
    pub axis_y: Vec3,
    /// … and z, out of the pad, about which the digit yaws.
    pub axis_z: Vec3,
    /// Range of ψ1.
    pub base_yaw: AngleRange,
    /// Sense of a positive yaw about +z.
    pub yaw_sign: f32,
    /// Length of the first link in metres.
    pub first_length: f32,
    /// Touch segment of the first link.
    pub first_touch: PlaneSegment,
    /// How far the first touch segment reaches from the base joint, in metres.
    pub first_radius: f32,
    /// How far any touch segment reaches from the base joint, in metres.
    pub reach: f32,
    /// The steps of the base joint, from the lower end of its range to the last one below its upper end.
    pub base_steps: Vec<BaseStep>,
    /// For every bend ratio, the steps of the outer joints: at least as many as the base joint has, and as many as
    /// the second joint needs to arrive at its limit. The last is at the limit.
    pub curls: [Vec<Curl>; 3],
}

impl DigitMotion {
    /// Tabulates a digit's closing.
    pub fn new(digit: &DigitRig) -> Self {
        let step = ANGLE_STEP_DEGREES.to_radians();
        let limits = &digit.limits;
        let base_steps: Vec<BaseStep> = (0..count_steps(limits.base_pitch, step))
            .map(|index| {
                let pitch = limits.base_pitch.min + index as f32 * step;
                let (sin, cos) = pitch.sin_cos();
                BaseStep { pitch, sin, cos }
            })
            .collect();
        let curls = BEND_RATIOS.map(|ratio| {
            let below_limit = count_steps(limits.second_pitch, ratio * step);
            (0..base_steps.len().max(below_limit + 1))
                .map(|index| {
                    let second_pitch = if index < below_limit {
                        limits.second_pitch.min + ratio * (index as f32 * step)
                    } else {
                        limits.second_pitch.max
                    };
                    Curl::new(digit, second_pitch)
                })
                .collect()
        });
        let first_touch = touch_segment(Vec2::ZERO, Vec2::X, digit.lengths[0], digit.diameters[0]);
        let outer_reach = curls
            .iter()
            .flatten()
            .map(|curl: &Curl| curl.second_radius.max(curl.third_radius))
            .fold(0.0, f32::max);
        let axes = digit.wrist_from_base.orientation;
        Self {
            base: digit.wrist_from_base.position,
            axis_x: axes * Vec3::X,
            axis_y: axes * Vec3::Y,
            axis_z: axes * Vec3::Z,
            base_yaw: limits.base_yaw,
            yaw_sign: digit.yaw_sign,
            first_length: digit.lengths[0],
            first_touch,
            first_radius: first_touch.radius(),
            reach: first_touch.radius().max(outer_reach),
            base_steps,
            curls,
        }
    }

    /// `FingerOpenedPose`: the sampled yaw with every pitch at the lower end of its range.
    pub fn opened(&self, base_yaw: f32) -> DigitAngles {
        self.angles(base_yaw, 0, 0, 0)
    }

    /// The joint angles at a step of the base joint and one of the outer joints for a bend ratio.
    pub fn angles(&self, base_yaw: f32, base_step: usize, ratio: usize, curl: usize) -> DigitAngles {
        let curl = &self.curls[ratio][curl];
        DigitAngles {
            base_yaw,
            base_pitch: self.base_steps[base_step].pitch,
            second_pitch: curl.second_pitch,
            third_pitch: curl.third_pitch,
        }
    }
}

impl Curl {
    fn new(digit: &DigitRig, second_pitch: f32) -> Self {
        let third = digit.limits.third_pitch;
        let third_pitch = (DigitAngles::THIRD_PITCH_SHARE * second_pitch)
            .max(third.min)
            .min(third.max);
        let [first_length, second_length, third_length] = digit.lengths;
        let second_joint = Vec2::new(first_length, 0.0);
        let second_along = Vec2::from_angle(second_pitch);
        let third_joint = second_joint + second_along * second_length;
        let third_along = Vec2::from_angle(second_pitch + third_pitch);
        let second_touch = touch_segment(second_joint, second_along, second_length, digit.diameters[1]);
        let third_touch = touch_segment(third_joint, third_along, third_length, digit.diameters[2]);
        Self {
            second_pitch,
            third_pitch,
            second_touch,
            third_touch,
            second_radius: second_touch.radius(),
            third_radius: third_touch.radius(),
            third_joint,
            tip: third_joint + third_along * third_length,
        }
    }
}

/// The closing motions of a hand's digits, thumb first.
pub fn hand_motion(rig: &Rig) -> [DigitMotion; 5] {
    std::array::from_fn(|digit| DigitMotion::new(&rig.digits[digit]))
}

/// True if one of the allowed ratios is drawn, instead of all being tried in turn (Algorithm 13, line 5).
pub fn draws_one_ratio(choice: BendRatioChoice) -> bool {
    matches!(
        choice,
        BendRatioChoice::OneRandom | BendRatioChoice::OneRandomFingersWithoutLow
    )
}

/// How many steps from the lower end of a range stay below its upper end; at least 1.
fn count_steps(range: AngleRange, step: f32) -> usize {
    // A thousandth of a step less, so that a range of whole steps has as many steps as it should in spite of rounding.
    let steps = ((range.max - range.min) / step - 1e-3).ceil();
    (steps.max(1.0)) as usize
}

/// The touch segment of a link that starts at `joint` and runs `along` (a unit vector): from A = (0, 0, W/2) to
/// B = (0, L, W/2) in the link's frame.
fn touch_segment(joint: Vec2, along: Vec2, length: f32, diameter: f32) -> PlaneSegment {
    let start = joint + along.perp() * (TOUCH_OFFSET_SHARE * diameter);
    PlaneSegment {
        start,
        end: start + along * length,
    }
}
