//! Which limits the process' memory has: control groups of both versions, and resource limits.
//!
//! Only files are read, so that no foreign code has to be called; where they are missing, as on other systems than
//! Linux, there is no limit to be found.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

use super::{LimitKind, MemoryLimit};

/// From here on a number means that there is no limit: version 1 says the largest multiple of the page size.
const UNLIMITED: u64 = 1 << 62;

/// Lines of `/proc/self/limits` that bound memory, with the names by which programmers know them.
const RESOURCE_LIMITS: [(&str, &str); 2] = [
    ("Max address space", "RLIMIT_AS"),
    ("Max data size", "RLIMIT_DATA"),
];

/// Every limit on the memory of this process that can be found.
pub fn memory_limits() -> Vec<MemoryLimit> {
    let read = |path: &Path| fs::read_to_string(path).ok();
    let text = |path: &str| read(Path::new(path)).unwrap_or_default();
    let mut limits = cgroup_limits(&text("/proc/self/cgroup"), &text("/proc/self/mountinfo"), read);
    limits.extend(resource_limits(&text("/proc/self/limits")));
    limits
}

/// The limits of the process' control groups: its own group's and those of the groups above it, as far as they are
/// mounted.
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
    /// The file with the limit.
    fn file(self) -> &'static str {
        match self {
            Self::One => "memory.limit_in_bytes",
            Self::Two => "memory.max",
        }
    }

    /// The path of the process' group, if a line of `/proc/self/cgroup` is about it: `4:memory:/path` or `0::/path`.
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
    /// The group that is seen at the mount point.
    root: String,
    /// Where it is.
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

/// The path of a group below the one that is seen at the mount point; none if it lies elsewhere, as it does where a
/// container sees its own group as the root but the names of all of them.
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

    /// What is found with these files.
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
    fn every_group_above_the_own_one_counts() {
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
    fn a_container_that_sees_its_group_as_the_root_finds_its_limit() {
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
    fn version_one_is_read_by_its_controller_and_knows_large_numbers() {
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
    fn a_group_outside_of_what_is_mounted_is_looked_for_at_the_mount_point() {
        let mounts = "32 30 0:30 /box /sys/fs/cgroup/memory ro - cgroup cgroup rw,memory\n";
        let files = [("/sys/fs/cgroup/memory/memory.limit_in_bytes", "77")];
        assert_eq!(found("4:memory:/boxes\n", mounts, &files)[0].1, 77);
    }

    #[test]
    fn nothing_readable_is_no_limit() {
        assert!(found("", "", &[]).is_empty());
        assert!(found("0::/a\n", "30 23\nx - cgroup\n", &[]).is_empty());
    }

    #[test]
    fn resource_limits_are_the_soft_ones() {
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
