//! Triangle meshes.

use glam::{DVec3, Vec3};

use super::aabb::Aabb;

/// A triangle mesh: every index is in range, every coordinate finite, no triangle without area.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// Why a mesh was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There is nothing to touch.
    #[error("the mesh has no triangles")]
    Empty,
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}, but there are {vertices} vertices")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A triangle has no area.
    #[error("triangle {triangle} has no area")]
    Degenerate {
        /// Index of the triangle.
        triangle: usize,
    },
}

impl TriangleMesh {
    /// A mesh from positions in metres and triangles, counter-clockwise seen from outside.
    ///
    /// # Errors
    /// The first thing that is wrong; see [`MeshError`].
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        check_finite(&positions)?;
        for (triangle, corners) in triangles.iter().enumerate() {
            check_indices(triangle, *corners, positions.len())?;
            if !has_area(&positions, *corners) {
                return Err(MeshError::Degenerate { triangle });
            }
        }
        Ok(Self { positions, triangles })
    }

    /// The same, but triangles without area are left out: for meshes that are deformed. Indices of triangles then mean
    /// those that remain.
    ///
    /// # Errors
    /// The first thing that is wrong; [`MeshError::Empty`] if no triangle remains.
    pub fn without_degenerates(positions: Vec<Vec3>, triangles: &[[u32; 3]]) -> Result<Self, MeshError> {
        check_finite(&positions)?;
        let mut kept = Vec::with_capacity(triangles.len());
        for (triangle, corners) in triangles.iter().enumerate() {
            check_indices(triangle, *corners, positions.len())?;
            if has_area(&positions, *corners) {
                kept.push(*corners);
            }
        }
        if kept.is_empty() {
            return Err(MeshError::Empty);
        }
        Ok(Self {
            positions,
            triangles: kept,
        })
    }

    /// The triangles that `is_chosen` says by their indices, with the vertices that they have; none if it says none.
    pub fn part(&self, is_chosen: impl Fn(usize) -> bool) -> Option<Self> {
        let mut part = Self {
            positions: Vec::new(),
            triangles: Vec::new(),
        };
        let mut moved_to = vec![None; self.positions.len()];
        for (_, corners) in self.triangles.iter().enumerate().filter(|&(i, _)| is_chosen(i)) {
            part.triangles.push(corners.map(|vertex| {
                *moved_to[vertex as usize].get_or_insert_with(|| {
                    part.positions.push(self.positions[vertex as usize]);
                    (part.positions.len() - 1) as u32
                })
            }));
        }
        (!part.triangles.is_empty()).then_some(part)
    }

    /// The vertices in metres.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The triangles as vertex indices.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// The outward unit normal of a triangle.
    pub fn normal(&self, triangle: usize) -> Vec3 {
        // In f64, so that slivers and tiny triangles get a sound normal: products of f32 differences are exact there.
        let [a, b, c] = self.corners(triangle).map(Vec3::as_dvec3);
        (b - a).cross(c - a).normalize_or(DVec3::Y).as_vec3()
    }

    /// The axis-aligned box around the triangles.
    pub fn aabb(&self) -> Aabb {
        Aabb::around(
            self.triangles
                .iter()
                .flatten()
                .map(|&v| self.positions[v as usize]),
        )
    }

    /// Area of the surface in m².
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|triangle| {
                let [a, b, c] = self.corners(triangle).map(Vec3::as_dvec3);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum()
    }

    /// The volume in m³ by the divergence theorem: negative if the mesh is inside out. Overlapping parts count twice;
    /// it means nothing for a mesh that is not closed.
    pub fn signed_volume(&self) -> f64 {
        self.volume_moments().0
    }

    /// The centroid of the volume in metres: the centre of mass of a homogeneous body. None if the mesh encloses no
    /// volume: if it is below a billionth of that of its box, or the centroid falls outside that box, as for a mesh
    /// that is far from closed.
    pub fn volume_centroid(&self) -> Option<Vec3> {
        /// Share of the box's volume that is taken for the sum of rounding errors.
        const NO_VOLUME: f64 = 1e-9;
        let aabb = self.aabb();
        let (volume, centroid) = self.volume_moments();
        let of_box = aabb.extents().as_dvec3().element_product();
        let centroid = centroid.as_vec3();
        (volume.abs() > NO_VOLUME * of_box && aabb.contains(centroid)).then_some(centroid)
    }

    /// Volume and centroid: the sums over the tetrahedra between the triangles and a point in the middle of the mesh.
    fn volume_moments(&self) -> (f64, DVec3) {
        let origin = self.aabb().centre().as_dvec3();
        let mut volume = 0.0;
        let mut moment = DVec3::ZERO;
        for triangle in 0..self.triangles.len() {
            let [a, b, c] = self.corners(triangle).map(|corner| corner.as_dvec3() - origin);
            let tetrahedron = a.dot(b.cross(c)) / 6.0;
            volume += tetrahedron;
            moment += tetrahedron * 0.25 * (a + b + c);
        }
        (volume, origin + moment / volume)
    }
}

fn check_finite(positions: &[Vec3]) -> Result<(), MeshError> {
    match positions.iter().position(|p| !p.is_finite()) {
        Some(vertex) => Err(MeshError::NotFinite { vertex }),
        None => Ok(()),
    }
}

fn check_indices(triangle: usize, corners: [u32; 3], vertices: usize) -> Result<(), MeshError> {
    match corners.into_iter().find(|&v| v as usize >= vertices) {
        Some(vertex) => Err(MeshError::IndexOutOfRange {
            triangle,
            vertex,
            vertices,
        }),
        None => Ok(()),
    }
}

/// True if the corners span an area that is a normal `f32`; indices must be in range.
fn has_area(positions: &[Vec3], corners: [u32; 3]) -> bool {
    let [a, b, c] = corners.map(|v| positions[v as usize]);
    // In f32, like the search structures: what underflows or overflows there must not count as an area.
    (b - a).cross(c - a).length().is_normal()
}
