//! Results: text for people and JSON for scripts, on standard output and in files. A closed pipe is reported, not a panic.

use std::{
    cmp::Reverse,
    fmt::{Debug, Display},
    fs,
    io::{self, Write as _},
    path::Path,
    time::Duration,
};

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};
use grasp_client::{
    json::to_json,
    v1::{self, Check, Convention},
};
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use prost::{Message, Name};
use serde::Serialize;
use serde_json::Value;

use crate::Failure;

/// A line below the header only: keeps tables compact and easy to paste.
const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The form of results.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Output {
    /// True for JSON, false for text.
    pub(crate) json: bool,
}

impl Output {
    /// Writes a message as protobuf's JSON, or as the text that `text` makes of it.
    pub(crate) fn write_message<M: Message + Name>(
        self,
        message: &M,
        text: impl FnOnce(&M) -> String,
    ) -> Result<(), Failure> {
        if self.json {
            return write_message(message);
        }
        write_line(&text(message))
    }

    /// Writes `value` as JSON, or as the text that `text` makes of it.
    pub(crate) fn write<T: Serialize>(
        self,
        value: &T,
        text: impl FnOnce(&T) -> String,
    ) -> Result<(), Failure> {
        if self.json {
            return write_json(value);
        }
        write_line(&text(value))
    }
}

pub(crate) fn write_message<M: Message + Name>(message: &M) -> Result<(), Failure> {
    write_json(&message_json(message)?)
}

/// Writes a message as one line of protobuf's JSON.
pub(crate) fn write_message_line<M: Message + Name>(message: &M) -> Result<(), Failure> {
    write_line(&message_json(message)?.to_string())
}

pub(crate) fn message_json<M: Message + Name>(message: &M) -> Result<Value, Failure> {
    to_json(message).map_err(|error| Failure::other("cannot write the result as JSON", error))
}

pub(crate) fn write_json<T: Serialize>(value: &T) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|error| Failure::other("cannot write the result as JSON", error))?;
    write_line(&text)
}

pub(crate) fn write_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let written = out.write_all(bytes).and_then(|()| out.flush());
    written.map_err(|error| Failure::output(&error))
}

pub(crate) fn write_line(text: &str) -> Result<(), Failure> {
    write_bytes(format!("{text}\n").as_bytes())
}

/// Writes a file, creating its folder if necessary.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent
        .map_or(Ok(()), fs::create_dir_all)
        .and_then(|()| fs::write(path, bytes))
        .map_err(|error| Failure::other(format!("cannot write {}", path.display()), error))
}

/// A table whose header is names separated by " | "; a leading `>` aligns a column to the right.
pub(crate) fn table(header: &str) -> Table {
    let header: Vec<&str> = header.split(" | ").collect();
    let mut table = Table::new();
    table
        .load_style(LINE_BELOW_HEADER)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(header.iter().map(|name| name.trim_start_matches('>')));
    for (name, column) in header.iter().zip(table.column_iter_mut()) {
        if name.starts_with('>') {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// Names and values, one pair per line, with aligned values.
pub(crate) fn pairs(pairs: &[(&str, String)]) -> String {
    let width = pairs.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    let pairs = pairs.iter();
    joined("\n", pairs.map(|(name, value)| format!("{name:width$}  {value}")))
}

pub(crate) fn warnings(warnings: &[String]) -> impl Iterator<Item = (&'static str, String)> {
    warnings.iter().map(|warning| ("warning", warning.clone()))
}

/// Interval at which a bar is redrawn during long steps.
const TICK: Duration = Duration::from_millis(100);

/// A bar of `steps` steps: hidden unless standard error is a terminal, and removed when the command ends. `counts` is the part of `indicatif`'s template that shows the position.
pub(crate) fn bar(steps: u64, counts: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!("{{bar:32}} {counts} {{elapsed:>4}} {{msg}}"))
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(steps)
        .with_style(style)
        .with_finish(ProgressFinish::AndClear);
    bar.enable_steady_tick(TICK);
    bar
}

/// The name, in words, of a value of an enumeration of the contract.
pub(crate) fn name_of(value: impl Copy + Debug) -> String {
    let mut words = String::new();
    for letter in format!("{value:?}").chars() {
        if !words.is_empty() && !letter.is_lowercase() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}

/// Texts separated by commas.
pub(crate) fn list<T: ToString>(texts: impl IntoIterator<Item = T>) -> String {
    joined(", ", texts)
}

/// Texts separated by `separator`.
pub(crate) fn joined<T: ToString>(separator: &str, texts: impl IntoIterator<Item = T>) -> String {
    let texts: Vec<String> = texts.into_iter().map(|text| text.to_string()).collect();
    texts.join(separator)
}

pub(crate) fn yes_or_no(is_so: bool) -> String {
    if is_so { "yes" } else { "no" }.to_owned()
}

pub(crate) fn grasp_type_name(grasp: &v1::Grasp) -> String {
    match grasp.r#type() {
        v1::GraspType::Unspecified => "unclassifiable".to_owned(),
        grasp_type => name_of(grasp_type),
    }
}

/// Metres per unit of length of a convention.
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

/// The three most frequent rejections, abbreviated, with their percentage of the attempts.
pub(crate) fn rejections_at_a_glance(report: &v1::SearchReport) -> String {
    rejections(report, 3, |check| match check {
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
    })
}

/// The most frequent rejections with their percentage of the attempts.
pub(crate) fn rejections<N: Display>(
    report: &v1::SearchReport,
    most: usize,
    name: impl Fn(Check) -> N,
) -> String {
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
    fn times_have_three_significant_digits_and_values_names_in_words() {
        for (seconds, expected) in [
            (0.0, "0.00 µs"),
            (0.000_012_345, "12.3 µs"),
            (0.001_234_5, "1.23 ms"),
            (0.123_45, "123 ms"),
            (9.999, "10.0 s"),
        ] {
            assert_eq!(human_time(seconds), expected);
        }
        assert_eq!(name_of(v1::GraspType::Prismatic4Finger), "prismatic 4 finger");
    }

    #[test]
    fn most_frequent_rejections_come_first() {
        let count = |(check, count): (Check, u64)| v1::CheckCount {
            check: check.into(),
            count,
        };
        let counts = [
            (Check::Contacts, 20),
            (Check::PalmCollision, 130),
            (Check::Thumb, 1),
        ];
        let report = v1::SearchReport {
            attempts: 200,
            rejections: counts
                .into_iter()
                .chain([(Check::Balance, 50)])
                .map(count)
                .collect(),
            ..v1::SearchReport::default()
        };
        let at_a_glance = rejections_at_a_glance(&report);
        assert_eq!(at_a_glance, "palm 65%, not immobile 25%, no contacts 10%");
        let all = rejections(&report, 9, name_of);
        assert_eq!(all, "palm collision 65%, balance 25%, contacts 10%, thumb 0%");
    }
}
