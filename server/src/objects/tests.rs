//! Objects for tests.

use glam::Vec3;
use grasp_synthesis::geometry::mesh::TriangleMesh;

use super::*;
use crate::validate::{RegionFields, RegionKind};

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
