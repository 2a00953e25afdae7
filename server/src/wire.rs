//! Single values as the contract has them.

use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{Digit, Handedness},
};

/// A pose, in the same frame and unit.
pub(crate) fn wire_pose(pose: Pose) -> v1::Pose {
    v1::Pose::new(pose.position, pose.orientation)
}

pub(crate) fn wire_digit(digit: Digit) -> v1::Digit {
    match digit {
        Digit::Thumb => v1::Digit::Thumb,
        Digit::Index => v1::Digit::Index,
        Digit::Middle => v1::Digit::Middle,
        Digit::Ring => v1::Digit::Ring,
        Digit::Little => v1::Digit::Little,
    }
}

pub(crate) fn wire_handedness(handedness: Handedness) -> v1::Handedness {
    match handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    }
}

/// Bytes in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
