//! Reads meshes and hands' rigs from untrusted bytes: OBJ, STL, PLY, and glTF with its buffers inside, recognised by their
//! content.
//!
//! One module per format. Each reader is given [`MeshLimits`] and keeps to them:
//! - Memory stays proportional to the bytes within the limits, whatever counts and sizes the file claims.
//! - No file is opened and no network is used: references to other files are ignored or refused by name.
//! - Violations are reported with their places in the file, up to a bounded number; nothing panics.
//!
//! The mesh that a reader returns is split into triangles, welded and checked in the same way: see [`read_mesh`].

mod edges;
mod error;
mod format;
mod gltf;
mod obj;
mod part_names;
mod parts;
mod ply;
mod polygon;
mod raw;
mod repair;
mod rig;
mod stl;
#[cfg(test)]
mod tests;
mod text;
mod winding;

use glam::{DVec3, Vec3};
use grasp_synthesis::{base::stop::Stop, geometry::mesh::TriangleMesh};

pub use error::ImportError;
pub use raw::keeps_origin;
pub use rig::{
    Binding, ImportedHand, ImportedRig, MappedJoint, ModelPose, PosedNode, PosedSkin, RigSource, posed_skin,
    read_rig, rig_at_rest,
};

use error::check_count;
use format::Format;
use raw::{Places, RawMesh, check_counts};
use repair::repair;

/// Largest distance of a vertex from the file's origin along an axis, in metres, where double precision has steps of 0.1 µm.
const MAX_COORDINATE_METRES: f64 = 1e9;

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
    fn unwelded(self) -> Self {
        Self {
            vertices: self.vertices.max(self.triangles.saturating_mul(3)),
            ..self
        }
    }
}

/// The axis that points up in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpAxis {
    /// +Y, as in glTF and in the service.
    Y,
    /// +Z, as modelling tools and CAD have it: (x, y, z) becomes (x, z, −y).
    Z,
}

/// How the coordinates of a file become those of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Import {
    /// The length of one unit of the file, in metres.
    pub unit_metres: f32,
    /// The axis that points up in the file.
    pub up_axis: UpAxis,
}

impl Default for Import {
    fn default() -> Self {
        Self::METRES
    }
}

impl Import {
    /// Of a file in metres, with +Y up.
    pub const METRES: Self = Self::with_unit(1.0);

    /// Of a file whose unit has a length in metres, with +Y up.
    pub const fn with_unit(unit_metres: f32) -> Self {
        Self {
            unit_metres,
            up_axis: UpAxis::Y,
        }
    }

    /// A position or an offset of the file in the object's axes, in metres.
    fn metres_from_file(self, position: DVec3) -> DVec3 {
        let DVec3 { x, y, z } = position * f64::from(self.unit_metres);
        match self.up_axis {
            UpAxis::Y => DVec3::new(x, y, z),
            UpAxis::Z => DVec3::new(x, z, -y),
        }
    }
}

/// A mesh and the names of its parts.
#[derive(Clone, Debug)]
pub struct ImportedMesh {
    /// Vertices (welded, in order of first use) and triangles (in the file's order, n - 2 for a polygon of n corners; the
    /// fan from its first corner if that one sees all others), in metres with +Y up.
    pub mesh: TriangleMesh,
    /// The origin of the mesh in the file, in the file's units and axes: zero, unless the mesh was too far from the file's origin
    /// and its own is the centre of its box.
    pub origin_in_file: DVec3,
    /// For each triangle, its index in the file, counted from 0 after polygons are split and before triangles are
    /// dropped; ascending.
    pub indices_in_file: Vec<u32>,
    /// Number of triangles in the file, dropped ones included.
    pub triangles_in_file: usize,
    /// The triangles of each name, ascending; sorted by name. Names are those of groups (`g`), objects (`o`) and materials
    /// (`usemtl`) of OBJ, of solids of STL, and of nodes, meshes and materials of glTF.
    pub groups: Vec<(String, Vec<u32>)>,
    /// Defects that do not prevent use: dropped triangles, unused vertices, open edges and the like.
    pub warnings: Vec<String>,
}

