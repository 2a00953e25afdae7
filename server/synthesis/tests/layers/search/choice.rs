//! Which of several valid grasps is answered.

use std::{cmp::Reverse, sync::Mutex};

use grasp_synthesis::search::{
    FoundGrasp, GraspObserver,
    report::{Alternative, Alternatives, Class, Differences, Part},
};

use crate::prelude::*;

const BY_SIDE: Differences = Differences {
    approach: true,
    grasp_type: false,
    region: false,
};

#[derive(Debug, Default)]
struct All(Mutex<Vec<FoundGrasp>>);

impl GraspObserver for All {
    fn wants(&self, _: &Grasp, _: GraspSource, _: f32) -> bool {
        true
    }

    fn keep(&self, found: FoundGrasp) {
        self.0.lock().unwrap().push(found);
    }

    fn goes_on_after_preferred(&self) -> bool {
        false
    }
}

fn found_by(workers: usize) -> (Vec<FoundGrasp>, SearchOutcome) {
    let holdout = floating(bar());
    let all = Arc::new(All::default());
    let outcome = guided(&holdout)
        .choice(Choice::BestWithinBudget)
        .reproducible(false)
        .max_attempts(300)
        .workers(workers)
        .observer(Arc::<All>::clone(&all))
        .run();
    let found = std::mem::take(&mut *all.0.lock().unwrap());
    (found, outcome)
}

fn any_grasp() -> Grasp {
    *found_by(1).0.swap_remove(0).grasp
}

#[test]
fn an_observer_sees_every_valid_grasp_whatever_the_number_of_workers() {
    let (mut one, outcome) = found_by(1);
    assert!(one.len() > 10 && one.len() as u64 == outcome.report.candidates);
    let most = one.iter().map(|found| found.value).fold(0.0, f32::max);
    assert_eq!(outcome.value, most);
    let (mut many, ..) = found_by(3);
    let index = |found: &FoundGrasp| match found.source {
        GraspSource::Attempt(index) => index,
        other => panic!("there are no known grips: {other:?}"),
    };
    one.sort_by_key(index);
    many.sort_by_key(index);
    let grasps = |all: &[FoundGrasp]| -> Vec<_> { all.iter().map(|found| found.grasp.clone()).collect() };
    assert_eq!(grasps(&one), grasps(&many));
    // The score also needs to know where the receiver stands.
    assert!(one.iter().all(|found| found.grasp.score.is_some()));
}

/// Grasps of made-up quality and class, some of them equally good.
fn made_up(random: &mut Random, grasp: &Grasp, number: usize) -> Vec<Alternative> {
    (0..number)
        .map(|index| {
            let handedness = [Handedness::Left, Handedness::Right][random.index(2)];
            let side = random.index(6) as u8;
            Alternative {
                class: Class {
                    approach: Some((side, handedness)),
                    grasp_type: None,
                    region: Some(Part::Octant(random.index(3) as u8)),
                },
                handedness,
                found: FoundGrasp {
                    grasp: Box::new(grasp.clone()),
                    source: if random.index(20) == 0 {
                        GraspSource::Preferred(index as u16)
                    } else {
                        GraspSource::Attempt(index as u64)
                    },
                    value: random.index(40) as f32 / 40.0,
                    at: Duration::ZERO,
                },
            }
        })
        .collect()
}

/// Preferred grips first, then by quality; of equals the first.
fn better(a: &Alternative, b: &Alternative) -> std::cmp::Ordering {
    let rank = |alternative: &Alternative| match alternative.found.source {
        GraspSource::Preferred(index) => (true, alternative.found.value, Reverse(index.into())),
        GraspSource::Attempt(index) => (false, alternative.found.value, Reverse(index)),
        other => panic!("none are made of {other:?}"),
    };
    rank(b).partial_cmp(&rank(a)).expect("the values are numbers")
}

fn sources(alternatives: &[Alternative]) -> Vec<GraspSource> {
    let found = alternatives.iter().map(|alternative| alternative.found.source);
    found.collect()
}

