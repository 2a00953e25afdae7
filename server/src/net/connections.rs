//! The open connections: who may have another one, and which ones are closed to make room or because they hold too much.

use std::{
    collections::{BTreeMap, HashMap},
    ops::Deref,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use grasp_admission::may_hold_another;

use super::{
    frames::{FrameBudget, PER_CONNECTION},
    reader::{CloseReason, Phase, Reader},
};
use crate::{
    client::Client,
    metrics::Counters,
    sync::{Mutex, locked},
    warning_rate::WarningRate,
};

/// How long a connection with waiting bytes may take none of them. Links of 10 kB/s take a chunk in 3 s.
const MAX_STALL: Duration = Duration::from_secs(20);

/// How long a connection has to be idle to be closed for the sake of others' files.
const SPARE: Duration = Duration::from_secs(10);

const STALL_CHECK: Duration = Duration::from_secs(1);

/// The open connections, and the bytes that wait on them.
#[derive(Debug)]
pub(crate) struct Connections {
    /// Largest number of connections.
    maximum: usize,
    /// Largest number of unread bytes.
    most_bytes: usize,
    unread: AtomicUsize,
    /// The zero of all times.
    start: Instant,
    open: Mutex<Open>,
    /// Connections that the server closed.
    pub(crate) closings: Counters,
    pub(super) warnings: WarningRate,
}

#[derive(Debug, Default)]
struct Open {
    /// In the order in which they were accepted.
    readers: BTreeMap<u64, Arc<Reader>>,
    clients: HashMap<Client, Share>,
    accepted: u64,
}

/// A client's part of the connections.
#[derive(Debug)]
struct Share {
    held: usize,
    frames: Arc<FrameBudget>,
}

/// A connection that has a place until this is dropped.
#[derive(Debug)]
pub(super) struct ConnectionPlace {
    reader: Arc<Reader>,
    number: u64,
}

impl Deref for ConnectionPlace {
    type Target = Arc<Reader>;

    fn deref(&self) -> &Arc<Reader> {
        &self.reader
    }
}

impl Drop for ConnectionPlace {
    fn drop(&mut self) {
        locked(&self.reader.all.open).remove(self.number);
    }
}

impl Open {
    fn remove(&mut self, number: u64) -> Option<Arc<Reader>> {
        let reader = self.readers.remove(&number)?;
        if let Some(share) = self.clients.get_mut(&reader.client) {
            share.held -= 1;
            if share.held == 0 && share.frames.is_full() {
                self.clients.remove(&reader.client);
            }
        }
        Some(reader)
    }

    /// Closes the connection, of this client or any, that is longest without its preface, or else without a call for this time.
    fn evict(&mut self, of: Option<&Client>, idle: Duration) -> bool {
        let waiting = self.readers.iter().filter_map(|(&number, reader)| {
            let is_of = of.is_none_or(|client| reader.client == *client);
            let rank = match reader.phase() {
                Phase::Greeting { since } => (0, since),
                Phase::Idle { since } if reader.left(since, idle).is_zero() => (1, since),
                Phase::Idle { .. } | Phase::Answering => return None,
            };
            is_of.then_some((rank, number))
        });
        let Some((_, number)) = waiting.min() else {
            return false;
        };
        if let Some(reader) = self.remove(number) {
            reader.close(CloseReason::Displaced);
        }
        true
    }
}

impl Connections {
    pub(crate) fn new(maximum: usize, most_bytes: usize) -> Arc<Self> {
        Arc::new(Self {
            maximum,
            most_bytes,
            unread: AtomicUsize::new(0),
            start: Instant::now(),
            open: Mutex::default(),
            closings: Counters::new("reason", CloseReason::NAMES),
            warnings: WarningRate::default(),
        })
    }

    /// Number of open connections.
    pub(crate) fn count(&self) -> usize {
        locked(&self.open).readers.len()
    }

    /// Bytes of answers that wait for clients to read them, and of unanswered requests.
    pub(crate) fn unread_bytes(&self) -> usize {
        self.unread.load(Ordering::Relaxed)
    }

    /// Gives a place to a client's new connection. If it may have no further one, the connection takes the place of one of its own
    /// that has no call; if all places are taken, of any client's. `None` if there is no such connection, or the client has sent
    /// too many frames.
    pub(super) fn admit(self: &Arc<Self>, client: &Client) -> Option<ConnectionPlace> {
        let mut open = locked(&self.open);
        let (held, frames) = match open.clients.get(client) {
            Some(share) => (share.held, Arc::clone(&share.frames)),
            None => (0, Arc::new(FrameBudget::new())),
        };
        let free = self.maximum.saturating_sub(open.readers.len());
        let of = (held > 0).then_some(client);
        if !frames.spend(PER_CONNECTION) || !may_hold_another(held, free) && !open.evict(of, Duration::ZERO) {
            return None;
        }
        // Clients without a connection are kept as long as their budget is not full; many at most for some seconds.
        if open.clients.len() > 2 * self.maximum {
            open.clients
                .retain(|_, share| share.held > 0 || !share.frames.is_full());
        }
        let share = open.clients.entry(client.clone()).or_insert_with(|| Share {
            held: 0,
            frames: Arc::clone(&frames),
        });
        share.held += 1;
        let reader = Arc::new(Reader::new(self, client.clone(), frames));
        open.accepted += 1;
        let number = open.accepted;
        open.readers.insert(number, Arc::clone(&reader));
        Some(ConnectionPlace { reader, number })
    }

    /// Closes the connection that can best be spared, where the process has no file left for another one.
    pub(super) fn make_room(&self) {
        locked(&self.open).evict(None, SPARE);
    }

    /// Closes connections that stall, until this is dropped.
    pub(crate) async fn close_stalled(&self) {
        let mut check = tokio::time::interval(STALL_CHECK);
        loop {
            check.tick().await;
            self.close_stalled_since(MAX_STALL);
        }
    }

    fn close_stalled_since(&self, longest: Duration) {
        for reader in self.readers() {
            if reader.stalled() > longest {
                reader.close(CloseReason::Stalled);
            }
        }
    }

    /// Closes the connections that hold the most until the others are within the bound.
    fn close_largest(&self) {
        let mut open: Vec<_> = self
            .readers()
            .into_iter()
            .map(|reader| (reader.held(), reader))
            .collect();
        open.sort_by_key(|(held, _)| (held.byte_time, held.bytes));
        let mut sum: usize = open.iter().map(|(held, _)| held.bytes).sum();
        while sum > self.most_bytes
            && let Some((held, largest)) = open.pop()
        {
            sum -= held.bytes;
            largest.close(CloseReason::TooManyBytes);
        }
    }

    /// Counts bytes that begin to wait on some connection.
    pub(super) fn add(&self, bytes: usize) {
        if self.unread.fetch_add(bytes, Ordering::Relaxed) + bytes > self.most_bytes {
            self.close_largest();
        }
    }

    /// Uncounts bytes.
    pub(super) fn remove(&self, bytes: usize) {
        self.unread.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// Connections that are not being closed.
    fn readers(&self) -> Vec<Arc<Reader>> {
        let open = locked(&self.open);
        let readers = open.readers.values().filter(|reader| !reader.is_closing());
        readers.cloned().collect()
    }

    /// Milliseconds since the start.
    pub(super) fn now(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_millis()).unwrap_or(u64::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(number: u8) -> Client {
        Client::at([127, 0, 0, number].into())
    }

    /// Bounds on bytes only.
    fn bounded(bytes: usize) -> Arc<Connections> {
        Connections::new(100, bytes)
    }

    fn connect(all: &Arc<Connections>) -> ConnectionPlace {
        all.admit(&Client::Local).expect("there is a place")
    }

    #[test]
    fn a_client_has_its_share_and_a_new_one_always_gets_in() {
        let all = Connections::new(8, usize::MAX);
        let mut held: Vec<_> = (0..6).map(|_| all.admit(&client(1)).unwrap()).collect();
        // Its oldest connection without a preface goes first, then its oldest one without a call.
        held[1].greeted();
        held[2].greeted();
        let call = held[2].begin_request();
        for closed in [0, 3, 4, 5] {
            assert!(!held[closed].is_closing());
            let next = all.admit(&client(1)).unwrap();
            next.greeted();
            held.push(next);
            assert!(held[closed].is_closing(), "{closed}");
        }
        held.push(all.admit(&client(1)).unwrap());
        assert!(held[1].is_closing() && !held[2].is_closing());
        assert_eq!(all.count(), 6);
        // Many clients take all places, the last ones without a call.
        let others: Vec<_> = (2..=12)
            .map(|number| all.admit(&client(number)).unwrap())
            .collect();
        assert_eq!(all.count(), 8);
        assert!(!held[2].is_closing() && !others[10].is_closing());
        drop(call);
        drop((held, others));
        assert_eq!(all.count(), 0);
    }

    #[test]
    fn a_connection_is_refused_only_where_all_have_calls() {
        let all = Connections::new(2, usize::MAX);
        let (first, second) = (all.admit(&client(1)).unwrap(), all.admit(&client(2)).unwrap());
        let calls = [first.begin_request(), second.begin_request()];
        assert!(all.admit(&client(3)).is_none());
        assert!(all.admit(&client(1)).is_none());
        drop(calls);
        assert!(all.admit(&client(1)).is_some());
        assert!(first.is_closing() && !second.is_closing());
    }

    #[test]
    fn a_client_that_connects_anew_has_no_new_budget_of_frames() {
        let all = Connections::new(10, usize::MAX);
        let first = all.admit(&client(1)).unwrap();
        let frames = Arc::clone(&first.frames);
        drop(first);
        // A slow machine may give it time for new ones.
        let refused = (0..100).any(|_| {
            while frames.spend(100) {}
            all.admit(&client(1)).is_none()
        });
        assert!(refused);
        assert!(all.admit(&client(2)).is_some());
    }

    #[test]
    fn closes_the_connection_with_the_most_beyond_the_bound() {
        let all = bounded(100);
        let readers: Vec<_> = (0..3).map(|_| connect(&all)).collect();
        let pairs = readers.iter().zip([30, 50, 20]);
        let since: Vec<u64> = pairs.map(|(reader, bytes)| reader.add(bytes)).collect();
        assert!(readers.iter().all(|reader| !reader.is_closing()));
        readers[2].add(1);
        let closed: Vec<bool> = readers.iter().map(|reader| reader.is_closing()).collect();
        assert_eq!(closed, [false, true, false]);
        // Bytes on connections that are being closed close no others.
        readers[0].add(10);
        assert!(!readers[0].is_closing());
        assert_eq!(all.unread_bytes(), 111);
        readers[1].remove(50, since[1]);
        assert_eq!(all.unread_bytes(), 61);
    }

    #[test]
    fn closes_connections_that_wait_for_long_and_not_one_with_a_large_new_answer() {
        let all = bounded(100);
        let slow: Vec<_> = (0..10).map(|_| connect(&all)).collect();
        for reader in &slow {
            reader.add(6);
        }
        std::thread::sleep(Duration::from_millis(20));
        let large = connect(&all);
        large.add(60);
        assert!(!large.is_closing());
        // Of the others, only as many as necessary.
        assert_eq!(slow.iter().filter(|reader| reader.is_closing()).count(), 4);
    }

    #[test]
    fn closes_only_connections_that_take_nothing() {
        let all = bounded(usize::MAX);
        let (stalled, slow, idle) = (connect(&all), connect(&all), connect(&all));
        stalled.add(10);
        let since = slow.add(10);
        std::thread::sleep(Duration::from_millis(60));
        slow.remove(1, since);
        all.close_stalled_since(Duration::from_millis(40));
        assert!(stalled.is_closing() && !slow.is_closing() && !idle.is_closing());
    }
}
