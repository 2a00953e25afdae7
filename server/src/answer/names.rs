//! Digits and hands as the contract names them.

use grasp_proto::v1;
use grasp_synthesis::model::hand::{Digit, Handedness};

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
