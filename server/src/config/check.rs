//! Checks the configuration.

use std::{fmt, net::SocketAddr, num::NonZeroUsize, ops::RangeInclusive, path::PathBuf, time::Duration};

use grasp_assets::hands::RIG_NAMES;

use super::{BadValue, Config, ConfigError, LogFormat, RawConfig, StorePlace};
use crate::{
    budget::BudgetLimits,
    limits::{MAX_RESPONSE, StoreLimits, StreamLimits},
    saved::NEEDED_PLACE,
    web::{NEEDED_ORIGINS, WebOrigins, parse_origins},
};

impl RawConfig {
    /// Checks every value; absent ones get their defaults.
    ///
    /// # Errors
    /// [`ConfigError::BadValues`] with every invalid value.
    pub fn validate(mut self) -> Result<Config, ConfigError> {
        let defaults = Config::default();
        let mut bad = Vec::new();
        let check = &mut Check(&mut bad);
        let budgets = self.budgets(check, defaults.budgets);
        let store = self.cache(check, defaults.store);
        let (place, maximum_saved_objects) =
            self.saving(check, defaults.place, defaults.maximum_saved_objects);
        let streams = self.streams(check, defaults.streams);
        let (builder_threads, learned_grips) =
            self.known_grips(check, defaults.builder_threads, defaults.learned_grips);
        let listen = listen_address(check, self.listen.take(), defaults.listen);
        let web_origins = web_origins(check, self.web_origins.take(), defaults.web_origins);
        let config = Config {
            listen,
            workers: check.count("workers", self.workers, 1..=1024, defaults.workers),
            io_threads: check.count("io_threads", self.io_threads, 1..=1024, defaults.io_threads),
            budgets,
            refinement: check.time("refinement_ms", self.refinement_ms, 0..=1000, defaults.refinement),
            maximum_searches: check.count(
                "maximum_searches",
                self.maximum_searches,
                1..=256,
                defaults.maximum_searches,
            ),
            maximum_uploads: check.count(
                "maximum_uploads",
                self.maximum_uploads,
                1..=64,
                defaults.maximum_uploads,
            ),
            streams,
            maximum_object_bytes: check.count(
                "maximum_object_bytes",
                self.maximum_object_bytes,
                1024..=256 << 20,
                defaults.maximum_object_bytes,
            ),
            maximum_object_triangles: check.count(
                "maximum_object_triangles",
                self.maximum_object_triangles,
                4..=10_000_000,
                defaults.maximum_object_triangles,
            ),
            place,
            maximum_saved_objects,
            store,
            maximum_rigs: check.count(
                "maximum_rigs",
                self.maximum_rigs,
                1..=10_000,
                defaults.maximum_rigs,
            ),
            objects_directory: check.folder("objects_directory", self.objects_directory),
            builder_threads,
            learned_grips,
            atlas_directory: check.folder("atlas_directory", self.atlas_directory),
            maximum_connections: check.count(
                "maximum_connections",
                self.maximum_connections,
                1..=1_000_000,
                defaults.maximum_connections,
            ),
            maximum_unread_bytes: check.count(
                "maximum_unread_bytes",
                self.maximum_unread_bytes,
                MAX_RESPONSE as u64..=1 << 30,
                defaults.maximum_unread_bytes,
            ),
            web_origins,
            drain: check.time("drain_ms", self.drain_ms, 0..=600_000, defaults.drain),
            default_rig: check.parsed(
                "default_rig",
                self.default_rig,
                defaults.default_rig,
                &RIG_NAMES.join(" or "),
                |name| RIG_NAMES.contains(&name).then(|| name.to_owned()),
            ),
            log_format: check.parsed(
                "log_format",
                self.log_format,
                defaults.log_format,
                "text or json",
                log_format,
            ),
            log: check.parsed("log", self.log, defaults.log, "a filter such as info", log_filter),
        };
        if bad.is_empty() {
            Ok(config)
        } else {
            Err(ConfigError::BadValues(bad))
        }
    }

    fn budgets(&self, check: &mut Check<'_>, defaults: BudgetLimits) -> BudgetLimits {
        let budgets = BudgetLimits {
            default: check.time(
                "default_budget_ms",
                self.default_budget_ms,
                1..=600_000,
                defaults.default,
            ),
            maximum: check.time(
                "maximum_budget_ms",
                self.maximum_budget_ms,
                1..=600_000,
                defaults.maximum,
            ),
            minimum_reserve: check.time(
                "deadline_reserve_ms",
                self.deadline_reserve_ms,
                0..=1000,
                defaults.minimum_reserve,
            ),
        };
        if budgets.default > budgets.maximum {
            check.reject(
                "default_budget_ms",
                budgets.default.as_millis(),
                format!("at most maximum_budget_ms, {}", budgets.maximum.as_millis()),
            );
        }
        budgets
    }

