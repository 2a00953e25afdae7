//! Chooses the receiving hand: searches with left and right hand in turn, within the same budget, for the better grasp.
//!
//! Slices alternate between the hands, short ones at first, until a hand has a natural grasp. After another valid grasp, both hands
//! share the time for improving it. A search for the best grasp gives half its budget to each hand. A reproducible one runs the
//! same attempts of both, the right hand's first.

use std::time::Duration;

use grasp_synthesis::{
    model::strategy::Choice,
    search::{
        REFINING_ATTEMPTS, Replaceable, SearchEnd, SearchOutcome, scene::Task, settings::SearchSettings,
    },
};

use super::slices::{Ended, FIRST_ATTEMPTS_PER_WORKER, Found, HandPlace, Site, Slices, next_size};

/// Attempts per worker in each hand's first turn: about a millisecond. More favour the right hand, whose turn is first.
const TURN_PER_WORKER: u64 = 4;

/// The part of the time for improving a grasp in which the hand that found it goes on before the other's turn: a quarter.
const OWN_PART: u32 = 4;

/// How long the known grips of each hand are tried before the other's, if the call's own thread did not: as long as the core does
/// before fresh attempts.
const KNOWN_GRIPS_TIME: Duration = Duration::from_micros(300);

/// Searches with two hands, each with its settings, whose query and run must be the same. Right comes first. If nothing is
/// found by the deadline and `patience` ends later, the search continues until then and takes the first valid grasp. Adds to
/// the site's progress, which must be empty.
pub(super) fn search_either<'a>(
    site: Site<'a>,
    hands: [(Task<'a>, &'a SearchSettings); 2],
    patience: Duration,
) -> Ended {
    let [right, left] = hands;
    let (_, of_right) = right;
    let mut search = EitherHand {
        site,
        hands: [Slices::new(site, 0, right), Slices::new(site, 1, left)],
        deadline: of_right.run.deadline,
        undecided: Vec::new(),
        last: None,
    };
    // Both together run no more attempts than one alone.
    let attempts = of_right.run.max_attempts;
    search.hands[0].left = attempts.div_ceil(2);
    search.hands[1].left = attempts / 2;
    let end = match (of_right.query.choice, of_right.run.reproducible) {
        (Choice::FirstValid, true) => search.lowest_attempt(),
        (Choice::FirstValid, false) => search.first_valid(),
        (Choice::BestWithinBudget, _) => {
            let end = search.best();
            let is_found = site.progress.outcome(end).outcome.grasp.is_some();
            if !is_found && end == SearchEnd::DeadlinePassed && search.deadline < Some(patience) {
                search.deadline = Some(patience);
                for slices in &mut search.hands {
                    slices.next.query.choice = Choice::FirstValid;
                    // If the search waited for workers until its deadline, it has not tried known grips yet.
                    slices.restore_known();
                }
                search.first_valid()
            } else {
                end
            }
        }
    };
    site.progress.outcome(end)
}

struct EitherHand<'a> {
    site: Site<'a>,
    hands: [Slices<'a>; 2],
    deadline: Option<Duration>,
    /// Slices of a reproducible search with valid grasps that the attempts still to run may replace, with their settings.
    undecided: Vec<(SearchOutcome, SearchSettings, HandPlace)>,
    /// The last attempt that may replace them.
    last: Option<u64>,
}

