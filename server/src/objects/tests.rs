//! Objects for tests.

use bytes::Bytes;
use glam::Vec3;
use grasp_import::MeshLimits;
use grasp_synthesis::geometry::mesh::TriangleMesh;

use super::{build::build_object, *};
use crate::validate::{RegionFields, RegionKind, Violations, object_fields};

impl StoredObject {
    /// An object whose file has the triangles of its mesh.
    pub(crate) fn plain(id: &str, object: PlainObject) -> Self {
        let file = MeshFile::plain(object.mesh.triangles().len());
        Self::new(
            id.to_owned(),
            object,
            Given::default(),
            Vec::new(),
            Arc::new(file),
        )
    }
}

/// A tetrahedron of the given edge with one forbidden triangle.
pub(crate) fn tetrahedron(id: &str, edge: f32, forbidden: &[u32]) -> StoredObject {
    let positions = vec![Vec3::ZERO, Vec3::X * edge, Vec3::Y * edge, Vec3::Z * edge];
    let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let mesh = TriangleMesh::new(positions, triangles).unwrap();
    let object = unstopped(|stop| PlainObject::new_until(mesh, 0.1, Vec3::ZERO, Some(0.3), forbidden, stop));
    StoredObject::plain(id, object.unwrap())
}

pub(super) const LIMITS: MeshLimits = MeshLimits {
    bytes: 10_000,
    vertices: 100,
    triangles: 100,
};

/// A tetrahedron of an edge in centimetres and a mass in kilograms, as a client creates it, and its mesh file.
pub(super) fn with_mesh_file(id: &str, edge: u8, mass: f32) -> (StoredObject, Bytes) {
    let mesh =
        format!("v 0 0 0\nv {edge} 0 0\nv 0 {edge} 0\nv 0 0 {edge}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
    let mut request = v1::CreateObjectRequest::new(id, mesh.into_bytes(), mass);
    request.object_mut().meters_per_unit = Some(0.01);
    let violations = Violations::default();
    let fields = object_fields(request, LIMITS.bytes, &violations);
    let object = build_object(&fields, LIMITS, violations, Stop::NEVER).unwrap();
    (object, fields.mesh.into())
}

/// A region that is not to be touched.
pub(super) fn forbidden(groups: &[&str], triangles: &[u32]) -> RegionFields {
    RegionFields {
        given: v1::Region {
            groups: groups.iter().map(|&name| name.to_owned()).collect(),
            triangles: triangles.to_vec(),
            ..v1::Region::new("forbidden", v1::Preference::Forbidden)
        },
        kind: RegionKind::Forbidden,
        zones: Vec::new(),
    }
}

#[test]
fn content_hash_covers_mesh_and_forbidden_set_only() {
    let hash = |id, edge, forbidden| tetrahedron(id, edge, forbidden).content_hash;
    assert_eq!(hash("a", 1.0, &[]), hash("b", 1.0, &[]));
    assert_ne!(hash("a", 1.0, &[]), hash("a", 2.0, &[]));
    assert_ne!(hash("a", 1.0, &[]), hash("a", 1.0, &[1]));
    assert_eq!(hash("a", 1.0, &[]).len(), 64);
}
