//! What a search has found so far.

use std::{
    sync::{Mutex, PoisonError},
    time::Duration,
};

use grasp_synthesis::{
    model::grasp::Grasp,
    search::{Replaceable, SearchEnd, SearchOutcome, SearchReport, settings::Run},
};

/// The sum of a search's finished slices. The searching thread adds to it; others may read it at any time.
#[derive(Debug, Default)]
pub(super) struct Progress(Mutex<Sum>);

#[derive(Clone, Debug, Default)]
struct Sum {
    report: SearchReport,
    /// The best grasp with its quality.
    best: Option<(Grasp, f32)>,
    /// Until when a best grasp that a person would not choose may be replaced.
    replaceable_until: Option<Replaceable>,
    /// The first attempt that has not run.
    next: u64,
    /// Must the answer not depend on the time that was left?
    is_reproducible: bool,
}

/// Whether a search has found a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// No.
    Nothing,
    /// One that one of the next attempts may replace.
    Replaceable {
        /// How many of them.
        attempts: u64,
        /// By when.
        by: Option<Duration>,
    },
    /// One that no later attempt replaces, unless the best is wanted.
    Settled,
}

impl Sum {
    /// Number of attempts left that may replace the best grasp.
    fn replacing_attempts(&self) -> u64 {
        match self.replaceable_until {
            None => 0,
            Some(Replaceable::UntilAttempt(last)) => last.saturating_add(1).saturating_sub(self.next),
            Some(Replaceable::UntilTime(_)) => u64::MAX,
        }
    }
}

impl Progress {
    /// Adds a slice, which `run` describes.
    pub(super) fn add(&self, slice: SearchOutcome, run: &Run) -> Found {
        let mut sum = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        sum.next = run.first_attempt.saturating_add(run.max_attempts);
        sum.is_reproducible = run.reproducible;
        let replaces = sum.replaceable_until.is_some() && slice.replaceable_until.is_none();
        let is_better = slice.grasp.is_some()
            && (replaces || sum.best.as_ref().is_none_or(|(_, value)| slice.value > *value));
        sum.report.merge(slice.report, is_better);
        if is_better {
            let is_first = sum.best.is_none();
            sum.best = slice.grasp.map(|grasp| (grasp, slice.value));
            // The first one decides for how long.
            if replaces || is_first {
                sum.replaceable_until = slice.replaceable_until;
            }
        }
        let by = match sum.replaceable_until {
            Some(Replaceable::UntilTime(by)) => Some(by),
            _ => None,
        };
        match (&sum.best, sum.replacing_attempts()) {
            (None, _) => Found::Nothing,
            (Some(_), 0) => Found::Settled,
            (Some(_), attempts) => Found::Replaceable { attempts, by },
        }
    }

    /// The outcome if the search ends here. A search that was not stopped and has a grasp has found one, whatever `end`
    /// says; but not a reproducible one that ran out of time before all attempts that may replace it.
    pub(super) fn outcome(&self, end: SearchEnd) -> SearchOutcome {
        let mut sum = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if sum.is_reproducible && end == SearchEnd::DeadlinePassed && sum.replacing_attempts() > 0 {
            sum.best = None;
        }
        let Sum {
            mut report,
            best,
            replaceable_until,
            ..
        } = sum;
        if best.is_some() {
            // The nearest miss is reported only if there is no grasp.
            report.nearest_miss = None;
        } else {
            report.attempt = None;
            report.source = None;
        }
        SearchOutcome {
            end: match (&best, end) {
                (Some(_), SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted) => SearchEnd::Found,
                (None, SearchEnd::Found) => SearchEnd::DeadlinePassed,
                (_, end) => end,
            },
            value: best.as_ref().map_or(0.0, |(_, value)| *value),
            replaceable_until: replaceable_until.filter(|_| best.is_some()),
            grasp: best.map(|(grasp, _)| grasp),
            report,
        }
    }
}
