//! The counts of one worker.

use super::report::{NearestMiss, SearchReport};
use crate::{
    base::{rejection::Rejection, stopwatch::StepTimes},
    model::hand::HandPose,
};

/// Unsettled attempts kept before the worker checks which are settled. More cost memory (24 bytes each),
/// fewer cost time.
const SETTLE_INTERVAL: usize = 4096;

/// A completed attempt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Record {
    /// Its index.
    pub(super) attempt: u64,
    /// Number of placements it pruned.
    pub(super) pruned: u64,
    /// Why it failed; `None` if it was valid.
    pub(super) rejection: Option<Rejection>,
}

/// The counts of one worker.
#[derive(Debug, Default)]
pub(super) struct Tally {
    settled: SearchReport,
    /// Attempts that count only if no earlier attempt is valid; empty unless the search is reproducible.
    unsettled: Vec<Record>,
    /// Placements pruned by interrupted attempts.
    interrupted_prunes: u64,
}

impl Tally {
    /// Counts an attempt immediately.
    pub(super) fn count(&mut self, record: &Record) {
        self.settled.attempts += 1;
        self.settled.pruned_placements += record.pruned;
        if let Some(rejection) = record.rejection {
            self.settled.rejections[rejection.index()] += 1;
        }
    }

    /// Counts an attempt once no earlier attempt can be the winner. Occasionally calls `last_settled` for the
    /// highest index for which this is known.
    pub(super) fn count_when_settled(&mut self, record: Record, last_settled: impl FnOnce() -> Option<u64>) {
        self.unsettled.push(record);
        if self.unsettled.len().is_multiple_of(SETTLE_INTERVAL)
            && let Some(last) = last_settled()
        {
            self.settle(last);
        }
    }

    /// Counts the kept attempts up to index `last`.
    fn settle(&mut self, last: u64) {
        // A worker's indices ascend.
        let settled = self.unsettled.partition_point(|record| record.attempt <= last);
        for index in 0..settled {
            let record = self.unsettled[index];
            self.count(&record);
        }
        self.unsettled.drain(..settled);
    }

    /// Records the placements pruned by an interrupted attempt.
    pub(super) fn record_interrupted(&mut self, pruned: u64) {
        self.interrupted_prunes += pruned;
    }

    /// Records a failed attempt, if it came closer than those before.
    pub(super) fn record_miss(
        &mut self,
        rejection: Rejection,
        wrench_angle: Option<f32>,
        attempt: u64,
        pose: impl FnOnce() -> HandPose,
    ) {
        let nearest = &mut self.settled.nearest_miss;
        if nearest
            .as_ref()
            .is_none_or(|nearest| nearest.is_farther_than(rejection, wrench_angle, attempt))
        {
            *nearest = Some(NearestMiss {
                rejection,
                attempt,
                wrench_angle,
                pose: pose(),
            });
        }
    }

    /// Records the times of the worker's steps.
    pub(super) fn record_times(&mut self, times: Option<StepTimes>) {
        self.settled.step_times = times;
    }

    /// Adds this worker's counts to a report; only attempts up to `last_counted`, if given.
    pub(super) fn add_to(mut self, report: &mut SearchReport, last_counted: Option<u64>) {
        self.settle(last_counted.unwrap_or(u64::MAX));
        if last_counted.is_none() {
            report.pruned_placements += self.interrupted_prunes;
        }
        report.merge(self.settled, false);
    }
}
