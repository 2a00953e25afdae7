//! Inboxes of tracks, and the names of those whose frames come in calls of their own.

use std::{collections::HashMap, sync::Arc, time::Duration};

use grasp_proto::v1;
use tokio::sync::{Notify, oneshot};
use uuid::Uuid;

use crate::{
    access::{Caller, Owner},
    call::CallContext,
    error::{Limit, ServiceError},
    limits::Places,
    sync::{JoinSet, Mutex, locked, timeout},
    tls::random_id,
    validate::{Latest, TrackIntake, quoted},
};

/// Most unread answers. More let distant clients have an answer to each frame.
const MAX_UNREAD: u64 = 6;

/// Longest wait of a frame for answers to be read, if no other one follows: the last frame of a burst is answered, too.
const MAX_UNREAD_TIME: Duration = Duration::from_millis(500);

const COLLECTION: &str = "tracks/";

/// When to retry if there are too many tracks: they end when givers let go.
const RETRY_AFTER: Duration = Duration::from_secs(1);

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
    pub latest: Latest,
    /// The call of the frame, or the part of a stream.
    pub call: CallContext,
    /// Where its answer goes; `None` for the stream.
    pub reply: Option<Reply>,
}

/// Where the answer to a pushed frame goes.
pub(crate) type Reply = oneshot::Sender<Result<v1::TrackAnswer, ServiceError>>;

impl Inbox {
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

    /// Takes a frame in, which `check` makes the latest unless a later one came before. A superseded pushed frame is answered at
    /// once.
    pub(crate) fn put(
        &self,
        frame: v1::TrackFrame,
        call: CallContext,
        reply: Option<Reply>,
        check: impl FnOnce(&mut TrackIntake, v1::TrackFrame) -> Result<Option<Latest>, ServiceError>,
    ) -> Result<(), ServiceError> {
        // Checked under the lock: frames that come at the same time are checked in some order.
        let mut state = locked(&self.state);
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
            // A caller that has left needs no answer.
            let _ = reply.send(Ok(v1::TrackAnswer {
                sequence,
                ..Default::default()
            }));
        }
        self.news.notify_one();
        Ok(())
    }

    pub(crate) fn end(&self, with: Result<(), ServiceError>) {
        locked(&self.state).end.get_or_insert(with);
        self.news.notify_one();
    }

    /// Waits for a new frame, and takes the latest; `None` at the end. After so many answers, it may wait until more of them are
    /// read.
    pub(crate) async fn latest(
        &self,
        answered: u64,
        idle: Duration,
    ) -> Result<Option<PendingFrame>, ServiceError> {
        let mut is_overdue = false;
        loop {
            let wait = {
                let mut state = locked(&self.state);
                if let Some(Err(error)) = &state.end {
                    return Err(error.clone());
                }
                let is_read = state.read.is_none_or(|read| answered < read + MAX_UNREAD)
                    || state.end.is_some()
                    || is_overdue;
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
            is_overdue = timeout(wait, self.news.notified()).await.is_err();
            if is_overdue && locked(&self.state).latest.is_none() {
                return Err(ServiceError::TrackIdle { limit: idle });
            }
        }
    }
}

/// All tracks, created ones and those of a single call.
#[derive(Debug)]
pub(crate) struct OpenTracks {
    pub places: Places,
    by_name: Mutex<HashMap<Uuid, OpenTrack>>,
}

#[derive(Debug)]
struct OpenTrack {
    owner: Owner,
    inbox: Arc<Inbox>,
    /// The only task, which answers its frames.
    task: JoinSet<()>,
}

/// Keeps the name of a track until it is dropped.
struct TrackName {
    tracks: Arc<OpenTracks>,
    id: Uuid,
}

impl Drop for TrackName {
    fn drop(&mut self) {
        let _ended = locked(&self.tracks.by_name).remove(&self.id);
    }
}

impl OpenTracks {
    pub(crate) fn new(maximum: usize) -> Self {
        Self {
            places: Places::new(Limit::Tracks, maximum, RETRY_AFTER),
            by_name: Mutex::default(),
        }
    }

    /// Opens a track of an owner under a name that cannot be guessed, which is returned. It ends with `answers`, or when it is deleted.
    pub(crate) fn open(
        self: &Arc<Self>,
        owner: Owner,
        inbox: Arc<Inbox>,
        answers: impl Future<Output = ()> + Send + 'static,
    ) -> String {
        let id = random_id();
        let named = TrackName {
            tracks: Arc::clone(self),
            id,
        };
        let mut task = JoinSet::new();
        let mut tracks = locked(&self.by_name);
        task.spawn(async move {
            let _named = named;
            answers.await;
        });
        tracks.insert(id, OpenTrack { owner, inbox, task });
        format!("{COLLECTION}{}", id.simple())
    }

    /// The inbox of the caller's track.
    pub(crate) fn inbox(&self, name: &str, caller: &Caller) -> Result<Arc<Inbox>, ServiceError> {
        let id = id_of("track", name)?;
        let tracks = locked(&self.by_name);
        let track = tracks.get(&id).ok_or_else(|| not_found(name))?;
        caller.check_owns(name, &track.owner)?;
        Ok(Arc::clone(&track.inbox))
    }

    /// Ends the caller's track.
    pub(crate) async fn delete(&self, name: &str, caller: &Caller) -> Result<(), ServiceError> {
        let id = id_of("name", name)?;
        let mut track = {
            let mut tracks = locked(&self.by_name);
            let track = tracks.get(&id).ok_or_else(|| not_found(name))?;
            caller.check_owns(name, &track.owner)?;
            tracks.remove(&id).ok_or_else(|| not_found(name))?
        };
        // Waits until its task has released everything.
        track.task.shutdown().await;
        Ok(())
    }
}

/// The id in the name of a track, which the request has in a field.
fn id_of(field: &str, name: &str) -> Result<Uuid, ServiceError> {
    let id = name
        .strip_prefix(COLLECTION)
        .and_then(|id| Uuid::try_parse(id).ok());
    id.ok_or_else(|| {
        let name = quoted(name);
        ServiceError::invalid(
            field,
            format!("is {name}; it must be the name of a created track, tracks/{{track}}"),
        )
    })
}

pub(crate) fn not_found(name: &str) -> ServiceError {
    ServiceError::TrackNotFound {
        name: name.to_owned(),
    }
}
