//! Hands with fewer than four fingers.

use crate::prelude::*;

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
