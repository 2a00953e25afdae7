//! One connection: its calls, its phase, and the bytes that wait on it.
//!
//! Flow control lets a client receive nothing while the server keeps the answers. So every chunk of an answer counts from when the
//! transport requests it until its last byte was handed to the socket: per connection, whose further calls are rejected beyond a
//! limit, and over all connections. Beyond that limit, the connections with the most bytes times waiting time are closed: not those
//! that have just requested something large. A connection is also closed if it takes no chunk for a while. Requests count over all
//! connections from when their bytes arrive until they are answered.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::{CancellationToken, WaitForCancellationFuture};

use super::{
    connections::Connections,
    frames::{CALL_TIME, FrameBudget, PER_CALL, PER_PART},
};
use crate::{
    client::Client,
    error::{Limit, ServiceError},
    limits::MAX_RESPONSE,
    sync::{Mutex, locked},
    tls::PeerName,
};

/// Bytes that wait on one connection from which its calls are rejected: some answers of the largest size.
const MAX_PER_CONNECTION: usize = 2 * MAX_RESPONSE;

/// When a client whose answers wait unread should try again.
const RETRY_WHEN_READ: Duration = Duration::from_millis(250);

/// Largest number of concurrent calls per connection; answers to others have the headers that pages need, unlike the transport's.
const MAX_CALLS: usize = 64;

/// When a client with too many calls should try again: after about the time of a few searches.
const RETRY_WHEN_ANSWERED: Duration = Duration::from_millis(50);

/// Why a connection is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CloseReason {
    Displaced,
    Stalled,
    TooManyBytes,
    Frames,
}

impl CloseReason {
    /// The names of all in metrics.
    pub(super) const NAMES: [&str; 4] = ["displaced", "stalled", "too_many_bytes", "frames"];

    fn text(self) -> &'static str {
        match self {
            Self::Displaced => "another connection needs its place",
            Self::Stalled => "its client has read nothing for too long",
            Self::TooManyBytes => {
                "it holds the most of too many bytes: its client does not read, or end its requests"
            }
            Self::Frames => "its client sends frames that lead to nothing",
        }
    }
}

/// A connection's client, and the bytes that wait on it. Times are in milliseconds since the start of [`Connections`].
#[derive(Debug)]
pub(crate) struct Reader {
    pub(super) all: Arc<Connections>,
    /// Whose connection it is.
    pub(crate) client: Client,
    /// The name in the client's certificate, if it has one.
    pub(crate) peer: PeerName,
    waiting: Mutex<WaitingBytes>,
    /// Bytes of unanswered requests.
    arriving: Mutex<WaitingBytes>,
    /// When the client last took a chunk or the first one began to wait.
    progress: AtomicU64,
    greeted: AtomicBool,
    /// Requests whose headers have been read and whose answers have not ended.
    requests: AtomicUsize,
    /// When the phase began, except while requests are answered.
    since: AtomicU64,
    /// A permit per call that may be running.
    calls: Arc<Semaphore>,
    pub(super) frames: Arc<FrameBudget>,
    /// Cancelled to close the connection at once.
    cut_off: CancellationToken,
}

/// The activity of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Its client has not sent all of HTTP/2's preface, or as many bytes of a request.
    Greeting { since: u64 },
    /// It has no call.
    Idle { since: u64 },
    /// It has calls.
    Answering,
}

