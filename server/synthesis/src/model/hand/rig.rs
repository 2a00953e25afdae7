//! A hand's rig: bones, joint limits and diameters.

use glam::Vec3;
use serde::Deserialize;

use super::{Digit, DigitAngles, Handedness, joints::index};
use crate::{base::pose::Pose, geometry::Segment};

/// A closed range of angles, in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleRange {
    /// Smallest angle.
    pub min: f32,
    /// Largest angle.
    pub max: f32,
}

impl AngleRange {
    /// A range from degrees.
    pub fn from_degrees(min: f32, max: f32) -> Self {
        Self {
            min: min.to_radians(),
            max: max.to_radians(),
        }
    }

    /// True if `angle` lies within the range, widened by `slack` radians at either end for rounding.
    pub fn contains(self, angle: f32, slack: f32) -> bool {
        angle >= self.min - slack && angle <= self.max + slack
    }
}

/// The limits of a digit's joints (thesis Table 4.1).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DigitLimits<T = AngleRange> {
    /// ψ1.
    pub base_yaw: T,
    /// θ1.
    pub base_pitch: T,
    /// θ2.
    pub second_pitch: T,
    /// θ3.
    pub third_pitch: T,
}

impl<T: Copy> DigitLimits<T> {
    /// Limits of yaw and pitches, from the base outward.
    pub(crate) fn to_array(self) -> [T; 4] {
        [
            self.base_yaw,
            self.base_pitch,
            self.second_pitch,
            self.third_pitch,
        ]
    }
}

impl DigitLimits {
    /// The largest pitches, from the base outward.
    pub(crate) fn max_pitches(&self) -> [f32; 3] {
        [self.base_pitch.max, self.second_pitch.max, self.third_pitch.max]
    }

    /// The nearest angles within the limits.
    #[must_use]
    pub fn clamped(&self, angles: DigitAngles) -> DigitAngles {
        let (angles, limits) = (angles.to_array(), self.to_array());
        DigitAngles::from_array(std::array::from_fn(|i| {
            angles[i].clamp(limits[i].min, limits[i].max)
        }))
    }
}

/// One digit chain: three links on a base that is fixed in the wrist frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DigitRig {
    /// The base joint's frame of the stretched digit (all angles zero) in the wrist frame: +y along the first link,
    /// +z toward the digit's pad.
    pub wrist_from_base: Pose,
    /// The sense of a positive yaw ψ1 about the base's +z: +1 is counter-clockwise, -1 clockwise. A positive yaw
    /// moves a finger toward the little finger (+1 on the right hand, thesis Figure 4.2b) and lifts the thumb out of
    /// the palm's plane (-1 on the right hand, since the thumb's pad faces the little finger).
    pub yaw_sign: f32,
    /// Lengths L of the three links, in metres; the last one ends at the fingertip.
    pub lengths: [f32; 3],
    /// Diameters W of the three links, in metres (Eq. 4.1).
    pub diameters: [f32; 3],
    /// The joint limits.
    pub limits: DigitLimits,
}

/// The palm among the parts that a link can overlap at rest, after the fifteen links by digit, …
pub const PALM_PART: usize = 15;

/// … and the ball of the thumb.
pub const THUMB_BALL_PART: usize = 16;

/// How deep a link overlaps the parts of a hand at rest, in metres: the links by digit, [`PALM_PART`] and [`THUMB_BALL_PART`].
pub type LinkOverlaps = [f32; THUMB_BALL_PART + 1];

/// How deep the parts of a hand overlap at rest, by link: flesh that neighbours share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RestOverlaps([[LinkOverlaps; 3]; 5]);

impl RestOverlaps {
    /// The depth of a link in another part.
    pub fn of(&self, link: usize, part: usize) -> f32 {
        self.0.as_flattened()[link][part]
    }

    /// Depths of a digit's links.
    pub fn of_digit(&self, digit: Digit) -> &[LinkOverlaps; 3] {
        &self.0[digit.index()]
    }

