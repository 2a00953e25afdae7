//! Test meshes, in metres and the size of things that fit a hand.

use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec3};
use grasp_synthesis::geometry::mesh::TriangleMesh;

use crate::random::Random;

/// A mesh in the making.
#[derive(Clone, Default)]
pub(crate) struct Parts {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Parts {
    /// A square of n × n cells from `corner` along `u` and `v`, facing u × v, in a cube from -1 to 1 that `place` puts
    /// in its place; with vertices of its own.
    fn face(&mut self, corner: Vec3, u: Vec3, v: Vec3, n: u32, place: impl Fn(Vec3) -> Vec3) {
        let first = self.positions.len() as u32;
        for j in 0..=n {
            for i in 0..=n {
                let step = |k: u32| 2.0 * k as f32 / n as f32;
                self.positions.push(place(corner + u * step(i) + v * step(j)));
            }
        }
        for j in 0..n {
            for i in 0..n {
                let a = first + j * (n + 1) + i;
                let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
                self.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }

    pub(crate) fn cuboid(mut self, centre: Vec3, half: Vec3, n: u32) -> Self {
        for axis in 0..3 {
            let [u, v, w] = [1, 2, 0].map(|k| Vec3::AXES[(axis + k) % 3]);
            let place = |p: Vec3| centre + half * p;
            self.face(2.0 * w - Vec3::ONE, u, v, n, place);
            self.face(-Vec3::ONE, v, u, n, place);
        }
        self
    }

    /// A surface of revolution-like grid: `at(i, j)` with i and j wrapping around as asked.
    fn sphere(mut self, centre: Vec3, radius: f32, n: u32, outward: bool) -> Self {
        let first = self.positions.len() as u32;
        self.positions.push(centre + Vec3::Y * radius);
        for ring in 1..n {
            let (sin, cos) = (PI * ring as f32 / n as f32).sin_cos();
            for sector in 0..2 * n {
                let (s, c) = (TAU * sector as f32 / (2 * n) as f32).sin_cos();
                self.positions
                    .push(centre + radius * Vec3::new(sin * s, cos, sin * c));
            }
        }
        self.positions.push(centre - Vec3::Y * radius);
        let last = self.positions.len() as u32 - 1;
        let at = |ring: u32, sector: u32| match ring {
            0 => first,
            r if r == n => last,
            r => first + 1 + (r - 1) * 2 * n + sector % (2 * n),
        };
        for ring in 0..n {
            for sector in 0..2 * n {
                let quad = [
                    at(ring, sector),
                    at(ring + 1, sector),
                    at(ring + 1, sector + 1),
                    at(ring, sector + 1),
                ];
                for corners in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
                    let [a, b, c] = corners;
                    if a != b && b != c && c != a {
                        self.triangles.push(if outward { corners } else { [a, c, b] });
                    }
                }
            }
        }
        self
    }

    pub(crate) fn mesh(self) -> TriangleMesh {
        TriangleMesh::new(self.positions, self.triangles).expect("the mesh is sound")
    }
}

pub(crate) fn cuboid(half: Vec3, n: u32) -> TriangleMesh {
    Parts::default().cuboid(Vec3::ZERO, half, n).mesh()
}

pub(crate) fn sphere(radius: f32, n: u32) -> TriangleMesh {
    Parts::default()
        .sphere(Vec3::new(0.01, -0.02, 0.03), radius, n, true)
        .mesh()
}

/// A sphere with a spherical cavity.
pub(crate) fn hollow_sphere() -> TriangleMesh {
    Parts::default()
        .sphere(Vec3::ZERO, 0.05, 12, true)
        .sphere(Vec3::ZERO, 0.03, 12, false)
        .mesh()
}

pub(crate) fn inside_out_sphere() -> TriangleMesh {
    Parts::default().sphere(Vec3::ZERO, 0.04, 12, false).mesh()
}

pub(crate) fn torus(ring: f32, tube: f32, n: u32) -> TriangleMesh {
    let (rows, columns) = (2 * n, n);
    let mut parts = Parts::default();
    for i in 0..rows {
        for j in 0..columns {
            let (s, c) = (TAU * i as f32 / rows as f32).sin_cos();
            let (v, u) = (TAU * j as f32 / columns as f32).sin_cos();
            let out = ring + tube * u;
            parts.positions.push(Vec3::new(out * c, out * s, tube * v));
        }
    }
    for i in 0..rows {
        for j in 0..columns {
            let at = |i: u32, j: u32| (i % rows) * columns + j % columns;
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            parts.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    parts.mesh()
}

/// Two boxes of which a part is in common.
pub(crate) fn overlapping_boxes() -> TriangleMesh {
    Parts::default()
        .cuboid(Vec3::ZERO, Vec3::new(0.04, 0.03, 0.02), 4)
        .cuboid(Vec3::new(0.03, 0.02, 0.01), Vec3::new(0.03, 0.03, 0.03), 3)
        .mesh()
}

/// A box without its lid.
pub(crate) fn open_box() -> TriangleMesh {
    let half = Vec3::new(0.04, 0.03, 0.05);
    let closed = cuboid(half, 4);
    let is_lid = |corners: &[u32; 3]| {
        corners
            .iter()
            .all(|&v| closed.positions()[v as usize].z > half.z - 1e-6)
    };
    let kept = closed
        .triangles()
        .iter()
        .copied()
        .filter(|corners| !is_lid(corners))
        .collect();
    TriangleMesh::new(closed.positions().to_vec(), kept).expect("the mesh is sound")
}

/// A very long and thin double cone of slivers.
pub(crate) fn needle() -> TriangleMesh {
    let mut parts = Parts::default();
    let n = 16;
    parts.positions.extend([Vec3::Z * 0.1, Vec3::Z * -0.1]);
    for i in 0..n {
        let (s, c) = (TAU * i as f32 / n as f32).sin_cos();
        parts.positions.push(Vec3::new(0.0005 * c, 0.0005 * s, 0.02));
    }
    for i in 0..n {
        let (a, b) = (2 + i, 2 + (i + 1) % n);
        parts.triangles.extend([[0, a, b], [1, b, a]]);
    }
    parts.mesh()
}

/// Triangles anywhere.
pub(crate) fn soup() -> TriangleMesh {
    let mut random = Random::new(77);
    let mut parts = Parts::default();
    for i in 0..300 {
        let centre = random.in_cube() * 0.08;
        let size = random.between(0.001, 0.04);
        for _ in 0..3 {
            parts.positions.push(centre + random.in_cube() * size);
        }
        parts.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    parts.mesh()
}

/// The same mesh turned and moved.
pub(crate) fn moved(mesh: &TriangleMesh, rotation: Quat, translation: Vec3) -> TriangleMesh {
    let positions = mesh
        .positions()
        .iter()
        .map(|&p| rotation * p + translation)
        .collect();
    TriangleMesh::new(positions, mesh.triangles().to_vec()).expect("the mesh is sound")
}

/// Everything that encloses a volume, by name.
pub(crate) fn solids() -> Vec<(&'static str, TriangleMesh)> {
    vec![
        ("box", cuboid(Vec3::new(0.05, 0.03, 0.02), 1)),
        ("gridded box", cuboid(Vec3::new(0.0625, 0.03125, 0.015_625), 8)),
        (
            "turned box",
            moved(
                &cuboid(Vec3::new(0.05, 0.03, 0.02), 6),
                Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7),
                Vec3::new(0.3, -0.2, 0.5),
            ),
        ),
        ("sphere", sphere(0.04, 16)),
        ("torus", torus(0.05, 0.015, 24)),
        ("plate", cuboid(Vec3::new(0.05, 0.03, 0.0005), 6)),
        ("overlapping boxes", overlapping_boxes()),
        ("needle", needle()),
        ("hollow sphere", hollow_sphere()),
        ("inside-out sphere", inside_out_sphere()),
    ]
}

/// Everything, by name.
pub(crate) fn all() -> Vec<(&'static str, TriangleMesh)> {
    let mut meshes = solids();
    meshes.push(("open box", open_box()));
    meshes.push(("soup", soup()));
    meshes
}
