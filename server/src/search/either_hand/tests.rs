//! Either hand on a held remote, whose attempts are the same for any number of workers.

use std::sync::Arc;

use grasp_assets::{
    hands::hand,
    holdouts::{BuiltInHoldout, holdouts},
    objects::object,
};
use grasp_synthesis::{
    base::stop::Stop,
    known::{atlas::Atlas, entry::Entry, growth::Growth},
    model::{hand::Handedness, holdout::Holdout, score::Term, strategy::Strategy},
    physical::grip::Gripper,
    search::{
        GraspSource, find_grasp,
        scene::Scene,
        settings::{Known, Run},
    },
};

use super::*;
use crate::executor::Workers;
use crate::search::slices::{Progress, tests::ReadingsClock};

/// Longest search, by its clock; reached only if something hangs.
const ENDS_BY: Duration = Duration::from_mins(2);

fn pool(workers: usize) -> rayon::ThreadPool {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(workers);
    pool.build().expect("threads start")
}

fn reproducible(seed: u64, max_attempts: u64, workers: usize) -> SearchSettings {
    SearchSettings {
        run: Run {
            seed,
            reproducible: true,
            max_attempts,
            workers,
            deadline: Some(ENDS_BY),
            ..Run::default()
        },
        ..SearchSettings::default()
    }
}

fn of_choice(choice: Choice, deadline: Duration) -> SearchSettings {
    let mut settings = reproducible(1, u64::MAX >> 1, 2);
    settings.query.choice = choice;
    settings.run.reproducible = false;
    settings.run.deadline = Some(deadline);
    settings
}

fn task<'a>(built_in: &BuiltInHoldout, holdout: &'a Holdout, side: Handedness) -> Task<'a> {
    Task {
        holdout,
        object: &object(&built_in.object).expect("it is built in").prepared,
        rig: &hand("adult", side).expect("it is built in").rig,
    }
}

fn either(built_in: &BuiltInHoldout, settings: &SearchSettings, patience: Duration) -> Ended {
    either_of(built_in, [settings; 2], patience)
}

fn either_of(built_in: &BuiltInHoldout, settings: [&SearchSettings; 2], patience: Duration) -> Ended {
    let holdout = built_in.to_holdout().expect("built-in holdouts are sound");
    let [right, left] = [Handedness::Right, Handedness::Left].map(|side| task(built_in, &holdout, side));
    let (pool, progress) = (pool(settings[0].run.workers), Progress::default());
    let site = Site {
        workers: Workers::alone(&pool),
        clock: &ReadingsClock::default(),
        stop: Stop::NEVER,
        progress: &progress,
    };
    search_either(site, [(right, settings[0]), (left, settings[1])], patience)
}

fn alone(built_in: &BuiltInHoldout, settings: &SearchSettings, side: Handedness) -> SearchOutcome {
    let holdout = built_in.to_holdout().expect("built-in holdouts are sound");
    let clock = ReadingsClock::default();
    let task = task(built_in, &holdout, side);
    let scene = Scene::new(task, settings);
    find_grasp(&pool(settings.run.workers), &scene, settings, &clock, Stop::NEVER)
}

/// An answer that is the same with one worker and with three.
fn with_any_number_of_workers(built_in: &BuiltInHoldout, settings: &SearchSettings) -> Ended {
    let mut settings = settings.clone();
    let [one, three] = [1, 3].map(|workers| {
        settings.run.workers = workers;
        either(built_in, &settings, ENDS_BY)
    });
    assert_eq!(three.hand, one.hand, "{}", built_in.name);
    assert_eq!(three.outcome.grasp, one.outcome.grasp);
    assert_eq!(three.outcome.report, one.outcome.report);
    one
}

#[test]
fn the_lowest_attempt_of_either_hand_wins_or_a_better_one_soon_after_it() {
    let (mut winners, mut improved) = ([0; 2], 0);
    for built_in in holdouts().iter().step_by(4) {
        for seed in 0..2 {
            // The first that is valid: a search that prefers nothing.
            let mut settings = reproducible(seed, 1000, 1);
            settings.query.refinement = Duration::ZERO;
            let of_hands = [Handedness::Right, Handedness::Left]
                .map(|side| alone(built_in, &settings, side).report.attempt());
            let expected = match of_hands {
                [Some(right), Some(left)] if left < right => Some((1, left)),
                [Some(right), _] => Some((0, right)),
                [None, left] => left.map(|left| (1, left)),
            };
            settings.run.max_attempts = 2000;
            let first = with_any_number_of_workers(built_in, &settings);
            let attempt = first.outcome.report.attempt();
            assert_eq!(attempt.map(|attempt| (first.hand, attempt)), expected);
            winners[first.hand] += usize::from(expected.is_some());
            let chosen = with_any_number_of_workers(built_in, &reproducible(seed, 2000, 1));
            let attempts = [attempt, chosen.outcome.report.attempt()];
            let [Some(first), Some(chosen)] = attempts else {
                panic!("{} has a grasp: {attempts:?}", built_in.name);
            };
            assert!(
                (first..=first + REFINING_ATTEMPTS).contains(&chosen),
                "{attempts:?}"
            );
            improved += usize::from(chosen > first);
        }
    }
    assert!(winners.iter().all(|&count| count > 0), "{winners:?}");
    assert!(improved > 0, "no first grasp was improved");
}

