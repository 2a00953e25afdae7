//! Single values as the contract has them.

use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{Digit, Handedness},
};

const MAX_QUOTED: usize = 80;

pub(crate) fn wire_pose(pose: Pose) -> v1::Pose {
    v1::Pose::new(pose.position, pose.orientation)
}

pub(crate) fn wire_digit(digit: Digit) -> v1::Digit {
    use v1::Digit as D;
    [D::Thumb, D::Index, D::Middle, D::Ring, D::Little][digit.index()]
}

pub(crate) fn wire_handedness(handedness: Handedness) -> v1::Handedness {
    match handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    }
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// A client's text in quotes, shortened if it is long.
pub(crate) fn quoted(text: &str) -> String {
    let mut characters = text.chars();
    let start: String = characters.by_ref().take(MAX_QUOTED).collect();
    let ellipsis = if characters.next().is_some() { "…" } else { "" };
    format!("{start:?}{ellipsis}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortens_long_quotes() {
        assert_eq!(quoted("a\nb"), "\"a\\nb\"");
        assert_eq!(quoted(&"é".repeat(500)).chars().count(), MAX_QUOTED + 3);
    }
}