/// Reads a mesh: of a file of several parts, those that are seen. What is invisible, there for collisions or in a lower level of
/// detail, by marks of glTF or by its name, is left out with a warning.
///
/// Polygons are split into triangles that cover them once; only one that intersects itself becomes a fan that overlaps, with
/// a warning. Coordinates are in double precision until unit, axes and origin are applied: a mesh whose box is centred more than
/// 10 m from the file's origin is moved there, with a warning. Vertices at equal positions are welded. Triangles that face the
/// wrong way are turned and those that are there twice dropped, where that is certain, with warnings.
///
/// # Errors
/// Every violation; see [`ImportError`]. Beyond 16 they are only counted.
pub fn read_mesh(bytes: &[u8], import: Import, limits: MeshLimits) -> Result<ImportedMesh, Vec<ImportError>> {
    read_mesh_until(bytes, import, &[], limits, Stop::NEVER)
}

/// The mesh of triangles that are in memory already, `corners` being their vertices by index, welded and repaired as
/// [`read_mesh`] does; in metres.
///
/// # Errors
/// A coordinate is not finite or too far away, a corner is no vertex, or no triangle has an area.
pub fn mesh_of_triangles(
    positions: impl IntoIterator<Item = Vec3>,
    corners: &[[u32; 3]],
) -> Result<ImportedMesh, Vec<ImportError>> {
    let mut raw = RawMesh::new("", Places::Triangles);
    raw.positions.extend(positions.into_iter().map(Vec3::as_dvec3));
    let names = raw.names.add_part("");
    let vertices = raw.positions.len();
    for (place, &corners) in corners.iter().enumerate() {
        if let Some(wrong) = corners.into_iter().find(|&corner| corner as usize >= vertices) {
            return Err(vec![ImportError::at(
                format!("triangle {place}"),
                format!("has vertex {wrong}; there are {vertices}, counted from 0"),
            )]);
        }
        raw.add_triangle(corners, place, names);
    }
    raw.check_coordinates(1.0)?;
    Ok(repair(raw, Import::METRES, DVec3::ZERO, Stop::NEVER)?)
}

/// As [`read_mesh`], unless it is stopped, and only parts with one of some names, if there are any.
///
/// # Errors
/// Those of [`read_mesh`], [`ImportError::NoSuchPart`] or [`ImportError::Stopped`].
pub fn read_mesh_until(
    bytes: &[u8],
    import: Import,
    parts: &[String],
    limits: MeshLimits,
    stop: Stop<'_>,
) -> Result<ImportedMesh, Vec<ImportError>> {
    let unit = import.unit_metres;
    if !(unit.is_finite() && unit > 0.0) {
        let what = format!("a unit of {unit} m cannot be used; it must be finite and more than 0");
        return Err(ImportError::Whole(what).into());
    }
    check_count("the file", "bytes", bytes.len() as u64, limits.bytes)?;
    let mut raw = match Format::of(bytes) {
        Format::Obj => obj::read(bytes, unit, limits, stop)?,
        Format::StlText => stl::read_text(bytes, limits, stop)?,
        Format::StlBinary => stl::read_binary(bytes, limits, stop)?,
        Format::Ply => ply::read(bytes, limits.unwelded(), stop)?,
        Format::Gltf => gltf::read(bytes, limits.unwelded(), stop)?,
    };
    parts::leave_out(&mut raw, parts)?;
    raw.check_coordinates(f64::from(unit))?;
    let origin_in_file = raw.recentre(import);
    let read = repair(raw, import, origin_in_file, stop)?;
    check_counts(read.mesh.positions().len() as u64, 0, limits)?;
    Ok(read)
}
