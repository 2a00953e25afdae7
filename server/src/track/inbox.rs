//! The latest frame of a track.

use std::sync::{Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use crate::{
    error::ServiceError,
    validate::{Frame, TrackIntake},
};

/// Takes frames in, and keeps the latest until it is taken.
#[derive(Debug)]
pub(crate) struct Inbox {
    state: Mutex<State>,
    news: Notify,
}

#[derive(Debug)]
struct State {
    intake: TrackIntake,
    latest: Option<Box<Frame>>,
    /// Frames that were overtaken since one was taken.
    skipped: u32,
    /// The end of the frames; an error ends the track at once.
    end: Option<Result<(), ServiceError>>,
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
        check: impl FnOnce(&mut TrackIntake) -> Result<Option<Frame>, ServiceError>,
    ) -> Result<Put, ServiceError> {
        // Checked under the lock: frames that come at the same time are checked in some order.
        let mut state = self.lock();
        let Some(frame) = check(&mut state.intake)? else {
            return Ok(Put::Overtaken);
        };
        if state.latest.replace(Box::new(frame)).is_some() {
            state.skipped = state.skipped.saturating_add(1);
        }
        drop(state);
        self.news.notify_one();
        Ok(Put::Latest)
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
    ///
    /// # Errors
    /// What ended the frames.
    pub(crate) async fn latest(&self) -> Result<Option<(Box<Frame>, u32)>, ServiceError> {
        loop {
            {
                let mut state = self.lock();
                if let Some(Err(error)) = &state.end {
                    return Err(error.clone());
                }
                if let Some(frame) = state.latest.take() {
                    return Ok(Some((frame, std::mem::take(&mut state.skipped))));
                }
                if state.end.is_some() {
                    return Ok(None);
                }
            }
            // A notice given before this wait ends it at once.
            self.news.notified().await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No code panics between two changes that belong together.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
