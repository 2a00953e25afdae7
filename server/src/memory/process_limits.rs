//! Finds the limits on the memory of the process: control groups of both versions, and resource limits.
//!
//! It only reads files, which needs no foreign code. Where they are missing, as on systems other than Linux, it finds
//! no limits.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

use super::{LimitKind, MemoryLimit};

/// Smallest number that means "no limit": version 1 writes the largest multiple of the page size.
const UNLIMITED: u64 = 1 << 62;

/// Lines of `/proc/self/limits` that bound memory, with the names of the limits.
const RESOURCE_LIMITS: [(&str, &str); 2] = [
    ("Max address space", "RLIMIT_AS"),
    ("Max data size", "RLIMIT_DATA"),
];

/// The limits on the memory of this process, as far as they can be found.
pub fn memory_limits() -> Vec<MemoryLimit> {
    let read = |path: &Path| fs::read_to_string(path).ok();
    let text = |path: &str| read(Path::new(path)).unwrap_or_default();
    let mut limits = cgroup_limits(&text("/proc/self/cgroup"), &text("/proc/self/mountinfo"), read);
    limits.extend(resource_limits(&text("/proc/self/limits")));
    limits
}

/// The limits of the process' control group and of the groups above it, as far as they are mounted.
fn cgroup_limits(groups: &str, mounts: &str, read: impl Fn(&Path) -> Option<String>) -> Vec<MemoryLimit> {
    let mut limits = Vec::new();
    for mount in mounts.lines().filter_map(parse_mount) {
        let own = groups
            .lines()
            .find_map(|line| mount.version.group_of(line))
            .and_then(|group| beneath(group, &mount.root))
            .unwrap_or_default();
        for group in own.ancestors() {
            let file = mount.point.join(group).join(mount.version.file());
            let bytes = read(&file).and_then(|text| text.trim().parse().ok());
            if let Some(bytes) = bytes.filter(|&bytes: &u64| bytes < UNLIMITED) {
                limits.push(MemoryLimit {
                    bytes,
                    kind: LimitKind::Used,
                    source: file.display().to_string(),
                });
            }
        }
    }
    limits
}

/// A version of control groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Version {
    One,
    Two,
}

impl Version {
    /// Name of the file with the limit.
    fn file(self) -> &'static str {
        match self {
            Self::One => "memory.limit_in_bytes",
            Self::Two => "memory.max",
        }
    }

    /// The path of the process' group in a line of `/proc/self/cgroup`, which reads `4:memory:/path` or `0::/path`.
    fn group_of(self, line: &str) -> Option<&str> {
        let mut parts = line.splitn(3, ':');
        let (hierarchy, controllers, path) = (parts.next()?, parts.next()?, parts.next()?);
        let ours = match self {
            Self::One => controllers.split(',').any(|controller| controller == "memory"),
            Self::Two => hierarchy == "0" && controllers.is_empty(),
        };
        ours.then_some(path)
    }
}

/// A mounted hierarchy of control groups that may bound memory.
#[derive(Debug, PartialEq, Eq)]
struct Mount {
    version: Version,
    /// The group at the mount point.
    root: String,
    /// The mount point.
    point: PathBuf,
}

/// Reads a line of `/proc/self/mountinfo`: `ID PARENT DEVICE ROOT POINT OPTIONS … - TYPE SOURCE SUPER_OPTIONS`.
fn parse_mount(line: &str) -> Option<Mount> {
    let (place, kind) = line.split_once(" - ")?;
    let mut place = place.split(' ').skip(3);
    let (root, point) = (place.next()?, place.next()?);
    let mut kind = kind.split(' ');
    let version = match kind.next()? {
        "cgroup2" => Version::Two,
        "cgroup" if kind.nth(1)?.split(',').any(|option| option == "memory") => Version::One,
        _ => return None,
    };
    Some(Mount {
        version,
        root: root.to_owned(),
        point: point.into(),
    })
}

/// The path of a group relative to the one at the mount point. None if it is outside: a container may see its own group
/// as the root, but the paths of the host.
fn beneath(group: &str, root: &str) -> Option<PathBuf> {
    let below = Path::new(group).strip_prefix(root).ok()?;
    below
        .components()
        .all(|part| matches!(part, Component::Normal(_)))
        .then(|| below.to_owned())
}

