//! Tracks whose frames come in calls of their own.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use uuid::Uuid;

use super::Inbox;
use crate::error::{Limit, ServiceError};

/// Prefix of the names of tracks.
const COLLECTION: &str = "tracks/";

/// When to retry if there are as many tracks as there may be: they end when givers let go.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// All tracks, open or of a single call.
#[derive(Debug)]
pub(crate) struct OpenTracks {
    maximum: usize,
    permits: Arc<Semaphore>,
    by_name: Mutex<HashMap<Uuid, Arc<Inbox>>>,
}

/// A track that frames can be pushed to until this is dropped.
#[derive(Debug)]
pub(crate) struct OpenTrack {
    tracks: Arc<OpenTracks>,
    id: Uuid,
}

impl OpenTrack {
    /// Its name.
    pub(crate) fn name(&self) -> String {
        format!("{COLLECTION}{}", self.id.simple())
    }
}

impl Drop for OpenTrack {
    fn drop(&mut self) {
        self.tracks.lock().remove(&self.id);
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
    ///
    /// # Errors
    /// [`ServiceError::Overloaded`] if there are as many as there may be.
    pub(crate) fn admit(&self) -> Result<OwnedSemaphorePermit, ServiceError> {
        let permit = Arc::clone(&self.permits).try_acquire_owned();
        permit.map_err(|_| ServiceError::Overloaded {
            limit: Limit::Tracks,
            maximum: self.maximum,
            retry_after: RETRY_AFTER,
        })
    }

    /// Opens a track under a name that cannot be guessed.
    pub(crate) fn open(self: &Arc<Self>, inbox: Arc<Inbox>) -> OpenTrack {
        let id = Uuid::new_v4();
        self.lock().insert(id, inbox);
        OpenTrack {
            tracks: Arc::clone(self),
            id,
        }
    }

    /// The track with this name.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] if it is no name of a track, [`ServiceError::TrackNotFound`] if there is none.
    pub(crate) fn get(&self, name: &str) -> Result<Arc<Inbox>, ServiceError> {
        let id = name
            .strip_prefix(COLLECTION)
            .and_then(|id| Uuid::try_parse(id).ok());
        let Some(id) = id else {
            let quoted = crate::validate::quoted(name);
            return Err(ServiceError::invalid(
                "track",
                format!(
                    "is {quoted}; it must be the track of the first message of OpenTrack, tracks/{{track}}"
                ),
            ));
        };
        self.lock()
            .get(&id)
            .cloned()
            .ok_or_else(|| ServiceError::TrackNotFound {
                name: name.to_owned(),
            })
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Uuid, Arc<Inbox>>> {
        // Each change is a single one of the map.
        self.by_name.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
