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

/// A digit after closing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PosedDigit {
    /// Joint angles; the opened pose if it has no contact.
    pub angles: DigitAngles,
    /// The bend ratio it closed with; `None` without contact.
    pub bend_ratio: Option<f32>,
    /// Contact of each link, from proximal to distal.
    pub hits: [Option<SegmentHit>; 3],
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
    fn close(&self, curls: &[Curl]) -> Option<(usize, usize, [Option<SegmentHit>; 3])> {
        for (step, (base, curl)) in self.motion.base_steps.iter().zip(curls).enumerate() {
            let axes = self.plane.pitched(base.sin, base.cos);
            let first = self.hit(&axes, &self.motion.first_touch, self.motion.first_radius);
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
    fn outer_hits(&self, axes: &LinkAxes, curl: &Curl) -> [Option<SegmentHit>; 2] {
        [
            self.hit(axes, &curl.second_touch, curl.second_radius),
            self.hit(axes, &curl.third_touch, curl.third_radius),
        ]
    }

    /// Contact of one link, whose touch segment reaches `radius` metres from the base joint.
    #[inline]
    fn hit(&self, axes: &LinkAxes, touch: &PlaneSegment, radius: f32) -> Option<SegmentHit> {
        // The object has no point nearer to the base joint than `distance`.
        if radius + REACH_SLACK < self.distance {
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
        (false, _) if strategy.stops_without_thumb() => Some(Rejection::NoThumbEarlyStop),
        (false, true) => Some(Rejection::NoThumb),
        (false, false) => Some(Rejection::NoContacts),
    }
}
