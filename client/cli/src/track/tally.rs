//! What became of the grasp, counted.

use std::{
    collections::{BTreeMap, VecDeque},
    fmt,
    time::Instant,
};

use grasp_client::{CurrentGraspStatus, v1::TrackAnswer};
use serde_json::{Value, json};

use crate::{
    format::{joined, list, name_of},
    output::pairs,
};

/// The statuses, in the order in which they are listed.
const STATUSES: [(CurrentGraspStatus, &str); 5] = [
    (CurrentGraspStatus::Kept, "kept"),
    (CurrentGraspStatus::Adjusted, "adjusted"),
    (CurrentGraspStatus::Replanned, "re-planned"),
    (CurrentGraspStatus::None, "none"),
    (CurrentGraspStatus::Aborted, "aborted"),
];

/// Answers so far.
#[derive(Debug, Default)]
pub(super) struct Tally {
    frames: usize,
    /// When frames that are not answered yet were sent, oldest first.
    sent: VecDeque<(u64, Instant)>,
    last_answered: Option<u64>,
    /// How many answers have each of [`STATUSES`].
    counts: [usize; STATUSES.len()],
    answered: usize,
    /// Frames overtaken by later ones.
    skipped: u64,
    /// Times in seconds.
    round_trips: Vec<f64>,
    server_times: Vec<f64>,
    /// Why grasps failed, in words, with how often.
    failures: BTreeMap<String, usize>,
    /// Distances of the object from where it was predicted, in metres; `None` without prediction.
    prediction_errors: Vec<f64>,
    /// Number of answers with a warning, and the first one.
    warned: usize,
    first_warning: Option<String>,
}

/// The median and the 99th percentile of some values.
fn percentiles(values: &[f64]) -> [f64; 2] {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    [0.5, 0.99].map(|share| {
        let place = (share * values.len().saturating_sub(1) as f64).round() as usize;
        values.get(place).copied().unwrap_or_default()
    })
}

impl Tally {
    /// Of so many frames.
    pub(super) fn new(frames: usize) -> Self {
        Self {
            frames,
            ..Self::default()
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
                self.round_trips.push(sent.elapsed().as_secs_f64());
            } else {
                self.skipped += 1;
            }
        }
        self.answered += 1;
        self.last_answered = Some(answer.sequence);
        self.server_times.push(answer.server_time().as_secs_f64());
        let status = answer.status();
        if let Some(place) = STATUSES.iter().position(|(known, _)| *known == status) {
            self.counts[place] += 1;
        }
        let current = answer.current.as_ref();
        if let Some(failed) = current.and_then(|current| current.failed_check.as_ref())
            && status != CurrentGraspStatus::None
        {
            *self.failures.entry(name_of(failed.check())).or_default() += 1;
        }
        if let Some(error) = &answer.last_prediction {
            self.prediction_errors.push(error.object_distance.into());
        }
        if let Some(warning) = answer.warnings.first() {
            self.warned += 1;
            self.first_warning.get_or_insert_with(|| warning.clone());
        }
    }

    /// The number of the latest frame that was answered.
    pub(super) fn last_answered(&self) -> Option<u64> {
        self.last_answered
    }

    /// True if any answer had a grasp.
    pub(super) fn has_grasp(&self) -> bool {
        let [kept, adjusted, replanned, ..] = self.counts;
        kept + adjusted + replanned > 0
    }

    /// The names of the statuses, with how many answers have each.
    fn by_status(&self) -> impl Iterator<Item = (&'static str, usize)> {
        STATUSES.into_iter().map(|(_, name)| name).zip(self.counts)
    }

    /// The live line.
    pub(super) fn line(&self) -> String {
        let counts = self.by_status().map(|(name, count)| format!("{name} {count}"));
        let latest = self.round_trips.last().copied().unwrap_or_default();
        format!("{}  {:.1} ms", joined("  ", counts), latest * 1e3)
    }

    /// The result, for scripts.
    pub(super) fn to_json(&self) -> Value {
        let both = |values: &[f64]| {
            let [median, p99] = percentiles(values);
            json!({ "median": median, "p99": p99 })
        };
        let errors = &self.prediction_errors;
        let mut all = json!({
            "frames": self.frames,
            "answered": self.answered,
            "skipped": self.skipped,
            "failures": self.failures,
            "round_trip_seconds": both(&self.round_trips),
            "server_seconds": both(&self.server_times),
            "object_prediction_error": (!errors.is_empty()).then(|| both(errors)),
            "warned": self.warned,
            "first_warning": self.first_warning,
        });
        for (name, count) in self.by_status() {
            all[name.replace('-', "")] = json!(count);
        }
        all
    }
}

/// The result, for people.
impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = |seconds: &[f64]| {
            let [median, p99] = percentiles(seconds).map(|seconds| seconds * 1e3);
            format!("{median:.2} ms, 99 %: {p99:.2} ms")
        };
        let (frames, answered, overtaken) = (self.frames, self.answered, self.skipped);
        let mut lines = vec![(
            "frames",
            format!("{frames}, {answered} answered, {overtaken} overtaken"),
        )];
        let is_shown = |(name, count): &(&str, usize)| *name != "aborted" || *count > 0;
        let counts = self.by_status().filter(is_shown);
        lines.extend(counts.map(|(name, count)| (name, count.to_string())));
        if !self.failures.is_empty() {
            let failures = self.failures.iter();
            let failures = failures.map(|(why, count)| format!("{why} ({count})"));
            lines.push(("failed checks", list(failures)));
        }
        if let Some(warning) = &self.first_warning {
            lines.push(("with warnings", format!("{}, first: {warning}", self.warned)));
        }
        lines.push(("round trip", times(&self.round_trips)));
        lines.push(("at the server", times(&self.server_times)));
        if !self.prediction_errors.is_empty() {
            let [median, p99] = percentiles(&self.prediction_errors).map(|metres| metres * 1e3);
            lines.push(("predicted", format!("{median:.1} mm off, 99 %: {p99:.1} mm")));
        }
        f.write_str(&pairs(&lines))
    }
}

#[cfg(test)]
mod tests {
    use grasp_client::v1::CurrentGraspReport;

    use super::*;

    fn answer(sequence: u64, status: CurrentGraspStatus) -> TrackAnswer {
        TrackAnswer {
            sequence,
            current: Some(CurrentGraspReport {
                status: status.into(),
                ..CurrentGraspReport::default()
            }),
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
        let line = tally.line();
        assert!(line.starts_with("kept 1  adjusted 0  re-planned 1  none 0"));
        let json = tally.to_json();
        assert_eq!(
            (&json["answered"], &json["skipped"], &json["replanned"]),
            (&2.into(), &2.into(), &1.into())
        );
        assert!(tally.has_grasp());
        assert!(tally.to_string().contains("4, 2 answered, 2 overtaken"));
    }
}
