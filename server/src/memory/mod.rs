//! Checks that the configuration fits in the memory that the process may use.
//!
//! A server that the kernel kills under load cannot say why. The check adds up measured figures before the server
//! starts, and rejects a configuration that does not fit. The figures are the growth of the resident set (`VmHWM`) of
//! the release build on 64-bit Linux with glibc's allocator, rounded up. A higher figure rejects more configurations; a
//! lower one risks being killed.

mod process_limits;

use std::fmt;

pub use process_limits::memory_limits;

use crate::config::{Config, StorePlace};

/// Bytes in a mebibyte, the unit of error messages.
const MIB: u64 = 1 << 20;

/// Bytes of a server without connections, searches and created objects, excluding pages of the program, which the
/// kernel can reclaim. Measured: 12.2 MiB, and up to 6 MiB of hands of other sizes than their rigs.
const AT_REST: u64 = 26 * MIB;

/// Memory of a created rig: mostly the ways in which the pads of its two hands oppose each other.
const PER_RIG: u64 = MIB;

/// Bytes per idle thread, mostly the used part of its stack. Measured: 19 KiB.
const PER_THREAD: u64 = 64 << 10;

/// Bytes per connection without calls. Measured: 21 KiB.
const PER_CONNECTION: u64 = 32 << 10;

/// Bytes per running or waiting search: its thread, and the giver's posed hand with its search structure. Measured:
/// 1.6 MiB. Estimated: 3 MiB while the largest meshes of hands are read.
const PER_SEARCH: u64 = 4 * MIB;

/// Bytes per byte of a mesh's text while it is received and read: the request and the text in it. Measured: 1.9.
const PER_TEXT_BYTE: u64 = 2;

/// The same for a mesh in one message, which may come packed and hardly become smaller by that: the packed request, too.
const PER_PACKED_TEXT_BYTE: u64 = 3;

/// Bytes per triangle of a mesh while it is read, excluding the text. Measured: up to 105, and 290 for a mesh of forbidden
/// triangles in many groups.
const PER_READ_TRIANGLE: u64 = 340;

/// Bytes per triangle of an object while what searches need is derived from it. Estimated: 220.
const PER_DERIVED_TRIANGLE: u64 = 240;

/// Bytes per object while the same is derived, independent of its size: the distance field, the surface pairs, and what is sharp.
/// Measured: 0.4 MiB. Estimated: 2 MiB for the oddest surfaces.
const PER_DERIVED_OBJECT: u64 = 2 * MIB;

/// Bytes per watcher that is as far behind as it may be: 2048 objects with their ids and events. Estimated: 0.4 MiB.
const PER_WATCHER: u64 = 512 << 10;

/// Bytes per track: its setup, the latest frame, the one that is answered, and what velocities are taken from. Estimated: 0.4 MiB with
/// the largest meshes of hands, 60 KiB with joints.
const PER_TRACK: u64 = 512 << 10;

/// Bytes per saved object: what describes it, its labels, and its places in maps. Estimated: 1.5 KiB with a few labels and warnings,
/// 7 KiB with as many and as long ones as can be.
const PER_SAVED_OBJECT: u64 = 8 << 10;

/// Bytes per growing atlas, excluding its published form: its grips twice while some are chosen, and their encoding for the
/// disk. One that is read from a file of thousands of grips takes 10 MB.
const PER_BUILDER: u64 = 20 * MIB;

/// Bytes of address space reserved per thread: Rust's default stack, which the async runtime uses too.
const STACK: u64 = 2 * MIB;

/// The kind of memory that a limit bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitKind {
    /// Memory in use, as control groups count it.
    Used,
    /// Reserved memory, used or not, as `RLIMIT_AS` and `RLIMIT_DATA` count it.
    Reserved,
}

/// A limit on the memory of the process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemoryLimit {
    /// The limit in bytes.
    pub bytes: u64,
    /// The memory that it bounds.
    pub kind: LimitKind,
    /// Its origin: the control group's file, or the name of the resource limit.
    pub source: String,
}

/// A share of the memory that a configuration may use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemoryShare {
    /// Its largest size in bytes.
    pub bytes: u64,
    /// Its purpose, with the settings that determine its size.
    pub purpose: String,
}

