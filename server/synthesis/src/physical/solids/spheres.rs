//! Groups of eight spheres of a hand, stored by coordinate, so that all are compared with one solid at once.

use glam::{Mat3, Vec3};

use crate::base::pose::Pose;

/// Spheres per group: one register of single precision; a group takes two cache lines.
pub const SPHERES: usize = 8;

/// Eight spheres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(128))]
pub struct Spheres {
    /// Coordinates of the centres, in metres.
    pub(super) centres: [[f32; SPHERES]; 3],
    /// The radii in metres.
    pub(super) radii: [f32; SPHERES],
}

impl Spheres {
    /// Spheres from a function of their index that returns centre and radius in metres.
    #[inline]
    pub fn new(sphere: impl Fn(usize) -> (Vec3, f32)) -> Self {
        let mut spheres = Self::default();
        // A loop, because mapped arrays are not inlined.
        for i in 0..SPHERES {
            let (centre, radius) = sphere(i);
            for axis in 0..3 {
                spheres.centres[axis][i] = centre[axis];
            }
            spheres.radii[i] = radius;
        }
        spheres
    }

    /// Packs spheres into groups of eight, padded with spheres that are near nothing.
    pub fn of_all<const GROUPS: usize>(spheres: &[(Vec3, f32)]) -> [Self; GROUPS] {
        debug_assert!(
            spheres.len() <= GROUPS * SPHERES,
            "{} spheres do not fit",
            spheres.len()
        );
        let padding = (Vec3::ZERO, f32::NEG_INFINITY);
        std::array::from_fn(|group| {
            Self::new(|i| spheres.get(group * SPHERES + i).copied().unwrap_or(padding))
        })
    }

    /// The centres and radii, in metres.
    pub fn iter(&self) -> impl Iterator<Item = (Vec3, f32)> {
        let [xs, ys, zs] = &self.centres;
        (0..SPHERES).map(|i| (Vec3::new(xs[i], ys[i], zs[i]), self.radii[i]))
    }

    /// The spheres for which `is_kept` is true; the others are replaced by ones that are near nothing.
    #[must_use]
    pub fn kept(mut self, is_kept: impl Fn(usize) -> bool) -> Self {
        for (i, radius) in self.radii.iter_mut().enumerate() {
            if !is_kept(i) {
                *radius = f32::NEG_INFINITY;
            }
        }
        self
    }

    /// The same spheres in another frame, or under a rigid motion.
    #[must_use]
    pub fn transformed(&self, a_from_b: Pose) -> Self {
        let [x_axis, y_axis, z_axis] = Mat3::from_quat(a_from_b.orientation).to_cols_array_2d();
        let [xs, ys, zs] = &self.centres;
        let mut moved = *self;
        for axis in 0..3 {
            let from = a_from_b.position[axis];
            for i in 0..SPHERES {
                moved.centres[axis][i] =
                    from + x_axis[axis] * xs[i] + y_axis[axis] * ys[i] + z_axis[axis] * zs[i];
            }
        }
        moved
    }
}