    /// The threads that build atlases, and the most learned grips.
    fn known_grips(&self, check: &mut Check<'_>, threads: usize, learned: usize) -> (usize, usize) {
        (
            check.within("builder_threads", self.builder_threads, 0..=64, threads),
            check.within("learned_grips", self.learned_grips, 0..=1024, learned),
        )
    }

    fn streams(&self, check: &mut Check<'_>, defaults: StreamLimits) -> StreamLimits {
        StreamLimits {
            upload_bytes: check.count(
                "maximum_upload_bytes",
                self.maximum_upload_bytes,
                1 << 20..=1 << 30,
                defaults.upload_bytes,
            ),
            upload_idle: check.time(
                "upload_idle_ms",
                self.upload_idle_ms,
                100..=600_000,
                defaults.upload_idle,
            ),
            watchers: check.count(
                "maximum_watchers",
                self.maximum_watchers,
                1..=10_000,
                defaults.watchers,
            ),
            tracks: check.count("maximum_tracks", self.maximum_tracks, 1..=10_000, defaults.tracks),
            track_idle: check.time(
                "track_idle_ms",
                self.track_idle_ms,
                100..=600_000,
                defaults.track_idle,
            ),
        }
    }

    fn saving(
        &mut self,
        check: &mut Check<'_>,
        place: StorePlace,
        maximum: NonZeroUsize,
    ) -> (StorePlace, NonZeroUsize) {
        let key = "maximum_saved_objects";
        let maximum = check.count(key, self.maximum_saved_objects, 1..=1_000_000, maximum);
        let store = self.store.take();
        let place = check.parsed("store", store, place, NEEDED_PLACE, StorePlace::parse);
        (place, maximum)
    }

    fn cache(&self, check: &mut Check<'_>, defaults: StoreLimits) -> StoreLimits {
        StoreLimits {
            objects: check.within("cache_objects", self.cache_objects, 1..=100_000, defaults.objects),
            bytes: check.within("cache_bytes", self.cache_bytes, 1 << 20..=1 << 40, defaults.bytes),
        }
    }
}

/// Collects the invalid values.
struct Check<'a>(&'a mut Vec<BadValue>);

impl Check<'_> {
    fn reject(&mut self, key: &'static str, value: impl fmt::Display, needed: impl Into<String>) {
        self.0.push(BadValue {
            key,
            value: value.to_string(),
            needed: needed.into(),
        });
    }

    fn in_range(
        &mut self,
        key: &'static str,
        value: Option<u64>,
        range: &RangeInclusive<u64>,
    ) -> Option<u64> {
        let value = value?;
        if range.contains(&value) {
            return Some(value);
        }
        self.reject(key, value, format!("{} to {}", range.start(), range.end()));
        None
    }

    fn within(
        &mut self,
        key: &'static str,
        value: Option<u64>,
        range: RangeInclusive<u64>,
        default: usize,
    ) -> usize {
        self.in_range(key, value, &range)
            .and_then(|value| usize::try_from(value).ok())
            .unwrap_or(default)
    }

    fn count(
        &mut self,
        key: &'static str,
        value: Option<u64>,
        range: RangeInclusive<u64>,
        default: NonZeroUsize,
    ) -> NonZeroUsize {
        NonZeroUsize::new(self.within(key, value, range, default.get())).unwrap_or(default)
    }

    fn time(
        &mut self,
        key: &'static str,
        value: Option<u64>,
        range: RangeInclusive<u64>,
        default: Duration,
    ) -> Duration {
        self.in_range(key, value, &range)
            .map_or(default, Duration::from_millis)
    }

    /// A path that is not empty. The folder itself is opened later.
    fn folder(&mut self, key: &'static str, value: Option<PathBuf>) -> Option<PathBuf> {
        let path = value?;
        if path.as_os_str().is_empty() {
            self.reject(key, "\"\"", "a folder, or absent");
            return None;
        }
        Some(path)
    }

    fn parsed<T>(
        &mut self,
        key: &'static str,
        value: Option<String>,
        default: T,
        needed: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) -> T {
        let Some(text) = value else { return default };
        parse(&text).unwrap_or_else(|| {
            self.reject(key, format_args!("{text:?}"), needed);
            default
        })
    }
}

fn listen_address(check: &mut Check<'_>, value: Option<String>, default: SocketAddr) -> SocketAddr {
    let needed = "an address like [::1]:50051";
    check.parsed("listen", value, default, needed, |text| text.parse().ok())
}

