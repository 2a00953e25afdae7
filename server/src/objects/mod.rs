//! The objects that can be held out: built-in ones, those of the objects directory, and those that clients created, in
//! a cache of bounded size. Those that clients created may also be [`saved`] in a folder or bucket.

pub(crate) mod build;
pub(crate) mod derived;
pub(crate) mod directory;
pub(crate) mod given;
pub(crate) mod glb;
mod mesh_file;
pub(crate) mod saved;
pub(crate) mod store;
#[cfg(test)]
pub(crate) mod tests;

use std::{
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};

use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::{Stop, Stopped, unstopped},
    model::{object::GraspObject, plain_object::PlainObject},
};
use sha2::{Digest as _, Sha256};

pub(crate) use self::derived::Derived;
use self::{
    derived::{DerivedCell, expected_bytes},
    given::Given,
    mesh_file::MeshFile,
};
use crate::{
    access::Owner,
    atlas_slots::AtlasSlots,
    validate::{COLLECTION, Labels, Place},
    wire::{hex, wire_pose},
};

#[derive(Debug)]
pub(crate) struct StoredObject {
    pub id: String,
    pub built_in: bool,
    pub object: PlainObject,
    /// SHA-256 of vertices, triangles and forbidden set, in hexadecimal.
    pub content_hash: String,
    pub warnings: Vec<String>,
    pub file: Arc<MeshFile>,
    pub given: Given,
    pub atlas_slots: AtlasSlots,
    derived: DerivedCell,
    /// Cloned by every call that uses the object.
    uses: Arc<()>,
}

impl StoredObject {
    /// A built-in object with its derived data.
    pub(crate) fn built_in(id: String, object: Arc<GraspObject>) -> Self {
        let plain = object.plain().clone();
        let file = MeshFile::plain(plain.mesh.triangles().len());
        let given = Given::of_built_in(&plain);
        let stored = Self {
            built_in: true,
            ..Self::new(id, plain, given, Vec::new(), Arc::new(file))
        };
        unstopped(|stop| stored.fill(object, stop));
        stored
    }

    fn new(
        id: String,
        object: PlainObject,
        given: Given,
        warnings: Vec<String>,
        file: Arc<MeshFile>,
    ) -> Self {
        Self {
            id,
            built_in: false,
            content_hash: content_hash(&object),
            object,
            warnings,
            file,
            given,
            atlas_slots: AtlasSlots::default(),
            derived: DerivedCell::default(),
            uses: Arc::default(),
        }
    }

    /// Keeps the data derived from an object that has its search structures.
    fn fill(&self, object: Arc<GraspObject>, stop: Stop<'_>) -> Result<Arc<Derived>, Stopped> {
        self.derived.get_or_build(|| Derived::of(object, stop))
    }

    /// The derived data, built if necessary: some ten milliseconds, up to seconds for the largest meshes. It stays until
    /// the object is dropped; the store does the same within the bounds of the cache.
    pub(crate) fn derived_until(&self, stop: Stop<'_>) -> Result<Arc<Derived>, Stopped> {
        self.derived.get_or_build(|| {
            let object = GraspObject::of_until(self.object.clone(), stop)?;
            Derived::of(Arc::new(object), stop)
        })
    }

    /// Keeps the object and its derived data from being evicted as long as the reference is held.
    pub(crate) fn hold(&self) -> Arc<()> {
        Arc::clone(&self.uses)
    }

    pub(crate) fn name(&self) -> String {
        name_of(&self.id)
    }

    /// True if the same grips hold it as another object: their surface, properties and forbidden triangles are the same,
    /// and the places where hands are wanted.
    pub(crate) fn has_grips_of(&self, other: &Self) -> bool {
        let properties = |of: &Self| (of.object.mass, of.object.friction, of.object.centre_of_mass);
        let is_guided = |of: &Self| of.object.regions().require_contacts();
        self.content_hash == other.content_hash
            && properties(self) == properties(other)
            && (self.given.regions == other.given.regions || !is_guided(self) && !is_guided(other))
    }

    /// True if its derived data equals that of another object.
    fn derives_as(&self, other: &Self) -> bool {
        self.has_grips_of(other)
            && self.given.regions == other.given.regions
            && self.given.grips == other.given.grips
    }

    /// True if a call uses it: evicting it would free nothing.
    pub(crate) fn is_in_use(&self) -> bool {
        Arc::strong_count(&self.uses) > 1 || self.derived.is_in_use()
    }

    /// Its estimated size at rest in bytes, without atlases.
    pub(crate) fn bytes(&self) -> usize {
        self.object.bytes()
            + self.warnings.iter().map(String::len).sum::<usize>()
            + self.file.bytes()
            + self.given.bytes()
    }

    /// Its estimated size in bytes with its derived data, built or not.
    pub(crate) fn derived_and_own_bytes(&self) -> usize {
        let derived = self.derived.get();
        self.bytes() + derived.map_or_else(|| expected_bytes(&self.object), |derived| derived.bytes())
    }

