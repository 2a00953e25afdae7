//! Places that clients share.

use std::{
    collections::{HashMap, hash_map::Entry},
    sync::Arc,
};

use crate::{
    Client,
    sync::{Mutex, locked},
};

/// Most places that a client holds, relative to those that are still free; see [`may_hold_another`].
const MAX_SHARE: usize = 3;

/// True if a client that holds some places may take another of the `free` ones: it holds none, or will hold at most three times those
/// that are free then. So a client alone gets three quarters, `n` greedy ones get `3 / (3 n + 1)` each, and one more client still finds
/// a place (A. K. Choudhury and E. L. Hahne, "Dynamic queue length thresholds for shared-memory packet switches", 1998).
pub fn may_hold_another(held: usize, free: usize) -> bool {
    free > 0 && (held == 0 || held < MAX_SHARE * (free - 1))
}

/// There is no place for this client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no free place for this client")]
pub struct Full;

/// Places that are taken as long as their [`Place`] lives.
#[derive(Debug)]
pub struct Places<C: Client>(Arc<PlacesState<C>>);

impl<C: Client> Clone for Places<C> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

#[derive(Debug)]
struct PlacesState<C> {
    maximum: usize,
    held: Mutex<HeldPlaces<C>>,
}

#[derive(Debug)]
struct HeldPlaces<C> {
    total: usize,
    /// Clients that hold places.
    by_client: HashMap<C, usize>,
}

/// One or more places of a client.
#[derive(Debug)]
pub struct Place<C: Client> {
    of: Places<C>,
    client: C,
    count: usize,
}

impl<C: Client> Places<C> {
    /// So many places, all free.
    pub fn new(maximum: usize) -> Self {
        let held = HeldPlaces {
            total: 0,
            by_client: HashMap::new(),
        };
        Self(Arc::new(PlacesState {
            maximum,
            held: Mutex::new(held),
        }))
    }

    /// Takes some places for a client, together. One that has none may take all that are free.
    ///
    /// # Errors
    /// [`Full`].
    pub fn take(&self, client: &C, count: usize) -> Result<Place<C>, Full> {
        let mut held = locked(&self.0.held);
        let free = self.0.maximum - held.total;
        let of_client = held.by_client.get(client).copied().unwrap_or(0);
        let last = count.saturating_sub(1);
        if count > free || (of_client > 0 && !may_hold_another(of_client + last, free - last)) {
            return Err(Full);
        }
        held.total += count;
        *held.by_client.entry(client.clone()).or_default() += count;
        drop(held);
        Ok(Place {
            of: self.clone(),
            client: client.clone(),
            count,
        })
    }

    /// Number of places.
    pub fn maximum(&self) -> usize {
        self.0.maximum
    }

    /// Number of places in use.
    pub fn taken(&self) -> usize {
        locked(&self.0.held).total
    }
}

impl<C: Client> Drop for Place<C> {
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

#[cfg(all(test, not(shuttle)))]
mod tests {
    use super::*;

    /// How many places each of some greedy clients gets, taking turns.
    fn shares(maximum: usize, clients: usize) -> Vec<usize> {
        let places = Places::new(maximum);
        let mut kept: Vec<Vec<_>> = (0..clients).map(|_| Vec::new()).collect();
        for _ in 0..maximum {
            for (client, kept) in kept.iter_mut().enumerate() {
                kept.extend(places.take(&client, 1));
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
        let places = Places::new(100);
        // Alone, a client may take all.
        drop(places.take(&1, 100).unwrap());
        let first = places.take(&1, 60).unwrap();
        assert!(places.take(&1, 20).is_err() && places.take(&2, 41).is_err());
        let other = places.take(&2, 40).unwrap();
        drop((first, other));
        assert_eq!(places.taken(), 0);
    }
}
