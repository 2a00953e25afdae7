//! The service that answers grasp requests, over gRPC, gRPC-Web and Connect.
//!
//! [`run`] serves on a listener, and [`Server::serve`] on several, until it is shut down; the binary `grasp-server` adds flags, logs and
//! signals.
//!
//! A request passes these modules: `call` records its arrival and deadline; `access` lets it in or refuses it; `services` handles it;
//! `validate` turns the message into checked values or a list of all errors; `objects` finds the object with its search structures,
//! `rigs` the hands, and `atlases` the grips known for it; `executor` admits the search, runs it on its own threads, and stops it when
//! the call is dropped; `search` runs it slice by slice; `answer` makes the response. Answers of many messages go through
//! `services::streaming`; `track` holds on to a grasp from one frame of a moving giver to the next. `budget` says how long a search may
//! take, and how much of a deadline recent delays leave for it. `limits` shares places between clients, which `client` tells apart.
//!
//! `wire` converts single values of the contract, `middleware` is the form of layers around services. `web` lets pages in browsers
//! call, and refuses pages of other origins and protocols other than gRPC, gRPC-Web and Connect, which `connect` converts to gRPC.
//! `listen` has the addresses and sockets on which the server listens, `tls` encrypts connections, and `reload` reads changed files
//! again.
//!
//! `saved` keeps the files of objects and rigs that clients create in a folder or bucket; `objects` and `rigs` define their
//! contents.
//!
//! `metrics` counts calls and searches, by the `methods` of the services, `traces` are their spans, and `monitor` answers operators
//! and probes on a port of its own. `warning_rate` bounds warnings that clients can cause, and `log_lines` escapes what they send.
//! `sync` has locks, tasks and waits that tests can run in many orders.
//!
//! Before serving, `memory` and `open_files` compare the configured limits with those of the process, and `objects::directory` loads
//! the folder of objects. Between calls, `atlases` builds atlases in the background.
//! `health_check` is a client: it asks a running server for its health. `faults` are those that tests inject.
//!
//! # Order of modules
//!
//! A module imports only modules of the rows above its own, which a test of the workspace checks:
//!
//! ```text
//! budget  client  convention  error  faults  methods  middleware  reload  sync  warning_rate  wire
//! limits  listen  log_lines  metrics  tls  traces  viewer
//! access  atlas_slots  health_check  net  saved  web
//! executor  rigs
//! answer  call  config  validate
//! connect  memory  objects  open_files  track
//! atlases
//! search
//! services
//! monitor
//! fuzzing  serve
//! ```
//!
//! The algorithm is in the crate `grasp-synthesis`, which knows nothing of gRPC or async code. Only `convention` knows
//! the engines' axes, only `error` knows status codes, and only `executor`, `atlases` and the preparation of objects
//! and hands start threads.

mod access;
mod answer;
mod atlas_slots;
mod atlases;
mod budget;
mod call;
mod client;
pub mod config;
mod connect;
mod convention;
mod error;
mod executor;
mod faults;
#[cfg(fuzzing)]
pub mod fuzzing;
mod health_check;
mod limits;
mod listen;
mod log_lines;
mod memory;
mod methods;
mod metrics;
mod middleware;
mod monitor;
mod net;
mod objects;
mod open_files;
mod reload;
mod rigs;
mod saved;
mod search;
mod serve;
mod services;
mod sync;
mod tls;
mod traces;
mod track;
mod validate;
mod viewer;
mod warning_rate;
mod web;
mod wire;

pub use access::new_token;
pub use budget::BudgetLimits;
pub use config::{Config, ConfigError};
#[doc(hidden)]
pub use faults::FaultPoint;
pub use health_check::check_health;
pub use limits::{StoreLimits, StreamLimits};
pub use listen::{ListenAddress, Listener};
pub use log_lines::LogLines;
pub use memory::{is_reserved_memory_limited, warn_of_memory};
pub use objects::directory::{DirectoryError, DirectoryProblem, FolderObject, objects_of_folder};
pub use open_files::fit_open_files;
pub use reload::Reloader;
pub use saved::StoreError;
pub use serve::{Gauges, ServeError, Server, run};
pub use tls::TlsFiles;
pub use web::WebOrigins;
