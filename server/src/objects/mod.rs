//! The objects that can be held out: built-in ones, those of the objects directory, and those that clients created, in
//! a cache of bounded size. Those that clients created may also be [`saved`] in a folder or bucket.

pub(crate) mod build;
mod centre_of_mass;
pub(crate) mod change;
pub(crate) mod changes;
pub(crate) mod directory;
mod extent;
pub(crate) mod given;
pub(crate) mod glb;
mod mesh_file;
pub(crate) mod resized;
mod revision;
pub(crate) mod saved;
pub(crate) mod store;

use std::{
    sync::{Arc, OnceLock},
    thread,
};

use glam::DVec3;
use grasp_assets::{
    hands::{Hand, hand, is_built_in},
    primitives::held_primitives,
};
use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::{Stop, Stopped, unstopped},
    geometry::mesh::TriangleMesh,
    known::{primitives::HeldPrimitive, transferred_grips::TransferredGrips},
    model::{hand::Handedness, object::GraspObject, strategy::Validity},
    propose::placement_cache::PlacementCaches,
    propose::prepared::PreparedObject,
};
use sha2::{Digest as _, Sha256};

pub(crate) use self::revision::{Body, Listed, Record, Resting, Revision};
use self::{given::Given, mesh_file::MeshFile};
use crate::{
    answer::{vector, wire_pose},
    atlas_slots::AtlasSlots,
};

/// Bytes per triangle in the search structures, in addition to its three indices: the hierarchy's nodes, the prepared triangle
/// and the forbidden flag. A generous estimate, because it bounds the cache.
const SEARCH_BYTES_PER_TRIANGLE: usize = 192;

/// Where grips transferred to an object are kept once they are made.
type GripsSlot = OnceLock<Arc<TransferredGrips>>;

/// An object as the server keeps it.
#[derive(Debug)]
pub(crate) struct StoredObject {
    /// The last part of its name.
    pub id: String,
    /// True if it is part of the server.
    pub built_in: bool,
    /// The object in the form that searches use; every search holds a clone.
    pub object: Arc<PreparedObject>,
    /// SHA-256 of vertices, triangles and forbidden set, in hexadecimal.
    pub content_hash: String,
    /// Oddities of its mesh.
    pub warnings: Vec<String>,
    /// What is kept of its file.
    pub file: Arc<MeshFile>,
    /// What its client knows of it.
    pub given: Given,
    /// Its atlases.
    pub atlas_slots: AtlasSlots,
    /// Its transferred grips for each of [`held_primitives`], made when they are first needed.
    transferred_grips: Vec<GripsSlot>,
}

impl StoredObject {
    /// A built-in object.
    pub(crate) fn built_in(id: String, object: Arc<GraspObject>) -> Self {
        let file = MeshFile::plain(object.surface.mesh().triangles().len());
        Self {
            built_in: true,
            ..Self::from_file(id, object, Vec::new(), Arc::new(file))
        }
    }

    /// An object from a client's file.
    pub(crate) fn from_file(
        id: String,
        object: Arc<GraspObject>,
        warnings: Vec<String>,
        file: Arc<MeshFile>,
    ) -> Self {
        unstopped(|stop| Self::from_file_until(id, object, warnings, file, stop))
    }

