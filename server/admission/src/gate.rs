//! The gate before the workers: jobs are admitted, take turns and end.

use std::{
    collections::HashMap,
    sync::Arc,
    time::{Duration, Instant},
};

use crate::{
    Client,
    sync::{AtomicBool, Condvar, Mutex, Ordering, locked},
    turns::{Cost, Ticket, Turns},
};

/// Admits jobs, and gives each its turns.
#[derive(Debug)]
pub struct Gate<C: Client>(Arc<Mutex<State<C>>>);

impl<C: Client> Clone for Gate<C> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

#[derive(Debug)]
struct State<C> {
    turns: Turns<C>,
    jobs: HashMap<u64, JobState<C>>,
}

#[derive(Debug)]
struct JobState<C> {
    ticket: Ticket<C>,
    /// Where its thread waits for a turn.
    news: Arc<Condvar>,
    is_done: bool,
    /// When its turn began, if it has one.
    turn_since: Option<Instant>,
    cost: Duration,
}

impl<C: Client> JobState<C> {
    fn end_turn(&mut self, turns: &mut Turns<C>) {
        if let Some(since) = self.turn_since.take() {
            self.cost += turns.end(&self.ticket, since.elapsed());
        }
    }
}

/// A job from its admission until this is dropped.
#[derive(Debug)]
pub struct Job<C: Client> {
    gate: Gate<C>,
    number: u64,
    is_cancelled: AtomicBool,
}

/// A job that would be too late.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the job would end after {expected:?}, which is too late")]
pub struct TooLate {
    /// The time until its end.
    pub expected: Duration,
}

impl<C: Client> State<C> {
    /// Wakes the jobs that were called.
    fn wake(&self) {
        for number in self.turns.called() {
            if let Some(job) = self.jobs.get(&number) {
                job.news.notify_one();
            }
        }
    }
}

impl<C: Client> Gate<C> {
    /// A gate to workers that take so many jobs at once.
    pub fn new(turns: usize) -> Self {
        Self(Arc::new(Mutex::new(State {
            turns: Turns::new(turns),
            jobs: HashMap::new(),
        })))
    }

    /// Admits a job of a client that has to end when it is due, by the costs of recent jobs and by those admitted before.
    ///
    /// # Errors
    /// [`TooLate`].
    pub fn admit(&self, client: C, now: Instant, due: Instant) -> Result<Job<C>, TooLate> {
        let mut state = locked(&self.0);
        let expected = state.turns.expected(&client, due);
        if !expected.is_zero() && now + expected > due {
            return Err(TooLate { expected });
        }
        let ticket = state.turns.open(client, due);
        let number = ticket.number();
        let job = JobState {
            ticket,
            news: Arc::new(Condvar::new()),
            is_done: false,
            turn_since: None,
            cost: Duration::ZERO,
        };
        state.jobs.insert(number, job);
        Ok(Job {
            gate: self.clone(),
            number,
            is_cancelled: AtomicBool::new(false),
        })
    }
}

impl<C: Client> Job<C> {
    /// Sets when it has to end, and whether it `yields`: others do not wait for a job that goes on as long as there is time. Before its
    /// first turn.
    pub fn set_due(&self, due: Instant, yields: bool) {
        let mut state = locked(&self.gate.0);
        let State { turns, jobs } = &mut *state;
        if let Some(job) = jobs.get_mut(&self.number) {
            turns.set_due(&mut job.ticket, due, !yields);
        }
    }

    /// Waits for its next turn on this thread, for no longer than `longest`. The one that it has ends, but it keeps the workers if nobody
    /// comes before it. False if there was none in time, or once it is cancelled or due.
    pub fn next_turn(&self, longest: Option<Duration>) -> bool {
        let latest = longest.map(|longest| Instant::now() + longest);
        let mut state = locked(&self.gate.0);
        let state_of_gate = &mut *state;
        let Some(job) = state_of_gate.jobs.get_mut(&self.number) else {
            return false;
        };
        let (ticket, news) = (job.ticket.clone(), Arc::clone(&job.news));
        state_of_gate.turns.wait(&ticket);
        job.end_turn(&mut state_of_gate.turns);
        state.wake();
        loop {
            let now = Instant::now();
            let latest = latest.map_or(ticket.due(), |latest| latest.min(ticket.due()));
            let left = latest.saturating_duration_since(now);
            if self.is_cancelled() || left.is_zero() {
                state.turns.leave(&ticket);
                state.wake();
                return false;
            }
            if state.turns.begin(&ticket) {
                if let Some(job) = state.jobs.get_mut(&self.number) {
                    job.turn_since = Some(now);
                }
                return true;
            }
            let waited = news.wait_timeout(state, left);
            (state, _) = waited.unwrap_or_else(std::sync::PoisonError::into_inner);
        }
    }

