//! Whether the server makes progress, and whether it should get calls.
//!
//! Load changes neither: a server that is full refuses calls with a delay, and a balancer that took it out would send its load to
//! the others until they are out, too. A store that cannot be reached changes only the health of the services that write to it:
//! grasps for the objects in memory do not need it, and servers with the same bucket would all be out at once.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use grasp_proto::v1::{
    grasp_service_server::GraspServiceServer, hand_rig_service_server::HandRigServiceServer,
    object_service_server::ObjectServiceServer,
};
use tonic::server::NamedService;
use tonic_health::{ServingStatus, server::HealthReporter};

use crate::{
    executor::SearchExecutor,
    saved::{OBJECTS, SavedFiles},
    services::Handler,
};

/// Interval of the search threads' heartbeat, and of changes of the health.
const BEAT_EVERY: Duration = Duration::from_secs(1);

/// Longest pause of the heartbeat, which waits for slices of searches, of 10 ms each.
const MAX_PAUSE: Duration = Duration::from_secs(30);

/// Number of beats from one look at the store to the next.
const BEATS_PER_LOOK: u32 = 10;

/// Longest time that the store may take to answer.
const STORE_TIME: Duration = Duration::from_secs(5);

/// Failed looks in a row after which the store counts as unreachable.
const MAX_STORE_FAILURES: u32 = 3;

/// Where the server is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// It reads saved objects and rigs.
    Starting,
    Serving,
    /// It has been told to end.
    Draining,
}

/// The signs of life.
#[derive(Debug)]
pub(crate) struct Vitals {
    start: Instant,
    phase: AtomicU8,
    /// When the search threads last ran a heartbeat, in milliseconds since the start.
    beat: AtomicU64,
    /// True while a heartbeat waits for the search threads.
    is_beating: AtomicBool,
    store_failures: AtomicU32,
}

impl Default for Vitals {
    fn default() -> Self {
        Self {
            start: Instant::now(),
            phase: AtomicU8::new(Phase::Starting as u8),
            beat: AtomicU64::new(0),
            is_beating: AtomicBool::new(false),
            store_failures: AtomicU32::new(0),
        }
    }
}

impl Vitals {
    pub(crate) fn enter(&self, phase: Phase) {
        self.phase.store(phase as u8, Ordering::SeqCst);
    }

    fn is_in(&self, phase: Phase) -> bool {
        self.phase.load(Ordering::SeqCst) == phase as u8
    }

    /// Whether the search threads make progress; that the async runtime does shows in that anybody asks.
    pub(crate) fn alive(&self) -> Result<String, String> {
        self.alive_within(MAX_PAUSE)
    }

    fn alive_within(&self, most: Duration) -> Result<String, String> {
        let beat = Duration::from_millis(self.beat.load(Ordering::Relaxed));
        let pause = self.start.elapsed().saturating_sub(beat);
        if pause > most {
            return Err(format!(
                "the search threads have done nothing for {} s",
                pause.as_secs()
            ));
        }
        Ok("alive".to_owned())
    }

    /// Whether the server should get calls.
    pub(crate) fn ready(&self) -> Result<String, String> {
        if self.is_in(Phase::Starting) {
            return Err("starting: reading what is saved".to_owned());
        }
        if self.is_in(Phase::Draining) {
            return Err("draining".to_owned());
        }
        self.alive()?;
        Ok(if self.is_store_reachable() {
            "ready".to_owned()
        } else {
            "ready, but the store cannot be reached".to_owned()
        })
    }

    pub(crate) fn is_store_reachable(&self) -> bool {
        self.store_failures.load(Ordering::Relaxed) < MAX_STORE_FAILURES
    }

