//! The gRPC service that answers grasp requests.
//!
//! [`run`] serves on a listener until it is told to stop; the binary `grasp-server` only wires it to flags, logs and
//! signals. The way of a request: `call` notes arrival and deadline; `validate` turns the message into checked
//! values or a list of everything wrong; `objects` has the object with its search structures; `search` admits the
//! search, runs it on threads of its own and stops it when the call is dropped; `answer` words what was found. Between
//! calls, `atlases` finds out how hands can hold the objects.
//!
//! Before it serves, `memory` compares what it may take with what it may have, and `objects::directory` reads the folder
//! of objects. `health_check` is the other side: it asks a server that runs.
//!
//! What is not here: the algorithm (crate `grasp-synthesis`), which in turn knows nothing of gRPC or async code.
//! Only `convention` knows the engines' axes, only `error` knows status codes, and nothing but `search` and
//! `atlases` starts threads.

mod answer;
mod atlases;
mod budget;
mod call;
pub mod config;
mod convention;
mod error;
mod health_check;
mod memory;
mod net;
mod objects;
mod search;
mod serve;
mod services;
mod validate;

pub use budget::BudgetLimits;
pub use config::{Config, ConfigError};
pub use health_check::{HealthCheckError, check_health};
pub use memory::{LimitKind, MemoryError, MemoryLimit, MemoryShare, check_memory, memory_limits};
pub use objects::{
    directory::{DirectoryError, DirectoryProblem},
    store::StoreLimits,
};
pub use serve::{Gauges, ServeError, Server, run};
