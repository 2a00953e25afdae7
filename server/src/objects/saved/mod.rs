//! Saved objects.
//!
//! Each object is a record `objects/{id}` and a mesh file `meshes/{SHA-256}`, which objects with the same mesh share. A mesh
//! is written before the first record that names it, and deleted after the last; each write replaces a file as a
//! whole. So a crash leaves every object whole or absent, and at worst a mesh without a record, which the next start removes.
//!
//! Every file is compared with its SHA-256 when it is read. One that does not match is never served, and stays for people to
//! inspect or replace. The names of all objects are in a file of their own, so that a lost record is missed.

#[cfg(test)]
mod tests;
mod version_0_1;

use std::{
    collections::{HashMap, HashSet},
    fmt,
    num::NonZeroUsize,
    sync::Arc,
    time::SystemTime,
};

use bytes::Bytes;
use futures_util::{StreamExt as _, TryStreamExt as _};
use grasp_import::MeshLimits;
use grasp_proto::v1;
use object_store::{Error, path::Path};
use prost::Message;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use uuid::Uuid;

use super::{Record, StoredObject, id_of, name_of};
use crate::{
    access::Owner,
    error::ServiceError,
    limits::BYTES_BESIDES_MESH,
    saved::{
        CreateFailure, MESHES, OBJECTS, Records, SavedFiles, StoreError, Unreadable, is_decodable, seal,
    },
    validate::{Labels, RequestKey},
    wire::hex,
};

/// Largest record in bytes.
const MAX_RECORD: u64 = 4 * BYTES_BESIDES_MESH as u64;

/// The number of the object in a record.
const OBJECT: usize = 10;

/// Records that are read at a time at the start.
const READ_AT_A_TIME: usize = 16;

/// Bytes per permit of the pool that meshes being loaded share.
const BYTES_PER_PERMIT: usize = 1 << 10;

/// SHA-256 of a mesh file.
pub(crate) type MeshHash = [u8; 32];

/// The saved objects, and how they are loaded. Every method that is async must run on the async runtime.
#[derive(Debug)]
pub(crate) struct SavedObjects {
    files: Arc<SavedFiles>,
    pub records: Records,
    /// Largest number of objects.
    pub maximum: usize,
    /// Bounds on meshes.
    pub limits: MeshLimits,
    /// One permit per object that may be loaded at a time.
    pub loads: Arc<Semaphore>,
    /// Permits for the bytes of their mesh files.
    load_bytes: Arc<Semaphore>,
    /// One permit: calls that wait for changes to end queue for it, so that only one of them blocks a thread.
    pub turn: Arc<Semaphore>,
}

/// The records found at the start.
#[derive(Debug, Default)]
pub(crate) struct FoundRecords {
    /// The records by id, without regions and known grips; `None` if damaged or missing.
    pub objects: Vec<(String, Option<SavedObject>)>,
    pub mesh_uses: MeshUses,
}

/// How many records name each mesh.
pub(crate) type MeshUses = HashMap<MeshHash, usize>;

impl SavedObjects {
    /// Up to `maximum` objects. Those that are loaded at a time have mesh files of at most `limits.bytes` together.
    pub(crate) fn new(
        files: Arc<SavedFiles>,
        maximum: NonZeroUsize,
        limits: MeshLimits,
        at_a_time: usize,
    ) -> Self {
        Self {
            records: Records::new(Arc::clone(&files), OBJECTS, MAX_RECORD),
            files,
            maximum: maximum.get(),
            limits,
            loads: Arc::new(Semaphore::new(at_a_time)),
            load_bytes: Arc::new(Semaphore::new(limits.bytes.div_ceil(BYTES_PER_PERMIT))),
            turn: Arc::new(Semaphore::new(1)),
        }
    }

