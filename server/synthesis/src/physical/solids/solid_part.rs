//! The part of a hand that a solid belongs to.

use std::fmt;

use super::{HandSolids, PALM_SOLIDS, THENAR_SOLIDS, TRACKED_SOLIDS, TrackedSolids};
use crate::model::hand::{Digit, Phalanx};

/// A part of a hand and its forearm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolidPart {
    /// A link of a digit.
    Phalanx(Digit, Phalanx),
    /// The part of the palm that moves with the wrist.
    Palm,
    /// The ball of the thumb and the web to the index finger.
    ThumbBall,
    /// The forearm.
    Forearm,
}

impl SolidPart {
    /// The digit; `None` for palm, ball of the thumb and forearm.
    pub const fn digit(self) -> Option<Digit> {
        match self {
            Self::Phalanx(digit, _) => Some(digit),
            Self::Palm | Self::ThumbBall | Self::Forearm => None,
        }
    }
}

impl fmt::Display for SolidPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Phalanx(Digit::Thumb, _) => "thumb",
            Self::Phalanx(Digit::Index, _) => "index finger",
            Self::Phalanx(Digit::Middle, _) => "middle finger",
            Self::Phalanx(Digit::Ring, _) => "ring finger",
            Self::Phalanx(Digit::Little, _) => "little finger",
            Self::Palm => "palm",
            Self::ThumbBall => "ball of the thumb",
            Self::Forearm => "forearm",
        })
    }
}

impl HandSolids {
    /// All solids with their parts, in the order of [`HandSolids::iter`].
    pub fn parts(&self) -> impl Iterator<Item = (SolidPart, &super::TaperedCapsule)> + Clone {
        self.iter()
            .enumerate()
            .map(|(index, solid)| (part_at(index), solid))
    }
}

impl TrackedSolids {
    /// All solids with their parts, in the order of [`TrackedSolids::iter`].
    pub fn parts(&self) -> impl Iterator<Item = (SolidPart, &super::TaperedCapsule)> + Clone {
        self.iter()
            .enumerate()
            .map(|(index, solid)| (part_at(index), solid))
    }
}

/// The part of the solid at an index of [`HandSolids::iter`] or [`TrackedSolids::iter`].
fn part_at(index: usize) -> SolidPart {
    /// The last solid is the middle of the forearm.
    const TRACKED_PALM: usize = HandSolids::COUNT + TRACKED_SOLIDS - 1;
    const PALM: usize = 15 + PALM_SOLIDS;
    const THENAR: usize = PALM + THENAR_SOLIDS;
    match index {
        0..15 => SolidPart::Phalanx(Digit::ALL[index / 3], Phalanx::ALL[index % 3]),
        15..PALM => SolidPart::Palm,
        PALM..THENAR => SolidPart::ThumbBall,
        HandSolids::COUNT..TRACKED_PALM => SolidPart::Palm,
        _ => SolidPart::Forearm,
    }
}
