//! Some balls of a hand, coordinate by coordinate: all of them are compared with one solid at once.

use glam::{Mat3, Vec3};

use crate::base::pose::Pose;

/// How many balls are compared at once: a register's worth of single precision, and two cache lines.
pub const SPHERES: usize = 8;

/// Eight balls.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(128))]
pub struct Spheres {
    /// Coordinates of the middles, in metres.
    pub(super) middles: [[f32; SPHERES]; 3],
    /// Their radii, in metres.
    pub(super) radii: [f32; SPHERES],
}

impl Spheres {
    /// Balls of middle and radius in metres.
    #[inline]
    pub fn new(ball: impl Fn(usize) -> (Vec3, f32)) -> Self {
        let mut spheres = Self::default();
        // A loop, as mapped arrays stay calls.
        for i in 0..SPHERES {
            let (middle, radius) = ball(i);
            for axis in 0..3 {
                spheres.middles[axis][i] = middle[axis];
            }
            spheres.radii[i] = radius;
        }
        spheres
    }

    /// All of some balls, by eights; where that leaves room, nothing that is near to anything.
    pub fn of_all<const GROUPS: usize>(spheres: &[(Vec3, f32)]) -> [Self; GROUPS] {
        debug_assert!(
            spheres.len() <= GROUPS * SPHERES,
            "{} spheres do not fit",
            spheres.len()
        );
        let nothing = (Vec3::ZERO, f32::NEG_INFINITY);
        std::array::from_fn(|group| {
            Self::new(|i| spheres.get(group * SPHERES + i).copied().unwrap_or(nothing))
        })
    }

    /// Their middles and radii in metres.
    pub fn iter(&self) -> impl Iterator<Item = (Vec3, f32)> {
        let [xs, ys, zs] = &self.middles;
        (0..SPHERES).map(|i| (Vec3::new(xs[i], ys[i], zs[i]), self.radii[i]))
    }

    /// The balls that are to be kept; in place of the others nothing that is near to anything.
    #[must_use]
    pub fn kept(mut self, is_kept: impl Fn(usize) -> bool) -> Self {
        for (i, radius) in self.radii.iter_mut().enumerate() {
            if !is_kept(i) {
                *radius = f32::NEG_INFINITY;
            }
        }
        self
    }

    /// The same balls in another frame, or elsewhere and turned.
    #[must_use]
    pub fn transformed(&self, a_from_b: Pose) -> Self {
        let [x_axis, y_axis, z_axis] = Mat3::from_quat(a_from_b.orientation).to_cols_array_2d();
        let [xs, ys, zs] = &self.middles;
        let mut moved = *self;
        for axis in 0..3 {
            let from = a_from_b.position[axis];
            for i in 0..SPHERES {
                moved.middles[axis][i] =
                    from + x_axis[axis] * xs[i] + y_axis[axis] * ys[i] + z_axis[axis] * zs[i];
            }
        }
        moved
    }
}
