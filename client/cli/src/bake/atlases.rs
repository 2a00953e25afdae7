//! Waits for the atlases of both hands.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use grasp_client::{ClientError, GraspClient, v1};
use indicatif::ProgressBar;

use super::results::{Grips, Row};
use crate::{Failure, objects::atlas_of};

/// Steps of an object's progress: each hand's atlas becomes useful, and complete.
pub(super) const STEPS: u64 = 4;

/// Grips of an atlas that answers most requests.
const USEFUL: u32 = 100;

/// How long to wait before the state of all objects is read again.
const PAUSE: Duration = Duration::from_millis(500);

/// How long none of the atlases may grow before they are given up: the server then has no memory for them.
const STALLED: Duration = Duration::from_mins(2);

/// Objects whose atlases grow.
#[derive(Debug)]
pub(super) struct Waiting<'a> {
    client: &'a GraspClient,
    /// By name.
    objects: BTreeMap<String, Growing>,
    /// True once the state of all was read since the last was added.
    is_read: bool,
    /// When one of them last grew.
    grew: Instant,
}

#[derive(Debug)]
struct Growing {
    place: usize,
    row: Row,
    steps: u64,
}

impl<'a> Waiting<'a> {
    pub(super) fn new(client: &'a GraspClient) -> Self {
        Self {
            client,
            objects: BTreeMap::new(),
            is_read: false,
            grew: Instant::now(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.objects.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.objects.is_empty()
    }

    /// Adds an object, with its place in the table.
    pub(super) fn add(&mut self, place: usize, row: Row) {
        self.is_read = false;
        self.grew = Instant::now();
        let growing = Growing { place, row, steps: 0 };
        self.objects.insert(growing.row.name.clone(), growing);
    }

    /// The objects whose atlases are complete; waits for some time between readings of their state.
    pub(super) async fn ready(&mut self, progress: &ProgressBar) -> Result<Vec<(usize, Row)>, Failure> {
        if self.is_read {
            tokio::time::sleep(PAUSE).await;
        }
        self.is_read = true;
        let names: Vec<String> = self.objects.keys().cloned().collect();
        let mut ready = Vec::new();
        for name in names {
            let state = self.client.get_object(&name).await;
            let Some(growing) = self.objects.get_mut(&name) else {
                continue;
            };
            let before = growing.row.grips;
            match state {
                Err(ClientError::NotFound(_)) => {
                    growing.row.error = Some("was deleted or evicted meanwhile".to_owned());
                }
                state => growing.row.describe(&state?, &atlases(self.client, &name).await?),
            }
            if growing.row.grips != before {
                self.grew = Instant::now();
            } else if self.grew.elapsed() > STALLED {
                growing.row.stalled = true;
            }
            let row = &growing.row;
            let is_over = row.error.is_some() || row.stalled;
            let steps = if is_over { STEPS } else { steps_of(row) };
            progress.inc(steps.saturating_sub(growing.steps));
            growing.steps = steps.max(growing.steps);
            let is_empty = |grips: [Grips; 2]| grips.iter().all(|hand| hand.entries == 0);
            let rests = row.grips.is_some_and(is_empty);
            if steps == STEPS {
                let done = self.objects.remove(&name);
                ready.extend(done.map(|growing| (growing.place, growing.row)));
            } else if rests {
                self.wake(&name).await?;
            }
        }
        Ok(ready)
    }

    /// Has the server load an object that rests, so that its atlas goes on.
    async fn wake(&self, name: &str) -> Result<(), Failure> {
        let mut request = v1::FindGraspRequest::new(name).with_budget(Duration::from_millis(10));
        request.search_mut().max_attempts = Some(1);
        self.client.find_grasp(&request).await?;
        Ok(())
    }
}

/// The atlases of an object for the right and the left hand.
pub(super) async fn atlases(client: &GraspClient, object: &str) -> Result<[v1::Atlas; 2], ClientError> {
    Ok([
        atlas_of(client, object, "right").await?,
        atlas_of(client, object, "left").await?,
    ])
}

/// Steps done of an object's progress. A server without atlases has nothing to wait for.
fn steps_of(row: &Row) -> u64 {
    let Some(grips) = row.grips else { return STEPS };
    let done = grips.map(|hand| match (hand.complete, hand.entries) {
        (true, _) => 2,
        (false, USEFUL..) => 1,
        (false, _) => 0,
    });
    done.into_iter().sum()
}
