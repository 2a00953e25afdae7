//! A rig in human-readable form, with names, metres and degrees. It is validated as a whole before it becomes a
//! [`Rig`].

use std::collections::BTreeMap;

use glam::{Quat, Vec3};
use serde::Deserialize;

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
#[derive(Clone, Debug, PartialEq, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Deserialize)]
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
    /// Smallest and largest angle of each joint, in degrees.
    pub limits_degrees: DigitLimits<[f32; 2]>,
}

impl RigDescription {
    /// Builds the rig; its reach is measured on the stretched middle finger.
    ///
    /// # Errors
    /// Every violation, in the order of the fields, each with field and value.
    pub fn to_rig(&self) -> Result<Rig, Vec<String>> {
        let mut violations = Vec::new();
        if self.name.trim().is_empty() {
            violations.push("name is empty; every rig needs one".to_owned());
        }
        violations.extend(point("palm_m", self.palm_m));
        for (name, digit) in self.digits.named() {
            violations.extend(digit.violations(name));
        }
        for (i, &point) in self.finger_metacarpals_m.iter().enumerate() {
            violations.extend(self::point(&format!("finger_metacarpals_m[{i}]"), point));
        }
        for (i, ends) in self.palm_segments_m.iter().enumerate() {
            for (j, &end) in ends.iter().enumerate() {
                violations.extend(point(&format!("palm_segments_m[{i}][{j}]"), end));
            }
        }
        for (name, &radius) in &self.joint_radii_m {
            violations.extend(if JOINT_NAMES.contains(&name.as_str()) {
                length(&format!("joint_radii_m.{name}"), radius)
            } else {
                Some(format!(
                    "joint_radii_m.{name} names no joint; must be a WebXR joint name or palm"
                ))
            });
        }
        let missing = JOINT_NAMES
            .iter()
            .filter(|name| !self.joint_radii_m.contains_key(**name));
        violations.extend(
            missing.map(|name| format!("joint_radii_m.{name} is missing; all 26 joints need a radius")),
        );
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
    fn violations(&self, name: &str) -> Vec<String> {
        let field = |field: &str| format!("digits.{name}.{field}");
        let mut violations: Vec<String> = point(&field("base_m"), self.base_m).into_iter().collect();
        let norm = Quat::from_array(self.base_orientation_xyzw).length();
        if !is_unit(norm) {
            let field = field("base_orientation_xyzw");
            violations.push(format!(
                "{field} has length {norm}; must be a unit quaternion x y z w"
            ));
        }
        if self.yaw_sign.abs() != 1.0 {
            violations.push(format!(
                "{} is {}; must be 1 or -1",
                field("yaw_sign"),
                self.yaw_sign
            ));
        }
        for (name, values) in [("lengths_m", self.lengths_m), ("diameters_m", self.diameters_m)] {
            let named = values.iter().enumerate();
            violations.extend(named.filter_map(|(i, &value)| length(&field(&format!("{name}[{i}]")), value)));
        }
        let joints = ["base_yaw", "base_pitch", "second_pitch", "third_pitch"];
        for (joint, [min, max]) in joints.into_iter().zip(self.limits_degrees.to_array()) {
            if !is_range(min, max) {
                let field = field(&format!("limits_degrees.{joint}"));
                violations.push(format!(
                    "{field} is {min} to {max}; must be finite, ascending and within -180 to 180 degrees"
                ));
            }
        }
        violations
    }

    fn to_digit(&self) -> DigitRig {
        let [base_yaw, base_pitch, second_pitch, third_pitch] = self
            .limits_degrees
            .to_array()
            .map(|[min, max]| AngleRange::from_degrees(min, max));
        DigitRig {
            wrist_from_base: Pose::new(
                Vec3::from(self.base_m),
                Quat::from_array(self.base_orientation_xyzw).normalize(),
            ),
            yaw_sign: self.yaw_sign,
            lengths: self.lengths_m,
            diameters: self.diameters_m,
            limits: DigitLimits {
                base_yaw,
                base_pitch,
                second_pitch,
                third_pitch,
            },
        }
    }
}

// NaN fails every comparison, so the following return false for it.

fn is_unit(length: f32) -> bool {
    (length - 1.0).abs() <= UNIT_TOLERANCE
}

fn is_range(min: f32, max: f32) -> bool {
    min >= -180.0 && min <= max && max <= 180.0
}

fn point(field: &str, point: [f32; 3]) -> Option<String> {
    let is_coordinate = |value: f32| value.abs() <= MAX_METRES;
    let value = point.iter().find(|value| !is_coordinate(**value))?;
    Some(format!(
        "{field} is {value}; must be finite and at most {MAX_METRES} m in size"
    ))
}

fn length(field: &str, value: f32) -> Option<String> {
    let is_length = value > 0.0 && value <= MAX_METRES;
    (!is_length).then(|| format!("{field} is {value}; must be above 0 and at most {MAX_METRES} m"))
}
