//! Step 2, Finger Posing: Algorithms 3 (`CALCULATEHOLDPOSEANDCONTACTS`), 4 (`FINDTOUCHINGFINGERPOSE`) and 5
//! (`GRASPINGCONTACTSEXIST`), with Algorithm 12 from strategy D on and Algorithm 13 from strategy E on.
//!
//! A digit closes from its opened pose in steps of 5° until a touch segment crosses the object:
//! - If the second or third link touches, the digit stops. Each touching link has one contact: the crossing nearest to
//!   the link's joint.
//! - If only the first link touches, the base joint stops and the other two continue at the same pace (prose of 4.4;
//!   Algorithm 4 as printed would stop) until an outer link touches or the second joint reaches its limit. The first
//!   link's contact is kept in either case.
//! - If nothing touches before the base joint reaches its limit, the next bend ratio is tried. After the last one, the
//!   digit has no contact and stays opened.
//!
//! With its yaw fixed, a digit moves in a plane, so its closing is tabulated once per search. The bend angle starts at the lower limit
//! of the base pitch: `θ1 = θ1.min + angle`, `θ2 = θ2.min + ratio · angle`, `θ3 = 2/3 θ2`, each clamped to its limits.

use glam::{Vec2, Vec3};

use super::wrist_placement::WristFrame;
use crate::{
    base::{random::AttemptStream, rejection::Rejection},
    geometry::{Segment, mesh_bvh::MeshPoint},
    model::{
        hand::{
            Digit, DigitAngles,
            rig::{AngleRange, DigitRig, Rig},
        },
        object::GraspObject,
        strategy::{BEND_RATIOS, BendRatioChoice, Strategy, allowed_ratios},
    },
};

/// A digit after closing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PosedDigit {
    /// Joint angles; the opened pose if it has no contact.
    pub angles: DigitAngles,
    /// The bend ratio it closed with; `None` without contact.
    pub bend_ratio: Option<f32>,
    /// Contact of each link, from proximal to distal.
    pub hits: [Option<MeshPoint>; 3],
    /// Ends of its links in the object's frame, in metres: base, second and third joint, tip.
    pub joints: [Vec3; 4],
}

impl PosedDigit {
    /// True if a link touches the object.
    pub fn touches(&self) -> bool {
        self.hits.iter().any(Option::is_some)
    }
}

/// The plane in which a digit closes once its yaw is set, in the object's frame.
#[derive(Clone, Copy, Debug)]
struct DigitPlane {
    base: Vec3,
    /// Direction of the first link at θ1 = 0.
    along: Vec3,
    /// Direction out of its pad at θ1 = 0.
    palmar: Vec3,
    /// The pitch axis: normal to the plane.
    normal: Vec3,
}

/// The first link's axes at a pitch of the base joint.
#[derive(Clone, Copy, Debug)]
struct LinkAxes {
    base: Vec3,
    along: Vec3,
    palmar: Vec3,
}

impl DigitPlane {
    fn new(motion: &DigitMotion, wrist: &WristFrame, base_yaw: f32) -> Self {
        let (sin, cos) = (motion.yaw_sign * base_yaw).sin_cos();
        Self {
            base: wrist.transform_point(motion.base),
            along: wrist.rotation * (motion.axis_y * cos - motion.axis_x * sin),
            palmar: wrist.rotation * motion.axis_z,
            normal: wrist.rotation * (motion.axis_x * cos + motion.axis_y * sin),
        }
    }

    #[inline]
    fn pitched(&self, sin: f32, cos: f32) -> LinkAxes {
        LinkAxes {
            base: self.base,
            along: self.along * cos + self.palmar * sin,
            palmar: self.palmar * cos - self.along * sin,
        }
    }
}

impl LinkAxes {
    #[inline]
    fn point(&self, point: Vec2) -> Vec3 {
        self.base + self.along * point.x + self.palmar * point.y
    }

    #[inline]
    fn segment(&self, segment: &PlaneSegment) -> Segment {
        Segment::new(self.point(segment.start), self.point(segment.end))
    }
}

