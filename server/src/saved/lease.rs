//! The lease of a bucket: a file that its owner keeps changing. A server that sees it change does not start; one that sees it unchanged
//! for a whole term takes it over. Only conditional writes change it, so of two servers one always loses, and no two clocks are
//! compared.

use std::{
    str,
    sync::{Arc, Weak},
    time::Duration,
};

use object_store::{Error, ObjectStore, ObjectStoreExt as _, PutMode, PutPayload, UpdateVersion, path::Path};
use tokio::{
    sync::Notify,
    time::{Instant, sleep, timeout_at},
};
use uuid::Uuid;

use super::{StoreError, in_use, this_process};
use crate::{
    sync::{Mutex, locked},
    tls::random_id,
};

/// The file, beside the folders.
const FILE: &str = "lease";

/// Largest file that is read, in bytes.
const MAX_FILE: u64 = 1 << 10;

/// Times of a lease.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    /// How long a file stays unchanged before another server takes it over.
    pub term: Duration,
    /// How long its owner writes after it began to change the file: less than the term, because writes take time to arrive.
    pub valid: Duration,
    /// How often its owner changes the file.
    pub renewal: Duration,
    /// How long to wait for a server that is being replaced and may end.
    pub wait: Duration,
    /// How often to look at the file while waiting.
    pub poll: Duration,
}

impl Times {
    pub(super) const USUAL: Self = Self {
        term: Duration::from_secs(15),
        valid: Duration::from_secs(10),
        renewal: Duration::from_secs(3),
        wait: super::LOCK_WAIT,
        poll: Duration::from_millis(250),
    };
}

#[derive(Debug)]
pub(super) struct Lease {
    files: Arc<dyn ObjectStore>,
    times: Times,
    /// Differs from that of every other server.
    id: Uuid,
    /// `None` until it is taken, and once it is lost or given back.
    held: Mutex<Option<HeldLease>>,
    /// Tells when it is lost.
    lost: Notify,
}

/// The file as this server wrote it.
#[derive(Clone, Debug)]
struct HeldLease {
    version: UpdateVersion,
    /// Number of changes.
    changes: u64,
    valid_until: Instant,
}

/// The file as it is.
struct LeaseFile {
    version: UpdateVersion,
    /// The id of its owner, or nothing if it was given back; the number of its changes; and its owner for people.
    content: String,
}

impl LeaseFile {
    fn id(&self) -> &str {
        self.content.split_whitespace().next().unwrap_or_default()
    }

    fn owner(&self) -> &str {
        self.content.splitn(3, ' ').nth(2).unwrap_or_default()
    }
}

fn error(source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::Generic {
        store: "lease",
        source: source.into(),
    }
}

impl Lease {
    pub(super) fn new(files: Arc<dyn ObjectStore>, times: Times) -> Arc<Self> {
        Arc::new(Self {
            files,
            times,
            id: random_id(),
            held: Mutex::default(),
            lost: Notify::new(),
        })
    }

    /// Takes the lease, and keeps it from now on. An error if another server has it.
    pub(super) async fn take(
        self: &Arc<Self>,
        refused: impl Fn(&dyn std::fmt::Display) -> StoreError,
    ) -> Result<(), StoreError> {
        let Times { term, wait, poll, .. } = self.times;
        let start = Instant::now();
        let mut last: Option<(LeaseFile, Instant)> = None;
        loop {
            let seen = self.look().await.map_err(|error| refused(&error))?;
            let mode = match (seen, &last) {
                (None, _) => PutMode::Create,
                (Some(seen), _) if seen.id().is_empty() => PutMode::Update(seen.version),
                (Some(seen), Some((before, since))) if seen.content == before.content => {
                    if since.elapsed() < term {
                        sleep(poll).await;
                        continue;
                    }
                    tracing::warn!(
                        owner = seen.owner(),
                        "took over the store of a server that is gone"
                    );
                    PutMode::Update(seen.version)
                }
                (Some(seen), Some(_)) if start.elapsed() >= wait => {
                    return Err(refused(&in_use(seen.owner())));
                }
                (Some(seen), _) => {
                    last = Some((seen, Instant::now()));
                    sleep(poll).await;
                    continue;
                }
            };
            match self.put(mode, 0).await {
                Ok(held) => {
                    *locked(&self.held) = Some(held);
                    tokio::spawn(keep(Arc::downgrade(self), self.times.renewal));
                    return Ok(());
                }
                // Another server was quicker.
                Err(Error::AlreadyExists { .. } | Error::Precondition { .. }) => {}
                Err(error) => return Err(refused(&error)),
            }
        }
    }

    /// Gives it back, so that another server may start at once. If that fails, the term passes first.
    pub(super) async fn give_back(&self) {
        let held = locked(&self.held).take();
        let Some(held) = held else { return };
        let path = Path::from(FILE);
        let put = self
            .files
            .put_opts(&path, PutPayload::new(), PutMode::Update(held.version).into());
        if let Err(error) = put.await {
            tracing::warn!(%error, "cannot give the lease of the store back");
        }
    }

    /// Waits until another server has it.
    pub(super) async fn lost(&self) {
        self.lost.notified().await;
    }

    /// The output of a change of the bucket, which must end while the lease is valid.
    pub(super) async fn within<T>(&self, change: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
        let until = locked(&self.held).as_ref().map(|held| held.valid_until);
        let until = until.filter(|until| *until > Instant::now());
        let until = until.ok_or_else(|| error("the server does not hold the lease of its store"))?;
        let changed = timeout_at(until, change).await;
        changed.unwrap_or_else(|_| Err(error("the lease of the store ran out before it was changed")))
    }

