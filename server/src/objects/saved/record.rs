//! The record of a saved object.

use std::time::SystemTime;

use grasp_proto::v1;
use prost::Message;
use uuid::Uuid;

use crate::{
    objects::{Record, name_of},
    saved::Unreadable,
    validate::RequestKey,
};

/// SHA-256 of a mesh.
pub(crate) type MeshHash = [u8; 32];

/// Everything about a saved object but its mesh.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct SavedObject {
    /// The request that would create the object as it is, without mesh and request id.
    #[prost(message, required, tag = "1")]
    pub request: v1::CreateObjectRequest,
    /// SHA-256 of the mesh file.
    #[prost(bytes = "vec", tag = "2")]
    mesh_sha256: Vec<u8>,
    /// Size of the mesh file in bytes.
    #[prost(uint64, tag = "3")]
    pub mesh_bytes: u64,
    /// The id of the request that created it; empty if it had none.
    #[prost(bytes = "vec", tag = "4")]
    request_id: Vec<u8>,
    /// SHA-256 of the content of that request; empty without an id.
    #[prost(bytes = "vec", tag = "5")]
    request_content: Vec<u8>,
    /// Identifies the state.
    #[prost(string, tag = "6")]
    pub etag: String,
    /// When the object was created.
    #[prost(message, required, tag = "7")]
    created: prost_types::Timestamp,
    /// When a client last changed it.
    #[prost(message, required, tag = "8")]
    updated: prost_types::Timestamp,
    /// What describes the object while its mesh is not in memory: without labels, etag, times and atlas.
    #[prost(message, required, tag = "9")]
    pub description: v1::Object,
}

impl SavedObject {
    /// The record of an object that a request creates.
    pub(crate) fn new(
        request: v1::CreateObjectRequest,
        (mesh_hash, mesh_bytes): (MeshHash, u64),
        request_key: Option<RequestKey>,
        record: &Record,
        description: v1::Object,
    ) -> Self {
        let mut saved = Self {
            request,
            mesh_sha256: mesh_hash.to_vec(),
            mesh_bytes,
            request_id: request_key.map_or_else(Vec::new, |key| key.id.as_bytes().to_vec()),
            request_content: request_key.map_or_else(Vec::new, |key| key.content.to_vec()),
            description,
            ..Self::default()
        };
        saved.set_record(record);
        saved
    }

    /// Replaces labels, etag and times.
    pub(crate) fn set_record(&mut self, record: &Record) {
        self.request.labels.clone_from(&record.labels);
        self.etag.clone_from(&record.etag);
        self.created = record.created.into();
        self.updated = record.updated.into();
    }

    /// Labels, etag and times.
    pub(crate) fn record(&self) -> Option<Record> {
        Some(Record {
            labels: self.request.labels.clone(),
            etag: self.etag.clone(),
            created: SystemTime::try_from(self.created).ok()?,
            updated: SystemTime::try_from(self.updated).ok()?,
        })
    }

    /// What is kept of it while its object is at rest: of the request, whose lists may be long, only id and labels.
    pub(crate) fn without_request(self) -> Self {
        let request = v1::CreateObjectRequest {
            object_id: self.request.object_id,
            labels: self.request.labels,
            ..Default::default()
        };
        Self { request, ..self }
    }

    /// What identifies the request that created it, if it had an id.
    pub(crate) fn request_key(&self) -> Option<RequestKey> {
        Some(RequestKey {
            id: Uuid::from_slice(&self.request_id).ok()?,
            content: self.request_content.as_slice().try_into().ok()?,
        })
    }

    /// SHA-256 of the mesh file.
    pub(crate) fn mesh_hash(&self) -> Option<MeshHash> {
        self.mesh_sha256.as_slice().try_into().ok()
    }

    /// The record of the object with this id.
    ///
    /// # Errors
    /// What is wrong with the message.
    pub(crate) fn from_message(id: &str, message: &[u8]) -> Result<Self, Unreadable> {
        let saved = Self::decode(message).map_err(|_| Unreadable::Message)?;
        let is_complete = saved.mesh_hash().is_some()
            && saved.record().is_some()
            && !saved.etag.is_empty()
            && saved.request_id.is_empty() == saved.request_key().is_none();
        if !is_complete {
            return Err(Unreadable::Message);
        }
        if saved.description.name != name_of(id) || saved.request.object_id != id {
            return Err(Unreadable::Name);
        }
        Ok(saved)
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, UNIX_EPOCH};

    use super::*;
    use crate::saved::{seal, unsealed};

    fn read(id: &str, bytes: &[u8]) -> Result<SavedObject, Unreadable> {
        SavedObject::from_message(id, unsealed(bytes)?)
    }

    fn saved() -> SavedObject {
        let request = v1::CreateObjectRequest {
            object_id: "mug".to_owned(),
            mass_kg: 0.3,
            ..Default::default()
        };
        let record = Record {
            labels: [("level".to_owned(), "kitchen".to_owned())].into(),
            etag: "1-2".to_owned(),
            created: UNIX_EPOCH + Duration::from_nanos(1_234_567_891),
            updated: UNIX_EPOCH + Duration::from_secs(7),
        };
        let description = v1::Object {
            name: "objects/mug".to_owned(),
            ..Default::default()
        };
        let key = RequestKey {
            id: Uuid::from_u128(7),
            content: [3; 32],
        };
        SavedObject::new(request, ([9; 32], 77), Some(key), &record, description)
    }

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let before = saved();
        let after = read("mug", &seal(&before)).unwrap();
        assert_eq!(before, after);
        let record = after.record().unwrap();
        assert_eq!(record.created, UNIX_EPOCH + Duration::from_nanos(1_234_567_891));
        assert_eq!(record.labels["level"], "kitchen");
        assert_eq!(after.request_key().unwrap().id, Uuid::from_u128(7));
        assert_eq!((after.mesh_hash(), after.mesh_bytes), (Some([9; 32]), 77));
    }

    #[test]
    fn every_changed_byte_is_found() {
        let bytes = seal(&saved());
        for place in 0..bytes.len() {
            for flipped in [0x01, 0x80, 0xff] {
                let mut damaged = bytes.to_vec();
                damaged[place] ^= flipped;
                assert_eq!(read("mug", &damaged), Err(Unreadable::Hash), "byte {place}");
            }
        }
    }

    #[test]
    fn every_cut_is_found() {
        let bytes = seal(&saved());
        for length in 0..bytes.len() {
            assert!(read("mug", &bytes[..length]).is_err(), "{length}");
        }
        let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
        assert!(read("mug", &longer).is_err());
    }

    #[test]
    fn a_record_of_another_object_or_version_is_found() {
        let bytes = seal(&saved());
        assert_eq!(read("cup", &bytes), Err(Unreadable::Name));
        for incomplete in [
            SavedObject {
                mesh_sha256: vec![9; 31],
                ..saved()
            },
            SavedObject {
                request_content: vec![3; 31],
                ..saved()
            },
            SavedObject {
                etag: String::new(),
                ..saved()
            },
        ] {
            let bytes = seal(&incomplete);
            assert_eq!(read("mug", &bytes), Err(Unreadable::Message));
        }
    }
}
