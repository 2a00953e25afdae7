//! The hand: its rig and pose, and the kinematics of its bones, joints and skin.

pub mod description;
pub mod joints;
pub mod kinematics;
pub mod rig;

use serde::{Deserialize, Serialize};

use crate::base::pose::Pose;

/// Left or right hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Handedness {
    /// The left hand.
    Left,
    /// The right hand.
    Right,
}

impl Handedness {
    /// The other hand.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }

    /// Sign of the wrist's x axis toward the thumb: 1 for the right hand, -1 for the left.
    pub(crate) const fn thumb_side(self) -> f32 {
        match self {
            Self::Left => -1.0,
            Self::Right => 1.0,
        }
    }
}

/// A digit of the hand: the thesis's finger index i.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Digit {
    /// 0.
    Thumb,
    /// 1.
    Index,
    /// 2.
    Middle,
    /// 3.
    Ring,
    /// 4.
    Little,
}

impl Digit {
    /// All digits, thumb first, as in the thesis.
    pub const ALL: [Self; 5] = [Self::Thumb, Self::Index, Self::Middle, Self::Ring, Self::Little];

    /// The thesis's finger index, from 0 for the thumb to 4 for the little finger.
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// A link of a digit's chain: the thesis's phalanx index j.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phalanx {
    /// 1: the proximal phalanx of a finger, the metacarpal of the thumb.
    First,
    /// 2: the intermediate phalanx of a finger, the proximal phalanx of the thumb.
    Second,
    /// 3: the distal phalanx.
    Third,
}

impl Phalanx {
    /// All links from the wrist outward.
    pub const ALL: [Self; 3] = [Self::First, Self::Second, Self::Third];

    /// The index from 0 for the link next to the palm to 2 for the distal one.
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// A part of the hand that can touch something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HandPart {
    /// A link of a digit.
    Phalanx(Digit, Phalanx),
    /// The palm, including the ball of the thumb.
    Palm,
}

impl HandPart {
    /// The digit; `None` for the palm.
    pub const fn digit(self) -> Option<Digit> {
        match self {
            Self::Phalanx(digit, _) => Some(digit),
            Self::Palm => None,
        }
    }

    /// True for the palm and for links of the selected digits; one flag per digit, thumb first.
    pub(crate) fn is_palm_or_in(self, digits: [bool; 5]) -> bool {
        self.digit().is_none_or(|digit| digits[digit.index()])
    }

    /// True for links of the thumb, false for those of fingers, `None` for the palm.
    pub fn is_thumb(self) -> Option<bool> {
        self.digit().map(|digit| digit == Digit::Thumb)
    }

    /// The link of the digit; `None` for the palm.
    pub const fn phalanx(self) -> Option<Phalanx> {
        match self {
            Self::Phalanx(_, phalanx) => Some(phalanx),
            Self::Palm => None,
        }
    }
}

/// The joint angles of one digit, in radians: the thesis's q = (θ1, ψ1, θ2), and θ3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DigitAngles {
    /// ψ1: sideways rotation of the base joint, toward the little finger; for the thumb, out of the palm's plane.
    pub base_yaw: f32,
    /// θ1: flexion of the base joint.
    pub base_pitch: f32,
    /// θ2: flexion of the second joint.
    pub second_pitch: f32,
    /// θ3: flexion of the third joint; two thirds of θ2 in the thesis's model.
    pub third_pitch: f32,
}

impl DigitAngles {
    /// θ3 / θ2: the coupling of the DIP joint to the PIP joint (thesis 4.4, Table 4.2).
    pub const THIRD_PITCH_SHARE: f32 = 2.0 / 3.0;

    /// The thesis's finger pose, in which the third joint follows the second. Angles in radians.
    pub fn coupled(base_yaw: f32, base_pitch: f32, second_pitch: f32) -> Self {
        Self {
            base_yaw,
            base_pitch,
            second_pitch,
            third_pitch: Self::THIRD_PITCH_SHARE * second_pitch,
        }
    }

    /// Yaw and pitches from the base outward.
    pub fn to_array(self) -> [f32; 4] {
        [
            self.base_yaw,
            self.base_pitch,
            self.second_pitch,
            self.third_pitch,
        ]
    }

    /// The angles with this yaw and these pitches.
    pub(crate) fn from_array([base_yaw, base_pitch, second_pitch, third_pitch]: [f32; 4]) -> Self {
        Self {
            base_yaw,
            base_pitch,
            second_pitch,
            third_pitch,
        }
    }

    /// Flexion of the three joints, from the base outward.
    pub(crate) fn pitches(self) -> [f32; 3] {
        [self.base_pitch, self.second_pitch, self.third_pitch]
    }

    /// The angles on the way to others: 0 is at the start, 1 at its end.
    #[must_use]
    pub fn toward(&self, to: &Self, share: f32) -> Self {
        let (from, to) = (self.to_array(), to.to_array());
        Self::from_array(std::array::from_fn(|i| from[i] + (to[i] - from[i]) * share))
    }
}

/// A complete configuration of the hand: the thesis's 21-dimensional vector, and the third joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HandPose {
    /// F0: the wrist frame (+y along the fingers, +z out of the palm) in the frame of the computation, mostly the
    /// object's.
    pub frame_from_wrist: Pose,
    /// The joint angles of the digits, thumb first.
    pub digits: [DigitAngles; 5],
}
