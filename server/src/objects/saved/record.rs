//! The record of a saved object.

use std::{collections::BTreeMap, time::SystemTime};

use grasp_proto::v1;
use prost::Message;
use uuid::Uuid;

use super::fields::Fields;
use crate::{objects::Record, saved::Unreadable, validate::RequestKey};

/// SHA-256 of a mesh.
pub(crate) type MeshHash = [u8; 32];

/// Everything about a saved object but its mesh.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct SavedObject {
    /// What the client gives it.
    #[prost(message, required, tag = "1")]
    fields: Fields,
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
    /// What is known of its mesh.
    #[prost(message, required, tag = "9")]
    findings: Findings,
}

/// What describes an object while its mesh is not in memory, beside what its client gives it.
#[derive(Clone, PartialEq, Message)]
struct Findings {
    #[prost(uint32, tag = "3")]
    triangle_count: u32,
    #[prost(message, optional, tag = "6")]
    centre_of_mass: Option<v1::Vector3>,
    #[prost(uint32, tag = "8")]
    forbidden_triangle_count: u32,
    #[prost(message, optional, tag = "9")]
    object_from_box: Option<v1::Pose>,
    #[prost(message, optional, tag = "10")]
    box_half_extents: Option<v1::Vector3>,
    #[prost(string, tag = "11")]
    content_hash: String,
    #[prost(string, repeated, tag = "12")]
    warnings: Vec<String>,
    #[prost(message, optional, tag = "14")]
    origin_in_file: Option<Origin>,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Origin {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

impl From<v1::GraspObject> for Findings {
    fn from(described: v1::GraspObject) -> Self {
        let bounding_box = described.bounding_box.unwrap_or_default();
        let origin_in_file = match described.origin_in_file[..] {
            [x, y, z] => Some(Origin { x, y, z }),
            _ => None,
        };
        Self {
            triangle_count: described.triangle_count,
            centre_of_mass: described.center_of_mass,
            forbidden_triangle_count: described.forbidden_triangle_count,
            object_from_box: bounding_box.pose,
            box_half_extents: bounding_box.half_extents,
            content_hash: described.content_hash,
            warnings: described.warnings,
            origin_in_file,
        }
    }
}

impl SavedObject {
    /// The record of an object that a client creates, from what the client gives it and from its description.
    pub(crate) fn new(
        given: v1::GraspObject,
        (mesh_hash, mesh_bytes): (MeshHash, u64),
        request_key: Option<RequestKey>,
        record: &Record,
        description: v1::GraspObject,
    ) -> Self {
        let mut saved = Self {
            mesh_sha256: mesh_hash.to_vec(),
            mesh_bytes,
            request_id: request_key.map_or_else(Vec::new, |key| key.id.as_bytes().to_vec()),
            request_content: request_key.map_or_else(Vec::new, |key| key.content.to_vec()),
            ..Self::default()
        };
        saved.set_object(given, description);
        saved.set_record(record);
        saved
    }

    /// The last part of the object's name.
    pub(crate) fn id(&self) -> &str {
        &self.fields.id
    }

    /// The object as a client would create it to be as it is.
    pub(crate) fn given(&self) -> v1::GraspObject {
        self.fields.clone().into()
    }

    /// Replaces what the client gives the object, and its description.
    pub(crate) fn set_object(&mut self, given: v1::GraspObject, description: v1::GraspObject) {
        self.fields = given.into();
        self.findings = description.into();
    }

    /// What describes the object while its mesh is not in memory: without labels, etag, times, regions and known grips.
    pub(crate) fn description(self) -> v1::GraspObject {
        let given = v1::GraspObject::from(self.fields);
        let Findings {
            triangle_count,
            centre_of_mass,
            forbidden_triangle_count,
            object_from_box,
            box_half_extents,
            content_hash,
            warnings,
            origin_in_file,
        } = self.findings;
        v1::GraspObject {
            labels: BTreeMap::new(),
            regions: Vec::new(),
            known_grips: Vec::new(),
            meters_per_unit: given.meters_per_unit.or(Some(1.0)),
            center_of_mass: centre_of_mass,
            triangle_count,
            forbidden_triangle_count,
            bounding_box: Some(v1::BoxShape {
                pose: object_from_box,
                half_extents: box_half_extents,
            }),
            content_hash,
            warnings,
            origin_in_file: origin_in_file.map_or_else(Vec::new, |Origin { x, y, z }| vec![x, y, z]),
            ..given
        }
    }

    /// Replaces labels, etag and times.
    pub(crate) fn set_record(&mut self, record: &Record) {
        self.fields.labels.clone_from(&record.labels);
        self.etag.clone_from(&record.etag);
        self.created = record.created.into();
        self.updated = record.updated.into();
    }

    /// Labels, etag and times.
    pub(crate) fn record(&self) -> Option<Record> {
        Some(Record {
            labels: self.fields.labels.clone(),
            etag: self.etag.clone(),
            created: SystemTime::try_from(self.created).ok()?,
            updated: SystemTime::try_from(self.updated).ok()?,
        })
    }

    /// What is kept of it while its object is at rest: no regions and known grips, which may be long.
    pub(crate) fn without_lists(mut self) -> Self {
        self.fields.drop_lists();
        self
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
        if saved.id() != id {
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
        let given = v1::GraspObject {
            name: "objects/mug".to_owned(),
            mass_kg: 0.3,
            ..Default::default()
        };
        let record = Record {
            labels: [("level".to_owned(), "kitchen".to_owned())].into(),
            etag: "1-2".to_owned(),
            created: UNIX_EPOCH + Duration::from_nanos(1_234_567_891),
            updated: UNIX_EPOCH + Duration::from_secs(7),
        };
        let key = RequestKey {
            id: Uuid::from_u128(7),
            content: [3; 32],
        };
        let description = v1::GraspObject {
            triangle_count: 12,
            bounding_box: Some(v1::BoxShape::default()),
            origin_in_file: vec![1.0, 2.0, 3.5],
            warnings: vec!["odd".to_owned()],
            meters_per_unit: Some(1.0),
            ..given.clone()
        };
        SavedObject::new(given, ([9; 32], 77), Some(key), &record, description)
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
        let description = after.description();
        assert_eq!((description.triangle_count, description.mass_kg), (12, 0.3));
        assert_eq!(description.origin_in_file, [1.0, 2.0, 3.5]);
        assert!(description.labels.is_empty());
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
