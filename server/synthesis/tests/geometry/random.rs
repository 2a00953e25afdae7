//! Random points and segments with fixed seeds.

use glam::{Quat, Vec3};
use grasp_synthesis::geometry::{Segment, mesh::TriangleMesh};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// A source of random geometry.
pub(crate) struct Random(Xoshiro256PlusPlus);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    /// A number from `low` to `high`.
    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.0.random::<f32>()
    }

    /// An index below `count`.
    pub(crate) fn index(&mut self, count: usize) -> usize {
        self.0.random_range(0..count)
    }

    /// A point in the cube from -1 to 1.
    pub(crate) fn in_cube(&mut self) -> Vec3 {
        Vec3::new(
            self.between(-1.0, 1.0),
            self.between(-1.0, 1.0),
            self.between(-1.0, 1.0),
        )
    }

    /// A unit vector.
    pub(crate) fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.in_cube();
            if (0.01..=1.0).contains(&v.length_squared()) {
                return v.normalize_or(Vec3::X);
            }
        }
    }

    /// A rotation.
    pub(crate) fn rotation(&mut self) -> Quat {
        Quat::from_axis_angle(self.direction(), self.between(0.0, std::f32::consts::PI))
    }

    /// A point in a box somewhat larger than the mesh's.
    pub(crate) fn near(&mut self, mesh: &TriangleMesh, slack: f32) -> Vec3 {
        let aabb = mesh.aabb();
        aabb.centre() + self.in_cube() * (aabb.extents() * 0.5 + slack)
    }

    /// A point on a random triangle, as exact as `f32` can name it, and the triangle.
    pub(crate) fn on_surface(&mut self, mesh: &TriangleMesh) -> (Vec3, usize) {
        let triangle = self.index(mesh.triangles().len());
        let [a, b, c] = mesh.corners(triangle).map(Vec3::as_dvec3);
        let (u, v) = (
            f64::from(self.between(0.0, 1.0)),
            f64::from(self.between(0.0, 1.0)),
        );
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        ((a + u * (b - a) + v * (c - a)).as_vec3(), triangle)
    }

    /// Segments of every kind that the synthesis asks about, and some that it should not: through the whole box, as
    /// short as a phalanx, starting or ending on the surface, starting 0.01 to 1 mm from it, along an axis, without
    /// length, between vertices.
    pub(crate) fn segment(&mut self, mesh: &TriangleMesh) -> Segment {
        let length = self.between(0.001, 0.06);
        let direction = self.direction();
        let (surface, triangle) = self.on_surface(mesh);
        match self.index(9) {
            0 => Segment::new(self.near(mesh, 0.02), self.near(mesh, 0.02)),
            1 => {
                let start = self.near(mesh, 0.02);
                Segment::new(start, start + direction * length)
            }
            2 => Segment::new(surface, surface + direction * length),
            3 => Segment::new(surface + direction * length, surface),
            4 => {
                let lift = self.between(1e-5, 1e-3) * if self.index(2) == 0 { 1.0 } else { -1.0 };
                let start = surface + mesh.normal(triangle) * lift;
                Segment::new(start, start + direction * length)
            }
            5 => {
                let start = surface + direction * self.between(0.0, 1e-3);
                Segment::new(
                    start,
                    start + Vec3::AXES[self.index(3)] * self.between(-0.05, 0.05),
                )
            }
            6 => {
                let vertex = |random: &mut Self| mesh.corners(random.index(mesh.triangles().len()))[0];
                Segment::new(vertex(self), vertex(self))
            }
            7 => Segment::new(surface, surface),
            _ => {
                let start = self.near(mesh, 0.0);
                Segment::new(start, start + (surface - start) * self.between(0.5, 1.5))
            }
        }
    }
}
