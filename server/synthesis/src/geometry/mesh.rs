//! Triangle meshes.

use glam::{DVec3, Vec3};

use super::boxes::Aabb;

/// A triangle mesh. Every index is in range, every coordinate finite, and every triangle has an area.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// Why a mesh was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There are no triangles.
    #[error("the mesh has no triangles")]
    Empty,
    /// A triangle refers to a vertex that does not exist.
    #[error("triangle {triangle} refers to vertex {vertex}, but there are {vertices} vertices")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it refers to.
        vertex: u32,
        /// Number of vertices.
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
    /// A mesh from positions, in metres, and triangles that are counter-clockwise seen from outside.
    ///
    /// # Errors
    /// The first violation found; see [`MeshError`].
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

    /// As [`TriangleMesh::new`], but drops triangles without area, which deformation may produce. Triangle indices
    /// then count the remaining ones.
    ///
    /// # Errors
    /// The first violation found; [`MeshError::Empty`] if no triangle remains.
    pub fn without_degenerates(positions: Vec<Vec3>, triangles: &[[u32; 3]]) -> Result<Self, MeshError> {
        check_finite(&positions)?;
        for (triangle, corners) in triangles.iter().enumerate() {
            check_indices(triangle, *corners, positions.len())?;
        }
        let kept = triangles.iter().copied();
        let triangles: Vec<[u32; 3]> = kept.filter(|&corners| has_area(&positions, corners)).collect();
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        Ok(Self { positions, triangles })
    }

    /// The same mesh, `scale` times as large about its origin.
    ///
    /// # Errors
    /// The first violation found: at the new size, a coordinate may overflow, or an area vanish.
    pub fn scaled(&self, scale: f32) -> Result<Self, MeshError> {
        let positions = self.positions.iter().map(|&position| position * scale);
        Self::new(positions.collect(), self.triangles.clone())
    }

    /// The triangles whose index `is_chosen` accepts, with the vertices they use; `None` if it accepts none.
    pub fn submesh(&self, is_chosen: impl Fn(usize) -> bool) -> Option<Self> {
        let mut submesh = Self {
            positions: Vec::new(),
            triangles: Vec::new(),
        };
        let mut new_index = vec![None; self.positions.len()];
        for (_, corners) in self.triangles.iter().enumerate().filter(|&(i, _)| is_chosen(i)) {
            submesh.triangles.push(corners.map(|vertex| {
                *new_index[vertex as usize].get_or_insert_with(|| {
                    submesh.positions.push(self.positions[vertex as usize]);
                    (submesh.positions.len() - 1) as u32
                })
            }));
        }
        (!submesh.triangles.is_empty()).then_some(submesh)
    }

    /// The vertex positions, in metres.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The triangles, as vertex indices.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The corners of a triangle, in metres.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// The outward unit normal of a triangle.
    pub fn normal(&self, triangle: usize) -> Vec3 {
        // f64 holds products of f32 differences exactly, so that slivers and tiny triangles get a sound normal.
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

    /// Surface area, in m².
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|triangle| {
                let [a, b, c] = self.corners(triangle).map(Vec3::as_dvec3);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum()
    }

    /// The volume by the divergence theorem, in m³; negative if the mesh is inside out. Overlapping parts count
    /// twice, and the value is meaningless unless the mesh is closed.
    pub fn signed_volume(&self) -> f64 {
        self.volume_moments().0
    }

    /// The centroid of the volume, in metres: the centre of mass of a homogeneous body. `None` if the mesh encloses no
    /// volume (less than a billionth of its box's) or is so far from closed that the centroid is outside its box.
    pub fn volume_centroid(&self) -> Option<Vec3> {
        /// Share of the box's volume below which a volume counts as rounding error.
        const NO_VOLUME: f64 = 1e-9;
        let aabb = self.aabb();
        let (volume, centroid) = self.volume_moments();
        let box_volume = aabb.extents().as_dvec3().element_product();
        let centroid = centroid.as_vec3();
        (volume.abs() > NO_VOLUME * box_volume && aabb.contains(centroid)).then_some(centroid)
    }

    /// Signed volume and centroid, summed over the tetrahedra between each triangle and the centre of the mesh's box.
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

/// True if the corners span an area that is a normal `f32` number. Indices must be in range.
fn has_area(positions: &[Vec3], corners: [u32; 3]) -> bool {
    let [a, b, c] = corners.map(|v| positions[v as usize]);
    // In f32 like the search structures, so that an area that underflows or overflows there is rejected here.
    (b - a).cross(c - a).length().is_normal()
}
