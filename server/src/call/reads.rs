//! Calls that read or delete: how many of a client run at a time.
//!
//! Each takes a little time on the threads that handle requests. Of one client only a few are handled at a time, and its others wait
//! for them, so that those of another client come between.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, Weak},
    task::Context,
    time::Duration,
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::body::Body;

use crate::{
    client::Client,
    error::{Limit, ServiceError},
    limits::{Place, Places, locked},
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
    /// Each client's permits, as long as it has calls.
    clients: Mutex<HashMap<Client, Weak<Semaphore>>>,
}

/// A call that may wait for others of its client.
pub(super) struct WaitingRead {
    place: Place,
    turns: Arc<Semaphore>,
}

/// The right to handle a call, until the end of its answer.
pub(super) struct ReadTurn {
    _place: Place,
    _turn: Option<OwnedSemaphorePermit>,
}

impl Default for Reads {
    fn default() -> Self {
        Self {
            places: Places::new(Limit::Reads, MAX_READS, RETRY_AFTER),
            clients: Mutex::default(),
        }
    }
}

impl Reads {
    pub(super) fn enter(&self, client: &Client) -> Result<WaitingRead, ServiceError> {
        let place = self.places.take(client)?;
        let mut clients = locked(&self.clients);
        let turns = clients.get(client).and_then(Weak::upgrade).unwrap_or_else(|| {
            clients.retain(|_, turns| turns.strong_count() > 0);
            let turns = Arc::new(Semaphore::new(MAX_AT_ONCE));
            clients.insert(client.clone(), Arc::downgrade(&turns));
            turns
        });
        Ok(WaitingRead { place, turns })
    }
}

impl WaitingRead {
    pub(super) async fn turn(self) -> ReadTurn {
        ReadTurn {
            _place: self.place,
            // Nothing closes the semaphore.
            _turn: self.turns.acquire_owned().await.ok(),
        }
    }
}

/// The turn ends with the body of the answer.
impl FrameFilter for ReadTurn {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        next_frame(inner, cx)
    }
}