    /// Raises a depth to at least this one.
    pub(crate) fn deepen(&mut self, link: usize, part: usize, depth: f32) {
        let links = self.0.as_flattened_mut();
        let deepest = links[link][part].max(depth);
        links[link][part] = deepest;
        if part < PALM_PART {
            links[part][link] = deepest;
        }
    }

    /// All depths.
    fn depths(&self) -> &[f32] {
        self.0.as_flattened().as_flattened()
    }

    /// The values of a hand that is `scale` times as large.
    fn scaled(&self, scale: f32) -> Self {
        Self(
            self.0
                .map(|digit| digit.map(|link| link.map(|depth| scale * depth))),
        )
    }
}

/// Number of solids of the palm and the ball of the thumb.
pub const FLESH_SOLIDS: usize = 14;

/// Deviation of a palm's flesh from that of the built-in hands at the same size, at the start and the end of each solid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PalmFlesh(pub [[EndChange; 2]; FLESH_SOLIDS]);

/// The change of one end of a solid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EndChange {
    /// Out of the palm, in metres.
    pub offset: f32,
    /// Of the radius, in metres.
    pub radius: f32,
}

impl PalmFlesh {
    /// All numbers.
    fn numbers(&self) -> impl Iterator<Item = f32> {
        self.0.iter().flatten().flat_map(|end| [end.offset, end.radius])
    }

    /// The values of a hand that is `scale` times as large.
    fn scaled(&self, scale: f32) -> Self {
        let scaled = |end: EndChange| EndChange {
            offset: scale * end.offset,
            radius: scale * end.radius,
        };
        Self(self.0.map(|ends| ends.map(scaled)))
    }
}

/// A hand's rig, in the wrist frame: +y along the stretched fingers, +z out of the palm.
///
/// A hand may lack up to two fingers. The tip of a missing finger has no radius, and its links have no length: all its
/// joints but the metacarpal are at its knuckle, which, like the metacarpal, shapes the palm.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// "thesis", "adult" or a custom name.
    pub name: String,
    /// Which hand.
    pub handedness: Handedness,
    /// H: the centre of the palm's skin, from which the palm distance is measured (thesis 5.3), in metres.
    pub palm: Vec3,
    /// d: distance from wrist to tip of the stretched middle finger (thesis 4.3) or, without one, of the longest finger, in
    /// metres.
    pub reach: f32,
    /// The digit chains, thumb first.
    pub digits: [DigitRig; 5],
    /// The proximal ends of the metacarpals of index, middle, ring and little finger, in metres.
    pub finger_metacarpals: [Vec3; 4],
    /// The ten collision segments under the palm's skin (thesis 4.5, Figure 4.4).
    pub palm_segments: [Segment; 10],
    /// Distance from joint to skin for the 26 joints in `OpenXR` order, in metres. Tips lie on the skin, as in
    /// tracking data; their radius is that of the rounded fingertip, so a capsule around the last phalanx must end
    /// one radius before the tip.
    pub joint_radii: [f32; 26],
    /// Overlaps at rest of rigs made from other hands; `None` for rigs whose parts are clear of each other at rest.
    pub rest_overlaps: Option<Box<RestOverlaps>>,
    /// The flesh of its palm, if that was measured.
    pub palm_flesh: Option<Box<PalmFlesh>>,
}

impl Rig {
    /// A digit's chain.
    pub fn digit(&self, digit: Digit) -> &DigitRig {
        &self.digits[digit.index()]
    }

    /// True if the hand has the digit.
    pub fn has(&self, digit: Digit) -> bool {
        self.joint_radii[index::TIP_OF_DIGIT[digit.index()]] > 0.0
    }

    /// The fingers that the hand has, index finger first.
    pub fn fingers(&self) -> impl DoubleEndedIterator<Item = Digit> {
        Digit::ALL[1..].iter().copied().filter(|&finger| self.has(finger))
    }

