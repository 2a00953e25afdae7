//! Warns of configured limits that add up to more memory than the process may use.
//!
//! The limits are kept while the server runs: caches evict, and calls beyond them are refused. All other memory is small or
//! short-lived: threads, connections, and the working memory of searches and readers of meshes.
//!
//! Control groups are read from files. Where those are missing, as on systems other than Linux, none are found.

use std::{fs, path::Path};

use rustix::process::{Resource, getrlimit};

use crate::{
    config::{Config, StorePlace},
    limits::shared_upload_bytes,
};

/// Smallest number that means "no limit": version 1 of control groups writes the largest multiple of the page size.
const UNLIMITED: u64 = 1 << 62;

/// A limit on the memory of the process.
#[derive(Debug)]
struct MemoryLimit {
    bytes: u64,
    /// Its origin: the control group's file, or the name of the resource limit.
    source: String,
}

/// The sum of the configured limits, in bytes: the cache, uploads in flight, meshes that are loaded, and unread messages.
fn configured_bytes(config: &Config) -> u64 {
    let uploads = (config.maximum_uploads.get()).saturating_mul(config.maximum_object_bytes.get());
    let loaded = if config.place == StorePlace::Memory {
        0
    } else {
        config.largest_mesh().get()
    };
    let bounds = [
        config.store.bytes,
        uploads,
        shared_upload_bytes(config.streams.upload_bytes.get()),
        loaded,
        config.maximum_unread_bytes.get(),
    ];
    bounds.into_iter().fold(0, usize::saturating_add) as u64
}

/// Logs a warning if the configured limits add up to more than the process may use.
pub fn warn_of_memory(config: &Config) {
    let bytes = configured_bytes(config);
    let read = |path: &Path| fs::read_to_string(path).ok();
    let groups = read(Path::new("/proc/self/cgroup")).unwrap_or_default();
    let limits = cgroup_limits(&groups, read).into_iter().chain(reserved_limits());
    if let Some(lowest) = limits.min_by_key(|limit| limit.bytes)
        && lowest.bytes < bytes
    {
        tracing::warn!(
            bytes,
            limit = lowest.bytes,
            source = lowest.source,
            "the configured limits add up to more memory than the process may use: lower cache_bytes, maximum_upload_bytes, \
             maximum_uploads, maximum_object_bytes or maximum_unread_bytes, or raise its limit"
        );
    }
}

/// True if reserved memory is limited, used or not.
pub fn is_reserved_memory_limited() -> bool {
    !reserved_limits().is_empty()
}

/// The limits on reserved memory.
fn reserved_limits() -> Vec<MemoryLimit> {
    let limit = |(resource, name): (Resource, &str)| {
        let bytes = getrlimit(resource).current?;
        let source = name.to_owned();
        Some(MemoryLimit { bytes, source })
    };
    let limits = [(Resource::As, "RLIMIT_AS"), (Resource::Data, "RLIMIT_DATA")];
    limits.into_iter().filter_map(limit).collect()
}

/// The limits of the process' control group and of those above it, by lines such as `4:memory:/path` or `0::/path`.
fn cgroup_limits(groups: &str, read: impl Fn(&Path) -> Option<String>) -> Vec<MemoryLimit> {
    let mut limits = Vec::new();
    for line in groups.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(group)) = (parts.next(), parts.next()) else {
            continue;
        };
        let (mount, name) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            of if of.split(',').any(|one| one == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        // In a container, the path may be that of the host; the root has the limit then.
        for group in Path::new(group.trim_start_matches('/')).ancestors() {
            let file = Path::new(mount).join(group).join(name);
            let bytes = read(&file).and_then(|text| text.trim().parse().ok());
            let source = file.display().to_string();
            let limit = bytes.filter(|&bytes| bytes < UNLIMITED);
            limits.extend(limit.map(|bytes| MemoryLimit { bytes, source }));
        }
    }
    limits
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroUsize;

    use super::*;

    #[test]
    fn limits_add_up_without_overflow() {
        let image = Config {
            place: StorePlace::Memory,
            ..Config::default()
        };
        // docker/README.md has this figure.
        assert_eq!(configured_bytes(&image), 960 << 20);
        let saving = Config {
            place: StorePlace::Folder("/saved".into()),
            ..image.clone()
        };
        assert_eq!(configured_bytes(&saving), (960 + 256) << 20);
        let largest = Config {
            maximum_uploads: NonZeroUsize::MAX,
            ..image
        };
        assert_eq!(configured_bytes(&largest), u64::MAX);
    }

    #[test]
    fn finds_the_limits_of_control_groups() {
        let files = [
            ("/sys/fs/cgroup/a/b/memory.max", "max\n"),
            ("/sys/fs/cgroup/a/memory.max", "268435456\n"),
            ("/sys/fs/cgroup/c/memory.max", "1\n"),
            ("/sys/fs/cgroup/memory.max", "1000\n"),
            ("/sys/fs/cgroup/memory/in:side/memory.limit_in_bytes", "77\n"),
            (
                "/sys/fs/cgroup/memory/memory.limit_in_bytes",
                "9223372036854771712\n",
            ),
        ];
        let read = |path: &Path| {
            let file = files.iter().find(|(name, _)| path == Path::new(name));
            file.map(|(_, text)| (*text).to_owned())
        };
        for (groups, expected) in [
            ("0::/a/b\n", &[268_435_456, 1000][..]),
            ("0::/../../outside\n", &[1000]),
            ("5:cpu,cpuacct:/a\n4:memory:/in:side\n", &[77]),
            ("4:memory:/of/the/host\nx\n", &[]),
            ("", &[]),
        ] {
            let found = cgroup_limits(groups, read);
            let bytes: Vec<u64> = found.iter().map(|limit| limit.bytes).collect();
            assert_eq!(bytes, expected, "{groups}");
        }
    }
}
