//! The race: the same answer for any number of workers, and a true report.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        OnceLock,
        atomic::{AtomicBool, AtomicU64},
    },
    thread,
};

use crate::prelude::*;

/// FNV-1a over every bit of a search's answer.
fn hash(outcome: &SearchOutcome) -> u64 {
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    let mut add = |bits: u64| {
        for byte in bits.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
        }
    };
    let report = &outcome.report;
    add(report.attempts);
    add(report.pruned_placements);
    // The golden hash covers only the kinds of the thesis' Table 5.2.
    for rejection in Rejection::THESIS {
        add(report.rejections[rejection.index()]);
    }
    add(report.attempt().unwrap_or(u64::MAX));
    if let Some(grasp) = &outcome.grasp {
        let wrist = grasp.pose.frame_from_wrist;
        let mut numbers = vec![grasp.wrench_angle, grasp.comfort];
        numbers.extend(wrist.position.to_array());
        numbers.extend(wrist.orientation.to_array());
        for digit in &grasp.pose.digits {
            let pitches = [digit.base_pitch, digit.second_pitch, digit.third_pitch];
            numbers.push(digit.base_yaw);
            numbers.extend(pitches);
        }
        numbers.extend(grasp.bend_ratios.map(|ratio| ratio.unwrap_or(-1.0)));
        for contact in &grasp.contacts {
            numbers.extend(contact.position.to_array());
            numbers.extend(contact.normal.to_array());
        }
        numbers.extend(grasp.forces.iter().flat_map(Vec3::to_array));
        for number in numbers {
            add(u64::from(number.to_bits()));
        }
        for contact in &grasp.contacts {
            add(u64::from(contact.triangle));
            add(match contact.part {
                HandPart::Phalanx(digit, phalanx) => (digit.index() * 3 + phalanx.index()) as u64,
                HandPart::Palm => 15,
            });
        }
    }
    hash
}

/// The search has the same outcome for numbers of workers and threads.
fn assert_same(search: &Search<'_>, one: &SearchOutcome, pools: &[(usize, usize)]) {
    for &(workers, threads) in pools {
        let many = search.clone().workers(workers).run_on(&pool(threads));
        assert_eq!(
            (many.end, &many.grasp, &many.report),
            (one.end, &one.grasp, &one.report)
        );
    }
}

/// The answers of the searches in [`reproducible_searches_match_for_any_number_of_workers`], bit for bit. Any change of a draw
/// or a rounding changes it.
const GOLDEN: u64 = 0x1594_CA74_F345_7B4E;

#[test]
fn reproducible_searches_match_for_any_number_of_workers() {
    let mut hashes = Vec::new();
    for (holdout, strategy) in [
        (held(bar()), Strategy::F),
        (held(rod()), Strategy::E),
        (floating(plate()), Strategy::B),
    ] {
        let search = thesis(&holdout, strategy);
        let one = search.run();
        assert_eq!(one.end, SearchEnd::Found);
        assert_same(&search, &one, &[(2, 1), (2, 2), (4, 4), (7, 3)]);
        hashes.push(hash(&one));
    }
    let combined = hashes.iter().fold(0_u64, |sum, hash| sum.rotate_left(21) ^ hash);
    assert_eq!(combined, GOLDEN, "{combined:#x}");
}

