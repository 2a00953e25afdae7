//! The unchecked configuration: flags before environment before file before defaults.

use std::{collections::BTreeSet, path::PathBuf};

use clap::{
    Args,
    builder::{OsStringValueParser, TypedValueParser},
};
use grasp_assets::hands::RIG_NAMES;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Config, ConfigError, LogFormat, StorePlace, check::Check};
use crate::{
    limits::MAX_RESPONSE,
    listen::{ListenAddress, NEEDED_LISTEN},
    saved::NEEDED_PLACE,
    traces::{NEEDED_ENDPOINT, parse_endpoint},
    web::{NEEDED_ORIGINS, parse_origins},
};

/// Every key, unchecked. An absent one falls back to the next source.
#[derive(Args, Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawConfig {
    /// Addresses to listen on, separated by commas or each with a flag of its own: an address with a port, or `unix:/PATH`
    /// [default: `[::1]:50051`, and `127.0.0.1:50051` as well].
    ///
    /// The socket of a path is private to the server's user. All addresses share the limits.
    #[arg(long, env = "GRASP_LISTEN", value_name = "ADDRESS", value_delimiter = ',')]
    #[serde(deserialize_with = "one_or_more", serialize_with = "joined")]
    pub listen: Option<Vec<String>>,
    /// File with the server's certificate and those between it and its authority, in PEM [default: none].
    ///
    /// With it, connections of TCP are encrypted (TLS 1.2 and 1.3). Changed files are taken up while the server runs.
    #[arg(long, env = "GRASP_TLS_CERTIFICATE", value_name = "FILE", value_parser = any_path())]
    pub tls_certificate: Option<PathBuf>,
    /// File with the key of the server's certificate, in PEM [default: none].
    #[arg(long, env = "GRASP_TLS_KEY", value_name = "FILE", value_parser = any_path())]
    pub tls_key: Option<PathBuf>,
    /// File with certificates of authorities in PEM, whose clients are known by their own certificates [default: none].
    #[arg(long, env = "GRASP_TLS_CLIENT_CA", value_name = "FILE", value_parser = any_path())]
    pub tls_client_ca: Option<PathBuf>,
    /// File of the tokens that calls need, without their secrets [default: none].
    ///
    /// `--new-token` makes an entry. Changes are taken up while the server runs.
    #[arg(long, env = "GRASP_TOKENS_FILE", value_name = "FILE", value_parser = any_path())]
    pub tokens_file: Option<PathBuf>,
    /// Listen on addresses that other machines may reach although anyone may call there or read along [default: false].
    ///
    /// Without it, such addresses need TLS, and tokens or certificates of clients.
    #[arg(long, env = "GRASP_INSECURE_PUBLIC", value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    pub insecure_public: Option<bool>,
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
    /// Largest mesh uploaded in pieces, in bytes; all uploads together may have half as much again [default: 268435456].
    #[arg(long, env = "GRASP_MAXIMUM_UPLOAD_BYTES", value_name = "BYTES")]
    pub maximum_upload_bytes: Option<u64>,
    /// Longest pause between the pieces of an upload, in milliseconds [default: 10000].
    #[arg(long, env = "GRASP_UPLOAD_IDLE_MS", value_name = "MS")]
    pub upload_idle_ms: Option<u64>,
    /// Most watchers of objects; others are rejected [default: 64].
    #[arg(long, env = "GRASP_MAXIMUM_WATCHERS", value_name = "COUNT")]
    pub maximum_watchers: Option<u64>,
    /// Most tracks of moving givers; others are rejected [default: 256].
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
    /// `friction`, `regions`, `known_grips` and `labels`. Each file has the limits of an upload; all objects together have the limits
    /// `cache_objects` and `cache_bytes`, in addition to those that clients create. They are never evicted.
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
    /// Most connections; others are closed, or take the place of one without a call [default: 1000].
    #[arg(long, env = "GRASP_MAXIMUM_CONNECTIONS", value_name = "COUNT")]
    pub maximum_connections: Option<u64>,
    /// Longest time without a call on a connection, in milliseconds [default: 300000].
    #[arg(long, env = "GRASP_CONNECTION_IDLE_MS", value_name = "MS")]
    pub connection_idle_ms: Option<u64>,
    /// Age from which a connection takes no more calls, in milliseconds, give or take a tenth [default: 1800000].
    ///
    /// Running calls end first, however long they take. Clients open another connection by themselves.
    #[arg(long, env = "GRASP_CONNECTION_AGE_MS", value_name = "MS")]
    pub connection_age_ms: Option<u64>,
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
    /// Serve a page at `/` that shows objects, hands and grasps in a browser [default: false].
    #[arg(long, env = "GRASP_VIEWER", value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    pub viewer: Option<bool>,
    /// Address for metrics (`/metrics`) and probes (`/livez`, `/readyz`), such as `127.0.0.1:9464` or `unix:/PATH` [default: none].
    #[arg(long, env = "GRASP_METRICS_LISTEN", value_name = "ADDRESS")]
    pub metrics_listen: Option<String>,
    /// Where to send traces of calls: a collector of OpenTelemetry that takes OTLP over gRPC, such as `http://localhost:4317` [default:
    /// none].
    ///
    /// Needs a server built with the feature otlp, as the one in the container image is.
    #[arg(long, env = "GRASP_OTLP_ENDPOINT", value_name = "ADDRESS")]
    pub otlp_endpoint: Option<String>,
    /// How long new calls are answered after a signal to end, in milliseconds, while health is already `NOT_SERVING` [default: 0].
    ///
    /// Give it the time that load balancers take to notice.
    #[arg(long, env = "GRASP_DRAIN_DELAY_MS", value_name = "MS")]
    pub drain_delay_ms: Option<u64>,
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

