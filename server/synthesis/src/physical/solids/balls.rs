//! Some balls of a hand, coordinate by coordinate: all of them are compared with one solid at once.

use glam::Vec3;

/// How many balls are compared at once: a register's worth of single precision, and two cache lines.
pub const BALLS: usize = 8;

/// Eight balls.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(128))]
pub struct Balls {
    /// Coordinates of the middles, in metres.
    pub(super) middles: [[f32; BALLS]; 3],
    /// Their radii, in metres.
    pub(super) radii: [f32; BALLS],
}

impl Balls {
    /// Balls of middle and radius in metres.
    pub fn new(balls: [(Vec3, f32); BALLS]) -> Self {
        Self {
            middles: [0, 1, 2].map(|axis| balls.map(|(middle, _)| middle[axis])),
            radii: balls.map(|(_, radius)| radius),
        }
    }
}
