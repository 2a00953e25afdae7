//! The server under test as a process of its own, and the processor time and memory that it takes.

use std::{
    collections::BTreeMap,
    fs, io,
    net::SocketAddr,
    path::{Path, PathBuf},
    process::{Child, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::cores::Cores;

/// Longest wait for a server to start.
const STARTS_WITHIN: Duration = Duration::from_mins(1);

/// Start of the names of threads that search.
const SEARCH_THREADS: &str = "grasp-search";

/// A running server, on a free port of 127.0.0.1. Dropping it ends it.
#[derive(Debug)]
pub(crate) struct ServerProcess {
    child: Child,
    log: PathBuf,
    /// Where it listens.
    pub(crate) address: SocketAddr,
}

/// Processor time of a thread, in seconds.
type ThreadTimes = BTreeMap<u32, ThreadTime>;

#[derive(Clone, Copy, Debug)]
struct ThreadTime {
    searches: bool,
    seconds: f64,
}

/// Processor time up to a moment.
#[derive(Clone, Debug)]
pub(crate) struct Usage(ThreadTimes);

/// Processor time between two moments, in seconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spent {
    /// Of threads that search.
    pub(crate) searching: f64,
    /// Of all others.
    pub(crate) other: f64,
}

impl Spent {
    /// Of all threads.
    pub(crate) fn total(self) -> f64 {
        self.searching + self.other
    }
}

impl ServerProcess {
    /// Starts `program` on cores, with objects in memory and these flags, and waits until it serves.
    pub(crate) fn start(program: &Path, cores: &Cores, flags: &[&str]) -> io::Result<Self> {
        let log = std::env::temp_dir().join(format!("grasp-promises-{}.log", std::process::id()));
        let mut command = cores.command(program);
        command
            .args([
                "--listen",
                "127.0.0.1:0",
                "--store",
                "memory",
                "--log-format",
                "json",
            ])
            .args(flags)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(fs::File::create(&log)?);
        let mut child = command.spawn()?;
        let began = Instant::now();
        loop {
            let text = fs::read_to_string(&log)?;
            if let Some(address) = text.lines().find_map(address_in) {
                return Ok(Self { child, log, address });
            }
            if let Some(status) = child.try_wait()? {
                return Err(io::Error::other(format!(
                    "the server ended with {status}: {text}"
                )));
            }
            if began.elapsed() > STARTS_WITHIN {
                child.kill()?;
                return Err(io::Error::other(format!("the server does not start: {text}")));
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// The processor time that its threads have taken so far.
    pub(crate) fn usage(&self) -> io::Result<Usage> {
        let mut times = ThreadTimes::new();
        for (id, folder) in self.threads()? {
            // A thread may end meanwhile.
            let (Ok(name), Ok(times_text)) = (
                fs::read_to_string(folder.join("comm")),
                fs::read_to_string(folder.join("schedstat")),
            ) else {
                continue;
            };
            let nanoseconds: f64 = times_text
                .split(' ')
                .next()
                .and_then(|first| first.parse().ok())
                .unwrap_or_default();
            let time = ThreadTime {
                searches: name.starts_with(SEARCH_THREADS),
                seconds: 1e-9 * nanoseconds,
            };
            times.insert(id, time);
        }
        Ok(Usage(times))
    }

    /// The processor time since an earlier moment, without that of threads that have ended.
    pub(crate) fn spent_since(&self, before: &Usage) -> io::Result<Spent> {
        let mut spent = Spent::default();
        for (id, now) in self.usage()?.0 {
            let seconds = now.seconds - before.0.get(&id).map_or(0.0, |then| then.seconds);
            if now.searches {
                spent.searching += seconds;
            } else {
                spent.other += seconds;
            }
        }
        Ok(spent)
    }

    /// The files with the states of the threads that search.
    pub(crate) fn search_threads(&self) -> io::Result<Vec<PathBuf>> {
        let threads = self.threads()?.into_iter().map(|(_, folder)| folder);
        Ok(threads
            .filter(|folder| {
                fs::read_to_string(folder.join("comm")).is_ok_and(|name| name.starts_with(SEARCH_THREADS))
            })
            .map(|folder| folder.join("stat"))
            .collect())
    }

    /// Resident memory, in bytes.
    pub(crate) fn resident_bytes(&self) -> io::Result<f64> {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id()))?;
        let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kibibytes = resident.and_then(|text| text.trim().strip_suffix(" kB")?.parse::<f64>().ok());
        Ok(1024.0 * kibibytes.ok_or_else(|| io::Error::other("no VmRSS"))?)
    }

    fn threads(&self) -> io::Result<Vec<(u32, PathBuf)>> {
        let threads = fs::read_dir(format!("/proc/{}/task", self.child.id()))?;
        Ok(threads
            .filter_map(|thread| {
                let thread = thread.ok()?;
                Some((thread.file_name().to_str()?.parse().ok()?, thread.path()))
            })
            .collect())
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        // It keeps nothing: objects are in memory. A log left behind does no harm.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = fs::remove_file(&self.log);
    }
}

/// The address in a line of the log.
fn address_in(line: &str) -> Option<SocketAddr> {
    let line: serde_json::Value = serde_json::from_str(line).ok()?;
    if line.get("message")? != "serving" {
        return None;
    }
    line.get("address")?.as_str()?.parse().ok()
}