/// Accepts an empty path, which validation rejects together with all other errors.
fn any_path() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

/// A list, or one text with commas.
fn one_or_more<'de, D: Deserializer<'de>>(reader: D) -> Result<Option<Vec<String>>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Texts {
        One(String),
        More(Vec<String>),
    }
    Ok(Some(match Texts::deserialize(reader)? {
        Texts::One(text) => text.split(',').map(str::to_owned).collect(),
        Texts::More(texts) => texts,
    }))
}

#[allow(clippy::ref_option, reason = "serde passes the field itself")]
fn joined<S: Serializer>(texts: &Option<Vec<String>>, writer: S) -> Result<S::Ok, S::Error> {
    texts.as_ref().map(|texts| texts.join(",")).serialize(writer)
}

impl RawConfig {
    /// The keys whose values differ.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        // Every value can be written as TOML, which leaves absent ones out.
        let [one, two] = [self, other].map(|values| toml::Table::try_from(values).unwrap_or_default());
        let keys: BTreeSet<&String> = one.keys().chain(two.keys()).collect();
        let differing = keys.into_iter().filter(|key| one.get(*key) != two.get(*key));
        differing.cloned().collect()
    }

    /// Checks every value. Absent ones become those of `fallback`, or else the defaults.
    ///
    /// # Errors
    /// [`ConfigError::BadValues`] with every invalid value.
    pub fn complete(&mut self, fallback: Self) -> Result<Config, ConfigError> {
        let mut config = Config::default();
        for (raw, fallback, value) in [
            (&mut self.viewer, fallback.viewer, &mut config.viewer),
            (
                &mut self.insecure_public,
                fallback.insecure_public,
                &mut config.insecure_public,
            ),
        ] {
            *value = *raw.get_or_insert(fallback.unwrap_or(*value));
        }
        let mut check = Check(Vec::new());
        /// Reads a key by one of [`Check`]'s methods into a value.
        macro_rules! read {
            ($method:ident($key:ident => $value:expr, $($valid:expr),*)) => {
                self.$key = self.$key.take().or(fallback.$key);
                check.$method(stringify!($key), &mut self.$key, &mut $value, $($valid),*)
            };
        }
        let (budgets, streams) = (&mut config.budgets, &mut config.streams);
        read!(addresses(listen => config.listen,));
        let (mut certificate, mut key, mut client_ca) = (None, None, None);
        read!(path(tls_certificate => certificate, "a file"));
        read!(path(tls_key => key, "a file"));
        read!(path(tls_client_ca => client_ca, "a file"));
        config.tls = check.tls(certificate, key, client_ca);
        read!(path(tokens_file => config.tokens_file, "a file"));
        read!(number(workers => config.workers, 1..=1024));
        read!(number(io_threads => config.io_threads, 1..=1024));
        read!(time(default_budget_ms => budgets.default, 1..=600_000));
        read!(time(maximum_budget_ms => budgets.maximum, 1..=600_000));
        read!(time(deadline_reserve_ms => budgets.minimum_reserve, 0..=1000));
        read!(time(refinement_ms => config.refinement, 0..=1000));
        read!(number(maximum_searches => config.maximum_searches, 1..=256));
        read!(number(maximum_uploads => config.maximum_uploads, 1..=64));
        read!(number(maximum_upload_bytes => streams.upload_bytes, 1 << 20..=1 << 30));
        read!(time(upload_idle_ms => streams.upload_idle, 100..=600_000));
        read!(number(maximum_watchers => streams.watchers, 1..=10_000));
        read!(number(maximum_tracks => streams.tracks, 1..=10_000));
        read!(time(track_idle_ms => streams.track_idle, 100..=600_000));
        read!(number(maximum_object_bytes => config.maximum_object_bytes, 1024..=256 << 20));
        read!(number(maximum_object_triangles => config.maximum_object_triangles, 4..=10_000_000));
        read!(text(store => config.place, NEEDED_PLACE, StorePlace::parse));
        read!(number(maximum_saved_objects => config.maximum_saved_objects, 1..=1_000_000));
        read!(number(cache_objects => config.store.objects, 1..=100_000));
        read!(number(cache_bytes => config.store.bytes, 1 << 20..=1 << 40));
        read!(number(maximum_rigs => config.maximum_rigs, 1..=10_000));
        read!(path(objects_directory => config.objects_directory, "a folder"));
        read!(number(builder_threads => config.builder_threads, 0..=64));
        read!(number(learned_grips => config.learned_grips, 0..=1024));
        read!(path(atlas_directory => config.atlas_directory, "a folder"));
        read!(number(maximum_connections => config.maximum_connections, 1..=1_000_000));
        read!(time(connection_idle_ms => config.connection_idle, 1000..=86_400_000));
        read!(time(connection_age_ms => config.connection_age, 1000..=86_400_000));
        read!(number(maximum_unread_bytes => config.maximum_unread_bytes, MAX_RESPONSE as u64..=1 << 30));
        read!(text(web_origins => config.web_origins, NEEDED_ORIGINS, parse_origins));
        let address = |text: &str| text.trim().parse::<ListenAddress>().ok();
        read!(optional(metrics_listen => config.metrics_listen, NEEDED_LISTEN, address));
        read!(optional(otlp_endpoint => config.otlp_endpoint, NEEDED_ENDPOINT, parse_endpoint));
        read!(time(drain_delay_ms => config.drain_delay, 0..=600_000));
        read!(time(drain_ms => config.drain, 0..=600_000));
        let rig = |name: &str| RIG_NAMES.contains(&name).then(|| name.to_owned());
        read!(text(default_rig => config.default_rig, &RIG_NAMES.join(" or "), rig));
        read!(text(log_format => config.log_format, "text or json", log_format));
        read!(text(log => config.log, "a filter such as info", log_filter));
        // The server would cut it.
        if budgets.default > budgets.maximum {
            let [default, maximum] = [budgets.default, budgets.maximum].map(|budget| budget.as_millis());
            let needed = format_args!("at most maximum_budget_ms, {maximum}");
            check.reject("default_budget_ms", default, needed);
        }
        check.reachable(&config);
        if check.0.is_empty() {
            Ok(config)
        } else {
            Err(ConfigError::BadValues(check.0))
        }
    }
}

