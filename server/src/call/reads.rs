//! Calls that read or delete: how many of a client run at a time.
//!
//! Each takes a little time on the threads that handle requests. Of one client only a few are handled at a time, and its others wait
//! for them, so that those of another client come between.

use std::{task::Context, time::Duration};

use tokio::sync::OwnedSemaphorePermit;
use tonic::body::Body;

use crate::{
    client::Client,
    error::{Limit, ServiceError},
    limits::{ClientPermits, Place, Places},
    middleware::{FrameFilter, PolledFrame, next_frame},
};

/// Largest number of these calls, those that wait included: some kilobytes each.
const MAX_READS: usize = 2048;

/// Largest number of a client's calls that are handled at a time.
const MAX_AT_ONCE: usize = 4;

/// When a client with too many should try again.
const RETRY_AFTER: Duration = Duration::from_millis(250);

const READ_METHODS: [&str; 8] = [
    "/grasp.v1.ObjectService/GetObject",
    "/grasp.v1.ObjectService/ListObjects",
    "/grasp.v1.ObjectService/DeleteObject",
    "/grasp.v1.ObjectService/GetAtlas",
    "/grasp.v1.ObjectService/GetMesh",
    "/grasp.v1.HandRigService/GetRig",
    "/grasp.v1.HandRigService/ListRigs",
    "/grasp.v1.HandRigService/DeleteRig",
];

pub(super) fn is_read(path: &str) -> bool {
    READ_METHODS.contains(&path)
}

/// The calls that read or delete.
#[derive(Debug)]
pub(crate) struct Reads {
    places: Places,
    turns: ClientPermits,
}

/// The place of a call, until the end of its answer.
pub(super) struct ReadPlace {
    _place: Place,
}

impl Default for Reads {
    fn default() -> Self {
        Self {
            places: Places::new(Limit::Reads, MAX_READS, RETRY_AFTER),
            turns: ClientPermits::new(MAX_AT_ONCE),
        }
    }
}

impl Reads {
    /// Lets a client's call wait for its turn.
    pub(super) fn enter(&self, client: &Client) -> Result<ReadPlace, ServiceError> {
        self.places.take(client).map(|place| ReadPlace { _place: place })
    }

    /// A turn for a call that has entered, once others of its client are handled. It must not last until the client has read the
    /// answer: one that does not read would wait for itself.
    pub(super) async fn turn(&self, client: &Client) -> Option<OwnedSemaphorePermit> {
        self.turns.acquire(client).await
    }
}

impl FrameFilter for ReadPlace {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        next_frame(inner, cx)
    }
}
