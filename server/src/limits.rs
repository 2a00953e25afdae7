//! Bounds and locks that more than one module needs.

use std::{
    num::NonZeroUsize,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::error::{Limit, ServiceError};

/// Bound on the objects that clients create.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoreLimits {
    /// Number of objects.
    pub objects: usize,
    /// Total size of the objects in bytes, by estimate.
    pub bytes: usize,
}

/// Bounds on calls that stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamLimits {
    /// Bytes of meshes uploaded in pieces, of all uploads together and thus of one.
    pub upload_bytes: NonZeroUsize,
    /// Longest pause between the pieces of an upload.
    pub upload_idle: Duration,
    /// Number of watchers of objects.
    pub watchers: NonZeroUsize,
    /// Number of tracks of moving givers.
    pub tracks: NonZeroUsize,
    /// Longest time without a frame of a track.
    pub track_idle: Duration,
}

/// Largest size in bytes of everything but the mesh in a `CreateObject` request, and of a manifest on disk.
pub(crate) const BYTES_BESIDES_MESH: usize = 1 << 20;

/// Largest request to `GraspService`, and to methods of `ObjectService` that build no object, in bytes. A hand of 26 joints takes
/// about 2 kB, a hand given as a mesh up to 110 kB.
pub(crate) const MAX_FIND_REQUEST: usize = 160 << 10;

/// Largest response of either service, in bytes. A full page of objects takes less than 1 MiB.
pub(crate) const MAX_RESPONSE: usize = 4 << 20;

/// Largest piece of an uploaded mesh, in bytes.
pub(crate) const MAX_PIECE: usize = 1 << 20;

/// Places that are taken as long as their permits live.
#[derive(Clone, Debug)]
pub(crate) struct Places {
    limit: Limit,
    maximum: usize,
    /// When a client without a place should try again.
    retry_after: Duration,
    /// For code that waits for places.
    pub free: Arc<Semaphore>,
}

impl Places {
    pub(crate) fn new(limit: Limit, maximum: usize, retry_after: Duration) -> Self {
        Self {
            limit,
            maximum,
            retry_after,
            free: Arc::new(Semaphore::new(maximum)),
        }
    }

    /// Takes a place.
    pub(crate) fn take(&self) -> Result<OwnedSemaphorePermit, ServiceError> {
        let place = Arc::clone(&self.free).try_acquire_owned();
        place.map_err(|_| ServiceError::Overloaded {
            limit: self.limit,
            maximum: self.maximum,
            retry_after: self.retry_after,
        })
    }

    pub(crate) fn taken(&self) -> usize {
        self.maximum - self.free.available_permits()
    }
}

/// The content of a mutex, even of a poisoned one: no code leaves half a change when it panics.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
