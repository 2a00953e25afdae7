//! A rig in human-readable form, with names, metres and degrees. It is validated as a whole before it becomes a
//! [`Rig`].

use std::collections::BTreeMap;

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::{
    DigitAngles, Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES},
    kinematics::digit_frames,
    rig::{AngleRange, DigitLimits, DigitRig, Rig},
};
use crate::{base::pose::Pose, geometry::Segment};

/// Largest deviation of a quaternion's length from one; quaternions are normalised when used.
const UNIT_TOLERANCE: f32 = 1e-3;

/// Largest length and coordinate of a hand, in metres. Larger values mean a file in another unit.
const MAX_METRES: f32 = 1.0;

/// A hand's rig in the wrist frame: +y along the stretched fingers, +z out of the palm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigDescription {
    /// The rig's name, not empty.
    pub name: String,
    /// Which hand.
    pub handedness: Handedness,
    /// The centre of the palm's skin, in metres.
    pub palm_m: [f32; 3],
    /// The digit chains.
    pub digits: DigitDescriptions,
    /// The proximal ends of the metacarpals of index, middle, ring and little finger, in metres.
    pub finger_metacarpals_m: [[f32; 3]; 4],
    /// The ten collision segments under the palm's skin: both ends of each, in metres.
    pub palm_segments_m: [[[f32; 3]; 2]; 10],
    /// Distance from joint to skin, in metres, by the joint's `WebXR` name or "palm".
    pub joint_radii_m: BTreeMap<String, f32>,
}

/// The digits by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DigitDescriptions {
    /// The thumb.
    pub thumb: DigitDescription,
    /// The index finger.
    pub index: DigitDescription,
    /// The middle finger.
    pub middle: DigitDescription,
    /// The ring finger.
    pub ring: DigitDescription,
    /// The little finger.
    pub little: DigitDescription,
}

/// One digit chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DigitDescription {
    /// The base joint in the wrist frame, in metres.
    pub base_m: [f32; 3],
    /// The stretched digit's frame in the wrist frame, a unit quaternion: +y along the digit, +z toward its pad.
    pub base_orientation_xyzw: [f32; 4],
    /// +1 if a positive yaw turns counter-clockwise about the base's +z, -1 if clockwise.
    pub yaw_sign: f32,
    /// Lengths of the three links, in metres; the last one ends at the fingertip.
    pub lengths_m: [f32; 3],
    /// Diameters of the three links, in metres.
    pub diameters_m: [f32; 3],
    /// The joint limits, in degrees.
    pub limits_degrees: LimitsDescription,
}

/// Smallest and largest angle of each joint, in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsDescription {
    /// ψ1.
    pub base_yaw: [f32; 2],
    /// θ1.
    pub base_pitch: [f32; 2],
    /// θ2.
    pub second_pitch: [f32; 2],
    /// θ3.
    pub third_pitch: [f32; 2],
}

/// A violation in one field of a description.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigViolation {
    /// The rig has no name.
    #[error("name is empty; every rig needs one")]
    NoName,
    /// A coordinate is NaN, infinite or too large for a hand.
    #[error("{field} is {value}; must be finite and at most {MAX_METRES} m in size")]
    NotACoordinate {
        /// Path of the field.
        field: String,
        /// Its value.
        value: f32,
    },
    /// A length is not positive, or too large for a hand.
    #[error("{field} is {value}; must be above 0 and at most {MAX_METRES} m")]
    NotALength {
        /// Path of the field.
        field: String,
        /// Its value.
        value: f32,
    },
    /// A quaternion is not of length one.
    #[error("{field} has length {length}; must be a unit quaternion x y z w")]
    NotAUnitQuaternion {
        /// Path of the field.
        field: String,
        /// Its length.
        length: f32,
    },
    /// A range of angles is not finite, is descending or exceeds ±180 degrees.
    #[error("{field} is {min} to {max}; must be finite, ascending and within -180 to 180 degrees")]
    NotARange {
        /// Path of the field.
        field: String,
        /// Its lower end.
        min: f32,
        /// Its upper end.
        max: f32,
    },
    /// The sense of the yaw is neither +1 nor -1.
    #[error("{field} is {value}; must be 1 or -1")]
    NotASign {
        /// Path of the field.
        field: String,
        /// Its value.
        value: f32,
    },
    /// No joint has that name.
    #[error("joint_radii_m.{name} names no joint; must be a WebXR joint name or palm")]
    UnknownJoint {
        /// The name.
        name: String,
    },
    /// A joint's radius is missing.
    #[error("joint_radii_m.{name} is missing; all 26 joints need a radius")]
    MissingJoint {
        /// The joint's name.
        name: &'static str,
    },
}

