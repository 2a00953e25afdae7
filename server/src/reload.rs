//! Settings in files that are read again while the server runs: when they change, and when the server is told to.

use std::{
    fmt::Debug,
    fs,
    os::unix::fs::MetadataExt as _,
    path::Path,
    sync::Arc,
    time::{Duration, Instant, SystemTime},
};

use tokio::{sync::Notify, task::spawn_blocking, time::MissedTickBehavior};

/// Interval between looks at the files' times.
const CHECK: Duration = Duration::from_secs(2);

/// Interval between reminders.
const REMINDER: Duration = Duration::from_hours(24);

/// Settings from files that can be read again.
pub(crate) trait Reloadable: Debug + Send + Sync {
    /// Its name in the log.
    fn subject(&self) -> &'static str;

    fn files(&self) -> Vec<&Path>;

    /// Reads the files. If the result is an error, which lists everything that is wrong, nothing has changed.
    fn reload(&self) -> Result<(), Vec<String>>;

    /// Warns of coming problems with them, once they are read and every day.
    fn remind(&self) {}
}

/// Tells a running server to read its files again.
#[derive(Clone, Debug, Default)]
pub struct Reloader(Arc<Notify>);

impl Reloader {
    /// Reads the files of certificates and tokens again, even if they have not changed. The log has the result.
    pub fn reload(&self) {
        self.0.notify_one();
    }
}

/// Identifies a state of files: time of change, size, device and number of each. `None` of one that is missing.
type Stamps = Vec<Option<(SystemTime, u64, u64, u64)>>;

fn stamps(of: &dyn Reloadable) -> Stamps {
    let stamp = |path: &Path| {
        let file = fs::metadata(path).ok()?;
        Some((file.modified().ok()?, file.len(), file.dev(), file.ino()))
    };
    of.files().into_iter().map(stamp).collect()
}

/// A reloadable with the state of its files.
#[derive(Debug)]
pub(crate) struct WatchedFiles {
    source: Arc<dyn Reloadable>,
    loaded: Stamps,
    /// At the last look.
    seen: Stamps,
}

impl WatchedFiles {
    /// Watches files that were just read.
    pub(crate) fn new(source: Arc<dyn Reloadable>) -> Self {
        source.remind();
        let loaded = stamps(&*source);
        Self {
            seen: loaded.clone(),
            loaded,
            source,
        }
    }

    /// Reads the files again if they have changed, but not since the last look: several may be replaced one after the other.
    fn look(&mut self, is_told: bool) {
        let now = stamps(&*self.source);
        let is_settled = now == self.seen;
        self.seen.clone_from(&now);
        if !is_told && (now == self.loaded || !is_settled) {
            return;
        }
        // Broken files are read again when they change again.
        self.loaded = now;
        if self.loaded.is_empty() {
            return;
        }
        let subject = self.source.subject();
        match self.source.reload() {
            Ok(()) => {
                tracing::info!("read the {subject} again");
                self.source.remind();
            }
            Err(problems) => {
                for problem in problems {
                    tracing::error!(%problem, "the {subject} stay as they were");
                }
            }
        }
    }
}

/// Reads changed files until it is dropped.
pub(crate) async fn keep_current(mut watched: Vec<WatchedFiles>, reloader: Reloader) {
    let mut check = tokio::time::interval(CHECK);
    check.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut reminded = Instant::now();
    loop {
        let is_told = tokio::select! {
            _ = check.tick() => false,
            () = reloader.0.notified() => true,
        };
        let is_due = reminded.elapsed() >= REMINDER;
        if is_due {
            reminded = Instant::now();
        }
        let looked = spawn_blocking(move || {
            for one in &mut watched {
                one.look(is_told);
                if is_due {
                    one.source.remind();
                }
            }
            watched
        });
        let Ok(back) = looked.await else { break };
        watched = back;
    }
    // A panic, which the log has. The server goes on with its present settings.
    std::future::pending::<()>().await;
}
