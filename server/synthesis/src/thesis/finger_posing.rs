//! Step 2, Finger Posing: Algorithm 3 (`CALCULATEHOLDPOSEANDCONTACTS`) with Algorithm 4 (`FINDTOUCHINGFINGERPOSE`),
//! from strategy D on Algorithm 12, from strategy E on Algorithm 13, and Algorithm 5 (`GRASPINGCONTACTSEXIST`).
//!
//! A digit closes from its opened pose in steps of 5° until a touch segment crosses the object:
//! - If the second or the third link touches, the pose is taken, with one contact for every link that touches: the
//!   crossing nearest to the link's joint.
//! - If only the first link touches, the base joint stays there and the other two go on at the same pace (prose of
//!   4.4; Algorithm 4 as printed would stop). That ends when one of the outer links touches, or with the second joint
//!   at its limit; the first link's contact is kept in both cases.
//! - If nothing touches until the base joint reaches the end of its range, the next bend ratio is tried; after the
//!   last one the digit has no contact and stays opened.

use glam::{Vec2, Vec3};

use super::{
    closing_motion::{Curl, DigitMotion, PlaneSegment, REACH_SLACK, draws_one_ratio},
    wrist_placement::WristFrame,
};
use crate::{
    base::{random::AttemptStream, rejection::Rejection},
    geometry::{Segment, mesh_bvh::SegmentHit},
    model::{
        bend_ratios::{BEND_RATIOS, BendRatioChoice, allowed_ratios},
        hand::{Digit, DigitAngles},
        object::GraspObject,
        strategy::Strategy,
    },
};

/// A digit after it was closed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PosedDigit {
    /// Its joint angles; the opened pose if it has no contact.
    pub angles: DigitAngles,
    /// The bend ratio with which it touches.
    pub bend_ratio: Option<f32>,
    /// Where its links touch, from the palm outward.
    pub hits: [Option<SegmentHit>; 3],
    /// The ends of its links in the object's frame: base, second and third joint, tip.
    pub joints: [Vec3; 4],
}

impl PosedDigit {
    /// True if a link touches the object.
    pub fn touches(&self) -> bool {
        self.hits.iter().any(Option::is_some)
    }
}

/// A digit's plane in the object's frame, its yaw applied: where the closing happens.
#[derive(Clone, Copy, Debug)]
struct DigitPlane {
    base: Vec3,
    /// Along the first link at θ1 = 0.
    along: Vec3,
    /// Out of its pad at θ1 = 0.
    palmar: Vec3,
    /// The pitch axis: normal to the plane.
    normal: Vec3,
}

/// The first link's axes after a turn of the base joint.
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
    fn turned(&self, sin: f32, cos: f32) -> LinkAxes {
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

/// `FINDTOUCHINGFINGERPOSE` for one digit: draws a yaw, then tries the bend ratios that `choice` allows.
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

/// The rest of `FINDTOUCHINGFINGERPOSE`, with nothing left to chance: closes a digit at a yaw in radians with bend ratios
/// tried in turn, given as indices into [`BEND_RATIOS`].
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

/// The distance of the base joint from the object in metres, or none if no touch segment can reach the object in any
/// step of closing: the thesis stops "posing a finger early when its base joint is further away from the object than
/// its finger length" (5.2). Exact, since the touch segments' own reach is asked for, and not the bones'.
fn distance_in_reach(object: &GraspObject, motion: &DigitMotion, plane: &DigitPlane) -> Option<f32> {
    let snug = &object.bounding_box;
    // The digit stays in its plane: an object whose box is all on one side of it cannot be touched.
    let axes = snug.object_from_box.orientation;
    let half = snug.half_extents;
    let spread = (axes * Vec3::X).dot(plane.normal).abs() * half.x
        + (axes * Vec3::Y).dot(plane.normal).abs() * half.y
        + (axes * Vec3::Z).dot(plane.normal).abs() * half.z;
    if (snug.object_from_box.position - plane.base)
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

/// The ends of a digit's links in the object's frame.
fn joints(motion: &DigitMotion, plane: &DigitPlane, base_step: usize, curl: &Curl) -> [Vec3; 4] {
    let step = motion.base_steps[base_step];
    let axes = plane.turned(step.sin, step.cos);
    [
        plane.base,
        axes.point(Vec2::new(motion.first_length, 0.0)),
        axes.point(curl.third_joint),
        axes.point(curl.tip),
    ]
}

/// The closing of one digit in its plane.
struct Closing<'a> {
    object: &'a GraspObject,
    motion: &'a DigitMotion,
    plane: &'a DigitPlane,
    /// From the base joint to the object, in metres.
    distance: f32,
}

impl Closing<'_> {
    /// Closes with one bend ratio. The steps of base and outer joints at which the digit ends, and where it touches.
    fn close(&self, curls: &[Curl]) -> Option<(usize, usize, [Option<SegmentHit>; 3])> {
        for (step, (base, curl)) in self.motion.base_steps.iter().zip(curls).enumerate() {
            let axes = self.plane.turned(base.sin, base.cos);
            let first = self.hit(&axes, &self.motion.first_touch, self.motion.first_radius);
            let [second, third] = self.outer_hits(&axes, curl);
            if second.is_some() || third.is_some() {
                return Some((step, step, [first, second, third]));
            }
            if first.is_some() {
                // The base joint stays, the others go on.
                let mut last = step;
                for (index, curl) in curls.iter().enumerate().skip(step + 1) {
                    if curl.second_pitch == curls[last].second_pitch {
                        // At the limit, where only the base joint would still have moved.
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

    /// The contacts of the second and the third link.
    #[inline]
    fn outer_hits(&self, axes: &LinkAxes, curl: &Curl) -> [Option<SegmentHit>; 2] {
        [
            self.hit(axes, &curl.second_touch, curl.second_radius),
            self.hit(axes, &curl.third_touch, curl.third_radius),
        ]
    }

    /// The contact of one link whose touch segment reaches `radius` metres from the base joint.
    #[inline]
    fn hit(&self, axes: &LinkAxes, touch: &PlaneSegment, radius: f32) -> Option<SegmentHit> {
        // Everything nearer to the base joint than the object's closest point is free.
        if radius + REACH_SLACK < self.distance {
            return None;
        }
        self.object.surface.first_hit(axes.segment(touch))
    }
}

/// `GRASPINGCONTACTSEXIST` as the kind of failure: a grasp needs a contact on the thumb and one on a finger. `posed`
/// are the digits that were posed, thumb first; from strategy D on posing stops after a thumb without contact.
pub fn missing_contacts(strategy: Strategy, posed: &[PosedDigit]) -> Option<Rejection> {
    let (thumb, fingers) = posed.split_first()?;
    let finger_touches = fingers.iter().any(PosedDigit::touches);
    match (thumb.touches(), finger_touches) {
        (true, true) => None,
        (true, false) => Some(Rejection::NoFingers),
        (false, _) if strategy.stops_without_thumb() => Some(Rejection::NoThumbEarlyStop),
        (false, true) => Some(Rejection::NoThumb),
        (false, false) => Some(Rejection::NoContacts),
    }
}
