//! The receiver's body, as far as it decides where the arm of the receiving hand comes from.

use glam::Vec3;

use crate::base::pose::Pose;

/// Length of an adult's upper arm, from the shoulder joint to the elbow, in metres (means of women and men in ANSUR II,
/// shoulder to elbow, less the flesh above the joint).
pub const UPPER_ARM_LENGTH: f32 = 0.30;

/// Length of an adult's forearm, from the elbow to the wrist, in metres (ANSUR II, radiale to stylion).
pub const FOREARM_LENGTH: f32 = 0.26;

/// Where the arm of the receiving hand may come from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Stance {
    /// From anywhere.
    Any,
    /// Preferably from where a receiver stands who faces the giver; without a giver, rather not from beneath.
    #[default]
    Facing,
    /// From this shoulder only.
    At(Arm),
}

/// An arm of two bones: the shoulder, in the object's frame, and the lengths in metres, each more than 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// The shoulder joint.
    pub shoulder: Vec3,
    /// From the shoulder to the elbow.
    pub upper_arm: f32,
    /// From the elbow to the wrist.
    pub forearm: f32,
}

/// A posed arm, in the frame of its hand's pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmPose {
    /// The shoulder joint, in metres.
    pub shoulder: Vec3,
    /// The elbow, in metres.
    pub elbow: Vec3,
    /// Flexion of the wrist toward the palm, in radians; negative for extension.
    pub flexion: f32,
    /// Deviation of the wrist toward the little finger, in radians; negative toward the thumb.
    pub deviation: f32,
    /// True if the shoulder is not the client's, but where a receiver who faces the giver would have it.
    pub is_assumed: bool,
}

impl Stance {
    /// The same stance, expressed in frame b.
    #[must_use]
    pub fn transformed(self, b_from_a: Pose) -> Self {
        match self {
            Self::At(arm) => Self::At(Arm {
                shoulder: b_from_a.transform_point(arm.shoulder),
                ..arm
            }),
            Self::Any | Self::Facing => self,
        }
    }
}