/// `FINDTOUCHINGFINGERPOSE` for one digit: draws a yaw, then closes with the bend ratios that `choice` allows.
pub fn find_touching_finger_pose(
    object: &GraspObject,
    wrist: &WristFrame,
    motion: &DigitMotion,
    digit: Digit,
    choice: BendRatioChoice,
    stream: &mut AttemptStream,
) -> PosedDigit {
    let base_yaw = stream.between(motion.base_yaw.min, motion.base_yaw.max);
    let ratios = allowed_ratios(choice, digit.index());
    let ratios = if draws_one_ratio(choice) {
        let drawn = stream.below(ratios.len());
        &ratios[drawn..=drawn]
    } else {
        ratios
    };
    close_digit(object, wrist, motion, base_yaw, ratios)
}

/// The deterministic part of `FINDTOUCHINGFINGERPOSE`: closes a digit at a yaw in radians, trying the bend ratios in turn.
/// `ratios` are indices into [`BEND_RATIOS`].
pub fn close_digit(
    object: &GraspObject,
    wrist: &WristFrame,
    motion: &DigitMotion,
    base_yaw: f32,
    ratios: &[usize],
) -> PosedDigit {
    let plane = DigitPlane::new(motion, wrist, base_yaw);
    if let Some(distance) = distance_in_reach(object, motion, &plane) {
        let closing = Closing {
            object,
            motion,
            plane: &plane,
            distance,
        };
        for &ratio in ratios {
            if let Some((base_step, curl, hits)) = closing.close(&motion.curls[ratio]) {
                return PosedDigit {
                    angles: motion.angles(base_yaw, base_step, ratio, curl),
                    bend_ratio: Some(BEND_RATIOS[ratio]),
                    hits,
                    joints: joints(motion, &plane, base_step, &motion.curls[ratio][curl]),
                };
            }
        }
    }
    PosedDigit {
        angles: motion.opened(base_yaw),
        bend_ratio: None,
        hits: [None; 3],
        joints: joints(motion, &plane, 0, &motion.curls[0][0]),
    }
}

/// Distance from the base joint to the object in metres, or `None` if no touch segment reaches the object at any step: the
/// thesis stops "posing a finger early when its base joint is further away from the object than its finger length"
/// (5.2). Uses the reach of the touch segments rather than the bones, so it never skips a digit that would touch.
fn distance_in_reach(object: &GraspObject, motion: &DigitMotion, plane: &DigitPlane) -> Option<f32> {
    let bounds = &object.bounding_box;
    // The digit stays in its plane, so it cannot touch an object whose box lies entirely on one side of it.
    let axes = bounds.object_from_box.orientation;
    let half = bounds.half_extents;
    let spread = (axes * Vec3::X).dot(plane.normal).abs() * half.x
        + (axes * Vec3::Y).dot(plane.normal).abs() * half.y
        + (axes * Vec3::Z).dot(plane.normal).abs() * half.z;
    if (bounds.object_from_box.position - plane.base)
        .dot(plane.normal)
        .abs()
        > spread + REACH_SLACK
    {
        return None;
    }
    object
        .surface
        .closest_point_within(plane.base, motion.reach + REACH_SLACK)
        .map(|closest| closest.distance)
}

/// Ends of a digit's links in the object's frame.
fn joints(motion: &DigitMotion, plane: &DigitPlane, base_step: usize, curl: &Curl) -> [Vec3; 4] {
    let step = motion.base_steps[base_step];
    let axes = plane.pitched(step.sin, step.cos);
    [
        plane.base,
        axes.point(Vec2::new(motion.first_length, 0.0)),
        axes.point(curl.third_joint),
        axes.point(curl.tip),
    ]
}

/// One digit closing in its plane.
struct Closing<'a> {
    object: &'a GraspObject,
    motion: &'a DigitMotion,
    plane: &'a DigitPlane,
    /// Distance from the base joint to the object, in metres.
    distance: f32,
}

