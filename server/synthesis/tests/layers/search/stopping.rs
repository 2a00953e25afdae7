//! Stopping: by flag, by deadline or by panic, at the next reading and without a wrong answer.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        OnceLock,
        atomic::{AtomicBool, AtomicU64},
    },
    thread::{self, ThreadId},
};

use crate::prelude::*;

#[test]
fn a_flag_set_before_the_start_stops_before_the_first_attempt() {
    let holdout = held(bar());
    let search = thesis(&holdout, Strategy::F).workers(2);
    let outcome = search.run_with(&pool(2), &FakeClock::default(), &AtomicBool::new(true));
    assert_eq!(outcome.end, SearchEnd::Stopped);
    assert_eq!(
        (outcome.report.attempts, outcome.report.pruned_placements),
        (0, 0)
    );
    assert!(outcome.grasp.is_none() && outcome.report.nearest_miss.is_none());
}

/// A clock that sets a flag, or panics, on one of its readings.
struct TrapClock<'a> {
    readings: AtomicU64,
    at: u64,
    stop: Option<&'a AtomicBool>,
}

impl Clock for TrapClock<'_> {
    fn now(&self) -> Duration {
        if self.readings.fetch_add(1, Ordering::SeqCst) == self.at {
            match self.stop {
                Some(stop) => stop.store(true, Ordering::SeqCst),
                None => panic!("the clock is broken"),
            }
        }
        Duration::ZERO
    }
}

/// A clock that paces two workers. The first to read it is the leader: it enters an attempt, and only then may the
/// follower take the next one. There the leader waits until the follower has read the clock `wait_for` times; from then
/// on the leader reads `late`.
struct PaceClock {
    leader: OnceLock<ThreadId>,
    readings: [AtomicU64; 2],
    wait_for: u64,
    late: Duration,
}

impl PaceClock {
    fn new(wait_for: u64, late: Duration) -> Self {
        Self {
            leader: OnceLock::new(),
            readings: Default::default(),
            wait_for,
            late,
        }
    }

    fn wait_until(&self, worker: usize, readings: u64) {
        while self.readings[worker].load(Ordering::SeqCst) < readings {
            thread::yield_now();
        }
    }
}

impl Clock for PaceClock {
    fn now(&self) -> Duration {
        let own = thread::current().id();
        let leads = *self.leader.get_or_init(|| own) == own;
        let reading = self.readings[usize::from(!leads)].fetch_add(1, Ordering::SeqCst);
        match (leads, reading) {
            // The leader has taken its attempt by its second reading.
            (false, 0) => self.wait_until(0, 2),
            (true, 1) => self.wait_until(1, self.wait_for),
            _ => {}
        }
        if leads && reading > 0 {
            self.late
        } else {
            Duration::ZERO
        }
    }
}

/// The attempt that the deadline cut short might have been valid.
#[test]
fn a_valid_attempt_does_not_win_after_an_interrupted_earlier_one() {
    let holdout = held(bar());
    let pool = pool(2);
    let valid = thesis(&holdout, Strategy::F).run();
    let valid = valid.report.attempt.expect("found");
    assert!(valid > 0);
    let alone = thesis(&holdout, Strategy::F)
        .first_attempt(valid)
        .max_attempts(1)
        .deadline(Duration::from_secs(1));
    let counting = FakeClock::ticking(1);
    alone.run_under(&pool, &counting);
    let both = alone.first_attempt(valid - 1).max_attempts(2).workers(2);
    for reproducible in [true, false] {
        let search = both.clone().reproducible(reproducible);
        let clock = PaceClock::new(counting.readings(), Duration::from_secs(2));
        let outcome = search.run_under(&pool, &clock);
        let (end, attempt) = if reproducible {
            (SearchEnd::DeadlinePassed, None)
        } else {
            (SearchEnd::Found, Some(valid))
        };
        assert_eq!((outcome.end, outcome.report.attempt), (end, attempt));
        assert_eq!(outcome.grasp.is_some(), !reproducible);
    }
}

#[test]
fn attempts_ahead_of_the_winner_do_not_count() {
    let holdout = held(rod());
    let ahead = 10_000;
    // A seed with a valid attempt that many failures follow.
    let next_valid = |seed, first_attempt| {
        let search = thesis(&holdout, Strategy::A).seed(seed);
        search.first_attempt(first_attempt).run().report.attempt
    };
    let (seed, valid) = (0..40)
        .find_map(|seed| {
            let valid = next_valid(seed, 0)?;
            (next_valid(seed, valid + 1)? > valid + ahead).then_some((seed, valid))
        })
        .expect("one of the seeds has such a gap");
    let search = thesis(&holdout, Strategy::A)
        .seed(seed)
        .first_attempt(valid)
        .deadline(Duration::from_secs(1))
        .workers(2);
    // Strategy A reads the clock once before an attempt, and once per digit.
    let clock = PaceClock::new(6 * (ahead - 10), Duration::ZERO);
    let outcome = search.run_under(&pool(2), &clock);
    assert_eq!(
        (outcome.end, outcome.report.attempt),
        (SearchEnd::Found, Some(valid))
    );
    assert_eq!(outcome.report.attempts, 1);
    assert!(outcome.report.rejections.iter().all(|&count| count == 0));
}