    /// As [`Self::from_file`], unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn from_file_until(
        id: String,
        object: Arc<GraspObject>,
        warnings: Vec<String>,
        file: Arc<MeshFile>,
        stop: Stop<'_>,
    ) -> Result<Self, Stopped> {
        Ok(Self {
            id,
            built_in: false,
            content_hash: content_hash(&object),
            object: Arc::new(PreparedObject::new_until(object, stop)?),
            warnings,
            file,
            given: Given::default(),
            atlas_slots: AtlasSlots::default(),
            transferred_grips: held_primitives().iter().map(|_| OnceLock::new()).collect(),
        })
    }

    /// Fills the placement cache and transfers grips for both hands of a rig, which otherwise the first search with
    /// each hand would have to do. Takes some ten milliseconds per hand, in parallel if the system has a thread for it.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn prepare(&self, rig: &str, stop: Stop<'_>) -> Result<(), Stopped> {
        let prepare_hand = |handedness| -> Result<(), Stopped> {
            let Some(hand) = hand(rig, handedness) else {
                return Ok(());
            };
            self.object.build_placement_cache(&hand.rig, stop)?;
            if let Some((held, grips)) = self.transferred_grips_of(hand) {
                let transferred = TransferredGrips::of_until(&self.object, held, stop)?;
                grips.get_or_init(|| Arc::new(transferred));
            }
            Ok(())
        };
        thread::scope(|scope| {
            let left = thread::Builder::new().spawn_scoped(scope, || prepare_hand(Handedness::Left));
            let right = prepare_hand(Handedness::Right);
            let left = left.ok().and_then(|thread| thread.join().ok());
            left.unwrap_or_else(|| prepare_hand(Handedness::Left)).and(right)
        })
    }

    /// Grips of primitives transferred to this object, from which searches start while it has no atlas; none if none fits.
    /// There are such grips for one rig; hands of the clients' own rigs start from those, too.
    pub(crate) fn transferred_grips(&self, hand: &Hand) -> Option<Arc<TransferredGrips>> {
        let (held, grips) = self.transferred_grips_of(hand)?;
        let grips = grips.get_or_init(|| Arc::new(TransferredGrips::of(&self.object, held)));
        (!grips.is_empty()).then(|| Arc::clone(grips))
    }

    /// The primitives' grips for a hand, and the place of those transferred from them.
    fn transferred_grips_of(&self, hand: &Hand) -> Option<(&'static Arc<[HeldPrimitive]>, &GripsSlot)> {
        let all = || held_primitives().iter().zip(&self.transferred_grips);
        let is_side = |of: &Hand| of.rig.handedness == hand.rig.handedness;
        let own = all().find(|((of, _), _)| **of == *hand);
        let of_other = || all().find(|((of, _), _)| !is_built_in(hand) && is_side(of));
        let ((_, held), grips) = own.or_else(of_other)?;
        Some((held, grips))
    }

    /// "objects/{object}".
    pub(crate) fn name(&self) -> String {
        name_of(&self.id)
    }

    /// True if the same grips hold it as another object: their surface, properties and forbidden triangles are the same.
    pub(crate) fn has_grips_of(&self, other: &Self) -> bool {
        let properties = |of: &Self| (of.object.mass, of.object.friction, of.object.centre_of_mass);
        self.content_hash == other.content_hash && properties(self) == properties(other)
    }

    /// True if a search holds it: evicting it would free nothing.
    pub(crate) fn is_in_use(&self) -> bool {
        Arc::strong_count(&self.object) > 1
    }

    /// Its estimated size in bytes, without atlases.
    pub(crate) fn bytes(&self) -> usize {
        let of_mesh = |mesh: &TriangleMesh| {
            size_of_val(mesh.positions())
                + size_of_val(mesh.triangles())
                + mesh.triangles().len() * SEARCH_BYTES_PER_TRIANGLE
        };
        of_mesh(self.object.surface.mesh())
            + self
                .object
                .forbidden_surface()
                .map_or(0, |surface| of_mesh(surface.mesh()))
            + self.object.surface.distance_field_bytes()
            + self.object.local_thickness.bytes()
            + self.object.local_shape.bytes()
            + self.object.surface_pairs().bytes()
            + self.object.parts().bytes()
            + PlacementCaches::MAX_BYTES
            + self.transferred_grips.len() * TransferredGrips::MAX_BYTES
            + self.warnings.iter().map(String::len).sum::<usize>()
            + self.file.bytes()
            + self.object.regions().bytes()
            + self.given.bytes()
    }

    /// The message that describes the object but for its labels, etag, times, atlas, regions and known grips.
    fn description(&self) -> v1::Object {
        let mesh = self.object.surface.mesh();
        let bounding_box = &self.object.bounding_box;
        v1::Object {
            name: self.name(),
            built_in: self.built_in,
            triangle_count: count(mesh.triangles().len()),
            vertex_count: count(mesh.positions().len()),
            mass_kg: self.object.mass,
            centre_of_mass: Some(vector(self.object.centre_of_mass)),
            friction: self.object.friction_under(Validity::Thesis),
            forbidden_triangle_count: count(self.object.forbidden_count()),
            object_from_box: Some(wire_pose(bounding_box.object_from_box)),
            box_half_extents: Some(vector(bounding_box.half_extents)),
            content_hash: self.content_hash.clone(),
            warnings: self.warnings.clone(),
            origin_in_file: (self.file.origin != DVec3::ZERO).then_some(v1::DoubleVector3 {
                x: self.file.origin.x,
                y: self.file.origin.y,
                z: self.file.origin.z,
            }),
            ..v1::Object::default()
        }
    }
}

/// The resource name of an id: "objects/{object}".
pub(crate) fn name_of(id: &str) -> String {
    format!("objects/{id}")
}

/// Saturates; meshes are bounded far below 2^32 triangles and vertices.
fn count(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

/// SHA-256 over the counts, the vertices, the triangles and the forbidden set, all little-endian.
fn content_hash(object: &GraspObject) -> String {
    let mesh = object.surface.mesh();
    let mut hash = Sha256::new();
    hash.update((mesh.positions().len() as u64).to_le_bytes());
    hash.update((mesh.triangles().len() as u64).to_le_bytes());
    for position in mesh.positions() {
        for coordinate in position.to_array() {
            hash.update(coordinate.to_le_bytes());
        }
    }
    for corner in mesh.triangles().iter().flatten() {
        hash.update(corner.to_le_bytes());
    }
    for triangle in 0..count(mesh.triangles().len()) {
        hash.update([u8::from(object.is_forbidden(triangle))]);
    }
    hex(&hash.finalize())
}

/// Bytes in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use glam::Vec3;
    use grasp_synthesis::geometry::mesh::TriangleMesh;

    use super::*;

    impl StoredObject {
        /// An object whose file has the triangles of its mesh.
        pub(crate) fn plain(id: &str, object: GraspObject) -> Self {
            let file = MeshFile::plain(object.surface.mesh().triangles().len());
            Self::from_file(id.to_owned(), Arc::new(object), Vec::new(), Arc::new(file))
        }
    }

    /// A tetrahedron of the given edge with one forbidden triangle.
    pub(crate) fn tetrahedron(id: &str, edge: f32, forbidden: &[u32]) -> StoredObject {
        let positions = vec![Vec3::ZERO, Vec3::X * edge, Vec3::Y * edge, Vec3::Z * edge];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let mesh = TriangleMesh::new(positions, triangles).unwrap();
        let object = GraspObject::new(mesh, 0.1, Vec3::ZERO, Some(0.3), forbidden).unwrap();
        StoredObject::plain(id, object)
    }

    #[test]
    fn content_hash_covers_mesh_and_forbidden_set_only() {
        let hash = |id, edge, forbidden| tetrahedron(id, edge, forbidden).content_hash;
        assert_eq!(hash("a", 1.0, &[]), hash("b", 1.0, &[]));
        assert_ne!(hash("a", 1.0, &[]), hash("a", 2.0, &[]));
        assert_ne!(hash("a", 1.0, &[]), hash("a", 1.0, &[1]));
        assert_eq!(hash("a", 1.0, &[]).len(), 64);
    }
}
