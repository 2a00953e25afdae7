//! The race: the same answer for any number of workers, and a true report.

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
        (one.report.attempts, one.report.attempt, &one.grasp),
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

/// The winner comes after so many attempts that workers merge their counts on the way.
#[test]
fn late_winners_match_for_any_number_of_workers() {
    let holdout = held(rod());
    let (seed, one) = (0..40)
        .find_map(|seed| {
            let search = thesis(&holdout, Strategy::A).seed(seed);
            let outcome = search.run();
            (outcome.report.attempt? > 15_000).then_some((seed, outcome))
        })
        .expect("one of the seeds takes long");
    assert_eq!(one.report.attempts, one.report.attempt.expect("found") + 1);
    let search = thesis(&holdout, Strategy::A).seed(seed);
    assert_same(&search, &one, &[(2, 2), (3, 2), (4, 4)]);
}

#[test]
fn grasps_of_a_race_are_replayed_by_seed_and_attempt() {
    let holdout = held(bar());
    for seed in 0..6 {
        let race = thesis(&holdout, Strategy::F)
            .seed(seed)
            .reproducible(false)
            .workers(3);
        let first = race.run();
        assert_eq!(first.end, SearchEnd::Found);
        let index = first.report.attempt.expect("found");
        let replay = race.first_attempt(index).max_attempts(1).workers(1);
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
    let count = |kind: Rejection| outcome.report.rejections[kind.index()];
    let immobility = 1 + count(Rejection::NotImmobilizing);
    let contact = immobility + count(Rejection::UnwantedContact);
    let collision = contact + count(Rejection::PalmCollision) + count(Rejection::FingerCollision);
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
