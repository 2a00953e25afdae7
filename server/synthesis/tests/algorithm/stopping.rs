//! Stopping: by flag, by deadline, by panic, at the next look and without a wrong answer.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        OnceLock,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::{self, ThreadId},
    time::Duration,
};

use glam::Vec3;
use grasp_synthesis::{
    base::clock::Clock,
    model::strategy::Strategy,
    search::{SearchEnd, find_grasp, settings::SearchSettings},
};

use crate::{
    race::search,
    support::{FakeClock, bar, held, pool, rig, rod, settings, upright_bar_with_forbidden_ends},
};

/// A flag that is set before the start: nothing runs.
#[test]
fn a_set_flag_stops_before_the_first_attempt() {
    let clock = FakeClock::default();
    let settings = SearchSettings {
        workers: 2,
        ..settings(Strategy::F)
    };
    let outcome = find_grasp(
        &pool(2),
        &held(bar()),
        &rig(),
        &settings,
        &clock,
        &AtomicBool::new(true),
    );
    assert_eq!(outcome.end, SearchEnd::Stopped);
    assert_eq!(
        (outcome.report.attempts, outcome.report.pruned_placements),
        (0, 0)
    );
    assert!(outcome.grasp.is_none() && outcome.report.nearest_miss.is_none());
}

/// A clock that sets a flag, or panics, when it is looked at for the n-th time.
struct TrapClock<'a> {
    looks: AtomicU64,
    at: u64,
    stop: Option<&'a AtomicBool>,
}

impl Clock for TrapClock<'_> {
    fn now(&self) -> Duration {
        if self.looks.fetch_add(1, Ordering::SeqCst) == self.at {
            match self.stop {
                Some(stop) => stop.store(true, Ordering::SeqCst),
                None => panic!("the clock fell off the wall"),
            }
        }
        Duration::ZERO
    }
}

/// A clock that sets the pace of two workers. The one that looks first is the leader: it gets into an attempt, and only
/// then may the other one take the next. There the leader waits until the other one has looked `wait_for` times; from
/// then on it is `late`, for the leader.
struct PaceClock {
    leader: OnceLock<ThreadId>,
    looks: [AtomicU64; 2],
    wait_for: u64,
    late: Duration,
}

impl PaceClock {
    fn new(wait_for: u64, late: Duration) -> Self {
        Self {
            leader: OnceLock::new(),
            looks: Default::default(),
            wait_for,
            late,
        }
    }

    fn wait_until(&self, worker: usize, looks: u64) {
        while self.looks[worker].load(Ordering::SeqCst) < looks {
            thread::yield_now();
        }
    }
}

impl Clock for PaceClock {
    fn now(&self) -> Duration {
        let own = thread::current().id();
        let leads = *self.leader.get_or_init(|| own) == own;
        let look = self.looks[usize::from(!leads)].fetch_add(1, Ordering::SeqCst);
        match (leads, look) {
            // The leader has taken its attempt when it looks for the second time.
            (false, 0) => self.wait_until(0, 2),
            (true, 1) => self.wait_until(1, self.wait_for),
            _ => {}
        }
        if leads && look > 0 {
            self.late
        } else {
            Duration::ZERO
        }
    }
}

