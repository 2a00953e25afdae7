//! Grasps that are seen as they are found, and the best that differ.

use std::sync::Mutex;

use grasp_synthesis::search::{
    FoundGrasp, GraspObserver,
    alternatives::{Alternative, Alternatives, Class, Differences, Part, Side},
};

use crate::prelude::*;

const BY_SIDE: Differences = Differences {
    approach: true,
    grasp_type: false,
    region: false,
};

/// Keeps all it sees.
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

/// The valid grasps among some attempts, and the outcome.
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

/// One of them.
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
    // With where the receiver stands, which the score needs, too.
    assert!(one.iter().all(|found| found.grasp.score.is_some()));
}

/// Grasps of made-up quality and class, some of them equally good.
fn made_up(random: &mut Random, grasp: &Grasp, number: usize) -> Vec<Alternative> {
    (0..number)
        .map(|index| {
            let handedness = [Handedness::Left, Handedness::Right][random.index(2)];
            let side = Side {
                axis: random.index(3) as u8,
                is_negative: random.index(2) == 0,
            };
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
fn rank(alternative: &Alternative) -> (bool, f32, std::cmp::Reverse<u64>) {
    let (is_preferred, index) = match alternative.found.source {
        GraspSource::Preferred(index) => (true, u64::from(index)),
        GraspSource::Attempt(index) => (false, index),
        other => panic!("none are made of {other:?}"),
    };
    (is_preferred, alternative.found.value, std::cmp::Reverse(index))
}

fn sources(alternatives: &[Alternative]) -> Vec<GraspSource> {
    alternatives
        .iter()
        .map(|alternative| alternative.found.source)
        .collect()
}

#[test]
fn the_best_of_the_best_classes_remain_in_whatever_order_they_come() {
    let grasp = any_grasp();
    let mut random = Random::new(11);
    for round in 0..200 {
        let most = 1 + random.index(9);
        let number = random.index(120);
        let mut offered = made_up(&mut random, &grasp, number);
        // By force: the best of each class, then the best of those.
        let better = |a: &Alternative, b: &Alternative| rank(b).partial_cmp(&rank(a)).unwrap();
        let mut best: Vec<Alternative> = Vec::new();
        for alternative in &offered {
            let same = best.iter_mut().find(|kept| kept.class == alternative.class);
            match same {
                Some(kept) if better(alternative, kept).is_lt() => *kept = alternative.clone(),
                Some(_) => {}
                None => best.push(alternative.clone()),
            }
        }
        best.sort_by(better);
        best.truncate(most);
        for _ in 0..3 {
            let mut kept = Alternatives::new(most);
            for place in (1..offered.len()).rev() {
                offered.swap(place, random.index(place + 1));
            }
            for alternative in &offered {
                if let Some(least) = kept.least() {
                    // What is skipped below the least quality would not have been kept.
                    let skipped = alternative.found.value < least && !alternative.found.source.is_preferred();
                    let mut with = kept.clone();
                    with.offer(alternative.clone());
                    let (with, without) = (sources(&with.into_best()), sources(&kept.clone().into_best()));
                    assert!(!skipped || with == without);
                }
                kept.offer(alternative.clone());
            }
            assert_eq!(sources(&kept.into_best()), sources(&best), "round {round}");
        }
    }
}

#[test]
fn the_side_is_the_one_that_the_back_of_the_hand_faces() {
    let object = bar();
    let mut grasp = any_grasp();
    // The palm faces +z of the wrist, so the back of the hand faces -z.
    for (back, axis, is_negative) in [
        (Vec3::new(0.9, 0.3, -0.2), 0, false),
        (Vec3::new(-0.5, 0.1, 0.4), 0, true),
        (Vec3::new(0.1, 0.8, 0.6), 1, false),
        (Vec3::new(0.1, -0.8, 0.6), 1, true),
        (Vec3::new(0.2, 0.1, 0.3), 2, false),
        (Vec3::new(0.2, 0.1, -0.3), 2, true),
    ] {
        let orientation = Quat::from_rotation_arc(Vec3::NEG_Z, back.normalize_or(Vec3::X));
        grasp.pose.frame_from_wrist = Pose::new(Vec3::ZERO, orientation);
        let class = Class::of(&grasp, Handedness::Left, &object, BY_SIDE);
        let side = Side { axis, is_negative };
        assert_eq!(class.approach, Some((side, Handedness::Left)));
        assert_eq!((class.grasp_type, class.region), (None, None));
    }
}

fn contact(x: f32, triangle: u32) -> Contact {
    Contact {
        position: Vec3::new(x, 0.01, -0.01),
        normal: Vec3::Y,
        triangle,
        part: HandPart::Palm,
    }
}

/// The part that contacts are on.
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
    let contacts = [contact(-0.09, 5), contact(0.03, 3), contact(0.03, 4)];
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
    let object = object.with_regions(regions);
    // Two contacts are on the second and on the third.
    assert_eq!(part(&object, &contacts), Some(Part::Region(Some(1))));
    assert_eq!(part(&object, &contacts[..1]), Some(Part::Region(Some(0))));
    assert_eq!(part(&object, &[contact(0.0, 9)]), Some(Part::Region(None)));
}
