//! What a search has found so far.

use std::sync::{Mutex, PoisonError};

use grasp_synthesis::{
    model::grasp::Grasp,
    search::{SearchEnd, SearchOutcome, SearchReport},
};

/// The sum of a search's finished slices. The searching thread adds to it; others may read it at any time.
#[derive(Debug, Default)]
pub(super) struct Progress(Mutex<Sum>);

#[derive(Clone, Debug, Default)]
struct Sum {
    report: SearchReport,
    /// The best grasp with its quality.
    best: Option<(Grasp, f32)>,
}

impl Progress {
    /// Adds a slice. True if a grasp has been found, in this slice or before.
    pub(super) fn add(&self, slice: SearchOutcome) -> bool {
        let mut sum = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_better =
            slice.grasp.is_some() && sum.best.as_ref().is_none_or(|(_, value)| slice.value > *value);
        sum.report.merge(slice.report, is_better);
        if is_better {
            sum.best = slice.grasp.map(|grasp| (grasp, slice.value));
        }
        sum.best.is_some()
    }

    /// The outcome if the search ends here. A search that was not stopped and has a grasp has found one, whatever `end`
    /// says.
    pub(super) fn outcome(&self, end: SearchEnd) -> SearchOutcome {
        let Sum { mut report, best } = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if best.is_some() {
            // The nearest miss is reported only if there is no grasp.
            report.nearest_miss = None;
        }
        SearchOutcome {
            end: match (&best, end) {
                (Some(_), SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted) => SearchEnd::Found,
                (_, end) => end,
            },
            value: best.as_ref().map_or(0.0, |(_, value)| *value),
            grasp: best.map(|(grasp, _)| grasp),
            report,
        }
    }
}