    /// Keeps the signs of life and the health of the services up to date, until this is dropped.
    pub(crate) async fn watch(
        self: Arc<Self>,
        executor: SearchExecutor,
        files: Option<Arc<SavedFiles>>,
        health: HealthReporter,
    ) {
        let mut beats = tokio::time::interval(BEAT_EVERY);
        let mut before = (true, true);
        for number in 1_u32.. {
            beats.tick().await;
            self.beat(&executor);
            if let Some(files) = &files
                && number.is_multiple_of(BEATS_PER_LOOK)
            {
                self.look(files).await;
            }
            let now = (self.alive().is_ok(), self.is_store_reachable());
            if now == before || !self.is_in(Phase::Serving) {
                continue;
            }
            tracing::warn!(
                is_alive = now.0,
                is_store_reachable = now.1,
                "the server's health changed"
            );
            before = now;
            set_health(&health, now.0, now.0 && now.1).await;
            // The drain may have begun meanwhile.
            if !self.is_in(Phase::Serving) {
                set_health(&health, false, false).await;
            }
        }
    }

    fn beat(self: &Arc<Self>, executor: &SearchExecutor) {
        if self.is_beating.swap(true, Ordering::Relaxed) {
            return;
        }
        let vitals = Arc::clone(self);
        executor.spawn(move || {
            let now = u64::try_from(vitals.start.elapsed().as_millis()).unwrap_or(u64::MAX);
            vitals.beat.store(now, Ordering::Relaxed);
            vitals.is_beating.store(false, Ordering::Relaxed);
        });
    }

    /// Looks for the mark of the store's folder.
    async fn look(&self, files: &SavedFiles) {
        let looked = tokio::time::timeout(STORE_TIME, files.is_marked(OBJECTS)).await;
        if matches!(looked, Ok(Ok(true))) {
            self.store_failures.store(0, Ordering::Relaxed);
        } else {
            self.store_failures.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Sets the health of the server and of the service of grasps, and that of the services of objects and rigs.
pub(crate) async fn set_health(health: &HealthReporter, finds: bool, saves: bool) {
    for (service, serves) in [
        ("", finds),
        (GraspServiceServer::<Handler>::NAME, finds),
        (ObjectServiceServer::<Handler>::NAME, saves),
        (HandRigServiceServer::<Handler>::NAME, saves),
    ] {
        let status = if serves {
            ServingStatus::Serving
        } else {
            ServingStatus::NotServing
        };
        health.set_service_status(service, status).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn is_alive_as_long_as_the_search_threads_run() {
        let executor = SearchExecutor::new(1, 1).expect("threads start");
        let vitals = Arc::new(Vitals::default());
        let (pause, most) = (Duration::from_millis(5), Duration::from_millis(200));
        let (release, released) = std::sync::mpsc::channel::<()>();
        executor.spawn(move || released.recv().unwrap());
        while vitals.alive_within(most).is_ok() {
            vitals.beat(&executor);
            tokio::time::sleep(pause).await;
        }
        release.send(()).unwrap();
        while vitals.alive_within(most).is_err() {
            vitals.beat(&executor);
            tokio::time::sleep(pause).await;
        }
    }

    #[tokio::test]
    async fn is_ready_only_between_start_and_drain_and_without_its_store() {
        let vitals = Vitals::default();
        assert!(vitals.ready().unwrap_err().contains("starting"));
        vitals.enter(Phase::Serving);
        vitals.ready().unwrap();
        let folder = std::env::temp_dir().join(format!("grasp-vitals-{}", std::process::id()));
        let place = crate::saved::StorePlace::Folder(folder.clone());
        let files = SavedFiles::open(&place).unwrap().unwrap();
        files.mark(OBJECTS).await.unwrap();
        vitals.look(&files).await;
        assert!(vitals.is_store_reachable());
        std::fs::remove_dir_all(&folder).unwrap();
        for failures in 1..=MAX_STORE_FAILURES {
            vitals.look(&files).await;
            assert_eq!(vitals.is_store_reachable(), failures < MAX_STORE_FAILURES);
        }
        assert!(vitals.ready().unwrap().contains("store"));
        vitals.enter(Phase::Draining);
        assert_eq!(vitals.ready(), Err("draining".to_owned()));
    }
}