fn web_origins(check: &mut Check<'_>, value: Option<String>, default: WebOrigins) -> WebOrigins {
    check.parsed("web_origins", value, default, NEEDED_ORIGINS, parse_origins)
}

fn log_filter(text: &str) -> Option<String> {
    let filter = tracing_subscriber::EnvFilter::try_new(text);
    filter.is_ok().then(|| text.to_owned())
}

fn log_format(text: &str) -> Option<LogFormat> {
    match text {
        "text" => Some(LogFormat::Text),
        "json" => Some(LogFormat::Json),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::unknown_variables;

    #[test]
    fn empty_configuration_has_the_defaults() {
        assert_eq!(RawConfig::default().validate().unwrap(), Config::default());
    }

    #[test]
    fn printed_configuration_can_be_read() {
        let config = Config {
            log_format: LogFormat::Json,
            drain: Duration::from_millis(77),
            refinement: Duration::from_millis(9),
            web_origins: WebOrigins::NONE,
            place: StorePlace::Folder("/saved".into()),
            objects_directory: Some("/objects".into()),
            atlas_directory: Some("/atlases".into()),
            builder_threads: 0,
            learned_grips: 0,
            ..Config::default()
        };
        let text = toml::to_string(&RawConfig::from(&config)).unwrap();
        let raw: RawConfig = toml::from_str(&text).unwrap();
        assert_eq!(raw.validate().unwrap(), config);
    }

    #[test]
    fn rejects_unknown_keys_by_name() {
        let error = toml::from_str::<RawConfig>("wokers = 3").unwrap_err();
        assert!(error.to_string().contains("wokers"), "{error}");
    }

    #[test]
    fn earlier_source_wins() {
        let flags = RawConfig {
            workers: Some(3),
            ..RawConfig::default()
        };
        let file = RawConfig {
            workers: Some(5),
            drain_ms: Some(9),
            ..RawConfig::default()
        };
        let merged = flags.or(file);
        assert_eq!((merged.workers, merged.drain_ms), (Some(3), Some(9)));
    }

    #[test]
    fn reports_every_invalid_value_with_its_key() {
        let raw = RawConfig {
            listen: Some("here".into()),
            workers: Some(0),
            io_threads: Some(0),
            default_budget_ms: Some(0),
            maximum_budget_ms: Some(0),
            deadline_reserve_ms: Some(10_000),
            refinement_ms: Some(1001),
            maximum_searches: Some(0),
            maximum_uploads: Some(0),
            maximum_upload_bytes: Some(1),
            upload_idle_ms: Some(1),
            maximum_watchers: Some(0),
            maximum_tracks: Some(0),
            track_idle_ms: Some(1),
            maximum_object_bytes: Some(1),
            maximum_object_triangles: Some(0),
            store: Some(String::new()),
            maximum_saved_objects: Some(0),
            cache_objects: Some(0),
            cache_bytes: Some(0),
            maximum_rigs: Some(0),
            objects_directory: Some(PathBuf::new()),
            builder_threads: Some(65),
            learned_grips: Some(1025),
            atlas_directory: Some(PathBuf::new()),
            maximum_connections: Some(0),
            maximum_unread_bytes: Some(0),
            web_origins: Some("game.example".into()),
            drain_ms: Some(u64::MAX),
            default_rig: Some("robot".into()),
            log_format: Some("xml".into()),
            log: Some("a=b=c".into()),
        };
        let Err(ConfigError::BadValues(bad)) = raw.validate() else {
            panic!("all of it is wrong");
        };
        assert_eq!(bad.len(), 32, "{bad:?}");
        let texts: Vec<String> = bad.iter().map(ToString::to_string).collect();
        for expected in [
            "listen is \"here\"; it must be an address like [::1]:50051",
            "workers is 0; it must be 1 to 1024",
        ] {
            assert!(texts.iter().any(|text| text == expected), "{texts:?}");
        }
    }

    #[test]
    fn rejects_a_default_budget_above_the_maximum() {
        let raw = RawConfig {
            default_budget_ms: Some(500),
            maximum_budget_ms: Some(400),
            ..RawConfig::default()
        };
        let error = raw.validate().unwrap_err();
        assert_eq!(
            error.to_string(),
            "default_budget_ms is 500; it must be at most maximum_budget_ms, 400"
        );
    }

    #[test]
    fn finds_misspelt_variables() {
        let present = ["GRASP_WORKER", "GRASP_WORKERS", "PATH"].map(str::to_owned);
        assert_eq!(
            unknown_variables(present, &["GRASP_WORKERS".to_owned()]),
            ["GRASP_WORKER"]
        );
    }
}