    /// The message that describes the object but for its labels, etag, times, regions and known grips.
    fn description(&self) -> v1::GraspObject {
        let mesh = &self.object.mesh;
        let bounding_box = &self.object.bounding_box;
        let file = &self.file;
        let origin = file.origin.to_array();
        v1::GraspObject {
            name: self.name(),
            built_in: self.built_in,
            mass_kg: self.object.mass,
            center_of_mass: Some(self.object.centre_of_mass.into()),
            friction: self.object.friction,
            meters_per_unit: Some(file.unit_metres),
            z_up: file.z_up,
            parts: file.parts.to_vec(),
            triangle_count: count(mesh.triangles().len()),
            forbidden_triangle_count: count(self.object.forbidden_count()),
            bounding_box: Some(v1::BoxShape {
                pose: Some(wire_pose(bounding_box.object_from_box)),
                half_extents: Some(bounding_box.half_extents.into()),
            }),
            content_hash: self.content_hash.clone(),
            warnings: self.warnings.clone(),
            origin_in_file: if origin == [0.0; 3] {
                Vec::new()
            } else {
                origin.into()
            },
            ..v1::GraspObject::default()
        }
    }
}

/// The state of an object that changes without its search structures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Record {
    pub labels: Labels,
    pub owner: Owner,
    pub etag: String,
    pub created: SystemTime,
    /// When a client last changed it; not before `created`.
    pub updated: SystemTime,
}

/// An object in one of its states, ready for searches.
#[derive(Clone, Debug)]
pub(crate) struct Revision {
    pub object: Arc<StoredObject>,
    pub record: Arc<Record>,
}

/// An object, in memory or at rest.
#[derive(Clone, Debug)]
pub(crate) enum Body {
    Loaded(Arc<StoredObject>),
    /// Saved, and loaded when it is needed: the message that describes it, without labels, etag, times, regions and known grips.
    AtRest(Arc<v1::GraspObject>),
}

/// An object in one of its states, as lists show it: ready for searches or not.
#[derive(Clone, Debug)]
pub(crate) struct Listed {
    pub body: Body,
    pub record: Arc<Record>,
}

/// Bytes that a label takes beside its characters.
const LABEL_OVERHEAD: usize = 2 * size_of::<String>();

impl Listed {
    /// The last part of the object's name.
    pub(crate) fn id(&self) -> &str {
        match &self.body {
            Body::Loaded(object) => &object.id,
            Body::AtRest(resting) => id_of(&resting.name),
        }
    }

    /// The object, if it is ready for searches.
    pub(crate) fn object(&self) -> Option<&Arc<StoredObject>> {
        match &self.body {
            Body::Loaded(object) => Some(object),
            Body::AtRest(_) => None,
        }
    }

    /// The state of an object that is ready for searches, or else the message that describes it.
    pub(crate) fn loaded(self) -> Result<Revision, Arc<v1::GraspObject>> {
        let record = self.record;
        match self.body {
            Body::Loaded(object) => Ok(Revision { object, record }),
            Body::AtRest(resting) => Err(resting),
        }
    }

    fn bytes(&self) -> usize {
        let Some(object) = self.object() else { return 0 };
        let labels = self.record.labels.iter();
        let of_labels = labels.map(|(key, value)| key.len() + value.len() + LABEL_OVERHEAD);
        object.bytes() + of_labels.sum::<usize>()
    }

    pub(crate) fn place(&self) -> Place {
        Place {
            created: nanoseconds(self.record.created),
            id: self.id().to_owned(),
        }
    }

    /// The message that describes the object, without regions and known grips.
    pub(crate) fn to_wire(&self) -> v1::GraspObject {
        self.record.described(match &self.body {
            Body::Loaded(object) => object.description(),
            Body::AtRest(resting) => (**resting).clone(),
        })
    }
}

impl Record {
    /// A message about the object with labels, owner, etag and times.
    fn described(&self, object: v1::GraspObject) -> v1::GraspObject {
        v1::GraspObject {
            labels: self.labels.clone(),
            owner: self.owner.to_string(),
            etag: self.etag.clone(),
            create_time: Some(self.created.into()),
            update_time: Some(self.updated.into()),
            ..object
        }
    }
}

/// Nanoseconds since 1970; saturates in 1970 and 2554.
fn nanoseconds(time: SystemTime) -> u64 {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

/// The resource name of an id: "objects/{object}".
pub(crate) fn name_of(id: &str) -> String {
    format!("{COLLECTION}{id}")
}

pub(crate) fn id_of(name: &str) -> &str {
    name.strip_prefix(COLLECTION).unwrap_or(name)
}

/// Saturates; meshes are bounded far below 2^32 triangles and vertices.
fn count(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

/// SHA-256 over the counts, the vertices, the triangles and the forbidden set, all little-endian.
fn content_hash(object: &PlainObject) -> String {
    let mesh = &object.mesh;
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
