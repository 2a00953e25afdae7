//! Requirements against naive formulas in double precision and plain sets.

use std::f32::consts::PI;

use crate::prelude::*;

const RUNS: usize = 2000;

/// Cases closer to a limit than this are skipped, since single precision decides them.
const UNDECIDED: f64 = 1e-5;

/// The angle between the hand's approach and an axis, in double precision.
fn approach_angle(wrist: Pose, axis: Vec3) -> f64 {
    let turned = |v: DVec3| wrist.orientation.as_dquat().normalize() * v;
    let blend = turned(DVec3::Y) + turned(DVec3::Z);
    let axis = axis.as_dvec3();
    (blend.dot(axis) / (blend.length() * axis.length()))
        .clamp(-1.0, 1.0)
        .acos()
}

fn within_cone(axis: Vec3, half_angle: f32) -> Requirements {
    Requirements {
        approach: Some(ApproachCone { axis, half_angle }),
        ..Requirements::default()
    }
}

#[test]
fn admits_wrists_within_reach_and_approach_cone_in_any_frame() {
    let mut random = Random::new(6);
    let mut admitted = [0; 2];
    for _ in 0..RUNS {
        let (wrist, b_from_a) = (random.pose(), random.pose());
        let (shoulder, distance) = (random.in_cube() * 1.5, random.between(0.1, 3.0));
        let (axis, half_angle) = (random.direction(), random.between(0.01, PI));
        let beyond = (wrist.position.as_dvec3() - shoulder.as_dvec3()).length() - f64::from(distance);
        let outside = approach_angle(wrist, axis) - f64::from(half_angle);
        if beyond.abs() < UNDECIDED || outside.abs() < UNDECIDED {
            continue;
        }
        let both = Requirements {
            reach: within_reach(shoulder, distance).reach,
            ..within_cone(axis, half_angle)
        };
        for (requirements, expected) in [
            (within_reach(shoulder, distance), beyond <= 0.0),
            (within_cone(axis, half_angle), outside <= 0.0),
            (both, beyond <= 0.0 && outside <= 0.0),
        ] {
            assert_eq!(
                requirements.admits_wrist(wrist),
                expected,
                "{requirements:?} {wrist:?}"
            );
            let elsewhere = requirements.transformed(b_from_a);
            assert_eq!(
                elsewhere.admits_wrist(b_from_a * wrist),
                expected,
                "{elsewhere:?}"
            );
            admitted[usize::from(expected)] += 1;
        }
    }
    assert!(admitted.iter().all(|&count| count > RUNS / 2), "{admitted:?}");
}

#[test]
fn narrow_cones_are_exact_to_rounding() {
    let mut random = Random::new(7);
    for _ in 0..RUNS {
        let (wrist, angle) = (random.pose(), random.between(1e-5, 1e-3));
        // Tilted by a small angle.
        let approach = approach_direction(wrist);
        let side = random.direction().cross(approach);
        if side.length() < 0.1 {
            continue;
        }
        let axis = (approach + side.normalize_or(Vec3::X) * angle.tan()).normalize_or(Vec3::X);
        // Rounding moves a unit vector by some 1e-7.
        assert!(within_cone(axis, angle + 5e-7).admits_wrist(wrist));
        assert!(!within_cone(axis, angle - 5e-7).admits_wrist(wrist));
    }
}

fn some<T: Copy>(random: &mut Random, all: &[T], most: usize) -> Vec<T> {
    let count = random.index(most + 1);
    (0..count).map(|_| all[random.index(all.len())]).collect()
}

#[test]
fn contacts_types_and_comfort_are_admitted_one_by_one() {
    let mut random = Random::new(8);
    let mut admitted = [0; 2];
    for _ in 0..RUNS {
        let [must, must_not] = [(); 2].map(|()| some(&mut random, &Digit::ALL, 1));
        let (allowed, excluded) = (
            (random.index(3) > 0).then(|| some(&mut random, &GraspType::ALL, 60)),
            some(&mut random, &GraspType::ALL, 20),
        );
        let worst = (random.index(2) == 0).then(|| random.between(0.0, 1.0));
        let requirements = Requirements {
            must_touch: must.iter().copied().collect(),
            must_not_touch: must_not.iter().copied().collect(),
            allowed_types: allowed.as_ref().map(|allowed| allowed.iter().copied().collect()),
            excluded_types: excluded.iter().copied().collect(),
            worst_comfort: worst,
            ..Requirements::default()
        };
        let touching = some(&mut random, &Digit::ALL, 6);
        let mut contacts: Vec<Contact> = touching
            .iter()
            .map(|&digit| contact(Vec3::ZERO, Vec3::Y, HandPart::Phalanx(digit, Phalanx::Second)))
            .collect();
        contacts.push(contact(Vec3::ZERO, Vec3::Y, HandPart::Palm));
        let touches = |digit: &Digit| touching.contains(digit);
        let is_right = must.iter().all(touches) && !must_not.iter().any(touches);
        assert_eq!(
            requirements.admits_contacts(&contacts),
            is_right,
            "{requirements:?}"
        );
        admitted[usize::from(is_right)] += 1;

        let grasp_type = some(&mut random, &GraspType::ALL, 1).pop();
        let is_in = |types: &Vec<GraspType>| grasp_type.is_some_and(|one| types.contains(&one));
        let is_admitted = allowed.as_ref().is_none_or(is_in) && !is_in(&excluded);
        assert_eq!(
            requirements.admits_type(grasp_type),
            is_admitted,
            "{requirements:?}"
        );
        let comfort = random.between(0.0, 1.0);
        let is_comfortable = worst.is_none_or(|worst| comfort <= worst);
        assert_eq!(requirements.admits_comfort(comfort), is_comfortable);
    }
    assert!(admitted.iter().all(|&count| count > RUNS / 5), "{admitted:?}");
}
