//! Fits the connections to the files that the process may open: each takes one, and the rest has to suffice for everything else.

use std::num::NonZeroUsize;

use crate::config::Config;

/// Files besides connections: the log, listeners, and saved objects and atlases that are read and written.
const OTHER_FILES: u64 = 64;

/// Raises the process' limit on open files (`RLIMIT_NOFILE`) as far as the configured connections need it and the system allows.
/// Logs a warning and lowers the connections if that is not enough. Does nothing on systems other than Linux.
pub fn fit_open_files(config: &mut Config) {
    let needed = config.maximum_connections.get() as u64 + OTHER_FILES;
    let limit = raised_to(needed);
    if limit >= needed {
        return;
    }
    let most = connections(limit);
    tracing::warn!(
        maximum_connections = config.maximum_connections,
        limit,
        most,
        "the process may open too few files for maximum_connections, which is lowered: raise its limit (ulimit -n)"
    );
    config.maximum_connections = most;
}

/// The connections for which a limit on open files suffices.
fn connections(limit: u64) -> NonZeroUsize {
    let left = usize::try_from(limit.saturating_sub(OTHER_FILES)).unwrap_or(usize::MAX);
    NonZeroUsize::new(left).unwrap_or(NonZeroUsize::MIN)
}

/// Raises the limit if it is lower, and returns it.
#[cfg(target_os = "linux")]
fn raised_to(needed: u64) -> u64 {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let allowed = limit.maximum.map_or(needed, |maximum| maximum.min(needed));
    match limit.current {
        Some(current) if current < allowed => {
            let raised = Rlimit {
                current: Some(allowed),
                ..limit
            };
            if setrlimit(Resource::Nofile, raised).is_ok() {
                allowed
            } else {
                current
            }
        }
        current => current.unwrap_or(u64::MAX),
    }
}

#[cfg(not(target_os = "linux"))]
fn raised_to(needed: u64) -> u64 {
    needed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_files_are_left_besides_connections_and_at_least_one_connection() {
        for (limit, expected) in [(1024, 960), (65, 1), (20, 1)] {
            assert_eq!(connections(limit).get(), expected, "{limit}");
        }
        let mut config = Config::default();
        fit_open_files(&mut config);
        assert!(config.maximum_connections <= Config::default().maximum_connections);
    }
}