    /// Ends its turn, if it has one.
    pub fn end_turn(&self) {
        let mut state = locked(&self.gate.0);
        let State { turns, jobs } = &mut *state;
        if let Some(job) = jobs.get_mut(&self.number) {
            job.end_turn(turns);
        }
        state.wake();
    }

    /// Ends its wait for a turn, and gives it no other one.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Release);
        // A thread that is about to wait holds the lock until it waits.
        if let Some(job) = locked(&self.gate.0).jobs.get(&self.number) {
            job.news.notify_one();
        }
    }

    /// True if it was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Acquire)
    }

    /// Lets its cost count for the expectation of others.
    pub fn done(&self) {
        if let Some(job) = locked(&self.gate.0).jobs.get_mut(&self.number) {
            job.is_done = true;
        }
    }
}

impl<C: Client> Drop for Job<C> {
    fn drop(&mut self) {
        let mut state = locked(&self.gate.0);
        let State { turns, jobs } = &mut *state;
        if let Some(mut job) = jobs.remove(&self.number) {
            job.end_turn(turns);
            let cost = match (job.ticket.due() <= Instant::now(), job.is_done) {
                (true, _) => Cost::AtLeast(job.cost),
                (false, true) => Cost::Whole(job.cost),
                (false, false) => Cost::Unknown,
            };
            turns.close(&job.ticket, cost);
        }
        state.wake();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[cfg(shuttle)]
    use shuttle::{sync::atomic::AtomicUsize, thread};
    #[cfg(not(shuttle))]
    use std::{sync::atomic::AtomicUsize, thread};

    const FAR: Duration = Duration::from_hours(1);

    /// Jobs take turns on threads of their own, and one is cancelled: no more run than there are turns, each ends, nothing is left.
    fn jobs_take_turns() {
        let gate = Gate::new(2);
        let running = Arc::new(AtomicUsize::new(0));
        let now = Instant::now();
        let threads: Vec<_> = (0..5_u64)
            .flat_map(|number| {
                let job = Arc::new(gate.admit(number % 2, now, now + FAR).expect("it has time"));
                let (cancelled, running) = (Arc::clone(&job), Arc::clone(&running));
                let work = thread::spawn(move || {
                    for _ in 0..2 {
                        if !job.next_turn(None) {
                            break;
                        }
                        assert!(running.fetch_add(1, Ordering::SeqCst) < 2);
                        thread::yield_now();
                        running.fetch_sub(1, Ordering::SeqCst);
                    }
                    job.done();
                });
                let cancel = (number == 4).then(|| thread::spawn(move || cancelled.cancel()));
                [Some(work), cancel]
            })
            .flatten()
            .collect();
        for thread in threads {
            thread.join().expect("it does not panic");
        }
        let state = locked(&gate.0);
        assert!(state.turns.is_idle() && state.jobs.is_empty());
    }

    #[cfg(not(shuttle))]
    #[test]
    fn jobs_take_turns_and_leave_nothing_behind() {
        for _ in 0..200 {
            jobs_take_turns();
        }
    }

    /// Prints the schedule of a failure, for `shuttle::replay`.
    #[cfg(shuttle)]
    #[test]
    fn jobs_take_turns_in_every_order() {
        let all = std::env::var("GRASP_TEST_CASES").is_ok_and(|cases| cases == "all");
        let orders = if all { 50_000 } else { 5_000 };
        shuttle::check_random(jobs_take_turns, orders);
        shuttle::check_pct(jobs_take_turns, orders, 3);
    }

    #[cfg(not(shuttle))]
    #[test]
    fn a_job_that_would_be_too_late_is_refused() {
        let gate = Gate::new(1);
        let now = Instant::now();
        for _ in 0..100 {
            let job = gate.admit("a", now, now + FAR).unwrap();
            assert!(job.next_turn(None));
            thread::sleep(Duration::from_millis(1));
            job.end_turn();
            job.done();
        }
        let at_once = gate.admit("a", now, now).unwrap();
        let late = gate.admit("a", now, now + Duration::from_millis(1)).unwrap_err();
        assert!(late.expected > Duration::from_millis(1));
        drop(at_once);
        assert!(gate.admit("a", now, now).is_ok());
    }
}
