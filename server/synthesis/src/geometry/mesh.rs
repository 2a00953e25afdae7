//! Triangle meshes.

use glam::Vec3;

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
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite { vertex });
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= positions.len()) {
                return Err(MeshError::IndexOutOfRange {
                    triangle,
                    vertex,
                    vertices: positions.len(),
                });
            }
            let [a, b, c] = corners.map(|v| positions[v as usize]);
            // NaN-safe: an overflowing product must not count as an area.
            let doubled_area = (b - a).cross(c - a).length();
            if !(doubled_area.is_finite() && doubled_area > 0.0) {
                return Err(MeshError::Degenerate { triangle });
            }
        }
        Ok(Self { positions, triangles })
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
        let [a, b, c] = self.corners(triangle);
        // Scaled first: the product of two tiny edges would underflow.
        let scale = (b - a)
            .abs()
            .max_element()
            .max((c - a).abs().max_element())
            .recip();
        ((b - a) * scale).cross((c - a) * scale).normalize_or(Vec3::Y)
    }
}
