//! The server's configuration: checked values, and where they come from.

mod check;
mod raw;

use std::{fmt, net::SocketAddr, num::NonZeroUsize, path::PathBuf, time::Duration};

pub use raw::{RawConfig, read_file, unknown_variables};

use grasp_synthesis::base::mechanisms::Mechanisms;

use crate::{budget::BudgetLimits, objects::store::StoreLimits};

/// How the log is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// For people.
    Text,
    /// For machines: one JSON object a line.
    Json,
}

/// A configuration that was checked. The defaults serve one machine's worth of clients.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// Where to listen. `run` takes a listener and does not look here.
    pub listen: SocketAddr,
    /// Threads that search. More find grasps sooner, up to the number of cores.
    pub workers: NonZeroUsize,
    /// Threads of the async runtime that the binary starts.
    pub io_threads: NonZeroUsize,
    /// How long searches may take.
    pub budgets: BudgetLimits,
    /// Searches that run or wait at most; others are turned away.
    pub maximum_searches: NonZeroUsize,
    /// Objects that are received or built at a time; others are turned away.
    pub maximum_uploads: NonZeroUsize,
    /// Bytes of an OBJ mesh.
    pub maximum_object_bytes: NonZeroUsize,
    /// Triangles, and vertices, of a mesh.
    pub maximum_object_triangles: NonZeroUsize,
    /// How much the created objects may take.
    pub store: StoreLimits,
    /// A folder of objects that the server starts with; none for the built-in ones alone.
    pub objects_directory: Option<PathBuf>,
    /// Threads that find out in the background how hands can hold the objects; 0: none does, and no atlases are kept.
    pub builder_threads: usize,
    /// A folder to keep atlases in; none to keep them in memory alone.
    pub atlas_directory: Option<PathBuf>,
    /// Connections; others wait.
    pub maximum_connections: NonZeroUsize,
    /// How long running calls are waited for at the end.
    pub drain: Duration,
    /// The receiving hand's rig unless a request names one; under `THESIS` validity, that is always the thesis' own.
    pub default_rig: String,
    /// How the log is written.
    pub log_format: LogFormat,
    /// What is logged, as a filter of `tracing-subscriber`: `info`, `grasp_server=debug,h2=warn`, …
    pub log: String,
    /// The mechanisms that searches run. No file or variable sets them: fewer are for measuring what each is worth.
    pub mechanisms: Mechanisms,
}

impl Default for Config {
    fn default() -> Self {
        let cores = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let non_zero = |n| NonZeroUsize::new(n).unwrap_or(NonZeroUsize::MIN);
        Self {
            listen: SocketAddr::from((std::net::Ipv6Addr::LOCALHOST, 50051)),
            workers: cores,
            // Requests and answers are small: a thread serves thousands of them a second.
            io_threads: non_zero((cores.get() / 8).max(2)),
            budgets: BudgetLimits {
                default: Duration::from_secs(1),
                maximum: Duration::from_secs(10),
                // Measured: timers of the runtime are up to 6 ms late while all cores search.
                reserve: Duration::from_millis(5),
            },
            maximum_searches: non_zero(64),
            maximum_uploads: non_zero(4),
            maximum_object_bytes: non_zero(8 << 20),
            maximum_object_triangles: non_zero(200_000),
            store: StoreLimits {
                objects: 1000,
                bytes: 512 << 20,
            },
            objects_directory: None,
            builder_threads: 1,
            atlas_directory: None,
            maximum_connections: non_zero(1000),
            drain: Duration::from_secs(10),
            default_rig: "adult".to_owned(),
            log_format: LogFormat::Text,
            log: "info".to_owned(),
            mechanisms: Mechanisms::ALL,
        }
    }
}

/// A value of the configuration that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadValue {
    /// The key, as it stands in the file.
    pub key: &'static str,
    /// The value.
    pub value: String,
    /// What would be right.
    pub needed: String,
}

/// Why there is no configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration file {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no TOML, or has a key or a type that is not known.
    #[error("the configuration file {} is wrong: {source}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where and why.
        source: Box<toml::de::Error>,
    },
    /// Values that cannot be used; all of them.
    #[error("{}", listed(.0))]
    BadValues(Vec<BadValue>),
}

impl fmt::Display for BadValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is {}; it must be {}", self.key, self.value, self.needed)
    }
}

fn listed(bad: &[BadValue]) -> String {
    bad.iter().map(BadValue::to_string).collect::<Vec<_>>().join("\n")
}
