//! Bounds on what a reader accepts.

/// Largest distance of a vertex from the origin along an axis, in metres. Anything a hand can hold is far smaller; a
/// larger value means a wrong unit, and products of such coordinates lose their precision.
pub const MAX_COORDINATE_METRES: f32 = 1000.0;

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
