//! The unchecked configuration: flags before environment before file before defaults.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use clap::{
    Args,
    builder::{OsStringValueParser, TypedValueParser},
};
use serde::{Deserialize, Serialize};

use super::{Config, ConfigError, LogFormat};

/// Prefix of every environment variable of the server.
const VARIABLE_PREFIX: &str = "GRASP_";

/// Every key, unchecked. An absent one falls back to the next source.
#[derive(Args, Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawConfig {
    /// Address to listen on [default: `[::1]:50051`].
    #[arg(long, env = "GRASP_LISTEN", value_name = "ADDRESS")]
    pub listen: Option<String>,
    /// Search threads [default: one per core].
    #[arg(long, env = "GRASP_WORKERS", value_name = "COUNT")]
    pub workers: Option<u64>,
    /// Threads for requests and responses [default: 2, or an eighth of the cores].
    #[arg(long, env = "GRASP_IO_THREADS", value_name = "COUNT")]
    pub io_threads: Option<u64>,
    /// Budget of a request that names none, in milliseconds [default: 1000].
    #[arg(long, env = "GRASP_DEFAULT_BUDGET_MS", value_name = "MS")]
    pub default_budget_ms: Option<u64>,
    /// Largest budget of a search, in milliseconds [default: 10000].
    #[arg(long, env = "GRASP_MAXIMUM_BUDGET_MS", value_name = "MS")]
    pub maximum_budget_ms: Option<u64>,
    /// Smallest part of a call's deadline reserved for the response, in milliseconds [default: 5].
    ///
    /// It grows with the delays of recent responses, up to three quarters of the deadline.
    #[arg(long, env = "GRASP_DEADLINE_RESERVE_MS", value_name = "MS")]
    pub deadline_reserve_ms: Option<u64>,
    /// How much longer a search goes on after a first valid grasp that a person would not choose, in milliseconds, if the
    /// request does not say [default: 5].
    ///
    /// With 0, the first valid grasp is the answer.
    #[arg(long, env = "GRASP_REFINEMENT_MS", value_name = "MS")]
    pub refinement_ms: Option<u64>,
    /// Most searches running or waiting; others are rejected [default: 64].
    #[arg(long, env = "GRASP_MAXIMUM_SEARCHES", value_name = "COUNT")]
    pub maximum_searches: Option<u64>,
    /// Most objects received, built or changed at a time; others are rejected [default: 4].
    #[arg(long, env = "GRASP_MAXIMUM_UPLOADS", value_name = "COUNT")]
    pub maximum_uploads: Option<u64>,
    /// Bytes of meshes uploaded in pieces, of all uploads together and thus of one [default: 268435456].
    #[arg(long, env = "GRASP_MAXIMUM_UPLOAD_BYTES", value_name = "BYTES")]
    pub maximum_upload_bytes: Option<u64>,
    /// Longest pause between the pieces of an upload, in milliseconds [default: 10000].
    #[arg(long, env = "GRASP_UPLOAD_IDLE_MS", value_name = "MS")]
    pub upload_idle_ms: Option<u64>,
    /// Most watchers of objects; others are rejected [default: 64].
    #[arg(long, env = "GRASP_MAXIMUM_WATCHERS", value_name = "COUNT")]
    pub maximum_watchers: Option<u64>,
    /// Most tracks of moving givers; others are rejected [default: 200].
    #[arg(long, env = "GRASP_MAXIMUM_TRACKS", value_name = "COUNT")]
    pub maximum_tracks: Option<u64>,
    /// Longest time without a frame of a track, in milliseconds [default: 10000].
    #[arg(long, env = "GRASP_TRACK_IDLE_MS", value_name = "MS")]
    pub track_idle_ms: Option<u64>,
    /// Largest mesh file in one message or in the objects directory, in bytes [default: 8388608].
    #[arg(long, env = "GRASP_MAXIMUM_OBJECT_BYTES", value_name = "BYTES")]
    pub maximum_object_bytes: Option<u64>,
    /// Most triangles, and most vertices, in a mesh [default: 200000].
    #[arg(long, env = "GRASP_MAXIMUM_OBJECT_TRIANGLES", value_name = "COUNT")]
    pub maximum_object_triangles: Option<u64>,
    /// Where created objects are kept: a folder or `s3://BUCKET/PREFIX`, where they outlast the server, or memory [default: grasp in
    /// the folder of the user's data].
    ///
    /// A folder is created if necessary, and used by one server at a time. S3 needs a server built with the feature s3; its
    /// region and credentials come from the variables AWS_*.
    #[arg(long, env = "GRASP_STORE", value_name = "PLACE")]
    pub store: Option<String>,
    /// Most objects kept in a folder or bucket; more are rejected [default: 10000].
    #[arg(long, env = "GRASP_MAXIMUM_SAVED_OBJECTS", value_name = "COUNT")]
    pub maximum_saved_objects: Option<u64>,
    /// Most created objects in memory [default: 1000].
    #[arg(long, env = "GRASP_CACHE_OBJECTS", value_name = "COUNT")]
    pub cache_objects: Option<u64>,
    /// Memory for created objects and atlases, in bytes, by estimate [default: 536870912].
    #[arg(long, env = "GRASP_CACHE_BYTES", value_name = "BYTES")]
    pub cache_bytes: Option<u64>,
    /// Most rigs of hands that clients created; more are rejected [default: 16].
    #[arg(long, env = "GRASP_MAXIMUM_RIGS", value_name = "COUNT")]
    pub maximum_rigs: Option<u64>,
    /// Folder of objects to start with: a mesh NAME.obj, .stl, .ply, .glb or .gltf with NAME.toml becomes objects/NAME [default: none].
    ///
    /// The TOML file has the keys of a `GraspObject`: `mass_kg` and optionally `meters_per_unit`, `z_up`, `parts`, `center_of_mass`,
    /// `friction`, `regions`, `known_grips` and `labels`. Each file has the limits of an upload; all objects together have the limits `cache_objects` and `cache_bytes`, in addition to those that
    /// clients create. They are never evicted.
    #[arg(long, env = "GRASP_OBJECTS_DIRECTORY", value_name = "FOLDER", value_parser = any_path())]
    pub objects_directory: Option<PathBuf>,
    /// Low-priority threads that build the objects' atlases in the background [default: 1].
    ///
    /// An atlas is a collection of grips that makes answers quick. Atlases take what created objects leave of
    /// `cache_bytes`. With 0 there are none.
    #[arg(long, env = "GRASP_BUILDER_THREADS", value_name = "COUNT")]
    pub builder_threads: Option<u64>,
    /// Most grips per object and hand that are learned from searches [default: 32].
    ///
    /// Where the atlas has no grip for a holdout, a search finds one, which answers the next holdout like it at once. With 0, no
    /// answer depends on earlier calls.
    #[arg(long, env = "GRASP_LEARNED_GRIPS", value_name = "COUNT")]
    pub learned_grips: Option<u64>,
    /// Folder that keeps atlases between runs [default: none].
    ///
    /// It is created if necessary. Its files take up to 1 GiB; the least recently used are removed first. Unfinished
    /// files that a crash left behind are removed at the next start.
    #[arg(long, env = "GRASP_ATLAS_DIRECTORY", value_name = "FOLDER", value_parser = any_path())]
    pub atlas_directory: Option<PathBuf>,
    /// Most connections; others wait [default: 1000].
    #[arg(long, env = "GRASP_MAXIMUM_CONNECTIONS", value_name = "COUNT")]
    pub maximum_connections: Option<u64>,
    /// Most bytes of answers that wait for clients to read them [default: 33554432].
    ///
    /// Beyond, the connection with the most is closed.
    #[arg(long, env = "GRASP_MAXIMUM_UNREAD_BYTES", value_name = "BYTES")]
    pub maximum_unread_bytes: Option<u64>,
    /// Origins of the pages that may call from browsers: none, `*`, or a list of loopback and origins such as
    /// `https://game.example`, separated by commas [default: loopback].
    ///
    /// Loopback are pages of localhost, 127.0.0.1 and `[::1]`, with any port. With none, browsers are not served.
    #[arg(long, env = "GRASP_WEB_ORIGINS", value_name = "ORIGINS")]
    pub web_origins: Option<String>,
    /// How long to wait for running calls at shutdown, in milliseconds [default: 10000].
    #[arg(long, env = "GRASP_DRAIN_MS", value_name = "MS")]
    pub drain_ms: Option<u64>,
    /// Rig of the receiving hand if a request with PHYSICAL validity names none [default: adult].
    #[arg(long, env = "GRASP_DEFAULT_RIG", value_name = "NAME")]
    pub default_rig: Option<String>,
    /// Format of the log: text or json [default: text].
    #[arg(long, env = "GRASP_LOG_FORMAT", value_name = "FORMAT")]
    pub log_format: Option<String>,
    /// Filter of the log: info, debug, or a list such as `grasp_server=debug,h2=warn` [default: info].
    #[arg(long, env = "GRASP_LOG", value_name = "FILTER")]
    pub log: Option<String>,
}