impl EitherHand<'_> {
    /// Looks for a first valid grasp in turns, and a little longer for a natural one.
    fn first_valid(&mut self) -> SearchEnd {
        let site = self.site;
        let mut improves_until = match self.known_grip() {
            Found::Settled => return SearchEnd::Found,
            Found::Replaceable { by, .. } => by,
            Found::Nothing => None,
        };
        let refinement = self.hands[0].next.query.refinement;
        let own = refinement / OWN_PART;
        for slices in &mut self.hands {
            slices.next.query.refinement = own;
            slices.per_worker = TURN_PER_WORKER;
        }
        for place in [0, 1].into_iter().cycle() {
            let slices = &mut self.hands[place];
            if slices.left == 0 {
                if self.hands.iter().all(|slices| slices.left == 0) {
                    return SearchEnd::AttemptsExhausted;
                }
                continue;
            }
            slices.next.run.deadline = [self.deadline, improves_until].into_iter().flatten().min();
            if improves_until.is_some() {
                slices.per_worker = TURN_PER_WORKER;
            }
            let (end, found) = slices.step();
            if end == SearchEnd::Stopped {
                return SearchEnd::Stopped;
            }
            match found {
                Found::Settled => return SearchEnd::Found,
                Found::Replaceable { by: Some(by), .. } => {
                    let by = by.saturating_sub(own).saturating_add(refinement);
                    improves_until = Some(improves_until.map_or(by, |until| until.min(by)));
                }
                Found::Replaceable { by: None, .. } | Found::Nothing => {}
            }
            if site.has_passed(self.deadline) || site.has_passed(improves_until) {
                return SearchEnd::DeadlinePassed;
            }
        }
        SearchEnd::AttemptsExhausted
    }

    /// Looks for valid known grips of both hands, unless that was done before.
    fn known_grip(&mut self) -> Found {
        let site = self.site;
        let mut best = Found::Nothing;
        for slices in &mut self.hands {
            let known = &slices.next.known;
            if known.tried > 0 || known.is_empty() {
                continue;
            }
            let until = site.clock.now().saturating_add(KNOWN_GRIPS_TIME);
            slices.next.run.deadline = [self.deadline, Some(until)].into_iter().flatten().min();
            let outcome = slices.run(0);
            let is_valid = outcome.grasp.is_some();
            // The sum of both hands.
            best = slices.add(outcome);
            if !is_valid {
                slices.restore_known();
            }
        }
        best
    }

    /// Looks for the best grasp, for half the time with each hand.
    fn best(&mut self) -> SearchEnd {
        let site = self.site;
        let start = site.clock.now();
        let half = |deadline: Duration| start.saturating_add(deadline.saturating_sub(start) / 2);
        let mut end = SearchEnd::AttemptsExhausted;
        let deadlines = [self.deadline.map(half), self.deadline];
        for (slices, deadline) in self.hands.iter_mut().zip(deadlines) {
            slices.next.run.deadline = deadline;
            end = SearchEnd::AttemptsExhausted;
            while slices.left > 0 {
                end = slices.step().0;
                if end == SearchEnd::Stopped {
                    return SearchEnd::Stopped;
                }
                if end == SearchEnd::DeadlinePassed || site.has_passed(deadline) {
                    end = SearchEnd::DeadlinePassed;
                    break;
                }
            }
        }
        end
    }

    /// Looks for the valid attempt with the lowest index, or a more natural one soon after it: the same attempts of both hands
    /// decide, whatever the number of workers and the time.
    fn lowest_attempt(&mut self) -> SearchEnd {
        let site = self.site;
        for slices in &mut self.hands {
            slices.next.run.deadline = self.deadline;
        }
        // Known grips precede all attempts.
        if let Some(end) = self.round(0) {
            return self.settle(end);
        }
        // Longer rounds would run attempts beyond those that may replace the first valid one.
        let prefers = self.hands[0].next.query.uses_known_grips();
        let workers = self.hands[0].next.run.workers as u64;
        let mut per_worker = FIRST_ATTEMPTS_PER_WORKER;
        loop {
            let start = site.clock.now();
            let first = self.hands[0].next.run.first_attempt;
            let attempts = match self.last {
                Some(last) => last.saturating_add(1).saturating_sub(first),
                None if prefers => REFINING_ATTEMPTS,
                None => per_worker.saturating_mul(workers),
            };
            if let Some(end) = self.round(attempts) {
                return self.settle(end);
            }
            per_worker = next_size(per_worker, site.clock.now().saturating_sub(start));
        }
    }

    /// Adds the undecided slices to the site's progress, without their grasps if the search was cut short: another one might have won.
    fn settle(&mut self, end: SearchEnd) -> SearchEnd {
        let is_cut = matches!(end, SearchEnd::DeadlinePassed | SearchEnd::Stopped);
        for (mut outcome, settings, hand) in self.undecided.drain(..) {
            if is_cut {
                outcome.grasp = None;
                outcome.replaceable_until = None;
            }
            self.site.progress.add(outcome, &settings, hand);
        }
        end
    }

    /// Runs the next attempts of both hands, 0 for the known grips. The end, if they decide the search or end it.
    fn round(&mut self, attempts: u64) -> Option<SearchEnd> {
        let was_last = self.last.is_some();
        let mut is_chosen = false;
        let mut attempts_of_left = attempts;
        for place in [0, 1] {
            let slices = &mut self.hands[place];
            let attempts = if place == 0 { attempts } else { attempts_of_left };
            let first = slices.next.run.first_attempt;
            let outcome = slices.run(attempts);
            match outcome.end {
                end @ (SearchEnd::Stopped | SearchEnd::Aborted) => return Some(end),
                SearchEnd::DeadlinePassed => {
                    slices.add(outcome);
                    return Some(SearchEnd::DeadlinePassed);
                }
                SearchEnd::AttemptsExhausted => {
                    slices.add(outcome);
                }
                SearchEnd::Found => {
                    match (outcome.replaceable_until, outcome.report.attempt()) {
                        (Some(Replaceable::UntilAttempt(last)), _) => {
                            self.last = Some(self.last.map_or(last, |known| known.min(last)));
                        }
                        (_, attempt) => {
                            is_chosen = true;
                            // Only an earlier one of the left hand is preferred to one of the right.
                            if let Some(attempt) = attempt {
                                attempts_of_left = attempts_of_left.min(attempt - first);
                            }
                        }
                    }
                    self.undecided.push((outcome, slices.next.clone(), place));
                    slices.advance();
                }
            }
        }
        let is_exhausted = attempts > 0 && self.hands.iter().all(|slices| slices.left == 0);
        if is_chosen || was_last {
            Some(SearchEnd::Found)
        } else {
            is_exhausted.then_some(SearchEnd::AttemptsExhausted)
        }
    }
}

#[cfg(test)]
mod tests;