impl Closing<'_> {
    /// Closes with one bend ratio. Returns the final steps of the base joint and the outer joints, and the contacts.
    fn close(&self, curls: &[Curl]) -> Option<(usize, usize, [Option<MeshPoint>; 3])> {
        for (step, (base, curl)) in self.motion.base_steps.iter().zip(curls).enumerate() {
            let axes = self.plane.pitched(base.sin, base.cos);
            let first = self.hit(&axes, &self.motion.first_touch);
            let [second, third] = self.outer_hits(&axes, curl);
            if second.is_some() || third.is_some() {
                return Some((step, step, [first, second, third]));
            }
            if first.is_some() {
                // The base joint stops, the outer joints continue.
                let mut last = step;
                for (index, curl) in curls.iter().enumerate().skip(step + 1) {
                    if curl.second_pitch == curls[last].second_pitch {
                        // The second joint is at its limit; the remaining steps would move only the base joint.
                        break;
                    }
                    last = index;
                    let [second, third] = self.outer_hits(&axes, curl);
                    if second.is_some() || third.is_some() {
                        return Some((step, index, [first, second, third]));
                    }
                }
                return Some((step, last, [first, None, None]));
            }
        }
        None
    }

    /// Contacts of the second and third links.
    #[inline]
    fn outer_hits(&self, axes: &LinkAxes, curl: &Curl) -> [Option<MeshPoint>; 2] {
        [
            self.hit(axes, &curl.second_touch),
            self.hit(axes, &curl.third_touch),
        ]
    }

    /// Contact of one link.
    #[inline]
    fn hit(&self, axes: &LinkAxes, touch: &PlaneSegment) -> Option<MeshPoint> {
        // The object has no point nearer to the base joint than `distance`.
        if touch.radius + REACH_SLACK < self.distance {
            return None;
        }
        self.object.surface.first_hit(axes.segment(touch))
    }
}

/// `GRASPINGCONTACTSEXIST`, negated: a grasp needs a contact on the thumb and one on a finger; returns which is missing.
/// `posed` are the posed digits, thumb first. From strategy D on, that is only the thumb if it misses.
pub fn missing_contacts(strategy: Strategy, posed: &[PosedDigit]) -> Option<Rejection> {
    let (thumb, fingers) = posed.split_first()?;
    let finger_touches = fingers.iter().any(PosedDigit::touches);
    match (thumb.touches(), finger_touches) {
        (true, true) => None,
        (true, false) => Some(Rejection::NoFingers),
        (false, _) if strategy >= Strategy::D => Some(Rejection::NoThumbEarlyStop),
        (false, true) => Some(Rejection::NoThumb),
        (false, false) => Some(Rejection::NoContacts),
    }
}

/// `angleStep` of Algorithm 4 in degrees (thesis 4.4). A larger step closes faster but penetrates the object deeper.
const ANGLE_STEP_DEGREES: f32 = 5.0;

/// Distance of a touch segment from the bone, as a share of the link's diameter W: 0.5 is on the skin.
const TOUCH_OFFSET_SHARE: f32 = 0.5;

/// Margin in metres by which something must be out of reach to be culled: well above rounding error.
const REACH_SLACK: f32 = 1e-5;

/// A line segment in a digit's plane: x along the first link, y out of its pad, in metres from the base joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneSegment {
    /// A, at the joint.
    pub start: Vec2,
    /// B, at the far end.
    pub end: Vec2,
    /// Largest distance of its points from the base joint, in metres.
    pub radius: f32,
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
            .map(|curl: &Curl| curl.second_touch.radius.max(curl.third_touch.radius))
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
            reach: first_touch.radius.max(outer_reach),
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
        Self {
            second_pitch,
            third_pitch,
            second_touch: touch_segment(second_joint, second_along, second_length, digit.diameters[1]),
            third_touch: touch_segment(third_joint, third_along, third_length, digit.diameters[2]),
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
fn draws_one_ratio(choice: BendRatioChoice) -> bool {
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

/// The touch segment of a link from `joint` in the unit direction `along`: from (0, 0, W/2) to (0, L, W/2) in its frame.
fn touch_segment(joint: Vec2, along: Vec2, length: f32, diameter: f32) -> PlaneSegment {
    let start = joint + along.perp() * (TOUCH_OFFSET_SHARE * diameter);
    let end = start + along * length;
    PlaneSegment {
        start,
        end,
        radius: start.length().max(end.length()),
    }
}
