//! Figures of the store, for monitoring.

use std::sync::Arc;

use super::ObjectStore;
use crate::objects::StoredObject;

/// Numbers of objects, and their memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StoreFigures {
    /// That came with the server.
    pub pinned: usize,
    /// Created ones in memory.
    pub loaded: usize,
    /// Created ones of which only the description is in memory.
    pub at_rest: usize,
    /// Created ones whose record could not be read.
    pub damaged: usize,
    /// Memory for created objects and their derived data, by estimate.
    pub bytes: usize,
    pub most_bytes: usize,
}

impl ObjectStore {
    pub(crate) fn figures(&self) -> StoreFigures {
        let created = self.created();
        let damaged = created.objects.values().filter(|entry| entry.is_damaged).count();
        let loaded = created
            .objects
            .values()
            .filter(|entry| entry.state.object().is_some())
            .count();
        StoreFigures {
            pinned: self.pinned.len(),
            loaded,
            at_rest: created.objects.len().saturating_sub(loaded + damaged),
            damaged,
            bytes: created.taken(),
            most_bytes: self.limits.bytes,
        }
    }

    /// All objects in memory.
    pub(crate) fn in_memory(&self) -> Vec<Arc<StoredObject>> {
        let created = self.created();
        let loaded = created.objects.values().filter_map(|entry| entry.state.object());
        self.pinned().chain(loaded).cloned().collect()
    }
}
