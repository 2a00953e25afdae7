//! Bounds on what a reader accepts.

/// Largest distance of a vertex from the file's origin along an axis, in metres. Farther out, even double precision has steps of
/// more than a tenth of a micrometre.
pub const MAX_COORDINATE_METRES: f64 = 1e9;

/// The largest file that a reader accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshLimits {
    /// Size of the file, in bytes.
    pub bytes: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles, after polygons are split.
    pub triangles: usize,
}

impl MeshLimits {
    /// For formats in which every triangle may have vertices of its own, which are welded later.
    pub(crate) fn unwelded(self) -> Self {
        Self {
            vertices: self.vertices.max(self.triangles.saturating_mul(3)),
            ..self
        }
    }
}
