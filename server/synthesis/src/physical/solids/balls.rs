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
    #[inline]
    pub fn new(ball: impl Fn(usize) -> (Vec3, f32)) -> Self {
        let mut balls = Self::default();
        // A loop, as mapped arrays stay calls.
        for i in 0..BALLS {
            let (middle, radius) = ball(i);
            for axis in 0..3 {
                balls.middles[axis][i] = middle[axis];
            }
            balls.radii[i] = radius;
        }
        balls
    }
}
