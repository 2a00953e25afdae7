//! Bounds and locks that more than one module needs.

use std::{
    num::NonZeroUsize,
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use crate::{
    client::Client,
    error::{Limit, ServiceError},
};

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
    /// Largest mesh uploaded in pieces, in bytes; all uploads together may have half as much again.
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

/// Bytes that all uploads in pieces share, by the largest of them, which leaves a third to others.
pub(crate) fn shared_upload_bytes(largest: usize) -> usize {
    largest.saturating_add(largest / 2)
}

/// A place of a client.
pub(crate) type Place = grasp_admission::Place<Client>;

/// Places that clients share fairly, and that are taken as long as their [`Place`] lives.
#[derive(Clone, Debug)]
pub(crate) struct Places {
    limit: Limit,
    /// When a client without a place should try again.
    retry_after: Duration,
    all: grasp_admission::Places<Client>,
}

impl Places {
    pub(crate) fn new(limit: Limit, maximum: usize, retry_after: Duration) -> Self {
        Self {
            limit,
            retry_after,
            all: grasp_admission::Places::new(maximum),
        }
    }

    /// Takes a place for a client.
    pub(crate) fn take(&self, client: &Client) -> Result<Place, ServiceError> {
        self.take_many(client, 1)
    }

    /// Takes some places for a client, together.
    pub(crate) fn take_many(&self, client: &Client, count: usize) -> Result<Place, ServiceError> {
        let place = self.all.take(client, count);
        place.map_err(|_| ServiceError::Overloaded {
            limit: self.limit,
            maximum: self.all.maximum(),
            retry_after: self.retry_after,
        })
    }

    pub(crate) fn taken(&self) -> usize {
        self.all.taken()
    }
}

/// The content of a mutex, even of a poisoned one: no code leaves half a change when it panics.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
