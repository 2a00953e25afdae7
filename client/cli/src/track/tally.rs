//! What became of the grasp, counted.

use std::{
    collections::{BTreeMap, VecDeque},
    fmt,
    time::{Duration, Instant},
};

use grasp_client::{CurrentGraspStatus, v1::TrackAnswer};
use serde::Serialize;

use crate::{format::name_of, output::pairs};

/// Answers so far.
#[derive(Debug)]
pub(super) struct Tally {
    frames: usize,
    /// When frames that are not answered yet were sent, oldest first.
    sent: VecDeque<(u64, Instant)>,
    last_answered: Option<u64>,
    /// The status before, for counts of changes.
    counts: BTreeMap<&'static str, usize>,
    answered: usize,
    skipped: u64,
    round_trips: Vec<Duration>,
    server_times: Vec<Duration>,
    /// Why grasps failed, in words, with how often.
    failures: BTreeMap<String, usize>,
    prediction_errors: Vec<f32>,
    /// Number of answers with a warning, and the first one.
    warned: usize,
    first_warning: Option<String>,
}

/// The result of a track.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    frames: usize,
    answered: usize,
    /// Overtaken by later frames.
    skipped: u64,
    kept: usize,
    adjusted: usize,
    replanned: usize,
    none: usize,
    aborted: usize,
    failures: BTreeMap<String, usize>,
    round_trip_seconds: Percentiles,
    server_seconds: Percentiles,
    /// Distances of the object from where it was predicted, in metres; none without prediction.
    object_prediction_error: Option<Percentiles>,
    /// Frames with something wrong, and what was in the first.
    warned: usize,
    first_warning: Option<String>,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Percentiles {
    median: f64,
    p99: f64,
}

impl Percentiles {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let place = (share * values.len().saturating_sub(1) as f64).round() as usize;
            values.get(place).copied().unwrap_or_default()
        };
        Self {
            median: at(0.5),
            p99: at(0.99),
        }
    }
}

/// The statuses, in the order in which they are listed.
const STATUSES: [(CurrentGraspStatus, &str); 5] = [
    (CurrentGraspStatus::Kept, "kept"),
    (CurrentGraspStatus::Adjusted, "adjusted"),
    (CurrentGraspStatus::Replanned, "re-planned"),
    (CurrentGraspStatus::None, "none"),
    (CurrentGraspStatus::Aborted, "aborted"),
];

impl Tally {
    /// Of so many frames.
    pub(super) fn new(frames: usize) -> Self {
        Self {
            frames,
            sent: VecDeque::new(),
            last_answered: None,
            counts: BTreeMap::new(),
            answered: 0,
            skipped: 0,
            round_trips: Vec::new(),
            server_times: Vec::new(),
            failures: BTreeMap::new(),
            prediction_errors: Vec::new(),
            warned: 0,
            first_warning: None,
        }
    }

    /// A frame is on its way.
    pub(super) fn sent(&mut self, sequence: u64) {
        self.sent.push_back((sequence, Instant::now()));
    }

    /// An answer has come.
    pub(super) fn answered(&mut self, answer: &TrackAnswer) {
        while let Some((sequence, sent)) = self.sent.pop_front_if(|(sent, _)| *sent <= answer.sequence) {
            if sequence == answer.sequence {
                self.round_trips.push(sent.elapsed());
            } else {
                self.skipped += 1;
            }
        }
        self.answered += 1;
        self.last_answered = Some(answer.sequence);
        self.server_times.push(answer.server_time());
        let status = answer.status();
        if let Some((_, name)) = STATUSES.iter().find(|(known, _)| *known == status) {
            *self.counts.entry(name).or_default() += 1;
        }
        let failed = answer
            .current
            .as_ref()
            .and_then(|current| current.failed_check.as_ref());
        if status != CurrentGraspStatus::None
            && let Some(failed) = failed
        {
            *self.failures.entry(name_of(failed.check())).or_default() += 1;
        }
        self.prediction_errors
            .extend(answer.last_prediction.as_ref().map(|error| error.object_distance));
        if let Some(warning) = answer.warnings.first() {
            self.warned += 1;
            self.first_warning.get_or_insert_with(|| warning.clone());
        }
    }