#[test]
fn the_best_of_the_best_classes_remain_in_whatever_order_they_come() {
    let grasp = any_grasp();
    let mut random = Random::new(11);
    for round in 0..200 {
        let (most, number) = (1 + random.index(9), random.index(120));
        let mut offered = made_up(&mut random, &grasp, number);
        // By brute force: the best of each class, then the best of those.
        let mut best = offered.clone();
        best.sort_by(better);
        let mut classes = Vec::new();
        best.retain(|alternative| {
            let is_new = !classes.contains(&alternative.class);
            classes.push(alternative.class);
            is_new
        });
        best.truncate(most);
        for _ in 0..3 {
            let mut kept = Alternatives::new(most);
            for place in (1..offered.len()).rev() {
                offered.swap(place, random.index(place + 1));
            }
            for alternative in &offered {
                // Below the least quality, none would be kept.
                let least = kept.least().unwrap_or(0.0);
                if alternative.found.value >= least || alternative.found.source.is_preferred() {
                    kept.offer(alternative.clone());
                }
            }
            assert_eq!(sources(&kept.best), sources(&best), "round {round}");
        }
    }
}

#[test]
fn the_side_is_the_one_that_the_back_of_the_hand_faces() {
    let object = bar();
    let mut grasp = any_grasp();
    // The palm faces +z of the wrist, so the back of the hand faces -z.
    for (back, side) in [
        (Vec3::new(0.9, 0.3, -0.2), 0),
        (Vec3::new(-0.5, 0.1, 0.4), 1),
        (Vec3::new(0.1, 0.8, 0.6), 2),
        (Vec3::new(0.1, -0.8, 0.6), 3),
        (Vec3::new(0.2, 0.1, 0.3), 4),
        (Vec3::new(0.2, 0.1, -0.3), 5),
    ] {
        let orientation = Quat::from_rotation_arc(Vec3::NEG_Z, back.normalize_or(Vec3::X));
        grasp.pose.frame_from_wrist = Pose::new(Vec3::ZERO, orientation);
        let class = Class::of(&grasp, Handedness::Left, &object, BY_SIDE);
        assert_eq!(class.approach, Some((side, Handedness::Left)));
        assert_eq!((class.grasp_type, class.region), (None, None));
    }
}

fn on(x: f32, triangle: u32) -> Contact {
    Contact {
        triangle,
        ..contact(Vec3::new(x, 0.01, -0.01), Vec3::Y, HandPart::Palm)
    }
}

fn part(object: &GraspObject, contacts: &[Contact]) -> Option<Part> {
    let mut grasp = any_grasp();
    grasp.contacts = contacts.to_vec();
    let by = Differences {
        approach: false,
        grasp_type: false,
        region: true,
    };
    Class::of(&grasp, Handedness::Right, object, by).region
}

#[test]
fn the_part_is_the_region_with_most_contacts_or_an_eighth_of_the_box() {
    let object = object_of(cuboid(Vec3::new(0.1, 0.04, 0.04), 1), &[]);
    let beyond = |x: f32| half_space(Vec3::X * x, Vec3::X);
    let region = |wish, triangles: &[u32], zones: &[Zone]| Region {
        wish,
        weight: 0.5,
        triangles: triangles.to_vec(),
        zones: zones.to_vec(),
    };
    // The contacts' middle is at x = -0.01, in the lower halves of x and z and in the upper half of y.
    let contacts = [on(-0.09, 5), on(0.03, 3), on(0.03, 4)];
    assert_eq!(part(&object, &contacts), Some(Part::Octant(0b010)));
    let triangles = object.mesh.triangles().len();
    let regions = Regions::new(
        &[
            region(Wish::Prefer, &[5, 2], &[]),
            region(Wish::Avoid, &[], &[beyond(0.02)]),
            region(Wish::Prefer, &[4, 3], &[]),
        ],
        triangles,
    );
    let object = changed(&object, |plain| plain.with_regions(regions));
    // Two contacts are on the second and on the third.
    assert_eq!(part(&object, &contacts), Some(Part::Region(Some(1))));
    assert_eq!(part(&object, &contacts[..1]), Some(Part::Region(Some(0))));
    assert_eq!(part(&object, &[on(0.0, 9)]), Some(Part::Region(None)));
}

