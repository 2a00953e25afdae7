//! Tracks whose frames come in calls of their own.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore},
    task::JoinHandle,
};
use uuid::Uuid;

use super::Inbox;
use crate::error::{Limit, ServiceError};

/// Prefix of the names of tracks.
const COLLECTION: &str = "tracks/";

/// When to retry if there are as many tracks as there may be: they end when givers let go.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// All tracks, created ones and those of a single call.
#[derive(Debug)]
pub(crate) struct OpenTracks {
    maximum: usize,
    permits: Arc<Semaphore>,
    by_name: Mutex<HashMap<Uuid, OpenTrack>>,
}

/// A created track.
#[derive(Debug)]
struct OpenTrack {
    inbox: Arc<Inbox>,
    /// Answers its frames; `None` before it begins.
    task: Option<Task>,
}

/// A task that ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Task(JoinHandle<()>);

/// Keeps the name of a track until it is dropped.
struct TrackName {
    tracks: Arc<OpenTracks>,
    id: Uuid,
}

impl Task {
    /// Starts it.
    pub(crate) fn start(work: impl Future<Output = ()> + Send + 'static) -> Self {
        Self(tokio::spawn(work))
    }

    /// Ends it, and waits until it holds nothing.
    async fn end(mut self) {
        self.0.abort();
        // An error says that it was aborted.
        let _ = (&mut self.0).await;
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Drop for TrackName {
    fn drop(&mut self) {
        let ended = self.tracks.lock().remove(&self.id);
        drop(ended);
    }
}

impl OpenTracks {
    /// No tracks yet.
    pub(crate) fn new(maximum: usize) -> Self {
        Self {
            maximum,
            permits: Arc::new(Semaphore::new(maximum)),
            by_name: Mutex::default(),
        }
    }

    /// Number of tracks.
    pub(crate) fn count(&self) -> usize {
        self.maximum - self.permits.available_permits()
    }

    /// The right to another track.
    pub(crate) fn admit(&self) -> Result<OwnedSemaphorePermit, ServiceError> {
        let permit = Arc::clone(&self.permits).try_acquire_owned();
        permit.map_err(|_| ServiceError::Overloaded {
            limit: Limit::Tracks,
            maximum: self.maximum,
            retry_after: RETRY_AFTER,
        })
    }

    /// Opens a track under a name that cannot be guessed, which is returned. It ends with `answers`, or when it is deleted.
    pub(crate) fn open(
        self: &Arc<Self>,
        inbox: Arc<Inbox>,
        answers: impl Future<Output = ()> + Send + 'static,
    ) -> String {
        let id = Uuid::new_v4();
        self.lock().insert(id, OpenTrack { inbox, task: None });
        let named = TrackName {
            tracks: Arc::clone(self),
            id,
        };
        let task = Task::start(async move {
            let _named = named;
            answers.await;
        });
        if let Some(track) = self.lock().get_mut(&id) {
            track.task = Some(task);
        }
        format!("{COLLECTION}{}", id.simple())
    }

    /// Where the frames of a track go.
    pub(crate) fn inbox(&self, name: &str) -> Result<Arc<Inbox>, ServiceError> {
        let id = id_of("track", name)?;
        let tracks = self.lock();
        let track = tracks.get(&id).ok_or_else(|| not_found(name))?;
        Ok(Arc::clone(&track.inbox))
    }

    /// Ends a track.
    pub(crate) async fn delete(&self, name: &str) -> Result<(), ServiceError> {
        let id = id_of("name", name)?;
        let track = self.lock().remove(&id).ok_or_else(|| not_found(name))?;
        if let Some(task) = track.task {
            task.end().await;
        }
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Uuid, OpenTrack>> {
        // Each change is a single one of the map.
        self.by_name.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The id in the name of a track, which the request has in a field.
fn id_of(field: &str, name: &str) -> Result<Uuid, ServiceError> {
    let id = name
        .strip_prefix(COLLECTION)
        .and_then(|id| Uuid::try_parse(id).ok());
    id.ok_or_else(|| {
        let quoted = crate::validate::quoted(name);
        ServiceError::invalid(
            field,
            format!("is {quoted}; it must be the name of a created track, tracks/{{track}}"),
        )
    })
}

/// The error of a name that no track has.
pub(crate) fn not_found(name: &str) -> ServiceError {
    ServiceError::TrackNotFound {
        name: name.to_owned(),
    }
}