#[test]
fn exhausted_searches_match_for_any_number_of_workers_and_report_the_nearest_miss() {
    let holdout = upright_bar_with_forbidden_ends();
    // With μ = 1 the printed cone has closed to the normal.
    let search = thesis(&holdout, Strategy::F).friction(1.0).max_attempts(3000);
    let one = search.run();
    assert_eq!(one.end, SearchEnd::AttemptsExhausted);
    assert_eq!(
        (one.report.attempts, one.report.attempt(), &one.grasp),
        (3000, None, &None)
    );
    let miss = one.report.nearest_miss.clone().expect("an attempt failed");
    assert_eq!(miss.rejection, Rejection::NotImmobilizing);
    assert_same(&search, &one, &[(2, 2), (4, 2), (7, 3)]);
    // Run one by one, no attempt that gets as far has a smaller angle.
    let pool = pool(1);
    let lowest = (0..3000)
        .filter_map(|index| {
            let alone = search.clone().first_attempt(index).max_attempts(1);
            let miss = alone.run_on(&pool).report.nearest_miss.expect("it failed");
            assert_eq!(miss.attempt, index);
            miss.wrench_angle.map(|angle| (angle, index))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    assert_eq!(lowest, miss.wrench_angle.map(|angle| (angle, miss.attempt)));
}

/// The winner comes late enough that workers merge their counts on the way.
#[test]
fn late_winners_match_for_any_number_of_workers() {
    let holdout = held(rod());
    let (seed, one) = (0..40)
        .find_map(|seed| {
            let search = thesis(&holdout, Strategy::A).seed(seed);
            let outcome = search.run();
            (outcome.report.attempt()? > 15_000).then_some((seed, outcome))
        })
        .expect("one of the seeds takes long");
    assert_eq!(one.report.attempts, one.report.attempt().expect("found") + 1);
    let search = thesis(&holdout, Strategy::A).seed(seed);
    assert_same(&search, &one, &[(2, 2), (3, 2), (4, 4)]);
}

/// Called from a thread of its own pool, even of a pool of one, a search does not wait for itself.
#[test]
fn starts_inside_its_own_pool_without_deadlock() {
    let holdout = held(bar());
    let outside = thesis(&holdout, Strategy::F).run();
    for threads in [1, 2] {
        let pool = pool(threads);
        let search = thesis(&holdout, Strategy::F).workers(2);
        let inside = pool.install(|| search.run_on(&pool));
        assert_eq!((&inside.grasp, &inside.report), (&outside.grasp, &outside.report));
    }
}

#[test]
fn step_times_add_up_on_request_and_change_nothing_else() {
    let holdout = held(bar());
    let plain = thesis(&holdout, Strategy::F).run();
    assert_eq!(plain.report.step_times, None);
    let timed = thesis(&holdout, Strategy::F).record_step_times(true);
    let clock = FakeClock::ticking(1);
    let outcome = timed.run_under(&pool(1), &clock);
    assert_eq!(outcome.grasp, plain.grasp);
    let times = outcome.report.step_times.expect("requested");
    // The clock advances by a nanosecond per reading, and without a deadline only the stopwatch reads it.
    let count = |kind: Rejection| outcome.report.rejections[kind.index()];
    let immobility = 1 + count(Rejection::NotImmobilizing);
    let contact = immobility + count(Rejection::UnwantedContact);
    let collision = contact + count(Rejection::PalmCollision) + count(Rejection::FingerCollision);
    let attempts = outcome.report.attempts;
    for (step, readings) in [
        (Step::WristPlacement, attempts),
        (Step::FingerPosing, attempts),
        (Step::CollisionValidation, collision),
        (Step::ContactValidation, contact),
        (Step::ImmobilityValidation, immobility),
    ] {
        assert_eq!(times[step as usize].as_nanos(), u128::from(readings), "{step:?}");
    }
}

#[test]
fn runs_no_more_attempts_than_there_are() {
    let holdout = held(bar());
    let none = thesis(&holdout, Strategy::F).max_attempts(0);
    let outcome = none.run();
    assert_eq!(
        (outcome.end, outcome.report.attempts),
        (SearchEnd::AttemptsExhausted, 0)
    );
    // The last index there is.
    let last = thesis(&holdout, Strategy::F)
        .first_attempt(u64::MAX - 1)
        .max_attempts(10);
    assert_eq!(last.run().report.attempts, 1);
}

struct ClockBy<F>(F);

impl<F: Fn() -> Duration + Sync> Clock for ClockBy<F> {
    fn now(&self) -> Duration {
        self.0()
    }
}

/// A clock that paces two workers. The first to read it is the leader: it enters an attempt, and only then may the
/// follower take the next one. There the leader waits until the follower has read the clock `wait_for` times; from then
/// on the leader reads `late`.
fn pacing(wait_for: u64, late: Duration) -> ClockBy<impl Fn() -> Duration + Sync> {
    let leader = OnceLock::new();
    let readings: [AtomicU64; 2] = Default::default();
    ClockBy(move || {
        let wait_until = |worker: usize, least: u64| {
            while readings[worker].load(Ordering::SeqCst) < least {
                thread::yield_now();
            }
        };
        let own = thread::current().id();
        let leads = *leader.get_or_init(|| own) == own;
        let reading = readings[usize::from(!leads)].fetch_add(1, Ordering::SeqCst);
        match (leads, reading) {
            // The leader has taken its attempt by its second reading.
            (false, 0) => wait_until(0, 2),
            (true, 1) => wait_until(1, wait_for),
            _ => {}
        }
        if leads && reading > 0 {
            late
        } else {
            Duration::ZERO
        }
    })
}

/// The attempt that the deadline cut short might have been valid.
#[test]
fn a_valid_attempt_does_not_win_after_an_interrupted_earlier_one() {
    let holdout = held(bar());
    let pool = pool(2);
    let valid = thesis(&holdout, Strategy::F).run();
    let valid = valid.report.attempt().expect("found");
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
        let clock = pacing(counting.readings(), Duration::from_secs(2));
        let outcome = search.run_under(&pool, &clock);
        let (end, attempt) = if reproducible {
            (SearchEnd::DeadlinePassed, None)
        } else {
            (SearchEnd::Found, Some(valid))
        };
        assert_eq!((outcome.end, outcome.report.attempt()), (end, attempt));
        assert_eq!(outcome.grasp.is_some(), !reproducible);
    }
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
            let readings = AtomicU64::new(0);
            let clock = ClockBy(|| {
                if readings.fetch_add(1, Ordering::SeqCst) == at {
                    stop.store(true, Ordering::SeqCst);
                }
                Duration::ZERO
            });
            let search = endless.clone().workers(workers);
            let outcome = search.run_with(&pool(workers), &clock, &stop);
            assert_eq!(outcome.end, SearchEnd::Stopped);
            let readings = readings.load(Ordering::SeqCst);
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
                    assert!(outcome.grasp.is_none() && outcome.report.attempt().is_none());
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
        let readings = AtomicU64::new(0);
        let trap = ClockBy(|| {
            assert!(
                readings.fetch_add(1, Ordering::SeqCst) < 200,
                "the clock is broken"
            );
            Duration::ZERO
        });
        let broken = endless.clone().workers(workers);
        let result = catch_unwind(AssertUnwindSafe(|| broken.run_with(&pool, &trap, &stop)));
        assert!(result.is_err());
        let sound = thesis(&holdout, Strategy::F).workers(workers);
        let outcome = sound.run_with(&pool, &FakeClock::default(), &stop);
        assert_eq!(outcome.end, SearchEnd::Found);
    }
}
