//! The latest frame of a track.

use std::{
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use grasp_proto::v1;
use tokio::{
    sync::{Notify, oneshot},
    time::timeout,
};

use crate::{
    call::CallContext,
    error::ServiceError,
    validate::{Latest, TrackIntake},
};

/// Most answers that are sent before the client has read them, if its frames say how many it has read. More let clients far away
/// have an answer to each frame, and show older ones to a client that comes back.
const MAX_UNREAD: u64 = 6;

/// How long a frame waits at most for answers to be read, if no other one follows: the last frame of a burst is answered, too.
const MAX_UNREAD_TIME: Duration = Duration::from_millis(500);

/// Takes frames in, and keeps the latest until it is taken.
#[derive(Debug)]
pub(crate) struct Inbox {
    state: Mutex<State>,
    news: Notify,
}

#[derive(Debug)]
struct State {
    intake: TrackIntake,
    latest: Option<PendingFrame>,
    /// Number of answers that the client has read, if it says so.
    read: Option<u64>,
    /// The end of the frames; an error ends the track at once.
    end: Option<Result<(), ServiceError>>,
}

/// A frame that is to be answered.
#[derive(Debug)]
pub(crate) struct PendingFrame {
    /// The frame.
    pub latest: Latest,
    /// The call that it came with, or the part of a stream.
    pub call: CallContext,
    /// Where its answer goes; `None` for the stream.
    pub reply: Option<Reply>,
}

/// Where the answer to a pushed frame goes.
pub(crate) type Reply = oneshot::Sender<Result<v1::TrackAnswer, ServiceError>>;

impl Inbox {
    /// An empty one.
    pub(crate) fn new(intake: TrackIntake) -> Self {
        Self {
            state: Mutex::new(State {
                intake,
                latest: None,
                read: None,
                end: None,
            }),
            news: Notify::new(),
        }
    }

    /// Takes a frame in, which `check` makes the latest unless a later one came before. A pushed one is answered at once if it is
    /// overtaken.
    pub(crate) fn put(
        &self,
        frame: v1::TrackFrame,
        call: CallContext,
        reply: Option<Reply>,
        check: impl FnOnce(&mut TrackIntake, v1::TrackFrame) -> Result<Option<Latest>, ServiceError>,
    ) -> Result<(), ServiceError> {
        // Checked under the lock: frames that come at the same time are checked in some order.
        let mut state = self.lock();
        if reply.is_none() {
            state.read = state.read.max(frame.answers_read);
        }
        let sequence = frame.sequence;
        let overtaken = match check(&mut state.intake, frame)? {
            None => reply.map(|reply| (reply, sequence)),
            Some(latest) => {
                let asked = PendingFrame { latest, call, reply };
                let before = state.latest.replace(asked);
                before.and_then(|before| Some((before.reply?, before.latest.sequence())))
            }
        };
        drop(state);
        if let Some((reply, sequence)) = overtaken {
            // Whoever waits no more needs no answer.
            let _ = reply.send(Ok(v1::TrackAnswer {
                sequence,
                ..Default::default()
            }));
        }
        self.news.notify_one();
        Ok(())
    }

    /// No more frames come.
    pub(crate) fn end(&self, with: Result<(), ServiceError>) {
        let mut state = self.lock();
        if state.end.is_none() {
            state.end = Some(with);
        }
        drop(state);
        self.news.notify_one();
    }

    /// Waits for a frame that nobody has taken, and takes the latest; `None` at the end. After so many answers, it may wait until more of them are read.
    pub(crate) async fn latest(
        &self,
        answered: u64,
        idle: Duration,
    ) -> Result<Option<PendingFrame>, ServiceError> {
        let mut last_news = Instant::now();
        loop {
            let wait = {
                let mut state = self.lock();
                if let Some(Err(error)) = &state.end {
                    return Err(error.clone());
                }
                let is_read = state.read.is_none_or(|read| answered < read + MAX_UNREAD)
                    || state.end.is_some()
                    || last_news.elapsed() >= MAX_UNREAD_TIME;
                if is_read && let Some(latest) = state.latest.take() {
                    return Ok(Some(latest));
                }
                if state.end.is_some() {
                    return Ok(None);
                }
                if state.latest.is_some() {
                    MAX_UNREAD_TIME
                } else {
                    idle
                }
            };
            // A notice given before this wait ends it at once.
            if timeout(wait, self.news.notified()).await.is_ok() {
                last_news = Instant::now();
            } else if self.lock().latest.is_none() {
                return Err(ServiceError::TrackIdle { limit: idle });
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No code panics between two changes that belong together.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