/// A valid attempt does not win while one before it was cut short by the deadline: that one might have been valid.
#[test]
fn an_interrupted_attempt_takes_the_win_from_those_after_it() {
    let holdout = held(bar());
    let pool = pool(2);
    let valid = search(&holdout, &settings(Strategy::F), 1);
    let valid = valid.report.attempt.expect("found");
    assert!(valid > 0);
    let alone = SearchSettings {
        first_attempt: valid,
        max_attempts: 1,
        deadline: Some(Duration::from_secs(1)),
        ..settings(Strategy::F)
    };
    let counting = FakeClock::ticking(1);
    find_grasp(
        &pool,
        &holdout,
        &rig(),
        &alone,
        &counting,
        &AtomicBool::new(false),
    );
    let both = SearchSettings {
        first_attempt: valid - 1,
        max_attempts: 2,
        workers: 2,
        ..alone
    };
    for reproducible in [true, false] {
        let settings = SearchSettings {
            reproducible,
            ..both.clone()
        };
        let clock = PaceClock::new(counting.looks(), Duration::from_secs(2));
        let outcome = find_grasp(
            &pool,
            &holdout,
            &rig(),
            &settings,
            &clock,
            &AtomicBool::new(false),
        );
        let (end, attempt) = if reproducible {
            (SearchEnd::DeadlinePassed, None)
        } else {
            (SearchEnd::Found, Some(valid))
        };
        assert_eq!((outcome.end, outcome.report.attempt), (end, attempt));
        assert_eq!(outcome.grasp.is_some(), !reproducible);
    }
}

/// However far another worker runs ahead of the winner, its attempts do not count.
#[test]
fn attempts_ahead_of_the_winner_do_not_count() {
    let holdout = held(rod());
    let ahead = 10_000;
    // A seed and a valid attempt of it that is followed by many failures.
    let next_valid = |seed, first_attempt| {
        let settings = SearchSettings {
            seed,
            first_attempt,
            ..settings(Strategy::A)
        };
        search(&holdout, &settings, 1).report.attempt
    };
    let (seed, valid) = (0..40)
        .find_map(|seed| {
            let valid = next_valid(seed, 0)?;
            (next_valid(seed, valid + 1)? > valid + ahead).then_some((seed, valid))
        })
        .expect("one of the seeds has such a gap");
    let settings = SearchSettings {
        seed,
        first_attempt: valid,
        deadline: Some(Duration::from_secs(1)),
        workers: 2,
        ..settings(Strategy::A)
    };
    // Strategy A looks once before an attempt, and once for each digit.
    let clock = PaceClock::new(6 * (ahead - 10), Duration::ZERO);
    let outcome = find_grasp(
        &pool(2),
        &holdout,
        &rig(),
        &settings,
        &clock,
        &AtomicBool::new(false),
    );
    assert_eq!(
        (outcome.end, outcome.report.attempt),
        (SearchEnd::Found, Some(valid))
    );
    assert_eq!(outcome.report.attempts, 1);
    assert!(outcome.report.rejections.iter().all(|&count| count == 0));
}

/// A flag that is set in the middle of an attempt ends it at the next look; the attempt does not count.
#[test]
fn a_flag_stops_within_an_attempt() {
    let holdout = upright_bar_with_forbidden_ends();
    // Without grasps: as many attempts as there is time for.
    let endless = SearchSettings {
        friction: 1.0,
        max_attempts: u64::MAX,
        deadline: Some(Duration::MAX),
        ..settings(Strategy::A)
    };
    for at in [1, 2, 5, 17, 100, 1001] {
        for workers in [1, 3] {
            let stop = AtomicBool::new(false);
            let clock = TrapClock {
                looks: AtomicU64::new(0),
                at,
                stop: Some(&stop),
            };
            let settings = SearchSettings {
                workers,
                ..endless.clone()
            };
            let outcome = find_grasp(&pool(workers), &holdout, &rig(), &settings, &clock, &stop);
            assert_eq!(outcome.end, SearchEnd::Stopped);
            let looks = clock.looks.into_inner();
            // Each worker looks at the flag before the clock, so at most one look of each follows.
            assert!(looks <= at + 1 + workers as u64, "{looks} looks, stopped at {at}");
            assert_eq!(
                outcome.report.rejections.iter().sum::<u64>(),
                outcome.report.attempts
            );
            // Strategy A looks once before an attempt and once for each digit.
            assert!(outcome.report.attempts <= at / 6 + 1);
        }
    }
}