    /// Reads every record, and removes meshes that no record names. An error if all records or meshes are missing.
    pub(crate) async fn read_all(&self) -> Result<FoundRecords, StoreError> {
        let failed = |error| self.files.error(&error);
        let meshes = self.files.list(MESHES).await.map_err(failed)?;
        let ids = self.records.ids().await?;
        if ids.files == 0 {
            self.check_lost(OBJECTS, ids.known.len(), "records").await?;
        }
        let read = ids.all.iter().cloned();
        let read = read.map(|id| async move { Ok((self.record(&id).await?, id)) });
        let mut read = futures_util::stream::iter(read).buffer_unordered(READ_AT_A_TIME);
        let mut found = FoundRecords::default();
        while let Some((saved, id)) = read.try_next().await.map_err(failed)? {
            let saved = saved.inspect_err(|wrong| log_damage(&id, wrong)).ok();
            if let Some(saved) = &saved {
                let hash = saved.mesh_hash();
                if meshes.get(&hex(&hash)) != Some(&saved.mesh_bytes) {
                    log_damage(&id, &"its mesh is missing or has another size");
                }
                *found.mesh_uses.entry(hash).or_default() += 1;
            }
            found.objects.push((id, saved.map(SavedObject::without_lists)));
        }
        drop(read);
        let used: HashSet<String> = found.mesh_uses.keys().map(|hash| hex(hash)).collect();
        if !used.iter().any(|mesh| meshes.contains_key(mesh)) {
            self.check_lost(MESHES, used.len(), "meshes").await?;
        }
        // With its mesh, a damaged record may still be replaced.
        let are_whole = found.objects.iter().all(|(_, saved)| saved.is_some());
        let unused = |mesh: &String| are_whole && !used.contains(mesh);
        for mesh in meshes.into_keys().filter(unused) {
            let path = Path::from_iter([MESHES, mesh.as_str()]);
            self.files.delete(&path).await.map_err(failed)?;
        }
        self.records.adopt(&ids).await?;
        for folder in [OBJECTS, MESHES] {
            self.files.mark(folder).await.map_err(failed)?;
        }
        Ok(found)
    }

    /// Checks a folder that has none of `count` files: one may be lost, but not several at once, nor the folder itself.
    async fn check_lost(&self, folder: &str, count: usize, what: &str) -> Result<(), StoreError> {
        let is_marked = self.files.is_marked(folder).await;
        if count == 0 || count == 1 && is_marked.map_err(|error| self.files.error(&error))? {
            return Ok(());
        }
        Err(self.files.error(&format_args!(
            "its folder {folder} has none of {count} {what}; mount the volume that has them, or remove {OBJECTS} and {OBJECTS}.names to \
             start without any object"
        )))
    }

    /// Writes a new object: its mesh, its record, and then the names of all.
    pub(crate) async fn create(
        &self,
        saved: &SavedObject,
        mesh: Bytes,
        names: Vec<String>,
    ) -> Result<(), CreateFailure> {
        let written = self.files.write(&mesh_path(&saved.mesh_hash()), mesh).await;
        if written.map_err(ServiceError::from).is_err() {
            return Err(CreateFailure { is_undone: true });
        }
        self.records.create(saved.id(), seal(saved), names).await
    }

    /// Writes the record of an object that has one.
    pub(crate) async fn write(&self, saved: &SavedObject) -> Result<(), Error> {
        self.records.write(saved.id(), seal(saved)).await
    }

    /// Deletes a mesh that no record names. If that fails, the next start does it.
    pub(crate) async fn delete_mesh(&self, hash: &MeshHash) {
        if let Err(error) = self.files.delete(&mesh_path(hash)).await {
            tracing::warn!(mesh = hex(hash), %error, "cannot delete the mesh of a deleted object");
        }
    }

    /// The record of an object. The inner error is why it cannot be read.
    pub(crate) async fn record(&self, id: &str) -> Result<Result<SavedObject, Unreadable>, Error> {
        let parse = |message: &[u8]| SavedObject::from_message(id, message);
        self.records.read(id, parse).await
    }

    /// The mesh file of an object, to be compared with its hash, and room for it until the permit is dropped. `None` if it is
    /// missing or too long. [`ServiceError::ObjectUnloadable`] if it is too large.
    pub(crate) async fn mesh(
        &self,
        saved: &SavedObject,
    ) -> Result<(Option<Bytes>, OwnedSemaphorePermit), ServiceError> {
        let (bytes, limit) = (saved.mesh_bytes, self.limits.bytes);
        if bytes > limit as u64 {
            return Err(ServiceError::ObjectUnloadable {
                name: name_of(saved.id()),
                reason: format!("its mesh has {bytes} bytes; the limit is {limit}"),
            });
        }
        let permits = (bytes as usize).div_ceil(BYTES_PER_PERMIT) as u32;
        let acquired = Arc::clone(&self.load_bytes).acquire_many_owned(permits).await;
        let room = acquired.map_err(|_| ServiceError::ShuttingDown)?;
        let read = self.files.read(&mesh_path(&saved.mesh_hash()), bytes).await?;
        Ok((read.ok(), room))
    }
}

/// Everything about a saved object but its mesh. Its messages are those of the contract, whose numbers never change.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct SavedObject {
    /// SHA-256 of the mesh file.
    #[prost(bytes = "vec", tag = "2")]
    mesh_sha256: Vec<u8>,
    /// Size of the mesh file in bytes.
    #[prost(uint64, tag = "3")]
    mesh_bytes: u64,
    /// The id of the request that created it; empty if it had none.
    #[prost(bytes = "vec", tag = "4")]
    request_id: Vec<u8>,
    /// SHA-256 of the content of that request; empty without an id.
    #[prost(bytes = "vec", tag = "5")]
    request_content: Vec<u8>,
    /// The object as clients get it.
    #[prost(message, required, tag = "10")]
    object: v1::GraspObject,
    /// Its centre of mass, if a client gave one.
    #[prost(message, optional, tag = "11")]
    given_centre_of_mass: Option<v1::Vector3>,
}

