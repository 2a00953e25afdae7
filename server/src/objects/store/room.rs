//! Room in the cache.

use super::{Created, ObjectStore, RETRY_AFTER};
use crate::error::{Limit, ServiceError};

/// Room in the cache for what is about to be added.
#[must_use = "reserved room is lost until it is released"]
pub(super) struct Reserved {
    bytes: usize,
    objects: usize,
}

impl Reserved {
    /// Gives the room back, so that what was added can be counted.
    pub(super) fn release(self, created: &mut Created) {
        created.bytes -= self.bytes;
        created.loaded -= self.objects;
    }
}

impl ObjectStore {
    /// Makes room for a new object or, if there is one, for that which `grows`, and keeps it until it is released.
    pub(super) fn reserve(
        &self,
        created: &mut Created,
        grows: Option<&str>,
        bytes: usize,
        objects: usize,
    ) -> Result<Reserved, ServiceError> {
        self.make_room(created, grows, bytes, objects)?;
        created.bytes += bytes;
        created.loaded += objects;
        Ok(Reserved { bytes, objects })
    }

    /// Drops what is derived from objects and objects at other sizes, and puts objects to rest or evicts them, until so many more bytes and objects fit.
    pub(super) fn make_room(
        &self,
        created: &mut Created,
        grows: Option<&str>,
        bytes: usize,
        objects: usize,
    ) -> Result<(), ServiceError> {
        let kept = grows.and_then(|id| created.objects.get(id));
        let whole = bytes + kept.map_or(0, |entry| entry.state.bytes());
        if whole > self.limits.bytes {
            return Err(ServiceError::invalid(
                if grows.is_some() { "forbidden" } else { "mesh" },
                format!(
                    "takes about {whole} bytes with the object's search structures; the cache holds {}",
                    self.limits.bytes
                ),
            ));
        }
        while created.loaded + objects > self.limits.objects || created.taken() + bytes > self.limits.bytes {
            let frees_bytes = created.taken() + bytes > self.limits.bytes && created.evict_derived_or_size();
            if !frees_bytes && !created.evict_one(grows) {
                return Err(ServiceError::Overloaded {
                    limit: Limit::ObjectCache,
                    maximum: self.limits.objects,
                    retry_after: RETRY_AFTER,
                });
            }
        }
        Ok(())
    }
}
