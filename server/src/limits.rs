//! Bounds that more than one module needs.

use std::{
    collections::HashMap,
    num::NonZeroUsize,
    sync::{Arc, Weak},
    time::Duration,
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::{
    client::Client,
    error::{Limit, ServiceError},
    sync::{Mutex, locked},
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

    /// Number of all places.
    pub(crate) fn maximum(&self) -> usize {
        self.all.maximum()
    }

    pub(crate) fn taken(&self) -> usize {
        self.all.taken()
    }
}

/// Permits of each client, so that those of one that has used up its own wait for each other only.
#[derive(Debug)]
pub(crate) struct ClientPermits {
    each: usize,
    /// The permits of clients that use or wait for some.
    clients: Mutex<HashMap<Client, Weak<Semaphore>>>,
}

impl ClientPermits {
    /// So many permits for each client.
    pub(crate) fn new(each: usize) -> Self {
        Self {
            each,
            clients: Mutex::default(),
        }
    }

    /// A permit of a client, once it has one left.
    pub(crate) async fn acquire(&self, client: &Client) -> Option<OwnedSemaphorePermit> {
        let permits = {
            let mut clients = locked(&self.clients);
            let known = clients.get(client).and_then(Weak::upgrade);
            known.unwrap_or_else(|| {
                clients.retain(|_, permits| permits.strong_count() > 0);
                let permits = Arc::new(Semaphore::new(self.each));
                clients.insert(client.clone(), Arc::downgrade(&permits));
                permits
            })
        };
        // Nothing closes the semaphore.
        permits.acquire_owned().await.ok()
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt as _;

    use super::*;

    #[test]
    fn a_client_waits_for_its_own_permits_only() {
        let permits = ClientPermits::new(1);
        let (one, other) = (Client::Local, Client::at([127, 0, 0, 1].into()));
        let held = permits.acquire(&one).now_or_never().flatten();
        assert!(held.is_some() && permits.acquire(&one).now_or_never().is_none());
        assert!(permits.acquire(&other).now_or_never().is_some());
        drop(held);
        assert!(permits.acquire(&one).now_or_never().flatten().is_some());
    }
}
