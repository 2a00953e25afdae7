//! Bounds answers that wait for clients who do not read them, and requests that clients do not end.
//!
//! Flow control lets a client receive nothing while the server keeps the answers. So every chunk of an answer counts from when the
//! transport requests it until its last byte was handed to the socket: per connection, whose further calls are rejected beyond a
//! limit, and over all connections. Beyond that limit, the connections with the most bytes times waiting time are closed: not those
//! that have just requested something large. A connection is also closed if it takes no chunk for a while. Requests count over all
//! connections from when their bytes arrive until they are answered.

use std::{
    sync::{
        Arc, Mutex, Weak,
        atomic::{AtomicU64, AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::CancellationToken;

use crate::{
    client::Client,
    error::{Limit, ServiceError},
    limits::{MAX_RESPONSE, locked},
    metrics::Counters,
    warning_rate::WarningRate,
};

/// Bytes that wait on one connection from which its calls are rejected: some answers of the largest size.
const MAX_PER_CONNECTION: usize = 2 * MAX_RESPONSE;

/// How long a connection with waiting bytes may take none of them. Links of 10 kB/s take a chunk in 3 s.
const MAX_STALL: Duration = Duration::from_secs(20);

const STALL_CHECK: Duration = Duration::from_secs(1);

/// When a client whose answers wait unread should try again.
const RETRY_WHEN_READ: Duration = Duration::from_millis(250);

/// Largest number of concurrent calls per connection; answers to others have the headers that pages need, unlike the transport's.
const MAX_CALLS: usize = 64;

/// When a client with too many calls should try again: after about the time of a few searches.
const RETRY_WHEN_ANSWERED: Duration = Duration::from_millis(50);

/// The unread answers of all connections.
#[derive(Debug)]
pub(crate) struct UnreadAnswers {
    most: usize,
    total: AtomicUsize,
    /// The zero of [`Reader::progress`].
    start: Instant,
    readers: Mutex<Vec<Weak<Reader>>>,
    /// Closed connections.
    pub(crate) closings: Counters,
    warnings: WarningRate,
}

/// Why connections are closed, as in metrics.
const TOO_MANY_BYTES: &str = "too_many_bytes";
const STALLED: &str = "stalled";

/// Bytes and calls that wait on one connection.
#[derive(Debug)]
pub(crate) struct Reader {
    all: Arc<UnreadAnswers>,
    waiting: Mutex<WaitingBytes>,
    /// Bytes of unanswered requests.
    arriving: Mutex<WaitingBytes>,
    /// When the client last took a chunk or the first one began to wait, in milliseconds since the start.
    progress: AtomicU64,
    /// Number of requests whose headers have been read.
    pub(super) requests: AtomicU64,
    answering: Arc<()>,
    /// A permit per call that may be running.
    calls: Arc<Semaphore>,
    /// Whose connection it is.
    pub(crate) client: Client,
    /// Cancelled to close the connection at once.
    pub(super) cut_off: CancellationToken,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WaitingBytes {
    pub bytes: usize,
    /// The sum over all bytes of when they began to wait, in milliseconds since the start.
    since: u128,
}

impl WaitingBytes {
    /// Adds bytes that have waited since then.
    pub(super) fn add(&mut self, bytes: usize, since: u64) {
        self.bytes += bytes;
        self.since += bytes as u128 * u128::from(since);
    }

    /// Takes bytes away that were added before.
    fn remove(&mut self, others: Self) {
        self.bytes -= others.bytes;
        self.since -= others.since;
    }

    /// Byte-milliseconds for which they have waited.
    fn held(&self, now: u64) -> u128 {
        (self.bytes as u128 * u128::from(now)).saturating_sub(self.since)
    }
}

impl UnreadAnswers {
    pub(crate) fn new(most: usize) -> Arc<Self> {
        Arc::new(Self {
            most,
            total: AtomicUsize::new(0),
            start: Instant::now(),
            readers: Mutex::default(),
            closings: Counters::new("reason", [TOO_MANY_BYTES, STALLED]),
            warnings: WarningRate::default(),
        })
    }

    pub(crate) fn bytes(&self) -> usize {
        self.total.load(Ordering::Relaxed)
    }

    /// Number of open connections.
    pub(crate) fn connections(&self) -> usize {
        let readers = locked(&self.readers);
        readers.iter().filter(|reader| reader.strong_count() > 0).count()
    }

    pub(crate) fn connect(self: &Arc<Self>, client: Client) -> Arc<Reader> {
        let reader = Arc::new(Reader {
            all: Arc::clone(self),
            waiting: Mutex::default(),
            arriving: Mutex::default(),
            progress: AtomicU64::new(0),
            requests: AtomicU64::new(0),
            answering: Arc::default(),
            calls: Arc::new(Semaphore::new(MAX_CALLS)),
            client,
            cut_off: CancellationToken::new(),
        });
        let mut readers = locked(&self.readers);
        if readers.len() == readers.capacity() {
            readers.retain(|reader| reader.strong_count() > 0);
        }
        readers.push(Arc::downgrade(&reader));
        reader
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
        let now = self.now();
        for reader in self.open() {
            let since = now.saturating_sub(reader.progress.load(Ordering::Relaxed));
            if reader.unread() > 0 && Duration::from_millis(since) > longest {
                reader.close(STALLED);
            }
        }
    }

    /// Closes the connections that hold the most until the others are within the bound.
    fn close_largest(&self) {
        let now = self.now();
        let mut open: Vec<_> = self
            .open()
            .into_iter()
            .map(|reader| {
                let [unread, arriving] = [&reader.waiting, &reader.arriving].map(|of| *locked(of));
                let held = unread.held(now) + arriving.held(now);
                (held, unread.bytes + arriving.bytes, reader)
            })
            .collect();
        open.sort_by_key(|(held, bytes, _)| (*held, *bytes));
        let mut sum: usize = open.iter().map(|(_, bytes, _)| bytes).sum();
        while sum > self.most
            && let Some((_, bytes, largest)) = open.pop()
        {
            sum -= bytes;
            largest.close(TOO_MANY_BYTES);
        }
    }

    /// Counts bytes that begin to wait on some connection.
    fn add(&self, bytes: usize) {
        if self.total.fetch_add(bytes, Ordering::Relaxed) + bytes > self.most {
            self.close_largest();
        }
    }

    fn open(&self) -> Vec<Arc<Reader>> {
        let readers = locked(&self.readers);
        let readers = readers.iter().filter_map(Weak::upgrade);
        readers.filter(|reader| !reader.cut_off.is_cancelled()).collect()
    }

    fn now(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_millis()).unwrap_or(u64::MAX)
    }
}

impl Reader {
    /// Counts a call as running until the permit is dropped.
    pub(crate) fn begin_call(&self) -> Result<OwnedSemaphorePermit, ServiceError> {
        let permit = Arc::clone(&self.calls).try_acquire_owned();
        permit.map_err(|_| ServiceError::Overloaded {
            limit: Limit::Calls,
            maximum: MAX_CALLS,
            retry_after: RETRY_WHEN_ANSWERED,
        })
    }

    /// Checks that the connection may get another answer.
    pub(crate) fn admit(&self) -> Result<(), ServiceError> {
        if self.unread() < MAX_PER_CONNECTION {
            return Ok(());
        }
        Err(ServiceError::Overloaded {
            limit: Limit::UnreadAnswers,
            maximum: MAX_PER_CONNECTION,
            retry_after: RETRY_WHEN_READ,
        })
    }

    /// Counts a request whose headers have been read, as unanswered until the returned guard is dropped.
    pub(super) fn answering(&self) -> Arc<()> {
        self.requests.fetch_add(1, Ordering::Relaxed);
        Arc::clone(&self.answering)
    }

    /// True if no request is being answered: a connection that answers one at a time is reading headers.
    pub(super) fn awaits_headers(&self) -> bool {
        Arc::strong_count(&self.answering) == 1
    }

    fn unread(&self) -> usize {
        locked(&self.waiting).bytes
    }

    fn close(&self, reason: &'static str) {
        self.all.closings.add_value(reason);
        if let Some(unlogged) = self.all.warnings.pass() {
            tracing::warn!(
                client = %self.client,
                unread_bytes = self.unread(),
                reason,
                unlogged,
                "closing a connection whose client does not read, or does not end its requests"
            );
        }
        self.cut_off.cancel();
    }

    /// Counts bytes that begin to wait. Returns the time, for [`Self::remove`].
    pub(super) fn add(&self, bytes: usize) -> u64 {
        let now = self.all.now();
        let mut waiting = locked(&self.waiting);
        if waiting.bytes == 0 {
            self.progress.store(now, Ordering::Relaxed);
        }
        waiting.add(bytes, now);
        drop(waiting);
        self.all.add(bytes);
        now
    }

    /// Uncounts bytes that have waited since then and were taken by the client or lost with the connection.
    pub(super) fn remove(&self, bytes: usize, since: u64) {
        let mut taken = WaitingBytes::default();
        taken.add(bytes, since);
        locked(&self.waiting).remove(taken);
        self.all.total.fetch_sub(bytes, Ordering::Relaxed);
        self.progress.store(self.all.now(), Ordering::Relaxed);
    }

    /// Counts bytes of an unanswered request. Returns the time.
    pub(super) fn begin(&self, bytes: usize) -> u64 {
        let now = self.all.now();
        locked(&self.arriving).add(bytes, now);
        self.all.add(bytes);
        now
    }

    /// Uncounts bytes of an answered request.
    pub(super) fn end(&self, bytes: WaitingBytes) {
        locked(&self.arriving).remove(bytes);
        self.all.total.fetch_sub(bytes.bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_closed(reader: &Reader) -> bool {
        reader.cut_off.is_cancelled()
    }

    #[test]
    fn rejects_calls_of_a_connection_on_which_too_much_waits() {
        let all = UnreadAnswers::new(usize::MAX);
        let (one, other) = (all.connect(Client::Local), all.connect(Client::Local));
        let since = one.add(MAX_PER_CONNECTION);
        assert!(one.admit().is_err() && other.admit().is_ok());
        one.remove(1, since);
        assert!(one.admit().is_ok());
        assert!(!is_closed(&one));
    }

    #[test]
    fn closes_the_connection_with_the_most_beyond_the_bound() {
        let all = UnreadAnswers::new(100);
        let readers: Vec<_> = (0..3).map(|_| all.connect(Client::Local)).collect();
        let pairs = readers.iter().zip([30, 50, 20]);
        let since: Vec<u64> = pairs.map(|(reader, bytes)| reader.add(bytes)).collect();
        assert!(readers.iter().all(|reader| !is_closed(reader)));
        readers[2].add(1);
        let closed: Vec<bool> = readers.iter().map(|reader| is_closed(reader)).collect();
        assert_eq!(closed, [false, true, false]);
        // Bytes on connections that are being closed close no others.
        readers[0].add(10);
        assert!(!is_closed(&readers[0]));
        assert_eq!(all.bytes(), 111);
        readers[1].remove(50, since[1]);
        assert_eq!(all.bytes(), 61);
    }

    #[test]
    fn closes_connections_that_wait_for_long_and_not_one_with_a_large_new_answer() {
        let all = UnreadAnswers::new(100);
        let slow: Vec<_> = (0..10).map(|_| all.connect(Client::Local)).collect();
        for reader in &slow {
            reader.add(6);
        }
        std::thread::sleep(Duration::from_millis(20));
        let large = all.connect(Client::Local);
        large.add(60);
        assert!(!is_closed(&large));
        // Of the others, only as many as necessary.
        assert_eq!(slow.iter().filter(|reader| is_closed(reader)).count(), 4);
    }

    #[test]
    fn closes_only_connections_that_take_nothing() {
        let all = UnreadAnswers::new(usize::MAX);
        let (stalled, slow, idle) = (
            all.connect(Client::Local),
            all.connect(Client::Local),
            all.connect(Client::Local),
        );
        stalled.add(10);
        let since = slow.add(10);
        std::thread::sleep(Duration::from_millis(60));
        slow.remove(1, since);
        all.close_stalled_since(Duration::from_millis(40));
        assert!(is_closed(&stalled) && !is_closed(&slow) && !is_closed(&idle));
    }
}
