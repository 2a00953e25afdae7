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

/// An object in one of its states, ready for searches.
#[derive(Clone, Debug)]
pub(crate) struct Revision {
    /// The object.
    pub object: Arc<StoredObject>,
    /// Its labels, etag and times.
    pub record: Arc<Record>,
}

/// What is in memory of an object that was saved and is not needed now.
#[derive(Debug)]
pub(crate) struct Resting {
    /// The last part of its name.
    pub id: String,
    /// What describes it, without labels, etag, times, regions and known grips.
    pub description: v1::GraspObject,
}

/// An object or what is in memory of it.
#[derive(Clone, Debug)]
pub(crate) enum Body {
    /// Ready for searches.
    Loaded(Arc<StoredObject>),
    /// To be loaded when it is needed.
    AtRest(Arc<Resting>),
}

/// An object in one of its states, as lists show it: ready for searches or not.
#[derive(Clone, Debug)]
pub(crate) struct Listed {
    /// The object.
    pub body: Body,
    /// Its labels, etag and times.
    pub record: Arc<Record>,
}

/// Bytes that a label takes beside its characters.
const LABEL_OVERHEAD: usize = 2 * size_of::<String>();

impl From<Revision> for Listed {
    fn from(Revision { object, record }: Revision) -> Self {
        Self {
            body: Body::Loaded(object),
            record,
        }
    }
}

impl Listed {
    /// The last part of the object's name.
    pub(crate) fn id(&self) -> &str {
        match &self.body {
            Body::Loaded(object) => &object.id,
            Body::AtRest(resting) => &resting.id,
        }
    }

    /// The object, if it is ready for searches.
    pub(crate) fn object(&self) -> Option<&Arc<StoredObject>> {
        match &self.body {
            Body::Loaded(object) => Some(object),
            Body::AtRest(_) => None,
        }
    }

    /// The state with its object, if that is ready for searches.
    pub(crate) fn loaded(&self) -> Option<Revision> {
        Some(Revision {
            object: Arc::clone(self.object()?),
            record: Arc::clone(&self.record),
        })
    }

    /// Its estimated size in bytes in the cache, without atlases.
    pub(super) fn bytes(&self) -> usize {
        let labels = self.record.labels.iter();
        let of_labels = || -> usize {
            labels
                .map(|(key, value)| key.len() + value.len() + LABEL_OVERHEAD)
                .sum()
        };
        self.object().map_or(0, |object| object.bytes() + of_labels())
    }

    /// Where the object is in lists.
    pub(crate) fn place(&self) -> Place {
        Place {
            created: nanoseconds(self.record.created),
            id: self.id().to_owned(),
        }
    }

    /// The message that describes the object, without regions and known grips.
    pub(crate) fn to_wire(&self) -> v1::GraspObject {
        let record = &*self.record;
        let described = match &self.body {
            Body::Loaded(object) => object.description(),
            Body::AtRest(resting) => resting.description.clone(),
        };
        v1::GraspObject {
            labels: record.labels.clone(),
            etag: record.etag.clone(),
            create_time: Some(record.created.into()),
            update_time: Some(record.updated.into()),
            ..described
        }
    }
}

/// Nanoseconds since 1970; saturates in 1970 and 2554.
fn nanoseconds(time: SystemTime) -> u64 {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}
