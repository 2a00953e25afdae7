//! The race: the same answer for any number of workers, a true report.

use std::sync::{OnceLock, atomic::AtomicBool};

use glam::Vec3;
use grasp_synthesis::{
    base::rejection::Rejection,
    model::{grasp::Grasp, hand::HandPart, holdout::Holdout, strategy::Strategy},
    search::{SearchEnd, SearchOutcome, find_grasp, settings::SearchSettings},
};

use crate::support::{
    FakeClock, bar, floating, held, plate, pool, rig, rod, settings, upright_bar_with_forbidden_ends,
};

pub(crate) fn search(holdout: &Holdout, settings: &SearchSettings, threads: usize) -> SearchOutcome {
    let clock = FakeClock::default();
    find_grasp(
        &pool(threads),
        holdout,
        &rig(),
        settings,
        &clock,
        &AtomicBool::new(false),
    )
}

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
    // The kinds of the thesis' Table 5.2, which were there when the golden hash was made.
    for rejection in Rejection::OF_THESIS {
        add(report.rejections[rejection.index()]);
    }
    add(report.attempt.unwrap_or(u64::MAX));
    if let Some(grasp) = &outcome.grasp {
        for number in numbers(grasp) {
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

/// Every number of a grasp.
fn numbers(grasp: &Grasp) -> Vec<f32> {
    let mut numbers = vec![grasp.wrench_angle, grasp.comfort];
    let wrist = grasp.pose.frame_from_wrist;
    numbers.extend(wrist.position.to_array());
    numbers.extend(wrist.orientation.to_array());
    for angles in &grasp.pose.digits {
        numbers.extend([
            angles.base_yaw,
            angles.base_pitch,
            angles.second_pitch,
            angles.third_pitch,
        ]);
    }
    numbers.extend(grasp.bend_ratios.map(|ratio| ratio.unwrap_or(-1.0)));
    for contact in &grasp.contacts {
        numbers.extend(contact.position.to_array());
        numbers.extend(contact.normal.to_array());
    }
    numbers.extend(grasp.forces.iter().flat_map(Vec3::to_array));
    numbers
}

/// What the searches of [`reproducible_searches_are_the_same_for_any_number_of_workers`] answer, bit for bit. It
/// changes with anything that changes a draw or a rounding.
const GOLDEN: u64 = 0x1594_CA74_F345_7B4E;

/// Grasp and report are the same for 1, 2, 4 and 7 workers, whatever the pool, and the same as ever.
#[test]
fn reproducible_searches_are_the_same_for_any_number_of_workers() {
    let mut hashes = Vec::new();
    for (holdout, strategy) in [
        (held(bar()), Strategy::F),
        (held(rod()), Strategy::E),
        (floating(plate()), Strategy::B),
    ] {
        let one = search(&holdout, &settings(strategy), 1);
        assert_eq!(one.end, SearchEnd::Found);
        for (workers, threads) in [(2, 1), (2, 2), (4, 4), (7, 3)] {
            let settings = SearchSettings {
                workers,
                ..settings(strategy)
            };
            let many = search(&holdout, &settings, threads);
            assert_eq!(
                (many.end, &many.grasp, &many.report),
                (one.end, &one.grasp, &one.report)
            );
        }
        hashes.push(hash(&one));
    }
    let combined = hashes.iter().fold(0_u64, |sum, hash| sum.rotate_left(21) ^ hash);
    assert_eq!(combined, GOLDEN, "{combined:#x}");
}

/// The same when no attempt is valid, nearest miss included.
#[test]
fn exhausted_searches_are_the_same_for_any_number_of_workers() {
    let holdout = upright_bar_with_forbidden_ends();
    // With μ = 1 the printed cone has closed to the normal.
    let settings = SearchSettings {
        friction: 1.0,
        max_attempts: 3000,
        ..settings(Strategy::F)
    };
    let one = search(&holdout, &settings, 1);
    assert_eq!(one.end, SearchEnd::AttemptsExhausted);
    assert_eq!(
        (one.report.attempts, one.report.attempt, &one.grasp),
        (3000, None, &None)
    );
    let miss = one.report.nearest_miss.clone().expect("an attempt failed");
    assert_eq!(miss.rejection, Rejection::NotImmobilizing);
    for (workers, threads) in [(2, 2), (4, 2), (7, 3)] {
        let many = search(
            &holdout,
            &SearchSettings {
                workers,
                ..settings.clone()
            },
            threads,
        );
        assert_eq!((many.end, &many.report), (one.end, &one.report));
    }
    // It is the nearest: of all attempts one by one, none that got as far has a smaller angle.
    let lowest = (0..3000)
        .filter_map(|index| {
            let alone = SearchSettings {
                first_attempt: index,
                max_attempts: 1,
                ..settings.clone()
            };
            let miss = search_alone(&holdout, &alone)
                .report
                .nearest_miss
                .expect("it failed");
            assert_eq!(miss.attempt, index);
            miss.wrench_angle.map(|angle| (angle, index))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    assert_eq!(lowest, miss.wrench_angle.map(|angle| (angle, miss.attempt)));
}

/// The same for a winner that comes after so many attempts that workers settle their counts on the way.
#[test]
fn late_winners_are_the_same_for_any_number_of_workers() {
    let holdout = held(rod());
    let (seed, one) = (0..40)
        .find_map(|seed| {
            let settings = SearchSettings {
                seed,
                ..settings(Strategy::A)
            };
            let outcome = search(&holdout, &settings, 1);
            (outcome.report.attempt? > 15_000).then_some((seed, outcome))
        })
        .expect("one of the seeds needs long");
    assert_eq!(
        one.report.attempts,
        one.report.attempt.map_or(0, |index| index + 1)
    );
    for (workers, threads) in [(2, 2), (3, 2), (4, 4)] {
        let settings = SearchSettings {
            seed,
            workers,
            ..settings(Strategy::A)
        };
        let many = search(&holdout, &settings, threads);
        assert_eq!(
            (many.end, &many.grasp, &many.report),
            (one.end, &one.grasp, &one.report)
        );
    }
}

/// A search on a pool that is shared by the calls of one test.
fn search_alone(holdout: &Holdout, settings: &SearchSettings) -> SearchOutcome {
    static POOL: OnceLock<rayon::ThreadPool> = OnceLock::new();
    let clock = FakeClock::default();
    find_grasp(
        POOL.get_or_init(|| pool(1)),
        holdout,
        &rig(),
        settings,
        &clock,
        &AtomicBool::new(false),
    )
}

/// A search without `reproducible` gives a grasp that its seed and index give again.
#[test]
fn any_grasp_can_be_replayed_by_its_index() {
    let holdout = held(bar());
    for seed in 0..6 {
        let race = SearchSettings {
            seed,
            reproducible: false,
            workers: 3,
            ..settings(Strategy::F)
        };
        let first = search(&holdout, &race, 3);
        assert_eq!(first.end, SearchEnd::Found);
        let index = first.report.attempt.expect("found");
        let replay = SearchSettings {
            first_attempt: index,
            max_attempts: 1,
            workers: 1,
            ..race
        };
        let again = search(&holdout, &replay, 1);
        assert_eq!(again.grasp, first.grasp);
        assert_eq!((again.report.attempt, again.report.attempts), (Some(index), 1));
        assert!(first.report.attempts <= first.report.attempt.unwrap_or(0) + 3 + first.report.attempts / 2);
        assert_eq!(first.report.nearest_miss, None);
    }
}

/// Called from a thread of the pool itself, also of a pool of one, it does not wait for itself.
#[test]
fn a_search_can_start_inside_its_own_pool() {
    let holdout = held(bar());
    let outside = search(&holdout, &settings(Strategy::F), 1);
    for threads in [1, 2] {
        let pool = pool(threads);
        let clock = FakeClock::default();
        let settings = SearchSettings {
            workers: 2,
            ..settings(Strategy::F)
        };
        let inside = pool.install(|| {
            find_grasp(
                &pool,
                &holdout,
                &rig(),
                &settings,
                &clock,
                &AtomicBool::new(false),
            )
        });
        assert_eq!((&inside.grasp, &inside.report), (&outside.grasp, &outside.report));
    }
}

/// Step times are there when asked for, add up the clock, and change nothing else.
#[test]
fn step_times_are_recorded_on_request() {
    let holdout = held(bar());
    let plain = search(&holdout, &settings(Strategy::F), 1);
    assert_eq!(plain.report.step_times, None);
    let timed = SearchSettings {
        record_step_times: true,
        ..settings(Strategy::F)
    };
    let clock = FakeClock::ticking(1);
    let outcome = find_grasp(
        &pool(1),
        &holdout,
        &rig(),
        &timed,
        &clock,
        &AtomicBool::new(false),
    );
    assert_eq!(outcome.grasp, plain.grasp);
    let times = outcome.report.step_times.expect("asked for");
    let attempts = outcome.report.attempts;
    // The clock moves by a nanosecond a look, and without a deadline only the stopwatch looks at it.
    assert_eq!(times.wrist_placement.as_nanos(), u128::from(attempts));
    assert_eq!(times.finger_posing.as_nanos(), u128::from(attempts));
    let later = |kinds: &[Rejection]| {
        kinds
            .iter()
            .map(|kind| outcome.report.rejections[kind.index()])
            .sum::<u64>()
    };
    let immobility = 1 + later(&[Rejection::NotImmobilizing]);
    let contact = immobility + later(&[Rejection::UnwantedContact]);
    let collision = contact + later(&[Rejection::PalmCollision, Rejection::FingerCollision]);
    assert_eq!(times.immobility_validation.as_nanos(), u128::from(immobility));
    assert_eq!(times.contact_validation.as_nanos(), u128::from(contact));
    assert_eq!(times.collision_validation.as_nanos(), u128::from(collision));
}

/// No attempts allowed: none made.
#[test]
fn zero_attempts_are_exhausted_at_once() {
    let none = SearchSettings {
        max_attempts: 0,
        ..settings(Strategy::F)
    };
    let outcome = search(&held(bar()), &none, 1);
    assert_eq!(
        (outcome.end, outcome.report.attempts),
        (SearchEnd::AttemptsExhausted, 0)
    );
    // The last index there is.
    let last = SearchSettings {
        first_attempt: u64::MAX - 1,
        max_attempts: 10,
        ..settings(Strategy::F)
    };
    let outcome = search(&held(bar()), &last, 1);
    assert_eq!(outcome.report.attempts, 1);
}