    /// The digits that stand in for these digits of a hand with four fingers: as many fingers, if it has them, those next to the
    /// thumb.
    #[must_use]
    pub fn own_digits(&self, digits: [bool; 5]) -> [bool; 5] {
        let [thumb, fingers @ ..] = digits;
        let count = fingers.iter().filter(|&&finger| finger).count();
        let mut own = [thumb, false, false, false, false];
        for finger in self.fingers().take(count) {
            own[finger.index()] = true;
        }
        own
    }

    /// All but the name, which does not affect grips, as little-endian bytes. Equal rigs have equal bytes.
    pub fn content(&self) -> Vec<u8> {
        let mut numbers: Vec<f32> = Vec::with_capacity(256);
        numbers.extend(self.palm.to_array());
        numbers.push(self.reach);
        for digit in &self.digits {
            let Pose {
                position,
                orientation,
            } = digit.wrist_from_base;
            numbers.extend(position.to_array());
            numbers.extend(orientation.to_array());
            numbers.push(digit.yaw_sign);
            numbers.extend(digit.lengths);
            numbers.extend(digit.diameters);
            for AngleRange { min, max } in digit.limits.to_array() {
                numbers.extend([min, max]);
            }
        }
        numbers.extend(self.finger_metacarpals.iter().flat_map(Vec3::to_array));
        for Segment { start, end } in self.palm_segments {
            numbers.extend(start.to_array());
            numbers.extend(end.to_array());
        }
        numbers.extend(self.joint_radii);
        numbers.extend(self.rest_overlaps.iter().flat_map(|overlaps| overlaps.depths()));
        numbers.extend(self.palm_flesh.iter().flat_map(|flesh| flesh.numbers()));
        let handedness = u8::from(self.handedness == Handedness::Right);
        let numbers = numbers.iter().flat_map(|number| number.to_le_bytes());
        std::iter::once(handedness).chain(numbers).collect()
    }

    /// The angles of the stretched hand, in radians: each as close to zero as its limits allow.
    pub fn stretched(&self) -> [DigitAngles; 5] {
        self.digits
            .map(|digit| digit.limits.clamped(DigitAngles::default()))
    }

    /// A hand of the same shape that is `scale` times as large.
    #[must_use]
    pub fn scaled(&self, scale: f32) -> Self {
        Self {
            palm: scale * self.palm,
            reach: scale * self.reach,
            digits: self.digits.map(|digit| DigitRig {
                wrist_from_base: Pose {
                    position: scale * digit.wrist_from_base.position,
                    ..digit.wrist_from_base
                },
                lengths: digit.lengths.map(|length| scale * length),
                diameters: digit.diameters.map(|diameter| scale * diameter),
                ..digit
            }),
            finger_metacarpals: self.finger_metacarpals.map(|start| scale * start),
            palm_segments: self
                .palm_segments
                .map(|segment| Segment::new(scale * segment.start, scale * segment.end)),
            joint_radii: self.joint_radii.map(|radius| scale * radius),
            rest_overlaps: self
                .rest_overlaps
                .as_ref()
                .map(|overlaps| Box::new(overlaps.scaled(scale))),
            palm_flesh: self
                .palm_flesh
                .as_ref()
                .map(|flesh| Box::new(flesh.scaled(scale))),
            ..self.clone()
        }
    }

    /// The same person's other hand: the mirror image in the plane x = 0.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let flip = |v: Vec3| v * Vec3::new(-1.0, 1.0, 1.0);
        Self {
            handedness: self.handedness.other(),
            palm: flip(self.palm),
            digits: self.digits.map(|digit| DigitRig {
                wrist_from_base: digit.wrist_from_base.mirrored_x(),
                yaw_sign: -digit.yaw_sign,
                ..digit
            }),
            finger_metacarpals: self.finger_metacarpals.map(flip),
            palm_segments: self
                .palm_segments
                .map(|s| Segment::new(flip(s.start), flip(s.end))),
            ..self.clone()
        }
    }
}
