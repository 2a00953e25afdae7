//! What the store keeps of an object beside its search structures.

use std::{
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};

use grasp_proto::v1;

use super::StoredObject;
use crate::validate::{Labels, Place};

/// The state of an object that changes without its search structures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Record {
    /// Labels that clients gave it.
    pub labels: Labels,
    /// Identifies the state.
    pub etag: String,
    /// When the object was created.
    pub created: SystemTime,
    /// When a client last changed it; not before `created`.
    pub updated: SystemTime,
}

/// An object in one of its states.
#[derive(Clone, Debug)]
pub(crate) struct Revision {
    /// The object.
    pub object: Arc<StoredObject>,
    /// Its labels, etag and times.
    pub record: Arc<Record>,
}

/// Bytes that a label takes beside its characters.
const LABEL_OVERHEAD: usize = 2 * size_of::<String>();

impl Revision {
    /// Its estimated size in bytes, without atlases.
    pub(super) fn bytes(&self) -> usize {
        let labels = self.record.labels.iter();
        let of_labels: usize = labels
            .map(|(key, value)| key.len() + value.len() + LABEL_OVERHEAD)
            .sum();
        self.object.bytes() + of_labels
    }

    /// Where the object is in lists.
    pub(crate) fn place(&self) -> Place {
        Place {
            created: nanoseconds(self.record.created),
            updated: nanoseconds(self.record.updated),
            id: self.object.id.clone(),
        }
    }

    /// The message that describes the object, with the state of its atlas.
    pub(crate) fn to_wire(&self, atlas: Option<v1::AtlasState>) -> v1::Object {
        let record = &*self.record;
        v1::Object {
            labels: record.labels.clone(),
            etag: record.etag.clone(),
            create_time: Some(record.created.into()),
            update_time: Some(record.updated.into()),
            ..self.object.to_wire(atlas)
        }
    }
}

/// Nanoseconds since 1970; saturates in 1970 and 2554.
fn nanoseconds(time: SystemTime) -> u64 {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}
