//! What one worker counts.

use super::report::{NearestMiss, SearchReport};
use crate::{
    base::{rejection::Rejection, stopwatch::StepTimes},
    model::hand::HandPose,
};

/// Attempts that are kept apart before the worker asks which of them are settled. More cost memory (24 bytes each),
/// fewer cost time.
const UNSETTLED_AT_ONCE: usize = 4096;

/// An attempt that ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Record {
    /// Its index.
    pub(super) attempt: u64,
    /// How many placements it pruned.
    pub(super) pruned: u64,
    /// Why it failed; none if it was valid.
    pub(super) rejection: Option<Rejection>,
}

/// The counts of one worker.
#[derive(Debug, Default)]
pub(super) struct Tally {
    settled: SearchReport,
    /// Attempts that count only if no attempt before them turns out valid; empty unless the search is reproducible.
    unsettled: Vec<Record>,
    /// Prunes of attempts that were interrupted.
    interrupted_prunes: u64,
}

impl Tally {
    /// Counts an attempt at once.
    pub(super) fn count(&mut self, record: &Record) {
        self.settled.attempts += 1;
        self.settled.pruned_placements += record.pruned;
        if let Some(rejection) = record.rejection {
            self.settled.rejections[rejection.index()] += 1;
        }
    }

    /// Counts an attempt as soon as it is known that no attempt before it is the winner. From time to time
    /// `last_settled` is asked for the highest index of which that is known.
    pub(super) fn count_when_settled(&mut self, record: Record, last_settled: impl FnOnce() -> Option<u64>) {
        self.unsettled.push(record);
        if self.unsettled.len().is_multiple_of(UNSETTLED_AT_ONCE)
            && let Some(last) = last_settled()
        {
            self.settle(last);
        }
    }

    /// Counts the kept attempts up to the index `last`.
    fn settle(&mut self, last: u64) {
        // A worker's indices ascend.
        let settled = self.unsettled.partition_point(|record| record.attempt <= last);
        for index in 0..settled {
            let record = self.unsettled[index];
            self.count(&record);
        }
        self.unsettled.drain(..settled);
    }

    /// Notes the placements that an interrupted attempt pruned.
    pub(super) fn note_interrupted(&mut self, pruned: u64) {
        self.interrupted_prunes += pruned;
    }

    /// Notes a failed attempt, if it comes closer than those before.
    pub(super) fn note_miss(
        &mut self,
        rejection: Rejection,
        wrench_angle: Option<f32>,
        attempt: u64,
        pose: impl FnOnce() -> HandPose,
    ) {
        let nearest = &mut self.settled.nearest_miss;
        if nearest
            .as_ref()
            .is_none_or(|nearest| nearest.is_beaten_by(rejection, wrench_angle, attempt))
        {
            *nearest = Some(NearestMiss {
                rejection,
                attempt,
                wrench_angle,
                pose: pose(),
            });
        }
    }

    /// Notes the times of the worker's steps.
    pub(super) fn note_times(&mut self, times: Option<StepTimes>) {
        self.settled.step_times = times;
    }

    /// Adds this worker's counts to a report, attempts up to the winner only if there is one that was to be the lowest.
    pub(super) fn add_to(mut self, report: &mut SearchReport, lowest_winner: Option<u64>) {
        self.settle(lowest_winner.unwrap_or(u64::MAX));
        if lowest_winner.is_none() {
            report.pruned_placements += self.interrupted_prunes;
        }
        report.merge(self.settled, false);
    }
}
