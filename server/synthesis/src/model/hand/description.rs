//! A rig in human-readable form, with names, metres and degrees.

use std::collections::BTreeMap;

use glam::{Quat, Vec3};
use serde::Deserialize;

use super::{
    Digit, DigitAngles, Handedness,
    joints::JOINT_NAMES,
    kinematics::digit_frames,
    rig::{AngleRange, DigitLimits, DigitRig, Rig},
};
use crate::{base::pose::Pose, geometry::Segment};

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
    pub digits: BTreeMap<Digit, DigitDescription>,
    /// The proximal ends of the metacarpals of index, middle, ring and little finger, in metres.
    pub finger_metacarpals_m: [[f32; 3]; 4],
    /// The ten collision segments under the palm's skin: both ends of each, in metres.
    pub palm_segments_m: [[[f32; 3]; 2]; 10],
    /// Distance from joint to skin, in metres, by the joint's `WebXR` name or "palm".
    pub joint_radii_m: BTreeMap<String, f32>,
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
    /// # Panics
    /// A digit is missing, or the radius of a joint.
    pub fn to_rig(&self) -> Rig {
        let digits = Digit::ALL.map(|digit| self.digits[&digit].to_digit());
        let stretched = digit_frames(&digits[2], Pose::IDENTITY, DigitAngles::default());
        Rig {
            name: self.name.clone(),
            handedness: self.handedness,
            palm: Vec3::from(self.palm_m),
            reach: stretched.tip.length(),
            digits,
            finger_metacarpals: self.finger_metacarpals_m.map(Vec3::from),
            palm_segments: self
                .palm_segments_m
                .map(|[start, end]| Segment::new(Vec3::from(start), Vec3::from(end))),
            joint_radii: JOINT_NAMES.map(|name| self.joint_radii_m[name]),
            rest_overlaps: None,
            palm_flesh: None,
        }
    }
}

impl DigitDescription {
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