/// The soft limits of `/proc/self/limits`.
fn resource_limits(text: &str) -> Vec<MemoryLimit> {
    RESOURCE_LIMITS
        .iter()
        .filter_map(|(title, name)| {
            let line = text.lines().find_map(|line| line.strip_prefix(title))?;
            Some(MemoryLimit {
                bytes: line.split_whitespace().next()?.parse().ok()?,
                kind: LimitKind::Reserved,
                source: (*name).to_owned(),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    /// The limits found in these files.
    fn found(groups: &str, mounts: &str, files: &[(&str, &str)]) -> Vec<(String, u64)> {
        let files: HashMap<&str, &str> = files.iter().copied().collect();
        let read = |path: &Path| files.get(path.to_str()?).map(|&text| text.to_owned());
        cgroup_limits(groups, mounts, read)
            .into_iter()
            .map(|limit| (limit.source, limit.bytes))
            .collect()
    }

    const UNIFIED: &str = "30 23 0:26 / /sys/fs/cgroup rw,nosuid shared:4 - cgroup2 cgroup2 rw,nsdelegate,memory_recursiveprot\n";

    #[test]
    fn finds_limits_of_groups_above_the_own_one() {
        let files = [
            ("/sys/fs/cgroup/a/b/memory.max", "max\n"),
            ("/sys/fs/cgroup/a/memory.max", "268435456\n"),
            ("/sys/fs/cgroup/c/memory.max", "1\n"),
        ];
        assert_eq!(
            found("0::/a/b\n", UNIFIED, &files),
            [("/sys/fs/cgroup/a/memory.max".to_owned(), 268_435_456)]
        );
    }

    #[test]
    fn finds_the_limit_of_a_container_whose_group_is_the_root() {
        let files = [("/sys/fs/cgroup/memory.max", "1000\n")];
        for groups in ["0::/\n", "0::/../../outside\n"] {
            assert_eq!(
                found(groups, UNIFIED, &files),
                [("/sys/fs/cgroup/memory.max".to_owned(), 1000)],
                "{groups}"
            );
        }
    }

    #[test]
    fn finds_limits_of_version_one_but_not_its_unlimited_ones() {
        let mounts = "31 30 0:29 /box /sys/fs/cgroup/cpu rw - cgroup cgroup rw,cpu\n\
                      32 30 0:30 /box /sys/fs/cgroup/memory ro,nosuid master:9 - cgroup cgroup rw,memory\n";
        let groups = "5:cpu,cpuacct:/box\n4:memory:/box/in:side\n0::/\n";
        let files = [
            (
                "/sys/fs/cgroup/memory/in:side/memory.limit_in_bytes",
                "536870912\n",
            ),
            (
                "/sys/fs/cgroup/memory/memory.limit_in_bytes",
                "9223372036854771712\n",
            ),
            ("/sys/fs/cgroup/cpu/memory.limit_in_bytes", "1\n"),
        ];
        assert_eq!(
            found(groups, mounts, &files),
            [(
                "/sys/fs/cgroup/memory/in:side/memory.limit_in_bytes".to_owned(),
                536_870_912
            )]
        );
    }

    #[test]
    fn uses_the_mount_point_for_a_group_outside_the_mount() {
        let mounts = "32 30 0:30 /box /sys/fs/cgroup/memory ro - cgroup cgroup rw,memory\n";
        let files = [("/sys/fs/cgroup/memory/memory.limit_in_bytes", "77")];
        assert_eq!(found("4:memory:/boxes\n", mounts, &files)[0].1, 77);
    }

    #[test]
    fn finds_no_limits_without_readable_files() {
        assert!(found("", "", &[]).is_empty());
        assert!(found("0::/a\n", "30 23\nx - cgroup\n", &[]).is_empty());
    }

    #[test]
    fn finds_soft_resource_limits() {
        let text = "Limit                     Soft Limit           Hard Limit           Units     \n\
                    Max data size             unlimited            unlimited            bytes     \n\
                    Max address space         1073741824           unlimited            bytes     \n";
        assert_eq!(
            resource_limits(text),
            [MemoryLimit {
                bytes: 1 << 30,
                kind: LimitKind::Reserved,
                source: "RLIMIT_AS".to_owned(),
            }]
        );
    }
}
