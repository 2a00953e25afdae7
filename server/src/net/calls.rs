//! Bounds the calls of a connection that run at a time.
//!
//! The transport has such a limit, too, but answers beyond it without the framing and the headers that pages need.

use std::{sync::Arc, time::Duration};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::error::{Limit, ServiceError};

/// When a client with too many calls should try again: after about the time of a few searches.
const RETRY_AFTER: Duration = Duration::from_millis(50);

/// The places for calls of one connection.
#[derive(Clone, Debug)]
pub(super) struct CallPlaces {
    most: usize,
    free: Arc<Semaphore>,
}

impl CallPlaces {
    /// Places for so many calls.
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            free: Arc::new(Semaphore::new(most)),
        }
    }

    /// A place for a call until it is answered.
    ///
    /// # Errors
    /// [`ServiceError::Overloaded`] if there is none.
    pub(super) fn take(&self) -> Result<OwnedSemaphorePermit, ServiceError> {
        let place = Arc::clone(&self.free).try_acquire_owned();
        place.map_err(|_| ServiceError::Overloaded {
            limit: Limit::Calls,
            maximum: self.most,
            retry_after: RETRY_AFTER,
        })
    }
}