/// A configuration that may use more memory than the process has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct MemoryError {
    /// The limits that are too low, with the bytes needed under each.
    pub too_low: Vec<(MemoryLimit, u64)>,
    /// The shares of the memory, largest first.
    pub shares: Vec<MemoryShare>,
}

impl fmt::Display for MemoryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (limit, needed) in &self.too_low {
            writeln!(
                f,
                "too little memory: the limit is {} ({}); this configuration may use {}",
                Mebibytes(limit.bytes),
                limit.source,
                Mebibytes(*needed)
            )?;
        }
        f.write_str("raise the limit, or lower the settings of the largest of these:")?;
        for share in &self.shares {
            write!(f, "\n{} {}", Mebibytes(share.bytes), share.purpose)?;
        }
        Ok(())
    }
}

/// Bytes in a readable unit, rounded up.
struct Mebibytes(u64);

impl fmt::Display for Mebibytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} MiB", self.0.div_ceil(MIB))
    }
}

/// Checks a configuration against limits. `directory_bytes` is the size of the objects in its objects directory.
///
/// # Errors
/// Every limit below what the configuration may use.
pub fn check_memory(
    config: &Config,
    directory_bytes: usize,
    limits: &[MemoryLimit],
) -> Result<(), MemoryError> {
    let mut shares = memory_shares(config, directory_bytes);
    let used: u64 = shares
        .iter()
        .fold(0, |sum, share| sum.saturating_add(share.bytes));
    let stacks = stacks(config);
    let too_low: Vec<(MemoryLimit, u64)> = limits
        .iter()
        .map(|limit| match limit.kind {
            LimitKind::Used => (limit, used),
            LimitKind::Reserved => (limit, used.saturating_add(stacks.bytes)),
        })
        .filter(|(limit, needed)| limit.bytes < *needed)
        .map(|(limit, needed)| (limit.clone(), needed))
        .collect();
    if too_low.is_empty() {
        return Ok(());
    }
    if too_low.iter().any(|(limit, _)| limit.kind == LimitKind::Reserved) {
        shares.push(stacks);
    }
    shares.sort_by_key(|share| std::cmp::Reverse(share.bytes));
    Err(MemoryError { too_low, shares })
}

/// The shares of the memory that a configuration may use.
fn memory_shares(config: &Config, directory_bytes: usize) -> Vec<MemoryShare> {
    let text = config.maximum_object_bytes.get() as u64;
    let triangles = config.maximum_object_triangles.get() as u64;
    let upload = text
        .saturating_mul(PER_PACKED_TEXT_BYTE)
        .saturating_add(triangles.saturating_mul(PER_READ_TRIANGLE));
    let derivations = config.derivations() as u64;
    let derivation = triangles
        .saturating_mul(PER_DERIVED_TRIANGLE)
        .saturating_add(PER_DERIVED_OBJECT);
    let threads = (config.workers.get() as u64).saturating_add(config.io_threads.get() as u64);
    let uploads = config.maximum_uploads.get() as u64;
    let upload_bytes = config.streams.upload_bytes.get() as u64;
    let watchers = config.streams.watchers.get() as u64;
    let tracks = config.streams.tracks.get() as u64;
    let searches = config.maximum_searches.get() as u64;
    let rigs = config.maximum_rigs.get() as u64;
    let builders = config.builder_threads as u64;
    let connections = config.maximum_connections.get() as u64;
    let unread = config.maximum_unread_bytes.get() as u64;
    let share = |bytes, purpose| MemoryShare { bytes, purpose };
    let mut shares = vec![
        share(AT_REST, "for the server at rest".to_owned()),
        share(
            threads.saturating_mul(PER_THREAD),
            format!(
                "for threads (workers is {}, io_threads is {})",
                config.workers, config.io_threads
            ),
        ),
        share(
            config.store.bytes as u64,
            format!(
                "for created objects and atlases (cache_bytes is {})",
                config.store.bytes
            ),
        ),
        share(
            builders.saturating_mul(PER_BUILDER),
            format!("to build atlases (builder_threads is {builders})"),
        ),
        share(
            uploads.saturating_mul(upload),
            format!(
                "to read objects (maximum_uploads is {uploads}, maximum_object_bytes is {text}, \
                 maximum_object_triangles is {triangles})"
            ),
        ),
        share(
            derivations.saturating_mul(derivation),
            format!(
                "to prepare objects for searches, {derivations} at a time (maximum_uploads is {uploads}, maximum_object_triangles is \
                 {triangles})"
            ),
        ),
        share(
            upload_bytes.saturating_mul(PER_TEXT_BYTE),
            format!("for meshes uploaded in pieces (maximum_upload_bytes is {upload_bytes})"),
        ),
        share(
            watchers.saturating_mul(PER_WATCHER),
            format!("for watchers of objects (maximum_watchers is {watchers})"),
        ),
        share(
            tracks.saturating_mul(PER_TRACK),
            format!("for tracks of moving givers (maximum_tracks is {tracks})"),
        ),
        share(
            rigs.saturating_mul(PER_RIG),
            format!("for created rigs (maximum_rigs is {rigs})"),
        ),
        share(
            searches.saturating_mul(PER_SEARCH),
            format!("for searches (maximum_searches is {searches})"),
        ),
        share(
            connections.saturating_mul(PER_CONNECTION),
            format!("for connections (maximum_connections is {connections})"),
        ),
        share(
            unread,
            format!("for answers that wait for their readers (maximum_unread_bytes is {unread})"),
        ),
    ];
    shares.extend(saved_shares(config));
    if let Some(path) = &config.objects_directory {
        shares.push(share(
            directory_bytes as u64,
            format!("for its objects (objects_directory is {})", path.display()),
        ));
    }
    shares
}

