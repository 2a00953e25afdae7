//! Times, names and rejections for people.

use std::cmp::Reverse;

use grasp_client::{Grasp, Rejection, SearchReport};
use serde::Serialize;

/// The JSON name of an enumeration's value, with spaces.
pub(crate) fn name_of<T: Serialize>(value: &T) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => name.replace('_', " "),
        other => format!("{other:?}"),
    }
}

/// The taxonomy's name of a grasp.
pub(crate) fn grasp_type_name(grasp: &Grasp) -> String {
    grasp
        .grasp_type
        .map_or_else(|| "unclassifiable".to_owned(), |grasp_type| name_of(&grasp_type))
}

/// A time in microseconds, milliseconds or seconds, with three significant digits.
pub(crate) fn human_time(seconds: f64) -> String {
    let (value, unit) = if seconds < 1e-3 {
        (seconds * 1e6, "µs")
    } else if seconds < 1.0 {
        (seconds * 1e3, "ms")
    } else {
        (seconds, "s")
    };
    let decimals = match value {
        ..9.995 => 2,
        ..99.95 => 1,
        _ => 0,
    };
    format!("{value:.decimals$} {unit}")
}

/// All rejections with their percentage of the attempts, most frequent first.
pub(crate) fn all_rejections(report: &SearchReport) -> String {
    rejections(report, usize::MAX, |rejection| name_of(&rejection))
}

/// The three most frequent rejections, abbreviated, with their percentage of the attempts.
pub(crate) fn rejections_at_a_glance(report: &SearchReport) -> String {
    rejections(report, 3, |rejection| {
        match rejection {
            Rejection::NoContacts => "no contacts",
            Rejection::NoThumb => "no thumb",
            Rejection::NoThumbEarlyStop => "early stop",
            Rejection::NoFingers => "no fingers",
            Rejection::PalmCollision => "palm",
            Rejection::FingerCollision => "finger",
            Rejection::UnwantedContact => "unwanted",
            Rejection::NotImmobilizing => "not immobile",
            Rejection::UnmetConstraint => "constraint",
            Rejection::Unrecognised => "other",
        }
        .to_owned()
    })
}

fn rejections(report: &SearchReport, most: usize, name: impl Fn(Rejection) -> String) -> String {
    let mut counts: Vec<_> = report.rejections.iter().filter(|count| count.count > 0).collect();
    counts.sort_by_key(|count| Reverse(count.count));
    if counts.is_empty() {
        return "none".to_owned();
    }
    let shares: Vec<_> = counts
        .iter()
        .take(most)
        .map(|count| {
            let percent = 100.0 * count.count as f64 / report.attempts.max(1) as f64;
            format!("{} {percent:.0}%", name(count.rejection))
        })
        .collect();
    shares.join(", ")
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use grasp_client::{Digit, RejectionCount};

    use super::*;

    #[test]
    fn times_have_three_significant_digits() {
        assert_eq!(human_time(0.0), "0.00 µs");
        assert_eq!(human_time(0.000_012_345), "12.3 µs");
        assert_eq!(human_time(0.001_234_5), "1.23 ms");
        assert_eq!(human_time(0.123_45), "123 ms");
        assert_eq!(human_time(9.999), "10.0 s");
        assert_eq!(human_time(12.0), "12.0 s");
    }

    #[test]
    fn names_have_spaces() {
        assert_eq!(name_of(&Rejection::NoThumbEarlyStop), "no thumb early stop");
        assert_eq!(name_of(&Digit::Little), "little");
    }

    #[test]
    fn most_frequent_rejections_come_first() {
        let count = |rejection, count| RejectionCount { rejection, count };
        let mut report = SearchReport {
            attempts: 200,
            pruned_placements: 0,
            rejections: vec![
                count(Rejection::NoContacts, 20),
                count(Rejection::PalmCollision, 130),
                count(Rejection::NoThumb, 0),
                count(Rejection::NotImmobilizing, 50),
            ],
            step_times: Vec::new(),
            seed: 0,
            attempt: None,
            search_time: Duration::ZERO,
            budget: Duration::ZERO,
            workers: 1,
            nearest_miss: None,
            strategy: None,
            validity: None,
            candidates: 0,
            source: None,
            atlas_entries: 0,
            atlas_stamp: None,
            other_atlas_stamp: None,
            learned_stamp: None,
            other_learned_stamp: None,
            preferred_grip: None,
            passed_over: Vec::new(),
            limits: Vec::new(),
            warnings: Vec::new(),
        };
        let at_a_glance = rejections_at_a_glance(&report);
        assert_eq!(at_a_glance, "palm 65%, not immobile 25%, no contacts 10%");
        report.rejections[2].count = 1;
        assert_eq!(rejections_at_a_glance(&report), at_a_glance);
        assert_eq!(
            all_rejections(&report),
            "palm collision 65%, not immobilizing 25%, no contacts 10%, no thumb 0%"
        );
        report.rejections.clear();
        assert_eq!(all_rejections(&report), "none");
    }
}