/// The first grips of a hand on an object.
fn first_grips(object_name: &str, side: Handedness) -> Known {
    let prepared = &object(object_name).expect("it is built in").prepared;
    let rig = &hand("adult", side).expect("it is built in").rig;
    let mut growth = Growth::new(prepared, rig);
    let mut gripper = Gripper::default();
    while growth.len() < 60 {
        growth.round(&mut gripper);
    }
    Known {
        atlas: Some(Arc::new(growth.atlas())),
        ..Known::default()
    }
}

#[test]
fn the_better_known_grip_of_both_hands_is_as_good_as_that_of_each_alone() {
    let sides = [Handedness::Right, Handedness::Left];
    let known = sides.map(|side| first_grips("remote", side));
    let with = |known: &Known, is_reproducible: bool| {
        let mut settings = reproducible(1, 1000, 2);
        settings.known = known.clone();
        settings.run.reproducible = is_reproducible;
        settings
    };
    let mut chosen = [0; 2];
    for built_in in holdouts().iter().filter(|built_in| built_in.object == "remote") {
        for is_reproducible in [true, false] {
            let settings = known.each_ref().map(|known| with(known, is_reproducible));
            let alone = [0, 1].map(|place| alone(built_in, &settings[place], sides[place]));
            let is_known =
                |outcome: &SearchOutcome| matches!(outcome.report.source, Some(GraspSource::Atlas(_)));
            let best = alone
                .iter()
                .filter(|outcome| is_known(outcome))
                .map(|outcome| outcome.value)
                .fold(f32::NEG_INFINITY, f32::max);
            let ended = either_of(built_in, settings.each_ref(), ENDS_BY);
            if best.is_finite() {
                assert!(is_known(&ended.outcome), "{}", built_in.name);
                assert!(ended.outcome.value >= best, "{}", built_in.name);
                chosen[ended.hand] += 1;
            }
        }
    }
    assert!(chosen.iter().sum::<i32>() > 0, "no known grip was valid");
}

#[test]
fn a_learned_grip_of_one_hand_gives_way_to_the_other_hands_atlas() {
    let mut given_way = 0;
    for built_in in holdouts().iter().filter(|built_in| built_in.object == "remote") {
        let mut of_left = of_choice(Choice::FirstValid, ENDS_BY);
        of_left.known = first_grips("remote", Handedness::Left);
        let left = alone(built_in, &of_left, Handedness::Left);
        let right = alone(built_in, &reproducible(1, 1000, 2), Handedness::Right);
        let (Some(GraspSource::Atlas(_)), Some(grasp)) = (left.report.source, right.grasp) else {
            continue;
        };
        let rig = &hand("adult", Handedness::Right).expect("it is built in").rig;
        let mut entry = Entry::of_grasp(&grasp).expect("one hand holds it");
        // As good as can be, so that only the rule can be against it.
        entry.grip_values = Term::ALL.map(|term| if term.is_grip_term() { 1.0 } else { 0.0 });
        let mut of_right = of_choice(Choice::FirstValid, ENDS_BY);
        of_right.known.learned = Some(Arc::new(Atlas::default().with(rig, entry, 1)));
        let learned = alone(built_in, &of_right, Handedness::Right);
        assert_eq!(learned.report.source, Some(GraspSource::Learned(0)));
        given_way += i32::from(learned.value > left.value);
        let ended = either_of(built_in, [&of_right, &of_left], ENDS_BY);
        assert_eq!((ended.hand, ended.outcome.report.source), (1, left.report.source));
        assert_eq!(ended.outcome.grasp, left.grasp);
        // The best of all is the better one of them at least.
        of_right.query.choice = Choice::BestWithinBudget;
        of_left.query.choice = Choice::BestWithinBudget;
        for settings in [&mut of_right, &mut of_left] {
            settings.run.deadline = Some(ReadingsClock::after(20_000));
        }
        let best = either_of(built_in, [&of_right, &of_left], ENDS_BY);
        assert!(best.outcome.value >= learned.value.max(left.value));
    }
    assert!(given_way > 0, "no learned grip was better");
}

#[test]
fn attempts_of_both_hands_together_stay_within_the_maximum() {
    let built_in = &holdouts()[0];
    for (max_attempts, expected) in [(1, 1), (2, 2), (7, 7)] {
        // Attempts that find nothing in so few.
        let mut settings = reproducible(3, max_attempts, 2);
        settings.query.strategy = Strategy::A;
        settings.query.bend_ratios = Strategy::A.default_bend_ratios();
        let ended = either(built_in, &settings, ENDS_BY).outcome;
        assert_eq!(ended.report.attempts, expected);
        assert_eq!(ended.end, SearchEnd::AttemptsExhausted);
        settings.run.reproducible = false;
        let ended = either(built_in, &settings, ENDS_BY).outcome;
        assert_eq!(ended.report.attempts, expected);
    }
}

#[test]
fn the_best_of_both_hands_is_ranked_within_the_budget_and_patience_follows() {
    let built_in = &holdouts()[0];
    let budget = ReadingsClock::after(20_000);
    let best = either(built_in, &of_choice(Choice::BestWithinBudget, budget), budget).outcome;
    assert!(best.grasp.is_some() && best.report.candidates > 1);
    // Without a grasp by the deadline, the first one after it.
    let settings = of_choice(Choice::BestWithinBudget, Duration::from_nanos(1));
    let late = either(built_in, &settings, ENDS_BY).outcome;
    assert_eq!(late.end, SearchEnd::Found);
    assert!(late.value <= best.value);
}
