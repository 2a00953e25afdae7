//! Bounds and locks that more than one module needs.

use std::{
    collections::{HashMap, hash_map::Entry},
    num::NonZeroUsize,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
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

/// Most places that a client holds, relative to those that would still be free; see [`may_hold_another`].
const MAX_SHARE: usize = 3;

/// True if a client may take another of the places that clients share, of which `free` are left: it has none, or would hold at most
/// three times those left then. So a client alone has three quarters, `n` greedy ones an `n + 1/3`th each, and one more client still
/// finds a place (A. K. Choudhury and E. L. Hahne, "Dynamic queue length thresholds for shared-memory packet switches", 1998).
pub(crate) fn may_hold_another(held: usize, free: usize) -> bool {
    free > 0 && (held == 0 || held < MAX_SHARE * (free - 1))
}

/// Places that clients share, and that are taken as long as their [`Place`] lives.
#[derive(Clone, Debug)]
pub(crate) struct Places(Arc<SharedPlaces>);

#[derive(Debug)]
struct SharedPlaces {
    limit: Limit,
    maximum: usize,
    /// When a client without a place should try again.
    retry_after: Duration,
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    total: usize,
    /// Clients that hold places.
    by_client: HashMap<Client, usize>,
}

/// One or more places of a client.
#[derive(Debug)]
pub(crate) struct Place {
    of: Places,
    client: Client,
    count: usize,
}

impl Places {
    pub(crate) fn new(limit: Limit, maximum: usize, retry_after: Duration) -> Self {
        Self(Arc::new(SharedPlaces {
            limit,
            maximum,
            retry_after,
            held: Mutex::default(),
        }))
    }

    /// Takes a place for a client.
    pub(crate) fn take(&self, client: &Client) -> Result<Place, ServiceError> {
        self.take_many(client, 1)
    }

    /// Takes places for a client; more than one only together.
    pub(crate) fn take_many(&self, client: &Client, count: usize) -> Result<Place, ServiceError> {
        let shared = &*self.0;
        let mut held = locked(&shared.held);
        let free = shared.maximum - held.total;
        let of_client = held.by_client.get(client).copied().unwrap_or(0);
        // The last of them decides; the first ones of a client that has none may be all that are free.
        let is_allowed = if of_client == 0 {
            count <= free
        } else {
            count <= free && may_hold_another(of_client + count - 1, free + 1 - count)
        };
        if !is_allowed {
            return Err(ServiceError::Overloaded {
                limit: shared.limit,
                maximum: shared.maximum,
                retry_after: shared.retry_after,
            });
        }
        held.total += count;
        *held.by_client.entry(client.clone()).or_default() += count;
        Ok(Place {
            of: self.clone(),
            client: client.clone(),
            count,
        })
    }

    /// Number of all places.
    pub(crate) fn maximum(&self) -> usize {
        self.0.maximum
    }

    pub(crate) fn taken(&self) -> usize {
        locked(&self.0.held).total
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut held = locked(&self.of.0.held);
        held.total -= self.count;
        if let Entry::Occupied(mut of_client) = held.by_client.entry(self.client.clone()) {
            *of_client.get_mut() -= self.count;
            if *of_client.get() == 0 {
                of_client.remove();
            }
        }
    }
}

/// The content of a mutex, even of a poisoned one: no code leaves half a change when it panics.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(number: u8) -> Client {
        Client::at([127, 0, 0, number].into())
    }

    /// How many places each of some greedy clients gets, taking turns.
    fn shares(maximum: usize, clients: u8) -> Vec<usize> {
        let places = Places::new(Limit::Searches, maximum, Duration::ZERO);
        let mut kept = vec![Vec::new(); clients.into()];
        for _ in 0..maximum {
            for number in 0..clients {
                kept[usize::from(number)].extend(places.take(&client(number)).map(Arc::new));
            }
        }
        let shares: Vec<usize> = kept.iter().map(Vec::len).collect();
        assert_eq!(places.taken(), shares.iter().sum::<usize>());
        drop(kept);
        assert_eq!(places.taken(), 0);
        assert!(locked(&places.0.held).by_client.is_empty());
        shares
    }

    #[test]
    fn greedy_clients_leave_a_place_for_one_more() {
        assert_eq!(shares(64, 1), [48]);
        assert_eq!(shares(64, 2), [27, 27]);
        assert_eq!(shares(4, 1), [3]);
        assert_eq!(shares(2, 1), [1]);
        assert_eq!(shares(2, 2), [1, 1]);
        assert_eq!(shares(1, 1), [1]);
        for clients in 1..12 {
            let taken: usize = shares(64, clients).iter().sum();
            assert!(taken < 64, "{clients}");
        }
    }

    #[test]
    fn many_places_are_taken_together_or_not_at_all() {
        let places = Places::new(Limit::UploadBytes, 100, Duration::ZERO);
        // The first upload may be as large as all together.
        drop(places.take_many(&client(1), 100).unwrap());
        let first = places.take_many(&client(1), 60).unwrap();
        assert!(places.take_many(&client(1), 20).is_err());
        assert!(places.take_many(&client(2), 41).is_err());
        let other = places.take_many(&client(2), 40).unwrap();
        drop((first, other));
        assert_eq!(places.taken(), 0);
    }
}