    /// The number of the latest frame that was answered.
    pub(super) fn last_answered(&self) -> Option<u64> {
        self.last_answered
    }

    /// The live line.
    pub(super) fn line(&self) -> String {
        let counts = STATUSES.map(|(_, name)| format!("{name} {}", self.count(name)));
        let latest = self.round_trips.last().copied().unwrap_or_default();
        format!("{}  {:.1} ms", counts.join("  "), latest.as_secs_f64() * 1e3)
    }

    fn count(&self, name: &str) -> usize {
        self.counts.get(name).copied().unwrap_or_default()
    }

    /// The result.
    pub(super) fn summary(self) -> Summary {
        let seconds = |durations: &[Duration]| Percentiles::of(durations.iter().map(Duration::as_secs_f64));
        let errors = &self.prediction_errors;
        Summary {
            frames: self.frames,
            answered: self.answered,
            skipped: self.skipped,
            kept: self.count("kept"),
            adjusted: self.count("adjusted"),
            replanned: self.count("re-planned"),
            none: self.count("none"),
            aborted: self.count("aborted"),
            round_trip_seconds: seconds(&self.round_trips),
            server_seconds: seconds(&self.server_times),
            object_prediction_error: (!errors.is_empty())
                .then(|| Percentiles::of(errors.iter().map(|&error| f64::from(error)))),
            failures: self.failures,
            warned: self.warned,
            first_warning: self.first_warning,
        }
    }
}

impl Summary {
    /// True if any answer had a grasp.
    pub(super) fn has_grasp(&self) -> bool {
        self.kept + self.adjusted + self.replanned > 0
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times =
            |times: Percentiles| format!("{:.2} ms, 99 %: {:.2} ms", times.median * 1e3, times.p99 * 1e3);
        let mut lines = vec![
            (
                "frames",
                format!(
                    "{}, {} answered, {} overtaken",
                    self.frames, self.answered, self.skipped
                ),
            ),
            ("kept", self.kept.to_string()),
            ("adjusted", self.adjusted.to_string()),
            ("re-planned", self.replanned.to_string()),
            ("none", self.none.to_string()),
        ];
        if self.aborted > 0 {
            lines.push(("aborted", self.aborted.to_string()));
        }
        if !self.failures.is_empty() {
            let failures = self
                .failures
                .iter()
                .map(|(why, count)| format!("{why} ({count})"));
            lines.push(("failed checks", failures.collect::<Vec<_>>().join(", ")));
        }
        if let Some(warning) = &self.first_warning {
            lines.push(("with warnings", format!("{}, first: {warning}", self.warned)));
        }
        lines.push(("round trip", times(self.round_trip_seconds)));
        lines.push(("at the server", times(self.server_seconds)));
        if let Some(error) = self.object_prediction_error {
            lines.push((
                "predicted",
                format!(
                    "{:.1} mm off, 99 %: {:.1} mm",
                    error.median * 1e3,
                    error.p99 * 1e3
                ),
            ));
        }
        f.write_str(&pairs(&lines))
    }
}

#[cfg(test)]
mod tests {
    use grasp_client::{v1::CurrentGraspReport, wire_duration};

    use super::*;

    fn answer(sequence: u64, status: CurrentGraspStatus) -> TrackAnswer {
        TrackAnswer {
            sequence,
            current: Some(CurrentGraspReport {
                status: status.into(),
                ..CurrentGraspReport::default()
            }),
            server_time: Some(wire_duration(Duration::from_millis(1))),
            ..TrackAnswer::default()
        }
    }

    #[test]
    fn counts_answers_by_status_and_frames_that_were_overtaken() {
        let mut tally = Tally::new(4);
        for sequence in 0..4 {
            tally.sent(sequence);
        }
        tally.answered(&answer(0, CurrentGraspStatus::Replanned));
        tally.answered(&answer(3, CurrentGraspStatus::Kept));
        assert_eq!(tally.last_answered(), Some(3));
        assert!(
            tally
                .line()
                .starts_with("kept 1  adjusted 0  re-planned 1  none 0")
        );
        let summary = tally.summary();
        assert_eq!((summary.answered, summary.skipped, summary.kept), (2, 2, 1));
        assert!(summary.has_grasp());
        assert!(summary.to_string().contains("4, 2 answered, 2 overtaken"));
    }
}