/// A deadline ends the search, and a reproducible search has its grasp or none, never another one.
#[test]
fn a_deadline_leaves_the_same_grasp_or_none() {
    let holdout = held(bar());
    let whole = search(&holdout, &settings(Strategy::F), 1);
    // How many looks at the clock it takes one worker.
    let counting = FakeClock::ticking(1);
    let patient = SearchSettings {
        deadline: Some(Duration::MAX),
        ..settings(Strategy::F)
    };
    find_grasp(
        &pool(1),
        &holdout,
        &rig(),
        &patient,
        &counting,
        &AtomicBool::new(false),
    );
    let needed = counting.looks();
    let (mut found, mut missed) = (0, 0);
    for workers in [1, 2, 3] {
        let pool = pool(workers);
        for looks in (1..40).map(|step| step * needed / 20) {
            let settings = SearchSettings {
                deadline: Some(Duration::from_nanos(looks)),
                workers,
                ..settings(Strategy::F)
            };
            let clock = FakeClock::ticking(1);
            let outcome = find_grasp(
                &pool,
                &holdout,
                &rig(),
                &settings,
                &clock,
                &AtomicBool::new(false),
            );
            match outcome.end {
                SearchEnd::Found => {
                    assert_eq!((&outcome.grasp, &outcome.report), (&whole.grasp, &whole.report));
                    found += 1;
                }
                SearchEnd::DeadlinePassed => {
                    assert!(outcome.grasp.is_none() && outcome.report.attempt.is_none());
                    assert!(clock.looks() <= looks + 2 * workers as u64 + 1);
                    missed += 1;
                }
                other => panic!("ended with {other:?}"),
            }
        }
    }
    assert!(found > 5 && missed > 5, "{found} found, {missed} missed");
}

/// A holdout that no placement suits: the search stays inside its first attempt and still ends at the deadline.
#[test]
fn a_hopeless_holdout_ends_at_the_deadline() {
    let mut hopeless = rig();
    // A palm so far from the wrist that it is never near the object while the wrist is.
    hopeless.palm = Vec3::new(0.0, 0.0, 5.0);
    for workers in [1, 2] {
        let settings = SearchSettings {
            deadline: Some(Duration::from_nanos(300)),
            workers,
            ..settings(Strategy::F)
        };
        let clock = FakeClock::ticking(1);
        let stop = AtomicBool::new(false);
        let outcome = find_grasp(&pool(workers), &held(bar()), &hopeless, &settings, &clock, &stop);
        assert_eq!(outcome.end, SearchEnd::DeadlinePassed);
        assert_eq!(outcome.report.attempts, 0);
        assert!(outcome.report.pruned_placements > 1000);
        assert!(clock.looks() <= 300 + 2 * workers as u64 + 1);
    }
}

/// A panic in an attempt reaches the caller, stops the other workers and leaves the pool usable.
#[test]
fn a_panic_propagates_and_leaves_the_pool_usable() {
    let (holdout, barren) = (held(bar()), upright_bar_with_forbidden_ends());
    let endless = SearchSettings {
        friction: 1.0,
        max_attempts: u64::MAX,
        deadline: Some(Duration::MAX),
        ..settings(Strategy::F)
    };
    for workers in [1, 2, 4] {
        let pool = pool(workers);
        let stop = AtomicBool::new(false);
        let trap = TrapClock {
            looks: AtomicU64::new(0),
            at: 200,
            stop: None,
        };
        let broken = SearchSettings {
            workers,
            ..endless.clone()
        };
        let result = catch_unwind(AssertUnwindSafe(|| {
            find_grasp(&pool, &barren, &rig(), &broken, &trap, &stop)
        }));
        assert!(result.is_err());
        let clock = FakeClock::default();
        let sound = SearchSettings {
            workers,
            ..settings(Strategy::F)
        };
        let outcome = find_grasp(&pool, &holdout, &rig(), &sound, &clock, &stop);
        assert_eq!(outcome.end, SearchEnd::Found);
    }
}