/// Attempts after the first valid grasp in which a natural grasp replaces it.
const WINDOW: u64 = 16;

const SEEDS: u64 = 12;

fn search(holdout: &Holdout, seed: u64) -> Search<'_> {
    guided(holdout).seed(seed).max_attempts(1000)
}

fn outcome_of(holdout: &Holdout, seed: u64, attempt: u64) -> SearchOutcome {
    let one = search(holdout, seed).first_attempt(attempt).max_attempts(1);
    one.run()
}

/// The winner by its definition, from attempts run one by one: index and grasp.
fn expected(holdout: &Holdout, seed: u64) -> (u64, Grasp) {
    let mut others: Vec<(u64, Grasp)> = Vec::new();
    for attempt in 0.. {
        if others.first().is_some_and(|(first, _)| attempt > first + WINDOW) {
            break;
        }
        let outcome = outcome_of(holdout, seed, attempt);
        let Some(grasp) = outcome.grasp else { continue };
        if outcome.replaceable_until.is_none() {
            return (attempt, grasp);
        }
        others.push((attempt, grasp));
    }
    let better = |best: (u64, Grasp), other: (u64, Grasp)| {
        let is_better = score(&other.1) > score(&best.1);
        if is_better { other } else { best }
    };
    let best = others.into_iter().reduce(better);
    best.expect("some attempt is valid")
}

#[test]
fn a_natural_grasp_replaces_another_within_some_attempts() {
    let mut replaced = 0;
    let held = tracked_holdouts().nth(3).expect("there are fifteen");
    let floating = ["remote", "scissors"].map(|name| floating(Arc::clone(object(name))));
    for holdout in [&floating[0], &floating[1], &held] {
        for seed in 0..SEEDS {
            let (index, grasp) = expected(holdout, seed);
            let earlier = (0..index).any(|attempt| outcome_of(holdout, seed, attempt).grasp.is_some());
            replaced += usize::from(earlier);
            let one = search(holdout, seed).run();
            assert_eq!(
                (one.report.attempt(), one.grasp),
                (Some(index), Some(grasp)),
                "{seed}"
            );
            for (workers, threads) in [(2, 2), (4, 3)] {
                let many = search(holdout, seed).workers(workers).run_on(&pool(threads));
                assert_eq!(many.report.attempt(), Some(index), "{seed}, {workers} workers");
                assert_eq!(many.report.attempts, one.report.attempts, "{seed}");
            }
        }
    }
    assert!(replaced > 3, "only {replaced} grasps were replaced");
}

const PROPOSALS: u64 = 1500;

#[test]
fn refinement_keeps_valid_hands_and_perturbs_near_misses_until_more_hold() {
    let scissors = object("scissors");
    let around = surroundings(scissors, &NO_GIVER, right());
    let place = place(scissors, right());
    let free = floating(Arc::clone(scissors));
    let (mut plain, mut refining) = (Gripper::answering(), Gripper::answering());
    let (mut held, mut refined) = (0, 0);
    for index in 0..PROPOSALS {
        let mut stream = AttemptStream::new(17, index);
        let Some(proposal) = propose(&place, &mut stream, Stop::NEVER) else {
            continue;
        };
        let first = hold(&mut plain, &around, &proposal, &mut Stopwatch::off(), Stop::NEVER);
        let end = hold_or_refine(
            &mut refining,
            &around,
            &proposal,
            &mut stream,
            &mut Stopwatch::off(),
            Stop::NEVER,
        );
        held += usize::from(first.is_ok());
        match (first, end) {
            (Err(_), Ok(grasp)) => {
                refined += 1;
                assert!(guided(&free).judge(&grasp.pose).is_valid(), "{index}");
                // The refined hand differs from the proposed one.
                assert_ne!(grasp.pose.digits.as_slice(), plain.posed.as_slice());
            }
            // A failed refinement reports the hand and error without it.
            (first, end) => {
                assert_eq!(first, end, "{index}");
                assert_eq!(plain.posed, refining.posed, "{index}");
            }
        }
    }
    assert!(held >= 10, "only {held} hold");
    assert!(3 * refined > held, "{held} {refined}");
}