/// Accepts an empty path, which validation rejects together with everything else that is wrong.
fn any_path() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

/// Reads a configuration file.
///
/// # Errors
/// The file cannot be read, is not TOML, or has an unknown key.
pub fn read_file(path: &Path) -> Result<RawConfig, ConfigError> {
    let text = fs::read_to_string(path).map_err(|source| ConfigError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    toml::from_str(&text).map_err(|source| ConfigError::Malformed {
        path: path.to_owned(),
        source: Box::new(source),
    })
}

/// Names among `present` that have the server's prefix but are not `known`, most likely misspelt. They are logged, not
/// rejected, because container platforms add their own variables.
pub fn unknown_variables(present: impl IntoIterator<Item = String>, known: &[String]) -> Vec<String> {
    present
        .into_iter()
        .filter(|name| name.starts_with(VARIABLE_PREFIX) && !known.contains(name))
        .collect()
}

impl RawConfig {
    /// These values, with those of `fallback` where they are absent.
    #[must_use]
    pub fn or(self, fallback: Self) -> Self {
        macro_rules! first {
            ($($key:ident),* $(,)?) => { Self { $($key: self.$key.or(fallback.$key)),* } };
        }
        first![
            listen,
            workers,
            io_threads,
            default_budget_ms,
            maximum_budget_ms,
            deadline_reserve_ms,
            refinement_ms,
            maximum_searches,
            maximum_uploads,
            maximum_upload_bytes,
            upload_idle_ms,
            maximum_watchers,
            maximum_tracks,
            track_idle_ms,
            maximum_object_bytes,
            maximum_object_triangles,
            store,
            maximum_saved_objects,
            cache_objects,
            cache_bytes,
            maximum_rigs,
            objects_directory,
            builder_threads,
            learned_grips,
            atlas_directory,
            maximum_connections,
            maximum_unread_bytes,
            web_origins,
            drain_ms,
            default_rig,
            log_format,
            log,
        ]
    }
}

impl From<&Config> for RawConfig {
    fn from(config: &Config) -> Self {
        let count = |n: usize| Some(n as u64);
        let time = |t: Duration| u64::try_from(t.as_millis()).ok();
        Self {
            listen: Some(config.listen.to_string()),
            workers: count(config.workers.get()),
            io_threads: count(config.io_threads.get()),
            default_budget_ms: time(config.budgets.default),
            maximum_budget_ms: time(config.budgets.maximum),
            deadline_reserve_ms: time(config.budgets.minimum_reserve),
            refinement_ms: time(config.refinement),
            maximum_searches: count(config.maximum_searches.get()),
            maximum_uploads: count(config.maximum_uploads.get()),
            maximum_upload_bytes: count(config.streams.upload_bytes.get()),
            upload_idle_ms: time(config.streams.upload_idle),
            maximum_watchers: count(config.streams.watchers.get()),
            maximum_tracks: count(config.streams.tracks.get()),
            track_idle_ms: time(config.streams.track_idle),
            maximum_object_bytes: count(config.maximum_object_bytes.get()),
            maximum_object_triangles: count(config.maximum_object_triangles.get()),
            store: Some(config.place.to_string()),
            maximum_saved_objects: count(config.maximum_saved_objects.get()),
            cache_objects: count(config.store.objects),
            cache_bytes: count(config.store.bytes),
            maximum_rigs: count(config.maximum_rigs.get()),
            objects_directory: config.objects_directory.clone(),
            builder_threads: count(config.builder_threads),
            learned_grips: count(config.learned_grips),
            atlas_directory: config.atlas_directory.clone(),
            maximum_connections: count(config.maximum_connections.get()),
            maximum_unread_bytes: count(config.maximum_unread_bytes.get()),
            web_origins: Some(config.web_origins.to_string()),
            drain_ms: time(config.drain),
            default_rig: Some(config.default_rig.clone()),
            log_format: Some(
                match config.log_format {
                    LogFormat::Text => "text",
                    LogFormat::Json => "json",
                }
                .to_owned(),
            ),
            log: Some(config.log.clone()),
        }
    }
}
