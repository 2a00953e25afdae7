//! What a search has found so far.

use std::{
    sync::{Mutex, PoisonError},
    time::Duration,
};

use grasp_synthesis::{
    model::{grasp::Grasp, strategy::Choice},
    search::{GraspSource, Replaceable, SearchEnd, SearchOutcome, SearchReport, settings::SearchSettings},
};

/// The hand of a part of a search: the place in its list of hands.
pub(super) type HandPlace = usize;

/// The outcome of a search with one hand, or of the better of both.
#[derive(Clone, Debug)]
pub(super) struct Ended {
    /// The hand of the grasp or, without one, of the nearest miss.
    pub hand: HandPlace,
    /// The outcome.
    pub outcome: SearchOutcome,
}

/// The sum of a search's finished slices. The searching thread adds to it; others may read it at any time.
#[derive(Debug, Default)]
pub(super) struct Progress(Mutex<Sum>);

#[derive(Clone, Debug, Default)]
struct Sum {
    report: SearchReport,
    best: Option<Best>,
    /// Until when a best grasp that a person would not choose may be replaced.
    replaceable_until: Option<Replaceable>,
    /// The hand of the nearest miss.
    missing_hand: HandPlace,
    /// The first attempt that has not run.
    next: u64,
    /// Must the answer not depend on the time that was left?
    is_reproducible: bool,
    /// Whether the best is wanted.
    compares_all: bool,
}

/// The best grasp so far.
#[derive(Clone, Debug)]
struct Best {
    grasp: Grasp,
    /// Its quality.
    value: f32,
    hand: HandPlace,
    source: Option<GraspSource>,
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

    /// True if a slice's grasp is preferred to the best so far: a preferred grip to all others; one that a person would choose
    /// to others; unless the best is wanted, a grip of one hand's atlas to a learned one of the other; then the one with
    /// the lower attempt, if the search is reproducible and both have one; then the better one.
    fn prefers(&self, slice: &SearchOutcome) -> bool {
        let Some(best) = &self.best else { return true };
        let are_chosen = [&self.replaceable_until, &slice.replaceable_until].map(Option::is_none);
        match (are_chosen, best.source, slice.report.source) {
            (_, Some(best), Some(new)) if best.is_preferred() != new.is_preferred() => new.is_preferred(),
            ([false, true], ..) => true,
            ([true, false], ..) => false,
            (_, Some(best), Some(new)) if !self.compares_all && best.is_learned() != new.is_learned() => {
                best.is_learned()
            }
            ([true, true], Some(GraspSource::Attempt(best)), Some(GraspSource::Attempt(new)))
                if self.is_reproducible =>
            {
                new < best
            }
            _ => slice.value > best.value,
        }
    }
}

impl Progress {
    /// Adds a slice of one hand, which `settings` describe.
    pub(super) fn add(&self, slice: SearchOutcome, settings: &SearchSettings, hand: HandPlace) -> Found {
        let run = &settings.run;
        let mut sum = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        sum.next = run.first_attempt.saturating_add(run.max_attempts);
        sum.is_reproducible = run.reproducible;
        sum.compares_all = settings.query.choice == Choice::BestWithinBudget;
        let is_better = slice.grasp.is_some() && sum.prefers(&slice);
        let replaces = sum.replaceable_until.is_some() && slice.replaceable_until.is_none();
        let source = slice.report.source;
        let missed = sum.report.nearest_miss.clone();
        sum.report.merge(slice.report, is_better);
        if sum.report.nearest_miss != missed {
            sum.missing_hand = hand;
        }
        if is_better {
            let is_first = sum.best.is_none();
            sum.best = slice.grasp.map(|grasp| Best {
                grasp,
                value: slice.value,
                hand,
                source,
            });
            // The first one decides for how long, unless a later one needs less.
            if replaces || is_first {
                sum.replaceable_until = slice.replaceable_until;
            }
        }
        if let (Some(until), Some(earlier)) = (&mut sum.replaceable_until, slice.replaceable_until) {
            *until = until.earlier(earlier);
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
    pub(super) fn outcome(&self, end: SearchEnd) -> Ended {
        let mut sum = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if sum.is_reproducible && end == SearchEnd::DeadlinePassed && sum.replacing_attempts() > 0 {
            sum.best = None;
        }
        let Sum {
            mut report,
            best,
            replaceable_until,
            missing_hand,
            is_reproducible,
            ..
        } = sum;
        if is_reproducible {
            // How many others were found by then depends on the slices.
            report.candidates = u64::from(best.is_some());
        }
        if best.is_some() {
            // The nearest miss is reported only if there is no grasp.
            report.nearest_miss = None;
        } else {
            report.source = None;
        }
        let hand = best.as_ref().map_or(missing_hand, |best| best.hand);
        let outcome = SearchOutcome {
            end: match (&best, end) {
                (Some(_), SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted) => SearchEnd::Found,
                (None, SearchEnd::Found) => SearchEnd::DeadlinePassed,
                (_, end) => end,
            },
            value: best.as_ref().map_or(0.0, |best| best.value),
            replaceable_until: replaceable_until.filter(|_| best.is_some()),
            grasp: best.map(|best| best.grasp),
            report,
        };
        Ended { hand, outcome }
    }
}