/// The shares of what is saved; none if nothing is.
fn saved_shares(config: &Config) -> Vec<MemoryShare> {
    if config.place == StorePlace::Memory {
        return Vec::new();
    }
    let saved = config.maximum_saved_objects.get() as u64;
    let uploads = config.maximum_uploads.get() as u64;
    let upload_bytes = config.streams.upload_bytes.get() as u64;
    let triangles = config.maximum_object_triangles.get() as u64;
    let reading = uploads.saturating_mul(triangles.saturating_mul(PER_READ_TRIANGLE));
    let meshes = (config.largest_mesh() as u64).saturating_mul(PER_TEXT_BYTE);
    vec![
        MemoryShare {
            bytes: saved.saturating_mul(PER_SAVED_OBJECT),
            purpose: format!("for what describes saved objects (maximum_saved_objects is {saved})"),
        },
        MemoryShare {
            bytes: reading.saturating_add(meshes),
            purpose: format!(
                "to load saved objects, unless store is memory (maximum_uploads is {uploads}, maximum_object_triangles is {triangles}, \
                 maximum_upload_bytes is {upload_bytes})"
            ),
        },
    ]
}

/// Memory that threads reserve but do not use.
fn stacks(config: &Config) -> MemoryShare {
    let threads = [
        config.workers.get(),
        config.io_threads.get(),
        config.builder_threads,
        config.blocking_threads(),
    ]
    .iter()
    .fold(0_u64, |sum, count| sum.saturating_add(*count as u64));
    MemoryShare {
        bytes: threads.saturating_mul(STACK),
        purpose: format!(
            "reserved for the stacks of {threads} threads (workers, io_threads, maximum_searches, maximum_uploads, \
             builder_threads)"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{StoreLimits, StreamLimits};

    fn limit(bytes: u64, kind: LimitKind) -> MemoryLimit {
        MemoryLimit {
            bytes,
            kind,
            source: "a test".to_owned(),
        }
    }

    /// 20 MiB at rest, 2 threads of 64 KiB, a cache of 100 MiB, 3 uploads of 3 MiB and 1000 triangles, 2 objects of 2 MiB that
    /// are prepared, 5 searches of 4 MiB, 7 connections of 32 KiB, 1 builder of 20 MiB, 8 MiB of answers, 4 MiB
    /// in pieces, 2 watchers and 4 tracks of 512 KiB.
    fn config() -> Config {
        let count = |n: usize| n.try_into().unwrap();
        Config {
            workers: count(1),
            io_threads: count(1),
            store: StoreLimits {
                objects: 1,
                bytes: 100 << 20,
            },
            place: StorePlace::Memory,
            maximum_uploads: count(3),
            streams: StreamLimits {
                upload_bytes: count(4 << 20),
                watchers: count(2),
                tracks: count(4),
                ..Config::default().streams
            },
            maximum_object_bytes: count(1 << 20),
            maximum_object_triangles: count(1000),
            maximum_searches: count(5),
            maximum_connections: count(7),
            maximum_unread_bytes: count(8 << 20),
            maximum_rigs: count(2),
            ..Config::default()
        }
    }

    const NEEDED: u64 = (26 + 100 + 3 * 3 + 2 * 2 + 5 * 4 + 20 + 8 + 4 * 2 + 1 + 2 + 2) * MIB
        + 2 * (64 << 10)
        + 3 * 340_000
        + 2 * 240_000
        + 7 * (32 << 10);

    #[test]
    fn accepts_the_exact_need_and_rejects_one_byte_less() {
        let check = |bytes| check_memory(&config(), 0, &[limit(bytes, LimitKind::Used)]);
        assert_eq!(check(NEEDED), Ok(()));
        let error = check(NEEDED - 1).unwrap_err();
        assert_eq!(error.too_low, [(limit(NEEDED - 1, LimitKind::Used), NEEDED)]);
    }

    #[test]
    fn reserved_memory_includes_every_threads_stack() {
        let reserved = NEEDED + (1 + 1 + 1 + 5 + 3 + 2 * 2 + 1 + 1) * 2 * MIB;
        let check = |bytes| check_memory(&config(), 0, &[limit(bytes, LimitKind::Reserved)]);
        assert_eq!(check(reserved), Ok(()));
        let text = check(reserved - 1).unwrap_err().to_string();
        assert!(
            text.contains("34 MiB reserved for the stacks of 17 threads"),
            "{text}"
        );
    }

    #[test]
    fn directory_objects_count() {
        let config = Config {
            objects_directory: Some("/objects".into()),
            ..config()
        };
        let limits = [limit(NEEDED + 10, LimitKind::Used)];
        assert_eq!(check_memory(&config, 10, &limits), Ok(()));
        assert!(check_memory(&config, 11, &limits).is_err());
    }

    #[test]
    fn saved_objects_count() {
        let config = Config {
            place: StorePlace::Folder("/saved".into()),
            maximum_saved_objects: 1000.try_into().unwrap(),
            ..config()
        };
        let needed = NEEDED + 1000 * (8 << 10) + 2 * (4 << 20) + 3 * 340_000;
        let check = |bytes| check_memory(&config, 0, &[limit(bytes, LimitKind::Used)]);
        assert_eq!(check(needed), Ok(()));
        let text = check(needed - 1).unwrap_err().to_string();
        assert!(text.contains("unless store is memory"), "{text}");
    }

    #[test]
    fn reports_every_low_limit_with_the_settings_to_lower() {
        let limits = [
            limit(30 * MIB, LimitKind::Used),
            limit(1 << 40, LimitKind::Used),
            limit(40 * MIB, LimitKind::Reserved),
        ];
        let text = check_memory(&config(), 0, &limits).unwrap_err().to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[..4],
            [
                "too little memory: the limit is 30 MiB (a test); this configuration may use 202 MiB",
                "too little memory: the limit is 40 MiB (a test); this configuration may use 236 MiB",
                "raise the limit, or lower the settings of the largest of these:",
                "100 MiB for created objects and atlases (cache_bytes is 104857600)",
            ]
        );
        for key in [
            "workers",
            "io_threads",
            "maximum_uploads",
            "maximum_object_bytes",
            "maximum_object_triangles",
            "maximum_upload_bytes",
            "maximum_watchers",
            "maximum_tracks",
            "maximum_searches",
            "maximum_connections",
            "builder_threads",
            "maximum_unread_bytes",
            "maximum_rigs",
        ] {
            assert!(text.contains(&format!("{key} is ")), "{key} in {text}");
        }
    }

    #[test]
    fn largest_settings_do_not_overflow() {
        let most = std::num::NonZeroUsize::MAX;
        let config = Config {
            maximum_uploads: most,
            maximum_object_bytes: most,
            maximum_searches: most,
            ..config()
        };
        let limits = [limit(u64::MAX - 1, LimitKind::Used)];
        assert!(check_memory(&config, usize::MAX, &limits).is_err());
    }

    #[test]
    fn defaults_fit_the_documented_memory() {
        // docker/README.md gives this figure for four cores.
        let config = Config {
            workers: 4.try_into().unwrap(),
            // As in the image.
            place: StorePlace::Memory,
            ..Config::default()
        };
        let check = |mib| check_memory(&config, 0, &[limit(mib * MIB, LimitKind::Used)]);
        assert_eq!(check(2000), Ok(()));
        assert!(check(1850).is_err());
    }
}