impl SavedObject {
    pub(crate) fn new(
        object: &StoredObject,
        record: &Record,
        request: Option<RequestKey>,
        mesh_hash: MeshHash,
        mesh_bytes: usize,
    ) -> Self {
        let mut saved = Self {
            mesh_sha256: mesh_hash.to_vec(),
            mesh_bytes: mesh_bytes as u64,
            request_id: request.map_or_else(Vec::new, |key| key.id.as_bytes().to_vec()),
            request_content: request.map_or_else(Vec::new, |key| key.content.to_vec()),
            ..Self::default()
        };
        saved.set(Some(object), record);
        saved
    }

    /// Replaces labels, etag and times, and the rest of the object if there is another.
    pub(crate) fn set(&mut self, object: Option<&StoredObject>, record: &Record) {
        if let Some(object) = object {
            self.given_centre_of_mass = object.given.centre_of_mass.map(Into::into);
            self.object = v1::GraspObject {
                regions: object.given.regions_to_wire(),
                known_grips: object.given.grips_to_wire(),
                ..object.description()
            };
        }
        self.object = record.described(std::mem::take(&mut self.object));
    }

    /// The last part of the object's name.
    fn id(&self) -> &str {
        id_of(&self.object.name)
    }

    /// The object as a client would create it to be as it is.
    pub(crate) fn given(self) -> v1::GraspObject {
        v1::GraspObject {
            center_of_mass: self.given_centre_of_mass,
            ..self.object
        }
    }

    /// The message that describes the object but for labels, etag, times, regions and known grips.
    pub(crate) fn description(self) -> v1::GraspObject {
        v1::GraspObject {
            labels: Labels::new(),
            owner: String::new(),
            etag: String::new(),
            ..self.without_lists().object
        }
    }

    /// Labels, etag and times. `None` without valid times.
    pub(crate) fn record(&self) -> Option<Record> {
        Some(Record {
            labels: self.object.labels.clone(),
            owner: Owner::named(&self.object.owner),
            etag: self.object.etag.clone(),
            created: SystemTime::try_from(self.object.create_time?).ok()?,
            updated: SystemTime::try_from(self.object.update_time?).ok()?,
        })
    }

    /// The part kept while its object is at rest: without regions and known grips, which may be long.
    pub(crate) fn without_lists(mut self) -> Self {
        self.object.regions = Vec::new();
        self.object.known_grips = Vec::new();
        self
    }

    /// Identifies the request that created it, if it had an id.
    pub(crate) fn request_key(&self) -> Option<RequestKey> {
        Some(RequestKey {
            id: Uuid::from_slice(&self.request_id).ok()?,
            content: self.request_content.as_slice().try_into().ok()?,
        })
    }

    /// Size of the mesh file in bytes.
    pub(crate) fn mesh_bytes(&self) -> u64 {
        self.mesh_bytes
    }

    /// SHA-256 of the mesh file.
    pub(crate) fn mesh_hash(&self) -> MeshHash {
        // Only refused messages have another length.
        self.mesh_sha256.as_slice().try_into().unwrap_or_default()
    }

    /// The record of the object with this id.
    pub(crate) fn from_message(id: &str, message: &[u8]) -> Result<Self, Unreadable> {
        if !is_decodable::<v1::GraspObject>(message, OBJECT) {
            return Err(Unreadable::Message);
        }
        let mut saved = Self::decode(message).map_err(|_| Unreadable::Message)?;
        if saved.object.name.is_empty() {
            let old = version_0_1::read(message).ok_or(Unreadable::Message)?;
            (saved.object, saved.given_centre_of_mass) = old;
        }
        let is_complete = saved.mesh_sha256.len() == size_of::<MeshHash>()
            && saved.record().is_some()
            && !saved.object.etag.is_empty()
            && saved.request_id.is_empty() == saved.request_key().is_none();
        if !is_complete {
            return Err(Unreadable::Message);
        }
        if saved.id() != id {
            return Err(Unreadable::Name);
        }
        Ok(saved)
    }
}

/// Logs why a saved object cannot be read.
pub(crate) fn log_damage(id: &str, reason: &dyn fmt::Display) {
    tracing::error!(object = name_of(id), %reason, "what was saved of an object is damaged");
}

fn mesh_path(hash: &MeshHash) -> Path {
    Path::from_iter([MESHES, hex(hash).as_str()])
}