impl RigDescription {
    /// Describes a rig.
    pub fn of_rig(rig: &Rig) -> Self {
        let digit = |i: usize| {
            let digit = &rig.digits[i];
            DigitDescription {
                base_m: digit.wrist_from_base.position.to_array(),
                base_orientation_xyzw: digit.wrist_from_base.orientation.to_array(),
                yaw_sign: digit.yaw_sign,
                lengths_m: digit.lengths,
                diameters_m: digit.diameters,
                limits_degrees: LimitsDescription {
                    base_yaw: degrees(digit.limits.base_yaw),
                    base_pitch: degrees(digit.limits.base_pitch),
                    second_pitch: degrees(digit.limits.second_pitch),
                    third_pitch: degrees(digit.limits.third_pitch),
                },
            }
        };
        Self {
            name: rig.name.clone(),
            handedness: rig.handedness,
            palm_m: rig.palm.to_array(),
            digits: DigitDescriptions {
                thumb: digit(0),
                index: digit(1),
                middle: digit(2),
                ring: digit(3),
                little: digit(4),
            },
            finger_metacarpals_m: rig.finger_metacarpals.map(|p| p.to_array()),
            palm_segments_m: rig
                .palm_segments
                .map(|segment| [segment.start.to_array(), segment.end.to_array()]),
            joint_radii_m: JOINT_NAMES
                .iter()
                .zip(rig.joint_radii)
                .map(|(name, radius)| ((*name).to_owned(), radius))
                .collect(),
        }
    }

    /// Builds the rig; its reach is measured on the stretched middle finger.
    ///
    /// # Errors
    /// Every violation, in the order of the fields.
    pub fn to_rig(&self) -> Result<Rig, Vec<RigViolation>> {
        let mut violations = Vec::new();
        if self.name.trim().is_empty() {
            violations.push(RigViolation::NoName);
        }
        check_point(&mut violations, || "palm_m".to_owned(), self.palm_m);
        for (name, digit) in self.digits.named() {
            digit.check(&mut violations, name);
        }
        for (i, &point) in self.finger_metacarpals_m.iter().enumerate() {
            check_point(&mut violations, || format!("finger_metacarpals_m[{i}]"), point);
        }
        for (i, ends) in self.palm_segments_m.iter().enumerate() {
            for (j, &end) in ends.iter().enumerate() {
                check_point(&mut violations, || format!("palm_segments_m[{i}][{j}]"), end);
            }
        }
        self.check_radii(&mut violations);
        if !violations.is_empty() {
            return Err(violations);
        }

        let digits = self.digits.named().map(|(_, digit)| digit.to_digit());
        let stretched = digit_frames(&digits[2], Pose::IDENTITY, DigitAngles::default());
        Ok(Rig {
            name: self.name.clone(),
            handedness: self.handedness,
            palm: Vec3::from(self.palm_m),
            reach: stretched.tip.length(),
            digits,
            finger_metacarpals: self.finger_metacarpals_m.map(Vec3::from),
            palm_segments: self
                .palm_segments_m
                .map(|[start, end]| Segment::new(Vec3::from(start), Vec3::from(end))),
            joint_radii: std::array::from_fn::<_, JOINT_COUNT, _>(|i| {
                self.joint_radii_m.get(JOINT_NAMES[i]).copied().unwrap_or(0.0)
            }),
            rest_overlaps: None,
            palm_flesh: None,
        })
    }