#[test]
fn a_flag_stops_within_an_attempt_that_then_does_not_count() {
    let holdout = upright_bar_with_forbidden_ends();
    // There is no grasp to find: attempts go on until the flag is set.
    let endless = thesis(&holdout, Strategy::A)
        .friction(1.0)
        .max_attempts(u64::MAX)
        .deadline(Duration::MAX);
    for at in [1, 2, 5, 17, 100, 1001] {
        for workers in [1, 3] {
            let stop = AtomicBool::new(false);
            let clock = TrapClock {
                readings: AtomicU64::new(0),
                at,
                stop: Some(&stop),
            };
            let search = endless.clone().workers(workers);
            let outcome = search.run_with(&pool(workers), &clock, &stop);
            assert_eq!(outcome.end, SearchEnd::Stopped);
            let readings = clock.readings.into_inner();
            // Each worker checks the flag before it reads the clock, so no worker reads it more than once afterwards.
            assert!(readings <= at + 1 + workers as u64, "{readings} {at}");
            assert_eq!(
                outcome.report.rejections.iter().sum::<u64>(),
                outcome.report.attempts
            );
            // Strategy A reads the clock once before an attempt and once per digit.
            assert!(outcome.report.attempts <= at / 6 + 1);
        }
    }
}

#[test]
fn a_deadline_leaves_a_reproducible_search_its_grasp_or_none() {
    let holdout = held(bar());
    let whole = thesis(&holdout, Strategy::F).run();
    // How often one worker reads the clock.
    let counting = FakeClock::ticking(1);
    let patient = thesis(&holdout, Strategy::F).deadline(Duration::MAX);
    patient.run_under(&pool(1), &counting);
    let needed = counting.readings();
    let (mut found, mut missed) = (0, 0);
    for workers in [1, 2, 3] {
        let pool = pool(workers);
        for readings in (1..40).map(|step| step * needed / 20) {
            let search = thesis(&holdout, Strategy::F)
                .deadline(Duration::from_nanos(readings))
                .workers(workers);
            let clock = FakeClock::ticking(1);
            let outcome = search.run_under(&pool, &clock);
            match outcome.end {
                SearchEnd::Found => {
                    assert_eq!((&outcome.grasp, &outcome.report), (&whole.grasp, &whole.report));
                    found += 1;
                }
                SearchEnd::DeadlinePassed => {
                    assert!(outcome.grasp.is_none() && outcome.report.attempt.is_none());
                    assert!(clock.readings() <= readings + 2 * workers as u64 + 1);
                    missed += 1;
                }
                other => panic!("ended with {other:?}"),
            }
        }
    }
    assert!(found > 5 && missed > 5, "{found} found, {missed} missed");
}

/// No placement suits: the search stays inside its first attempt and still ends at the deadline.
#[test]
fn a_hopeless_holdout_ends_at_the_deadline() {
    // A palm so far from the wrist that it is never near the object while the wrist is.
    let hopeless = PreparedRig::new(Rig {
        palm: Vec3::new(0.0, 0.0, 5.0),
        ..Rig::clone(simple_rig())
    });
    let holdout = held(bar());
    for workers in [1, 2] {
        let search = thesis(&holdout, Strategy::F)
            .rig(&hopeless)
            .deadline(Duration::from_nanos(300))
            .workers(workers);
        let clock = FakeClock::ticking(1);
        let outcome = search.run_under(&pool(workers), &clock);
        assert_eq!(outcome.end, SearchEnd::DeadlinePassed);
        assert_eq!(outcome.report.attempts, 0);
        assert!(outcome.report.pruned_placements > 1000);
        assert!(clock.readings() <= 300 + 2 * workers as u64 + 1);
    }
}

#[test]
fn a_panic_reaches_the_caller_and_leaves_the_pool_usable() {
    let (holdout, barren) = (held(bar()), upright_bar_with_forbidden_ends());
    let endless = thesis(&barren, Strategy::F)
        .friction(1.0)
        .max_attempts(u64::MAX)
        .deadline(Duration::MAX);
    for workers in [1, 2, 4] {
        let pool = pool(workers);
        let stop = AtomicBool::new(false);
        let trap = TrapClock {
            readings: AtomicU64::new(0),
            at: 200,
            stop: None,
        };
        let broken = endless.clone().workers(workers);
        let result = catch_unwind(AssertUnwindSafe(|| broken.run_with(&pool, &trap, &stop)));
        assert!(result.is_err());
        let sound = thesis(&holdout, Strategy::F).workers(workers);
        let outcome = sound.run_with(&pool, &FakeClock::default(), &stop);
        assert_eq!(outcome.end, SearchEnd::Found);
    }
}
