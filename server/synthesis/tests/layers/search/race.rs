//! The race: the same answer for any number of workers, and a true report.

use glam::Vec3;
use grasp_synthesis::{
    base::{rejection::Rejection, stopwatch::Step},
    model::{grasp::Grasp, hand::HandPart, holdout::Holdout, strategy::Strategy},
    search::{SearchEnd, SearchOutcome},
};

use crate::fixtures::{
    clocks::FakeClock,
    hands::simple_rig,
    holdouts::{floating, held, upright_bar_with_forbidden_ends},
    objects::{bar, plate, rod},
    searches::{Search, pool},
};

fn thesis(holdout: &Holdout, strategy: Strategy) -> Search<'_> {
    Search::thesis(holdout, simple_rig(), strategy)
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
    // Only the kinds of the thesis' Table 5.2: others were added after the golden hash.
    for rejection in Rejection::THESIS {
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

/// The answers of the searches in [`reproducible_searches_match_for_any_number_of_workers`], bit for bit. It changes
/// with every change of a draw or a rounding.
const GOLDEN: u64 = 0x1594_CA74_F345_7B4E;

/// Grasp and report are the same for 1, 2, 4 and 7 workers on any pool, and match the golden result.
#[test]
fn reproducible_searches_match_for_any_number_of_workers() {
    let mut hashes = Vec::new();
    for (holdout, strategy) in [
        (held(bar()), Strategy::F),
        (held(rod()), Strategy::E),
        (floating(plate()), Strategy::B),
    ] {
        let one = thesis(&holdout, strategy).run();
        assert_eq!(one.end, SearchEnd::Found);
        for (workers, threads) in [(2, 1), (2, 2), (4, 4), (7, 3)] {
            let search = Search {
                workers,
                ..thesis(&holdout, strategy)
            };
            let many = search.run_on(&pool(threads));
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

#[test]
fn exhausted_searches_match_for_any_number_of_workers_and_report_the_nearest_miss() {
    let holdout = upright_bar_with_forbidden_ends();
    // With μ = 1 the printed cone has closed to the normal.
    let search = Search {
        friction: 1.0,
        max_attempts: 3000,
        ..thesis(&holdout, Strategy::F)
    };
    let one = search.run();
    assert_eq!(one.end, SearchEnd::AttemptsExhausted);
    assert_eq!(
        (one.report.attempts, one.report.attempt, &one.grasp),
        (3000, None, &None)
    );
    let miss = one.report.nearest_miss.clone().expect("an attempt failed");
    assert_eq!(miss.rejection, Rejection::NotImmobilizing);
    for (workers, threads) in [(2, 2), (4, 2), (7, 3)] {
        let many = Search {
            workers,
            ..search.clone()
        };
        let many = many.run_on(&pool(threads));
        assert_eq!((many.end, &many.report), (one.end, &one.report));
    }
    // Run one by one, no attempt that gets as far has a smaller angle.
    let pool = pool(1);
    let lowest = (0..3000)
        .filter_map(|index| {
            let alone = Search {
                first_attempt: index,
                max_attempts: 1,
                ..search.clone()
            };
            let miss = alone.run_on(&pool).report.nearest_miss.expect("it failed");
            assert_eq!(miss.attempt, index);
            miss.wrench_angle.map(|angle| (angle, index))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    assert_eq!(lowest, miss.wrench_angle.map(|angle| (angle, miss.attempt)));
}

/// The winner comes after so many attempts that workers merge their counts on the way.
#[test]
fn late_winners_match_for_any_number_of_workers() {
    let holdout = held(rod());
    let (seed, one) = (0..40)
        .find_map(|seed| {
            let search = Search {
                seed,
                ..thesis(&holdout, Strategy::A)
            };
            let outcome = search.run();
            (outcome.report.attempt? > 15_000).then_some((seed, outcome))
        })
        .expect("one of the seeds takes long");
    assert_eq!(
        one.report.attempts,
        one.report.attempt.map_or(0, |index| index + 1)
    );
    for (workers, threads) in [(2, 2), (3, 2), (4, 4)] {
        let search = Search {
            seed,
            workers,
            ..thesis(&holdout, Strategy::A)
        };
        let many = search.run_on(&pool(threads));
        assert_eq!(
            (many.end, &many.grasp, &many.report),
            (one.end, &one.grasp, &one.report)
        );
    }
}

#[test]
fn grasps_of_a_race_are_replayed_by_seed_and_attempt() {
    let holdout = held(bar());
    for seed in 0..6 {
        let race = Search {
            seed,
            reproducible: false,
            workers: 3,
            ..thesis(&holdout, Strategy::F)
        };
        let first = race.run();
        assert_eq!(first.end, SearchEnd::Found);
        let index = first.report.attempt.expect("found");
        let replay = Search {
            first_attempt: index,
            max_attempts: 1,
            workers: 1,
            ..race
        };
        let again = replay.run();
        assert_eq!(again.grasp, first.grasp);
        assert_eq!((again.report.attempt, again.report.attempts), (Some(index), 1));
        assert!(first.report.attempts <= first.report.attempt.unwrap_or(0) + 3 + first.report.attempts / 2);
        assert_eq!(first.report.nearest_miss, None);
    }
}

/// Called from a thread of its own pool, even of a pool of one, a search does not wait for itself.
#[test]
fn starts_inside_its_own_pool_without_deadlock() {
    let holdout = held(bar());
    let outside = thesis(&holdout, Strategy::F).run();
    for threads in [1, 2] {
        let pool = pool(threads);
        let search = Search {
            workers: 2,
            ..thesis(&holdout, Strategy::F)
        };
        let inside = pool.install(|| search.run_on(&pool));
        assert_eq!((&inside.grasp, &inside.report), (&outside.grasp, &outside.report));
    }
}

#[test]
fn step_times_add_up_on_request_and_change_nothing_else() {
    let holdout = held(bar());
    let plain = thesis(&holdout, Strategy::F).run();
    assert_eq!(plain.report.step_times, None);
    let timed = Search {
        record_step_times: true,
        ..thesis(&holdout, Strategy::F)
    };
    let clock = FakeClock::ticking(1);
    let outcome = timed.run_under(&pool(1), &clock);
    assert_eq!(outcome.grasp, plain.grasp);
    let times = outcome.report.step_times.expect("requested");
    let attempts = outcome.report.attempts;
    // The clock advances by a nanosecond per reading, and without a deadline only the stopwatch reads it.
    assert_eq!(
        times[Step::WristPlacement as usize].as_nanos(),
        u128::from(attempts)
    );
    assert_eq!(
        times[Step::FingerPosing as usize].as_nanos(),
        u128::from(attempts)
    );
    let later = |kinds: &[Rejection]| {
        kinds
            .iter()
            .map(|kind| outcome.report.rejections[kind.index()])
            .sum::<u64>()
    };
    let immobility = 1 + later(&[Rejection::NotImmobilizing]);
    let contact = immobility + later(&[Rejection::UnwantedContact]);
    let collision = contact + later(&[Rejection::PalmCollision, Rejection::FingerCollision]);
    assert_eq!(
        times[Step::ImmobilityValidation as usize].as_nanos(),
        u128::from(immobility)
    );
    assert_eq!(
        times[Step::ContactValidation as usize].as_nanos(),
        u128::from(contact)
    );
    assert_eq!(
        times[Step::CollisionValidation as usize].as_nanos(),
        u128::from(collision)
    );
}

#[test]
fn runs_no_more_attempts_than_there_are() {
    let holdout = held(bar());
    let none = Search {
        max_attempts: 0,
        ..thesis(&holdout, Strategy::F)
    };
    let outcome = none.run();
    assert_eq!(
        (outcome.end, outcome.report.attempts),
        (SearchEnd::AttemptsExhausted, 0)
    );
    // The last index there is.
    let last = Search {
        first_attempt: u64::MAX - 1,
        max_attempts: 10,
        ..thesis(&holdout, Strategy::F)
    };
    assert_eq!(last.run().report.attempts, 1);
}