    async fn look(&self) -> Result<Option<LeaseFile>, Error> {
        let file = match self.files.get(&Path::from(FILE)).await {
            Err(Error::NotFound { .. }) => return Ok(None),
            file => file?,
        };
        let version = UpdateVersion {
            e_tag: file.meta.e_tag.clone(),
            version: file.meta.version.clone(),
        };
        let bytes = match file.meta.size {
            0..=MAX_FILE => file.bytes().await?,
            _ => return Err(error("the file lease is too large for one")),
        };
        let content = String::from_utf8_lossy(&bytes).into_owned();
        Ok(Some(LeaseFile { version, content }))
    }

    async fn put(&self, mode: PutMode, changes: u64) -> Result<HeldLease, Error> {
        let valid_until = Instant::now() + self.times.valid;
        let content = format!("{} {changes} {}", self.id.simple(), this_process());
        let path = Path::from(FILE);
        let put = self.files.put_opts(&path, content.into(), mode.into());
        let put = timeout_at(valid_until, put).await;
        let put = put.unwrap_or_else(|_| Err(error("changing the lease took too long")))?;
        Ok(HeldLease {
            version: put.into(),
            changes,
            valid_until,
        })
    }

    /// Changes the file. False once it is lost or given back.
    async fn renew(&self) -> bool {
        let held = locked(&self.held).clone();
        let Some(held) = held else { return false };
        let changes = held.changes + 1;
        let mut renewed = self.put(PutMode::Update(held.version), changes).await;
        if let Err(Error::Precondition { .. }) = renewed {
            // An earlier change may have been made although it seemed to fail.
            renewed = match self.look().await {
                Ok(Some(seen)) if seen.id() == self.id.simple().to_string() => {
                    self.put(PutMode::Update(seen.version), changes).await
                }
                Ok(_) => {
                    *locked(&self.held) = None;
                    tracing::error!("another server took the store over");
                    self.lost.notify_one();
                    return false;
                }
                Err(error) => Err(error),
            };
        }
        match renewed {
            Ok(renewed) => {
                // Unless it was given back meanwhile.
                let mut held = locked(&self.held);
                if let Some(held) = &mut *held {
                    *held = renewed;
                }
            }
            Err(error) => tracing::warn!(%error, "cannot renew the lease of the store"),
        }
        true
    }
}

/// Keeps a lease until it is dropped, lost or given back.
async fn keep(lease: Weak<Lease>, every: Duration) {
    loop {
        sleep(every).await;
        let Some(lease) = lease.upgrade() else { return };
        if !lease.renew().await {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use object_store::memory::InMemory;

    use super::*;

    /// Hundredths of the usual times.
    const TIMES: Times = Times {
        term: Duration::from_millis(900),
        valid: Duration::from_millis(600),
        renewal: Duration::from_millis(60),
        wait: Duration::from_millis(150),
        poll: Duration::from_millis(10),
    };

    fn refused(reason: &dyn std::fmt::Display) -> StoreError {
        StoreError {
            place: "bucket".to_owned(),
            reason: reason.to_string(),
        }
    }

    async fn change(lease: &Lease) -> Result<(), Error> {
        lease.within(async { Ok(()) }).await
    }

    #[tokio::test]
    async fn a_second_server_is_refused_until_the_first_gives_the_lease_back() {
        let bucket: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
        let [first, second] = [(); 2].map(|()| Lease::new(Arc::clone(&bucket), TIMES));
        assert!(change(&first).await.is_err());
        first.take(refused).await.unwrap();
        change(&first).await.unwrap();
        let error = second.take(refused).await.unwrap_err().to_string();
        let owner = format!("another server uses it ({})", this_process());
        assert!(error.contains(&owner), "{error}");
        assert!(change(&second).await.is_err());
        change(&first).await.unwrap();
        first.give_back().await;
        assert!(change(&first).await.is_err());
        let start = Instant::now();
        second.take(refused).await.unwrap();
        assert!(start.elapsed() < TIMES.term);
        change(&second).await.unwrap();
    }

    #[tokio::test]
    async fn the_lease_of_a_killed_server_is_taken_over_after_its_term() {
        let bucket: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
        let [first, second] = [(); 2].map(|()| Lease::new(Arc::clone(&bucket), TIMES));
        first.take(refused).await.unwrap();
        drop(first);
        let start = Instant::now();
        second.take(refused).await.unwrap();
        assert!(start.elapsed() >= TIMES.term, "{:?}", start.elapsed());
        change(&second).await.unwrap();
    }

    #[tokio::test]
    async fn a_server_that_lost_its_lease_changes_nothing_more() {
        let bucket: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
        let lease = Lease::new(Arc::clone(&bucket), TIMES);
        lease.take(refused).await.unwrap();
        // As another server would, while this one was paused.
        bucket
            .put(&Path::from(FILE), "another 0 process 7".into())
            .await
            .unwrap();
        tokio::time::timeout(TIMES.term, lease.lost())
            .await
            .expect("it notices");
        assert!(change(&lease).await.is_err());
        // It does not take it back.
        sleep(2 * TIMES.renewal).await;
        let content = bucket
            .get(&Path::from(FILE))
            .await
            .unwrap()
            .bytes()
            .await
            .unwrap();
        assert_eq!(content, "another 0 process 7");
    }

    #[tokio::test]
    async fn of_servers_that_start_at_once_one_gets_the_lease() {
        let bucket: Arc<dyn ObjectStore> = Arc::new(InMemory::new());
        let mut taking = tokio::task::JoinSet::new();
        for _ in 0..8 {
            let lease = Lease::new(Arc::clone(&bucket), TIMES);
            taking.spawn(async move {
                let taken = lease.take(refused).await;
                (lease, taken.is_ok())
            });
        }
        let taken = taking.join_all().await;
        assert_eq!(taken.iter().filter(|(_, is_taken)| *is_taken).count(), 1);
    }
}
