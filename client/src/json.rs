//! JSON forms of durations, times and seeds. Times are in RFC 3339. Durations are numbers of seconds. Seeds are strings of digits, as in protobuf's
//! JSON mapping, since many readers' numbers hold fewer than 64 bits; numbers are accepted, too.

use std::time::SystemTime;

/// A time in RFC 3339, such as `2026-11-26T10:20:30.500Z`.
pub fn rfc3339(time: SystemTime) -> String {
    prost_types::Timestamp::from(time).to_string()
}

/// A duration as a number of seconds.
pub(crate) mod seconds {
    use std::time::Duration;

    use serde::{Deserialize, Deserializer, Serializer, de::Error as _};

    pub(crate) fn serialize<S: Serializer>(duration: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(duration.as_secs_f64())
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Duration, D::Error> {
        let seconds = f64::deserialize(deserializer)?;
        Duration::try_from_secs_f64(seconds).map_err(|_| {
            D::Error::custom(format!(
                "{seconds} is not a number of seconds; it must be at least 0"
            ))
        })
    }
}

/// A duration as a number of seconds, or null.
pub(crate) mod optional_seconds {
    use std::time::Duration;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Seconds(#[serde(with = "super::seconds")] Duration);

    #[expect(clippy::ref_option, reason = "serde's `with` passes a reference to the field")]
    pub(crate) fn serialize<S: Serializer>(
        duration: &Option<Duration>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        duration.map(Seconds).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Duration>, D::Error> {
        Ok(Option::<Seconds>::deserialize(deserializer)?.map(|Seconds(duration)| duration))
    }
}

/// A time as [`rfc3339`] writes it.
pub(crate) mod time {
    use std::time::SystemTime;

    use prost_types::Timestamp;
    use serde::{Deserialize, Deserializer, Serializer, de::Error as _};

    pub(crate) fn serialize<S: Serializer>(time: &SystemTime, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&super::rfc3339(*time))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SystemTime, D::Error> {
        let text = String::deserialize(deserializer)?;
        let time = text.parse::<Timestamp>().ok().map(SystemTime::try_from);
        match time {
            Some(Ok(time)) => Ok(time),
            _ => Err(D::Error::custom(format!("{text:?} is not a time in RFC 3339"))),
        }
    }
}

/// A seed as a string of digits.
pub(crate) mod seed {
    use serde::{Deserialize, Deserializer, Serializer, de::Error as _};

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum NumberOrText {
        Number(u64),
        Text(String),
    }

    #[expect(
        clippy::trivially_copy_pass_by_ref,
        reason = "serde's `with` passes a reference to the field"
    )]
    pub(crate) fn serialize<S: Serializer>(seed: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(seed)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        match NumberOrText::deserialize(deserializer)? {
            NumberOrText::Number(seed) => Ok(seed),
            NumberOrText::Text(text) => text
                .parse()
                .map_err(|_| D::Error::custom(format!("seed {text:?} is not an integer from 0 to 2^64 - 1"))),
        }
    }
}

/// A seed as a string of digits, or null.
pub(crate) mod optional_seed {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Seed(#[serde(with = "super::seed")] u64);

    #[expect(clippy::ref_option, reason = "serde's `with` passes a reference to the field")]
    pub(crate) fn serialize<S: Serializer>(seed: &Option<u64>, serializer: S) -> Result<S::Ok, S::Error> {
        seed.map(Seed).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u64>, D::Error> {
        Ok(Option::<Seed>::deserialize(deserializer)?.map(|Seed(seed)| seed))
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use serde::{Deserialize, Serialize};

    use crate::search::FindRequest;

    #[test]
    fn times_are_texts_of_rfc_3339() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Timed(#[serde(with = "super::time")] SystemTime);

        let timed = Timed(SystemTime::UNIX_EPOCH + Duration::new(1_000_000_000, 500_000_000));
        let text = serde_json::to_string(&timed).unwrap();
        assert!(
            text.starts_with("\"2001-09-09T01:46:40.5") && text.ends_with("Z\""),
            "{text}"
        );
        assert_eq!(serde_json::from_str::<Timed>(&text).unwrap(), timed);
        let error = serde_json::from_str::<Timed>("\"yesterday\"").unwrap_err();
        assert!(error.to_string().contains("RFC 3339"), "{error}");
    }

    #[test]
    fn seed_round_trips_through_json() {
        let request = FindRequest {
            seed: Some(u64::MAX),
            ..FindRequest::new("objects/remote")
        };
        let text = serde_json::to_string(&request).unwrap();
        assert!(text.contains(r#""seed":"18446744073709551615""#), "{text}");
        assert_eq!(serde_json::from_str::<FindRequest>(&text).unwrap(), request);
    }

    #[test]
    fn seed_may_be_a_number_but_not_a_word() {
        let read = |seed: &str| {
            serde_json::from_str::<FindRequest>(&format!(r#"{{"object": "objects/x", "seed": {seed}}}"#))
        };
        assert_eq!(read("7").unwrap().seed, Some(7));
        assert_eq!(read("null").unwrap().seed, None);
        assert!(read(r#""seven""#).unwrap_err().to_string().contains("seven"));
    }

    #[test]
    fn budget_is_a_number_of_seconds() {
        let read = |budget: &str| {
            let text = format!(r#"{{"object": "objects/x", "budget_seconds": {budget}}}"#);
            serde_json::from_str::<FindRequest>(&text).map(|request| request.budget)
        };
        assert_eq!(read("0.25").unwrap(), Some(Duration::from_millis(250)));
        assert_eq!(read("3").unwrap(), Some(Duration::from_secs(3)));
        assert_eq!(read("null").unwrap(), None);
        assert!(read("-1").unwrap_err().to_string().contains("-1"));
        assert!(read("1e300").is_err());
    }

    #[test]
    fn rejects_unknown_fields() {
        let error =
            serde_json::from_str::<FindRequest>(r#"{"object": "objects/x", "budget": 1}"#).unwrap_err();
        assert!(error.to_string().contains("unknown field `budget`"), "{error}");
    }
}
