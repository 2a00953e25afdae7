//! Times, names and rejections for people.

use std::cmp::Reverse;

use grasp_client::v1::{self, Check, Convention};

/// An enumeration of the contract.
pub(crate) trait Named {
    /// The value's name in the contract, without the enumeration's.
    fn contract_name(self) -> &'static str;
}

macro_rules! named {
    ($($enumeration:ident $prefix:literal)*) => {$(
        impl Named for v1::$enumeration {
            fn contract_name(self) -> &'static str {
                let name = self.as_str_name();
                name.strip_prefix($prefix).unwrap_or(name)
            }
        }
    )*};
}

named! {
    AtlasGrowth "ATLAS_GROWTH_"
    Check "CHECK_"
    CurrentGraspStatus "CURRENT_GRASP_STATUS_"
    Digit "DIGIT_"
    GraspSource "GRASP_SOURCE_"
    GraspType "GRASP_TYPE_"
    Handedness "HANDEDNESS_"
    KeyFrameKind "KEY_FRAME_KIND_"
    ObjectChange "OBJECT_CHANGE_"
    Preference "PREFERENCE_"
}

/// The name of an enumeration's value, in words.
pub(crate) fn name_of(value: impl Named) -> String {
    value.contract_name().to_lowercase().replace('_', " ")
}

/// Texts with commas in between.
pub(crate) fn list<T: ToString>(texts: impl IntoIterator<Item = T>) -> String {
    joined(", ", texts)
}

/// Texts with a separator in between.
pub(crate) fn joined<T: ToString>(separator: &str, texts: impl IntoIterator<Item = T>) -> String {
    let texts: Vec<String> = texts.into_iter().map(|text| text.to_string()).collect();
    texts.join(separator)
}

/// Whether something is so.
pub(crate) fn yes_or_no(is_so: bool) -> String {
    if is_so { "yes" } else { "no" }.to_owned()
}

/// The taxonomy's name of a grasp.
pub(crate) fn grasp_type_name(grasp: &v1::Grasp) -> String {
    match grasp.r#type() {
        v1::GraspType::Unspecified => "unclassifiable".to_owned(),
        grasp_type => name_of(grasp_type),
    }
}

/// A grasp's comfort E.
pub(crate) fn comfort(grasp: &v1::Grasp) -> String {
    let thesis = grasp.thesis.unwrap_or_default();
    format!("{:.4}", thesis.comfort)
}

/// Metres of a length of 1 in a convention.
pub(crate) fn metres(convention: Convention) -> f32 {
    match convention {
        Convention::Unreal | Convention::UnrealXzy => 0.01,
        _ => 1.0,
    }
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
pub(crate) fn all_rejections(report: &v1::SearchReport) -> String {
    rejections(report, usize::MAX, name_of)
}

/// The three most frequent rejections, abbreviated, with their percentage of the attempts.
pub(crate) fn rejections_at_a_glance(report: &v1::SearchReport) -> String {
    rejections(report, 3, |check| {
        let name = match check {
            Check::Contacts => "no contacts",
            Check::Thumb => "no thumb",
            Check::ThumbEarly => "early stop",
            Check::Fingers => "no fingers",
            Check::PalmCollision => "palm",
            Check::FingerCollision => "finger",
            Check::Forbidden => "unwanted",
            Check::Balance => "not immobile",
            Check::Requirements => "requirement",
            _ => "other",
        };
        name.to_owned()
    })
}

fn rejections(report: &v1::SearchReport, most: usize, name: impl Fn(Check) -> String) -> String {
    let mut counts: Vec<_> = report.rejections.iter().filter(|count| count.count > 0).collect();
    counts.sort_by_key(|count| Reverse(count.count));
    if counts.is_empty() {
        return "none".to_owned();
    }
    list(counts.iter().take(most).map(|count| {
        let percent = 100.0 * count.count as f64 / report.attempts.max(1) as f64;
        format!("{} {percent:.0}%", name(count.check()))
    }))
}

#[cfg(test)]
mod tests {
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
        assert_eq!(name_of(Check::GiverClearance), "giver clearance");
        assert_eq!(name_of(v1::Digit::Little), "little");
    }

    #[test]
    fn most_frequent_rejections_come_first() {
        let count = |check: Check, count| v1::CheckCount {
            check: check.into(),
            count,
        };
        let mut report = v1::SearchReport {
            attempts: 200,
            rejections: vec![
                count(Check::Contacts, 20),
                count(Check::PalmCollision, 130),
                count(Check::Thumb, 0),
                count(Check::Balance, 50),
            ],
            ..v1::SearchReport::default()
        };
        let at_a_glance = rejections_at_a_glance(&report);
        assert_eq!(at_a_glance, "palm 65%, not immobile 25%, no contacts 10%");
        report.rejections[2].count = 1;
        assert_eq!(rejections_at_a_glance(&report), at_a_glance);
        assert_eq!(
            all_rejections(&report),
            "palm collision 65%, balance 25%, contacts 10%, thumb 0%"
        );
        report.rejections.clear();
        assert_eq!(all_rejections(&report), "none");
    }
}
