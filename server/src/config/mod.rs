//! The server's configuration: checked values and their sources.

mod check;
mod raw;
mod sources;

use std::{fmt, num::NonZeroUsize, path::PathBuf, time::Duration};

pub use crate::saved::StorePlace;
pub use raw::RawConfig;
pub use sources::{read_file, unknown_variables};

use grasp_import::MeshLimits;
use grasp_synthesis::search::settings::REFINEMENT;

use crate::{
    budget::BudgetLimits,
    limits::{StoreLimits, StreamLimits},
    listen::ListenAddress,
    tls::TlsFiles,
    web::WebOrigins,
};

/// Threads that wait for the disk or network where objects are saved.
const DISK_THREADS: usize = 8;

/// Format of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// For people.
    Text,
    /// For machines: one JSON object per line.
    Json,
}

impl fmt::Display for LogFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Text => "text",
            Self::Json => "json",
        })
    }
}

/// A checked configuration. The defaults suit the clients of one machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// Addresses to listen on, at least one. `run` ignores them and takes a listener.
    pub listen: Vec<ListenAddress>,
    /// Certificates, with which connections of TCP are encrypted. `None` for connections in the clear.
    pub tls: Option<TlsFiles>,
    /// File of the tokens that calls need. `None` if they need none.
    pub tokens_file: Option<PathBuf>,
    /// Lets anyone call who can reach an address of another interface than loopback, in the clear.
    pub insecure_public: bool,
    /// Number of search threads. More find grasps sooner, up to the number of cores.
    pub workers: NonZeroUsize,
    /// Number of threads of the binary's async runtime.
    pub io_threads: NonZeroUsize,
    /// Bounds on search times.
    pub budgets: BudgetLimits,
    /// How much longer a search goes on after a first valid grasp that is not natural, if the request does not say; at most 1 s.
    /// Longer finds more natural grasps, shorter answers sooner.
    pub refinement: Duration,
    /// Largest number of running and waiting searches; others are rejected.
    pub maximum_searches: NonZeroUsize,
    /// Largest number of objects received, built or changed at a time; others are rejected.
    pub maximum_uploads: NonZeroUsize,
    /// Bounds on calls that stream; others are rejected.
    pub streams: StreamLimits,
    /// Largest mesh file in one message or in the objects directory, in bytes.
    pub maximum_object_bytes: NonZeroUsize,
    /// Largest number of triangles, and of vertices, in a mesh.
    pub maximum_object_triangles: NonZeroUsize,
    /// Where created objects are kept.
    pub place: StorePlace,
    /// Largest number of objects kept in a folder or bucket; others are rejected.
    pub maximum_saved_objects: NonZeroUsize,
    /// Bound on the created objects in memory.
    pub store: StoreLimits,
    /// Largest number of rigs created by clients; others are rejected.
    pub maximum_rigs: NonZeroUsize,
    /// Folder of objects to start with. `None` for the built-in objects only.
    pub objects_directory: Option<PathBuf>,
    /// Number of background threads that build atlases; with 0 there are no atlases.
    pub builder_threads: usize,
    /// Largest number of grips that are learned from searches, per object and hand.
    pub learned_grips: usize,
    /// Folder that keeps atlases. `None` for that of [`Self::kept_atlases`].
    pub atlas_directory: Option<PathBuf>,
    /// Largest number of connections; others are closed, or take the place of one without a call.
    pub maximum_connections: NonZeroUsize,
    /// Longest time without a call on a connection.
    pub connection_idle: Duration,
    /// Age from which a connection takes no more calls, give or take a tenth.
    pub connection_age: Duration,
    /// Largest number of bytes of answers that wait for clients to read them; beyond, the connection with the most is closed.
    pub maximum_unread_bytes: NonZeroUsize,
    /// Origins of the pages that may call from browsers.
    pub web_origins: WebOrigins,
    /// Serve the page that shows grasps in a browser at `/`.
    pub viewer: bool,
    /// Address for metrics and probes. `None` for nowhere. The binary listens there; see [`crate::Server::monitored_on`].
    pub metrics_listen: Option<ListenAddress>,
    /// Address of a collector of OpenTelemetry for traces, `http://HOST:PORT`. `None` for no traces.
    pub otlp_endpoint: Option<String>,
    /// How long new calls are answered after the signal to end, for balancers to notice.
    pub drain_delay: Duration,
    /// How long to wait for running calls at shutdown.
    pub drain: Duration,
    /// Rig of the receiving hand if a request names none. Under `THESIS` validity it is always the rig `thesis`.
    pub default_rig: String,
    /// Format of the log.
    pub log_format: LogFormat,
    /// Filter of the log, as in `tracing-subscriber`: `info`, `grasp_server=debug,h2=warn`, …
    pub log: String,
}

