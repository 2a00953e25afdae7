//! Prometheus' text format, version 0.0.4, and its counters and histograms: atomic numbers, without a lock or an allocation.

use std::{
    fmt::{self, Write as _},
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

/// Content type of the page.
pub(crate) const CONTENT_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

/// Labels with their values.
pub(crate) type Labels<'a> = &'a [(&'a str, &'a str)];

/// Upper bounds of the buckets of all histograms, in microseconds: a warm call takes 200, a frame of a headset 11,000.
const BOUNDS_US: [u64; 16] = [
    100, 250, 500, 1000, 2500, 5000, 10_000, 25_000, 50_000, 100_000, 250_000, 500_000, 1_000_000, 2_500_000,
    5_000_000, 10_000_000,
];

/// A number of events.
#[derive(Debug, Default)]
pub(crate) struct Counter(AtomicU64);

impl Counter {
    pub(crate) fn add(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Counters of events that differ by one label, whose values are known from the start.
#[derive(Debug)]
pub(crate) struct Counters {
    label: &'static str,
    counts: Vec<(&'static str, Counter)>,
}

impl Counters {
    pub(crate) fn new(label: &'static str, values: impl IntoIterator<Item = &'static str>) -> Self {
        let counts = values.into_iter().map(|value| (value, Counter::default()));
        Self {
            label,
            counts: counts.collect(),
        }
    }

    /// Counts an event with the value at this place; one beyond the last is not counted.
    pub(crate) fn add(&self, place: usize) {
        if let Some((_, count)) = self.counts.get(place) {
            count.add();
        }
    }

    /// Counts an event with this value; an unknown one is not counted.
    pub(crate) fn add_value(&self, value: &str) {
        if let Some((_, count)) = self.counts.iter().find(|(known, _)| *known == value) {
            count.add();
        }
    }
}

/// Durations.
#[derive(Debug, Default)]
pub(crate) struct Histogram {
    /// Events in each bucket, and those beyond the last bound.
    buckets: [Counter; BOUNDS_US.len() + 1],
    sum_ns: AtomicU64,
}

impl Histogram {
    pub(crate) fn record(&self, time: Duration) {
        let us = time.as_nanos().div_ceil(1000);
        let bucket = BOUNDS_US.iter().position(|&bound| us <= u128::from(bound));
        self.buckets[bucket.unwrap_or(BOUNDS_US.len())].add();
        let ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.sum_ns.fetch_add(ns, Ordering::Relaxed);
    }
}

/// A page of metrics. Every family begins with its type and help.
#[derive(Debug, Default)]
pub(crate) struct Exposition(String);

impl Exposition {
    /// Begins a family; `kind` is gauge, counter or histogram.
    pub(crate) fn family(&mut self, name: &str, kind: &str, help: &str) {
        self.line(format_args!("# HELP {name} {help}"));
        self.line(format_args!("# TYPE {name} {kind}"));
    }

    pub(crate) fn sample(&mut self, name: &str, labels: Labels<'_>, value: impl fmt::Display) {
        self.0.push_str(name);
        for (place, (label, value)) in labels.iter().enumerate() {
            let separator = if place == 0 { '{' } else { ',' };
            // Debug escapes quotes, backslashes and newlines, as the format requires.
            let _ = write!(self.0, "{separator}{label}={value:?}");
        }
        if !labels.is_empty() {
            self.0.push('}');
        }
        self.line(format_args!(" {value}"));
    }

    /// A gauge without labels.
    pub(crate) fn gauge(&mut self, name: &str, help: &str, value: impl fmt::Display) {
        self.family(name, "gauge", help);
        self.sample(name, &[], value);
    }

    /// A gauge with a value per label.
    pub(crate) fn gauges(&mut self, name: &str, help: &str, label: &str, values: &[(&str, usize)]) {
        self.family(name, "gauge", help);
        for (of, value) in values {
            self.sample(name, &[(label, of)], value);
        }
    }

    pub(crate) fn counter(&mut self, name: &str, help: &str, value: impl fmt::Display) {
        self.family(name, "counter", help);
        self.sample(name, &[], value);
    }

    pub(crate) fn counters(&mut self, name: &str, help: &str, counters: &Counters) {
        self.family(name, "counter", help);
        for (value, count) in &counters.counts {
            self.sample(name, &[(counters.label, value)], count.get());
        }
    }

    /// The samples of a histogram whose family has begun.
    pub(crate) fn histogram(&mut self, name: &str, labels: Labels<'_>, histogram: &Histogram) {
        let [bucket, sum, count] = ["bucket", "sum", "count"].map(|part| format!("{name}_{part}"));
        let bounds = BOUNDS_US.map(|bound| (bound as f64 / 1e6).to_string());
        let bounds = bounds.iter().map(String::as_str).chain(["+Inf"]);
        let mut total = 0;
        for (bound, events) in bounds.zip(&histogram.buckets) {
            total += events.get();
            self.sample(&bucket, &[labels, &[("le", bound)]].concat(), total);
        }
        let seconds = histogram.sum_ns.load(Ordering::Relaxed) as f64 / 1e9;
        self.sample(&sum, labels, seconds);
        self.sample(&count, labels, total);
    }

    pub(crate) fn into_text(self) -> String {
        self.0
    }

    fn line(&mut self, text: fmt::Arguments<'_>) {
        // Writing to a text does not fail.
        let _ = self.0.write_fmt(text);
        self.0.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bucket_has_what_is_at_most_its_bound() {
        let histogram = Histogram::default();
        for us in [0, 100, 101, 10_000_000, 10_000_001] {
            histogram.record(Duration::from_micros(us));
        }
        histogram.record(Duration::from_nanos(100_001));
        let mut page = Exposition::default();
        page.family("x_seconds", "histogram", "Times.");
        page.histogram("x_seconds", &[("a", "b\"\n")], &histogram);
        let text = page.into_text();
        for line in [
            "# TYPE x_seconds histogram",
            "x_seconds_bucket{a=\"b\\\"\\n\",le=\"0.0001\"} 2",
            "x_seconds_bucket{a=\"b\\\"\\n\",le=\"0.00025\"} 4",
            "x_seconds_bucket{a=\"b\\\"\\n\",le=\"10\"} 5",
            "x_seconds_bucket{a=\"b\\\"\\n\",le=\"+Inf\"} 6",
            "x_seconds_count{a=\"b\\\"\\n\"} 6",
            "x_seconds_sum{a=\"b\\\"\\n\"} 20.000302001",
        ] {
            assert!(text.lines().any(|other| other == line), "{line} in {text}");
        }
    }

    #[test]
    fn only_known_values_count() {
        let counters = Counters::new("of", ["a", "b"]);
        counters.add(1);
        counters.add(2);
        counters.add_value("b");
        counters.add_value("c");
        let mut page = Exposition::default();
        page.counters("x_total", "Things.", &counters);
        let text = page.into_text();
        assert!(
            text.ends_with("x_total{of=\"a\"} 0\nx_total{of=\"b\"} 2\n"),
            "{text}"
        );
    }
}
