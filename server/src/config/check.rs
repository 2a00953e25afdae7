//! Checks the configuration.

use std::{fmt, num::NonZeroUsize, ops::RangeInclusive, path::PathBuf, time::Duration};

use grasp_assets::hands::RIG_NAMES;

use super::{BadValue, Config, ConfigError, LogFormat, RawConfig, StorePlace};
use crate::{
    budget::BudgetLimits,
    limits::{MAX_RESPONSE, StoreLimits, StreamLimits},
    saved::NEEDED_PLACE,
    web::{NEEDED_ORIGINS, parse_origins},
};

impl RawConfig {
    /// Checks every value; absent ones get their defaults.
    ///
    /// # Errors
    /// [`ConfigError::BadValues`] with every invalid value.
    pub fn validate(self) -> Result<Config, ConfigError> {
        let defaults = Config::default();
        let (budgets, streams) = (defaults.budgets, defaults.streams);
        let mut bad = Vec::new();
        let check = &mut Check(&mut bad);
        /// Checks a value by one of [`Check`]'s methods.
        macro_rules! read {
            ($method:ident, $key:ident, $range:expr, $default:expr) => {
                check.$method(stringify!($key), self.$key, $range, $default)
            };
        }
        /// Checks a number that has the name of its key.
        macro_rules! count {
            ($key:ident, $range:expr) => {
                read!(count, $key, $range, defaults.$key)
            };
        }
        let needed = "an address like [::1]:50051";
        let listen = check.parsed("listen", self.listen, defaults.listen, needed, |text| {
            text.parse().ok()
        });
        let config = Config {
            listen,
            workers: count!(workers, 1..=1024),
            io_threads: count!(io_threads, 1..=1024),
            budgets: BudgetLimits {
                default: read!(time, default_budget_ms, 1..=600_000, budgets.default),
                maximum: read!(time, maximum_budget_ms, 1..=600_000, budgets.maximum),
                minimum_reserve: read!(time, deadline_reserve_ms, 0..=1000, budgets.minimum_reserve),
            },
            refinement: read!(time, refinement_ms, 0..=1000, defaults.refinement),
            maximum_searches: count!(maximum_searches, 1..=256),
            maximum_uploads: count!(maximum_uploads, 1..=64),
            streams: StreamLimits {
                upload_bytes: read!(
                    count,
                    maximum_upload_bytes,
                    1 << 20..=1 << 30,
                    streams.upload_bytes
                ),
                upload_idle: read!(time, upload_idle_ms, 100..=600_000, streams.upload_idle),
                watchers: read!(count, maximum_watchers, 1..=10_000, streams.watchers),
                tracks: read!(count, maximum_tracks, 1..=10_000, streams.tracks),
                track_idle: read!(time, track_idle_ms, 100..=600_000, streams.track_idle),
            },
            maximum_object_bytes: count!(maximum_object_bytes, 1024..=256 << 20),
            maximum_object_triangles: count!(maximum_object_triangles, 4..=10_000_000),
            place: check.parsed(
                "store",
                self.store,
                defaults.place,
                NEEDED_PLACE,
                StorePlace::parse,
            ),
            maximum_saved_objects: count!(maximum_saved_objects, 1..=1_000_000),
            store: StoreLimits {
                objects: read!(within, cache_objects, 1..=100_000, defaults.store.objects),
                bytes: read!(within, cache_bytes, 1 << 20..=1 << 40, defaults.store.bytes),
            },
            maximum_rigs: count!(maximum_rigs, 1..=10_000),
            objects_directory: check.folder("objects_directory", self.objects_directory),
            builder_threads: read!(within, builder_threads, 0..=64, defaults.builder_threads),
            learned_grips: read!(within, learned_grips, 0..=1024, defaults.learned_grips),
            atlas_directory: check.folder("atlas_directory", self.atlas_directory),
            maximum_connections: count!(maximum_connections, 1..=1_000_000),
            maximum_unread_bytes: count!(maximum_unread_bytes, MAX_RESPONSE as u64..=1 << 30),
            web_origins: check.parsed(
                "web_origins",
                self.web_origins,
                defaults.web_origins,
                NEEDED_ORIGINS,
                parse_origins,
            ),
            drain: read!(time, drain_ms, 0..=600_000, defaults.drain),
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
        check.budgets(config.budgets);
        if bad.is_empty() {
            Ok(config)
        } else {
            Err(ConfigError::BadValues(bad))
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

    /// Checks that the default budget is none that the server cuts.
    fn budgets(&mut self, BudgetLimits { default, maximum, .. }: BudgetLimits) {
        if default > maximum {
            let needed = format!("at most maximum_budget_ms, {}", maximum.as_millis());
            self.reject("default_budget_ms", default.as_millis(), needed);
        }
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

fn log_filter(text: &str) -> Option<String> {
    let filter = text.parse::<tracing_subscriber::filter::Targets>();
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
    use crate::{config::unknown_variables, web::WebOrigins};

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