    fn check_radii(&self, violations: &mut Vec<RigViolation>) {
        for (name, &radius) in &self.joint_radii_m {
            if JOINT_NAMES.contains(&name.as_str()) {
                check_length(violations, || format!("joint_radii_m.{name}"), radius);
            } else {
                violations.push(RigViolation::UnknownJoint { name: name.clone() });
            }
        }
        for name in JOINT_NAMES {
            if !self.joint_radii_m.contains_key(name) {
                violations.push(RigViolation::MissingJoint { name });
            }
        }
    }
}

impl DigitDescriptions {
    /// Names and descriptions of the digits, thumb first.
    fn named(&self) -> [(&'static str, &DigitDescription); 5] {
        [
            ("thumb", &self.thumb),
            ("index", &self.index),
            ("middle", &self.middle),
            ("ring", &self.ring),
            ("little", &self.little),
        ]
    }
}

impl DigitDescription {
    fn check(&self, violations: &mut Vec<RigViolation>, name: &str) {
        check_point(violations, || format!("digits.{name}.base_m"), self.base_m);
        let length = Quat::from_array(self.base_orientation_xyzw).length();
        if !is_unit(length) {
            violations.push(RigViolation::NotAUnitQuaternion {
                field: format!("digits.{name}.base_orientation_xyzw"),
                length,
            });
        }
        if self.yaw_sign.abs() != 1.0 {
            violations.push(RigViolation::NotASign {
                field: format!("digits.{name}.yaw_sign"),
                value: self.yaw_sign,
            });
        }
        for (i, &length) in self.lengths_m.iter().enumerate() {
            check_length(violations, || format!("digits.{name}.lengths_m[{i}]"), length);
        }
        for (i, &diameter) in self.diameters_m.iter().enumerate() {
            check_length(violations, || format!("digits.{name}.diameters_m[{i}]"), diameter);
        }
        let limits = &self.limits_degrees;
        for (joint, [min, max]) in [
            ("base_yaw", limits.base_yaw),
            ("base_pitch", limits.base_pitch),
            ("second_pitch", limits.second_pitch),
            ("third_pitch", limits.third_pitch),
        ] {
            if !is_range(min, max) {
                violations.push(RigViolation::NotARange {
                    field: format!("digits.{name}.limits_degrees.{joint}"),
                    min,
                    max,
                });
            }
        }
    }

    fn to_digit(&self) -> DigitRig {
        let range = |[min, max]: [f32; 2]| AngleRange::from_degrees(min, max);
        DigitRig {
            wrist_from_base: Pose::new(
                Vec3::from(self.base_m),
                Quat::from_array(self.base_orientation_xyzw).normalize(),
            ),
            yaw_sign: self.yaw_sign,
            lengths: self.lengths_m,
            diameters: self.diameters_m,
            limits: DigitLimits {
                base_yaw: range(self.limits_degrees.base_yaw),
                base_pitch: range(self.limits_degrees.base_pitch),
                second_pitch: range(self.limits_degrees.second_pitch),
                third_pitch: range(self.limits_degrees.third_pitch),
            },
        }
    }
}

/// A range in degrees, rounded to a ten-thousandth, so that hand-written values survive a round trip.
fn degrees(range: AngleRange) -> [f32; 2] {
    [range.min, range.max].map(|radians| ((f64::from(radians).to_degrees() * 1e4).round() / 1e4) as f32)
}

// NaN fails every comparison, so the following return false for it.

fn is_unit(length: f32) -> bool {
    (length - 1.0).abs() <= UNIT_TOLERANCE
}

fn is_range(min: f32, max: f32) -> bool {
    min >= -180.0 && min <= max && max <= 180.0
}

fn is_coordinate(value: f32) -> bool {
    value.abs() <= MAX_METRES
}

fn is_length(value: f32) -> bool {
    value > 0.0 && value <= MAX_METRES
}

fn check_point(violations: &mut Vec<RigViolation>, field: impl Fn() -> String, point: [f32; 3]) {
    if let Some(&value) = point.iter().find(|&&value| !is_coordinate(value)) {
        violations.push(RigViolation::NotACoordinate {
            field: field(),
            value,
        });
    }
}

fn check_length(violations: &mut Vec<RigViolation>, field: impl Fn() -> String, value: f32) {
    if !is_length(value) {
        violations.push(RigViolation::NotALength {
            field: field(),
            value,
        });
    }
}