fn log_filter(text: &str) -> Option<String> {
    let filter = text.parse::<tracing_subscriber::filter::Targets>();
    filter.is_ok().then(|| text.to_owned())
}

fn log_format(text: &str) -> Option<LogFormat> {
    let formats = [LogFormat::Text, LogFormat::Json];
    formats.into_iter().find(|format| format.to_string() == text)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{listen::ListenAddress, web::WebOrigins};

    #[test]
    fn printed_configuration_can_be_read_and_unknown_keys_are_rejected() {
        let mut defaults = RawConfig::default();
        let config = defaults.complete(RawConfig::default()).unwrap();
        assert_eq!(config, Config::default());
        let text = "log_format = 'json'\ndrain_ms = 77\nweb_origins = 'none'\nstore = '/saved'\nworkers = 5";
        let file: RawConfig = toml::from_str(&format!("{text}\nobjects_directory = '/objects'")).unwrap();
        let mut raw = RawConfig {
            workers: Some(3),
            builder_threads: Some(0),
            ..RawConfig::default()
        };
        let config = raw.complete(file).unwrap();
        assert_eq!((config.log_format, config.builder_threads), (LogFormat::Json, 0));
        // A flag wins over the file.
        assert_eq!(
            (config.workers.get(), config.drain),
            (3, Duration::from_millis(77))
        );
        assert_eq!(config.web_origins, WebOrigins::NONE);
        assert_eq!(config.place, StorePlace::Folder("/saved".into()));
        let text = toml::to_string(&raw).unwrap();
        let mut read: RawConfig = toml::from_str(&text).unwrap();
        assert_eq!(read, raw);
        assert_eq!(read.complete(RawConfig::default()).unwrap(), config);
        // Every value is printed but that of an absent folder.
        assert_eq!(text.lines().count(), 36, "{text}");
        let error = toml::from_str::<RawConfig>("wokers = 3").unwrap_err();
        assert!(error.to_string().contains("wokers"), "{error}");
    }

    #[test]
    fn reports_every_invalid_value_with_its_key() {
        // Six numbers may be 0.
        for (number, expected) in [(0, 35), (i64::MAX, 41)] {
            let mut raw = RawConfig::default();
            raw.complete(RawConfig::default()).unwrap();
            let mut keys = toml::Table::try_from(&raw).unwrap();
            for (key, value) in &mut keys {
                *value = match value {
                    toml::Value::Integer(_) => number.into(),
                    // Either value is valid.
                    toml::Value::Boolean(_) => continue,
                    _ if key == "log" => "a=b=c".into(),
                    _ => "".into(),
                };
            }
            let folders = ["objects_directory", "atlas_directory"];
            let files = ["tls_certificate", "tls_key", "tls_client_ca", "tokens_file"];
            let paths = folders.into_iter().chain(files);
            keys.extend(paths.map(|key| (key.to_owned(), "".into())));
            keys.insert("metrics_listen".to_owned(), "9464".into());
            keys.insert("otlp_endpoint".to_owned(), "localhost:4317".into());
            let mut raw: RawConfig = keys.try_into().unwrap();
            let Err(ConfigError::BadValues(bad)) = raw.complete(RawConfig::default()) else {
                panic!("most of it is wrong");
            };
            assert_eq!(bad.len(), expected, "{bad:?}");
            for expected in [
                "listen is \"\"; it must be an address like [::1]:50051, or unix:/PATH",
                &format!("workers is {number}; it must be 1 to 1024"),
            ] {
                assert!(bad.iter().any(|bad| bad == expected), "{bad:?}");
            }
        }
        let mut raw = RawConfig {
            default_budget_ms: Some(500),
            maximum_budget_ms: Some(400),
            ..RawConfig::default()
        };
        let error = raw.complete(RawConfig::default()).unwrap_err();
        assert_eq!(
            error.to_string(),
            "default_budget_ms is 500; it must be at most maximum_budget_ms, 400"
        );
    }

    #[test]
    fn addresses_may_be_a_list_or_a_text_with_commas() {
        let listen = |text: &str| {
            let mut raw: RawConfig = toml::from_str(text).unwrap();
            raw.complete(RawConfig::default()).map(|config| config.listen)
        };
        let both = listen("listen = ['[::1]:1', 'unix:/a']").unwrap();
        assert_eq!(both, ["[::1]:1", "unix:/a"].map(|text| text.parse().unwrap()));
        assert_eq!(listen("listen = '[::1]:1,unix:/a'").unwrap(), both);
        assert_eq!(listen("").unwrap(), [ListenAddress::DEFAULT]);
        for wrong in ["[]", "''", "'[::1]:1,'", "['here']"] {
            assert!(listen(&format!("listen = {wrong}")).is_err(), "{wrong}");
        }
    }

    #[test]
    fn addresses_that_others_may_reach_need_tls_and_known_clients_or_a_word_that_they_do_not() {
        let complete = |text: &str| {
            let raw: Result<RawConfig, _> = toml::from_str(&text.replace(';', "\n"));
            raw.unwrap().complete(RawConfig::default())
        };
        let tls = "tls_certificate = 'a'; tls_key = 'b'";
        for (others, expected) in [
            ("", Err("TLS")),
            (tls, Err("knowing its clients")),
            ("insecure_public = true", Ok(())),
            ("tokens_file = 'd'", Err("TLS")),
            (&format!("{tls}; tls_client_ca = 'c'"), Ok(())),
            (&format!("{tls}; tokens_file = 'd'"), Ok(())),
        ] {
            let answer = complete(&format!("listen = '[::1]:1,0.0.0.0:2,192.0.2.1:3'; {others}"));
            match (answer, expected) {
                (Ok(_), Ok(())) => {}
                (Err(error), Err(missing)) => {
                    let start = "listen is 0.0.0.0:2, 192.0.2.1:3, which other machines may reach, without ";
                    let start = format!("{start}{missing};");
                    assert!(error.to_string().starts_with(&start), "{error}");
                }
                (answer, _) => panic!("{others}: {answer:?}"),
            }
            complete(&format!(
                "listen = '127.0.0.1:1,[::ffff:127.0.0.1]:2,unix:/a'; {others}"
            ))
            .unwrap();
        }
        for alone in ["tls_key", "tls_client_ca"] {
            let error = complete(&format!("{alone} = 'b'")).unwrap_err().to_string();
            assert!(error.starts_with("tls_certificate is absent"), "{error}");
        }
    }

    #[test]
    fn changed_keys_are_named() {
        let mut one = RawConfig::default();
        one.complete(RawConfig::default()).unwrap();
        let mut other = one.clone();
        assert!(one.differences(&other).is_empty());
        other.log = Some("debug".to_owned());
        other.objects_directory = Some("/objects".into());
        assert_eq!(one.differences(&other), ["log", "objects_directory"]);
    }
}
