//! The latest frame of a track.

use std::{
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use grasp_proto::v1;
use tokio::{sync::Notify, time::timeout};

use crate::{
    error::ServiceError,
    validate::{Frame, Intake, TrackIntake, WrongFrame},
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
    latest: Option<Latest>,
    /// Frames that were overtaken since one was taken.
    skipped: u32,
    /// Number of answers that the client has read, if it says so.
    read: Option<u64>,
    /// The end of the frames; an error ends the track at once.
    end: Option<Result<(), ServiceError>>,
}

/// A frame that is to be answered.
#[derive(Debug)]
pub(crate) enum Latest {
    /// With the grasp for it.
    Frame(Box<Frame>),
    /// With what is wrong with it.
    Wrong(WrongFrame),
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Put {
    /// It is the latest.
    Latest,
    /// A later one had come before.
    Overtaken,
}

impl Inbox {
    /// An empty one.
    pub(crate) fn new(intake: TrackIntake) -> Self {
        Self {
            state: Mutex::new(State {
                intake,
                latest: None,
                skipped: 0,
                read: None,
                end: None,
            }),
            news: Notify::new(),
        }
    }

    /// Takes a frame in. `check` makes it one; a wrong one leaves the track as it was.
    ///
    /// # Errors
    /// Those of `check`.
    pub(crate) fn put(
        &self,
        frame: Option<v1::TrackFrame>,
        check: impl FnOnce(&mut TrackIntake, Option<v1::TrackFrame>) -> Result<Intake, ServiceError>,
    ) -> Result<Put, ServiceError> {
        // Checked under the lock: frames that come at the same time are checked in some order.
        let mut state = self.lock();
        state.read = state
            .read
            .max(frame.as_ref().and_then(|frame| frame.answers_read));
        let latest = match check(&mut state.intake, frame)? {
            Intake::Overtaken => return Ok(Put::Overtaken),
            Intake::Frame(frame) => Latest::Frame(frame),
            Intake::Untracked(frame) => Latest::Wrong(frame),
        };
        self.replace(state, latest);
        Ok(Put::Latest)
    }

    /// Takes a frame in that is answered with what is wrong with it.
    pub(crate) fn put_wrong(&self, frame: WrongFrame) {
        self.replace(self.lock(), Latest::Wrong(frame));
    }

    fn replace(&self, mut state: MutexGuard<'_, State>, latest: Latest) {
        if state.latest.replace(latest).is_some() {
            state.skipped = state.skipped.saturating_add(1);
        }
        drop(state);
        self.news.notify_one();
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

    /// Waits for a frame that nobody has taken, and takes the latest with the number of those that it overtook; none at the end.
    /// After so many answers, it may wait until more of them are read.
    ///
    /// # Errors
    /// What ended the frames; [`ServiceError::TrackIdle`] if none comes for as long as `idle`.
    pub(crate) async fn latest(
        &self,
        answered: u64,
        idle: Duration,
    ) -> Result<Option<(Latest, u32)>, ServiceError> {
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
                    return Ok(Some((latest, std::mem::take(&mut state.skipped))));
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