/// Bytes that count for a connection, for the choice of those to close.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldBytes {
    pub bytes: usize,
    /// Byte-milliseconds for which they have waited.
    pub byte_time: u128,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WaitingBytes {
    pub bytes: usize,
    /// The sum over all bytes of when they began to wait.
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

/// A request whose headers have been read, until its answer has ended.
#[derive(Debug)]
pub(super) struct OpenRequest {
    reader: Arc<Reader>,
    arrived: Instant,
    answered: bool,
}

impl OpenRequest {
    /// The answer begins.
    pub(super) fn answered(&mut self) {
        self.answered = true;
        self.reader.frames.earn(PER_CALL);
    }

    /// The transport has another part of the answer.
    pub(super) fn sent(&self) {
        self.reader.frames.earn(PER_PART);
    }
}

impl Drop for OpenRequest {
    fn drop(&mut self) {
        let reader = &self.reader;
        if !self.answered && self.arrived.elapsed() >= CALL_TIME {
            reader.frames.earn(PER_CALL);
        }
        // Before the last one ends: it is idle from now on.
        reader.since.store(reader.all.now(), Ordering::Relaxed);
        reader.requests.fetch_sub(1, Ordering::Release);
    }
}

impl Reader {
    pub(super) fn new(all: &Arc<Connections>, client: Client, frames: Arc<FrameBudget>) -> Self {
        Self {
            client,
            peer: PeerName::default(),
            waiting: Mutex::default(),
            arriving: Mutex::default(),
            progress: AtomicU64::new(0),
            greeted: AtomicBool::new(false),
            requests: AtomicUsize::new(0),
            since: AtomicU64::new(all.now()),
            calls: Arc::new(Semaphore::new(MAX_CALLS)),
            frames,
            cut_off: CancellationToken::new(),
            all: Arc::clone(all),
        }
    }

    pub(super) fn phase(&self) -> Phase {
        if self.requests.load(Ordering::Acquire) > 0 {
            return Phase::Answering;
        }
        let since = self.since.load(Ordering::Relaxed);
        if self.greeted.load(Ordering::Relaxed) {
            Phase::Idle { since }
        } else {
            Phase::Greeting { since }
        }
    }

    /// The rest of a time that began then.
    pub(super) fn left(&self, since: u64, time: Duration) -> Duration {
        time.saturating_sub(Duration::from_millis(self.all.now().saturating_sub(since)))
    }

    /// The client has sent its preface, or as many bytes of a request.
    pub(super) fn greeted(&self) {
        self.since.store(self.all.now(), Ordering::Relaxed);
        self.greeted.store(true, Ordering::Relaxed);
    }

    /// Counts a request whose headers have been read, as unanswered until the returned guard is dropped.
    pub(super) fn begin_request(self: &Arc<Self>) -> OpenRequest {
        self.requests.fetch_add(1, Ordering::Relaxed);
        OpenRequest {
            reader: Arc::clone(self),
            arrived: Instant::now(),
            answered: false,
        }
    }

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

    fn unread(&self) -> usize {
        locked(&self.waiting).bytes
    }

    /// How long its client has taken nothing although there is something.
    pub(super) fn stalled(&self) -> Duration {
        if self.unread() == 0 {
            return Duration::ZERO;
        }
        let progress = self.progress.load(Ordering::Relaxed);
        Duration::from_millis(self.all.now().saturating_sub(progress))
    }

    /// Bytes of answers and requests that wait on it.
    pub(super) fn held(&self) -> HeldBytes {
        let now = self.all.now();
        let [unread, arriving] = [&self.waiting, &self.arriving].map(|of| *locked(of));
        HeldBytes {
            bytes: unread.bytes + arriving.bytes,
            byte_time: unread.held(now) + arriving.held(now),
        }
    }

    /// Takes frames off the client's budget; false if it is exceeded, for which the connection is closed.
    pub(super) fn spend_frames(&self, frames: u64) -> bool {
        let within = self.frames.spend(frames);
        if !within {
            self.close(CloseReason::Frames);
        }
        within
    }

    /// Closes the connection at once.
    pub(super) fn close(&self, reason: CloseReason) {
        self.all.closings.add(reason as usize);
        if let Some(unlogged) = self.all.warnings.pass() {
            tracing::warn!(
                client = %self.client,
                unread_bytes = self.unread(),
                reason = reason.text(),
                unlogged,
                "closing a connection"
            );
        }
        self.cut_off.cancel();
    }

    pub(crate) fn is_closing(&self) -> bool {
        self.cut_off.is_cancelled()
    }

    /// Completes when the connection has to be closed at once.
    pub(super) fn closed(&self) -> WaitForCancellationFuture<'_> {
        self.cut_off.cancelled()
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
        self.all.remove(bytes);
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
        self.all.remove(bytes.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_calls_of_a_connection_on_which_too_much_waits() {
        let all = Connections::new(10, usize::MAX);
        let (one, other) = (
            all.admit(&Client::Local).unwrap(),
            all.admit(&Client::Local).unwrap(),
        );
        let since = one.add(MAX_PER_CONNECTION);
        assert!(one.admit().is_err() && other.admit().is_ok());
        one.remove(1, since);
        assert!(one.admit().is_ok());
        assert!(!one.is_closing());
    }

    #[test]
    fn a_connection_greets_then_idles_between_calls() {
        let all = Connections::new(10, usize::MAX);
        let reader = all.admit(&Client::Local).unwrap();
        assert!(matches!(reader.phase(), Phase::Greeting { .. }));
        reader.greeted();
        assert!(matches!(reader.phase(), Phase::Idle { .. }));
        let calls = [reader.begin_request(), reader.begin_request()];
        for call in calls {
            assert_eq!(reader.phase(), Phase::Answering);
            std::thread::sleep(Duration::from_millis(3));
            drop(call);
        }
        let now = all.now();
        let Phase::Idle { since } = reader.phase() else {
            panic!("it has no call");
        };
        assert!(since <= now && since > 0);
    }
}
