//! Reads Wavefront OBJ text into a mesh. To come; the interface is fixed.

use grasp_synthesis::geometry::mesh::TriangleMesh;

/// What is read at most.
#[derive(Clone, Copy, Debug)]
pub struct ObjLimits {
    /// Bytes of text.
    pub bytes: usize,
    /// Vertices.
    pub vertices: usize,
    /// Triangles after polygons were split into fans.
    pub triangles: usize,
}

/// A mesh with the names that its parts had in the file.
#[derive(Clone, Debug)]
pub struct ObjMesh {
    /// Vertices (welded) and triangles, in file order; scaled to metres.
    pub mesh: TriangleMesh,
    /// For every group (`g`), object (`o`) and material (`usemtl`) name: its triangles, ascending. Sorted by name.
    pub groups: Vec<(String, Vec<u32>)>,
    /// What was odd but could be used: dropped triangles without area, unused vertices, open edges, …
    pub warnings: Vec<String>,
}

/// Why OBJ text was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObjError {
    /// Nothing to touch.
    #[error("the mesh has no triangles")]
    Empty,
}

/// Reads OBJ text; `unit_metres` is the length of one unit.
///
/// # Errors
/// Everything that is wrong with it; see [`ObjError`].
pub fn read_obj(_text: &[u8], _unit_metres: f32, _limits: ObjLimits) -> Result<ObjMesh, Vec<ObjError>> {
    Err(vec![ObjError::Empty])
}