impl Default for Config {
    fn default() -> Self {
        let cores = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let non_zero = |n| NonZeroUsize::new(n).unwrap_or(NonZeroUsize::MIN);
        Self {
            listen: vec![ListenAddress::DEFAULT],
            tls: None,
            tokens_file: None,
            insecure_public: false,
            workers: cores,
            // Messages are small: a thread serves thousands of calls per second.
            io_threads: non_zero((cores.get() / 8).max(2)),
            budgets: BudgetLimits {
                default: Duration::from_secs(1),
                maximum: Duration::from_secs(10),
                // Timers of the runtime are up to 6 ms late while all cores search.
                minimum_reserve: Duration::from_millis(5),
            },
            refinement: REFINEMENT,
            maximum_searches: non_zero(64),
            maximum_uploads: non_zero(4),
            streams: StreamLimits {
                upload_bytes: non_zero(256 << 20),
                upload_idle: Duration::from_secs(10),
                watchers: non_zero(64),
                tracks: non_zero(256),
                track_idle: Duration::from_secs(10),
            },
            maximum_object_bytes: non_zero(8 << 20),
            maximum_object_triangles: non_zero(200_000),
            place: StorePlace::default(),
            maximum_saved_objects: non_zero(10_000),
            store: StoreLimits {
                objects: 1000,
                bytes: 512 << 20,
            },
            maximum_rigs: non_zero(16),
            objects_directory: None,
            builder_threads: 1,
            learned_grips: 32,
            atlas_directory: None,
            maximum_connections: non_zero(1000),
            connection_idle: Duration::from_mins(5),
            connection_age: Duration::from_mins(30),
            maximum_unread_bytes: non_zero(32 << 20),
            web_origins: WebOrigins::LOOPBACK,
            viewer: false,
            metrics_listen: None,
            otlp_endpoint: None,
            drain_delay: Duration::ZERO,
            drain: Duration::from_secs(10),
            default_rig: "adult".to_owned(),
            log_format: LogFormat::Text,
            log: "info".to_owned(),
        }
    }
}

impl Config {
    /// Folder that keeps atlases: the given one, else `atlases` where objects are saved. `None` to keep them in memory only.
    pub fn kept_atlases(&self) -> Option<PathBuf> {
        let beside_objects = || Some(self.place.folder()?.join("atlases"));
        self.atlas_directory.clone().or_else(beside_objects)
    }

    /// Most threads besides those that search, build atlases and handle requests: one per search, upload and message being packed, two
    /// per preparation, one for a deletion or preparation ahead of calls, one that reads changed settings, and those that load saved
    /// objects or wait for the disk.
    pub fn blocking_threads(&self) -> usize {
        let uploads = self.maximum_uploads.get();
        let of_store = if self.place == StorePlace::Memory {
            0
        } else {
            uploads.saturating_add(DISK_THREADS)
        };
        let threads = [
            self.maximum_searches.get(),
            uploads,
            self.derivations(),
            self.derivations(),
            self.io_threads.get(),
            1,
            1,
            of_store,
        ];
        threads.into_iter().fold(0, usize::saturating_add)
    }

    /// Number of objects that are prepared for searches at a time: half as many as are received, because that takes less time.
    pub(crate) fn derivations(&self) -> usize {
        self.maximum_uploads.get().div_ceil(2)
    }

    /// Number of objects and rigs that one client builds or prepares at a time: those take a core each, of which other clients keep
    /// half.
    pub(crate) fn heavy_work(&self) -> usize {
        (self.workers.get() / 2).clamp(1, self.maximum_uploads.get())
    }

    /// Largest mesh file in bytes, in one message or in pieces.
    pub(crate) fn largest_mesh(&self) -> NonZeroUsize {
        self.maximum_object_bytes.max(self.streams.upload_bytes)
    }

    pub(crate) fn mesh_limits(&self, bytes: NonZeroUsize) -> MeshLimits {
        let triangles = self.maximum_object_triangles.get();
        MeshLimits {
            bytes: bytes.get(),
            vertices: triangles,
            triangles,
        }
    }
}

/// Why there is no configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration file {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file is not TOML, or has an unknown key or a value of the wrong type.
    #[error("the configuration file {} is wrong: {source}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The place and the cause.
        source: Box<toml::de::Error>,
    },
    /// All invalid values, each with its key and the values that are valid.
    #[error("{}", .0.join("\n"))]
    BadValues(Vec<String>),
}
