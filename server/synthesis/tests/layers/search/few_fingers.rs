//! Hands that hook their fingers, and hands without some.

use crate::prelude::*;
use grasp_synthesis::physical::hanging::MAX_SWING;

const ROOM: f32 = 0.047;

fn only_hooks() -> Requirements {
    Requirements {
        allowed_types: Some(TypeSet::from_iter([GraspType::FixedHook])),
        ..Requirements::default()
    }
}

fn found(room: f32, up: Vec3, requirements: Requirements, attempts: u64) -> Option<Grasp> {
    let holdout = Holdout::new(lunch_box(room).into(), None, up).expect("up is a unit vector");
    guided(&holdout)
        .requirements(requirements)
        .max_attempts(attempts)
        .grasp()
}

/// Whether the forces hold the weight of a load that swings by no more than it may.
fn assert_holds(grasp: &Grasp, up: Vec3) {
    let weight = 1.5 * 9.81;
    let force: Vec3 = grasp.forces.iter().sum();
    assert!((force - up * weight).length() < 0.03 * weight, "{force}");
    let mut torque = Vec3::ZERO;
    for ((contact, force), torsion) in grasp.contacts.iter().zip(&grasp.forces).zip(&grasp.torsions) {
        let pressing = -force.dot(contact.normal);
        let rubbing = (force + contact.normal * pressing).length();
        assert!(pressing >= 0.0 && force.length() <= 27.001, "{force}");
        assert!(rubbing <= 0.6 * pressing * 1.001 + 1e-5, "{rubbing} {pressing}");
        torque += contact.position.cross(*force) - contact.normal * *torsion;
    }
    // The force acts along a vertical line that the centre of mass swings to.
    assert!(torque.dot(up).abs() < 0.02 * weight * 0.06, "{torque}");
    let line = up.cross(torque) / weight;
    let pivot_height = grasp.contacts[0].position.dot(up);
    let swing = line.length().atan2(pivot_height);
    assert!(swing <= MAX_SWING + 0.1, "{swing}");
}

#[test]
fn a_lunch_box_hangs_in_hooked_fingers() {
    let tilted = |axis: Vec3| Quat::from_axis_angle(axis, 20.0_f32.to_radians()) * Vec3::Y;
    for up in [Vec3::Y, tilted(Vec3::X), tilted(Vec3::NEG_X), tilted(Vec3::Z)] {
        for requirements in [only_hooks(), without_thumb()] {
            let grasp = found(ROOM, up, requirements, 3_000).unwrap_or_else(|| panic!("none under {up}"));
            assert!(grasp.hangs && requirements.admits(&grasp));
            assert_eq!(grasp.classification.grasp_type, Some(GraspType::FixedHook));
            assert_holds(&grasp, up);
            // Under another direction of gravity, it would fall.
            assert!(Entry::of_grasp(&grasp).is_none());
        }
    }
}

#[test]
fn nothing_hangs_upside_down_or_without_room() {
    for (room, up) in [(ROOM, Vec3::NEG_Y), (ROOM, Vec3::X), (0.008, Vec3::Y)] {
        let grasp = found(room, up, without_thumb(), 200);
        assert!(grasp.is_none(), "{room} {up}: {grasp:?}");
    }
}

#[test]
fn grips_with_the_thumb_do_not_hang() {
    let with_thumb = Requirements {
        must_touch: DigitSet::from_iter([Digit::Thumb]),
        ..Requirements::default()
    };
    let grasp = found(ROOM, Vec3::Y, with_thumb, 5_000).expect("there is a grasp");
    assert!(!grasp.hangs);
}

const HANDS: [&[Digit]; 4] = [
    &[Digit::Index, Digit::Middle, Digit::Ring],
    &[Digit::Middle, Digit::Ring, Digit::Little],
    &[Digit::Index, Digit::Little],
    &[Digit::Index, Digit::Middle],
];

fn missing(rig: &PreparedRig) -> impl Iterator<Item = Digit> {
    Digit::ALL.into_iter().filter(|&digit| !rig.has(digit))
}

#[test]
fn a_whole_hand_uses_the_digits_that_are_asked_for() {
    let rig = adult(Handedness::Right);
    for count in 0..5 {
        let digits = std::array::from_fn(|digit| digit <= count);
        assert_eq!(rig.own_digits(digits), digits);
    }
    let three = adult_with(HANDS[1], Handedness::Right);
    assert_eq!(
        three.own_digits([true, true, true, false, false]),
        [true, false, true, true, false]
    );
    assert_eq!(
        three.own_digits([false, true, true, true, true]),
        [false, false, true, true, true]
    );
}

#[test]
fn missing_fingers_are_within_the_palm_in_every_pose() {
    let mut random = Random::new(41);
    for fingers in HANDS {
        for handedness in [Handedness::Left, Handedness::Right] {
            let rig = adult_with(fingers, handedness);
            for _ in 0..50 {
                let pose = hand_pose(random.pose(), random.angles(&rig));
                let joints = HandJoints::of_pose(&rig, &pose);
                for solids in [
                    HandSolids::of_pose(&rig, &pose),
                    TrackedSolids::of_joints(&joints).hand,
                ] {
                    for digit in missing(&rig) {
                        for link in solids.phalanges[digit.index()] {
                            assert_eq!([link.start_radius, link.end_radius, link.length()], [0.0; 3]);
                            let palm = solids.palm.iter().map(|solid| solid.signed_distance(link.start));
                            let depth = -palm.fold(f32::INFINITY, f32::min);
                            assert!(depth > 0.005, "{digit:?} of {fingers:?}: {depth}");
                        }
                    }
                }
            }
            let stretched = hand_pose(Pose::IDENTITY, rig.stretched());
            assert!(self_clearance(&rig, &HandSolids::of_pose(&rig, &stretched)) >= 0.0);
        }
    }
}

#[test]
fn grasps_do_without_missing_fingers() {
    for fingers in HANDS {
        let rig = adult_with(fingers, Handedness::Right);
        let mut found = 0;
        for holdout in holdouts() {
            let held_out = holdout.to_holdout().expect("it is sound");
            let search = guided(&held_out).rig(&rig).max_attempts(400);
            let Some(grasp) = search.grasp() else { continue };
            found += 1;
            for digit in missing(&rig) {
                assert!(!touches(&grasp.contacts, digit), "{digit:?} of {fingers:?}");
                assert_eq!(grasp.bend_ratios[digit.index()], None);
            }
            let touches = |&finger: &Digit| touches(&grasp.contacts, finger);
            assert!(fingers.iter().any(touches), "{fingers:?}");
        }
        println!("{fingers:?}: {found} of {}", holdouts().len());
        assert!(found >= 12, "{fingers:?}: {found}");
    }
}
