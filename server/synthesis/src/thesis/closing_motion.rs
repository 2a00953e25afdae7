//! The closing motion of a digit, tabulated (thesis 4.4).
//!
//! With its yaw fixed, a digit moves in a plane, because its three pitch axes are parallel. The forward kinematics of
//! closing are therefore two-dimensional and the same in every attempt, so they are tabulated once per search:
//! [`BaseStep`] holds the rotation of the first link, [`Curl`] the touch segments of the outer links in the plane of the
//! first. Tests compare the tables with the full forward kinematics of [`crate::model::hand::kinematics`].
//!
//! The bend angle starts at the lower limit of the base pitch: `θ1 = θ1.min + angle`,
//! `θ2 = θ2.min + ratio · angle` (the thumb's θ2 starts at -45°), `θ3 = 2/3 θ2`, each clamped to its limits.

use glam::{Vec2, Vec3};

use crate::model::{
    bend_ratios::BEND_RATIOS,
    bend_ratios::BendRatioChoice,
    hand::{
        DigitAngles,
        rig::{AngleRange, DigitRig, Rig},
    },
};

/// `angleStep` of Algorithm 4 in degrees (thesis 4.4). A larger step closes faster but penetrates the object deeper.
pub(crate) const ANGLE_STEP_DEGREES: f32 = 5.0;

/// Distance of a touch segment from the bone, as a share of the link's diameter W: 0.5 is on the skin. The thesis prints
/// the full width, which is W/2 off the skin of its Eq. 4.1.
pub(crate) const TOUCH_OFFSET_SHARE: f32 = 0.5;

/// Margin in metres by which something must be out of reach to be culled: well above rounding error.
pub(crate) const REACH_SLACK: f32 = 1e-5;

/// A line segment in a digit's plane: x along the first link, y out of its pad, in metres from the base joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneSegment {
    /// A, at the joint.
    pub start: Vec2,
    /// B, at the far end.
    pub end: Vec2,
}

impl PlaneSegment {
    /// Largest distance of its points from the base joint, in metres.
    fn radius(&self) -> f32 {
        self.start.length().max(self.end.length())
    }
}

/// One step of the base joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseStep {
    /// θ1 in radians.
    pub pitch: f32,
    /// Sine of θ1.
    pub sin: f32,
    /// Cosine of θ1.
    pub cos: f32,
}

/// One step of the second and third joints, in the frame of the first link. Lengths and positions are in metres.
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
    /// Reach of the second touch segment from the base joint.
    pub second_radius: f32,
    /// Reach of the third touch segment from the base joint.
    pub third_radius: f32,
    /// Position of the third joint.
    pub third_joint: Vec2,
    /// Position of the tip.
    pub tip: Vec2,
}

/// The tabulated closing motion of one digit.
#[derive(Clone, Debug, PartialEq)]
pub struct DigitMotion {
    /// The base joint in the wrist frame, in metres.
    pub base: Vec3,
    /// x axis of the extended digit's base frame, in the wrist frame: the pitch axis.
    pub axis_x: Vec3,
    /// y axis of that frame: along the link.
    pub axis_y: Vec3,
    /// z axis of that frame: out of the pad, the yaw axis.
    pub axis_z: Vec3,
    /// Range of ψ1.
    pub base_yaw: AngleRange,
    /// Sign of a positive yaw about +z.
    pub yaw_sign: f32,
    /// Length of the first link in metres.
    pub first_length: f32,
    /// Touch segment of the first link.
    pub first_touch: PlaneSegment,
    /// Reach of the first touch segment from the base joint, in metres.
    pub first_radius: f32,
    /// Largest reach of any touch segment from the base joint, in metres.
    pub reach: f32,
    /// The steps of the base joint, from its lower limit to the last step below its upper limit.
    pub base_steps: Vec<BaseStep>,
    /// The steps of the outer joints for each bend ratio: at least as many as `base_steps`, and enough for the second
    /// joint to reach its limit, where the last one is.
    pub curls: [Vec<Curl>; 3],
}

impl DigitMotion {
    /// Tabulates a digit's closing motion.
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

    /// `FingerOpenedPose`: the sampled yaw in radians, with every pitch at its lower limit.
    pub fn opened(&self, base_yaw: f32) -> DigitAngles {
        self.angles(base_yaw, 0, 0, 0)
    }

    /// The joint angles for a yaw in radians, a base step, a bend ratio (its index) and a step of the outer joints.
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

/// True if one allowed ratio is drawn at random instead of trying all in turn (Algorithm 13, line 5).
pub(crate) fn draws_one_ratio(choice: BendRatioChoice) -> bool {
    matches!(
        choice,
        BendRatioChoice::OneRandom | BendRatioChoice::OneRandomFingersWithoutLow
    )
}

/// Number of steps from the lower end of a range that stay below its upper end, and at least 1.
fn count_steps(range: AngleRange, step: f32) -> usize {
    // Subtracting a thousandth of a step keeps rounding from adding one to a range of whole steps.
    let steps = ((range.max - range.min) / step - 1e-3).ceil();
    (steps.max(1.0)) as usize
}

/// The touch segment of a link from `joint` in the unit direction `along`: from A = (0, 0, W/2) to B = (0, L, W/2) in the
/// link's frame.
fn touch_segment(joint: Vec2, along: Vec2, length: f32, diameter: f32) -> PlaneSegment {
    let start = joint + along.perp() * (TOUCH_OFFSET_SHARE * diameter);
    PlaneSegment {
        start,
        end: start + along * length,
    }
}
