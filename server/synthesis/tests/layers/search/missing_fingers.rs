//! Hands with fewer than four fingers.

use grasp_assets::holdouts::holdouts;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{Digit, HandPose, Handedness, joints::HandJoints},
    physical::solids::{HandSolids, TrackedSolids, self_clearance},
    propose::prepared::PreparedRig,
};

use crate::fixtures::{
    hands::{adult, adult_with},
    random::Random,
    searches::Search,
};

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
                let pose = HandPose {
                    frame_from_wrist: random.pose(),
                    digits: random.angles(&rig),
                };
                let joints = HandJoints::of_pose(&rig, &pose);
                for solids in [
                    HandSolids::of_pose(&rig, &pose),
                    TrackedSolids::of_joints(&joints).hand,
                ] {
                    for digit in missing(&rig) {
                        for link in solids.phalanges[digit.index()] {
                            assert_eq!(
                                (link.start_radius, link.end_radius, link.length()),
                                (0.0, 0.0, 0.0)
                            );
                            let palm = solids.palm.iter().map(|solid| solid.signed_distance(link.start));
                            let depth = -palm.fold(f32::INFINITY, f32::min);
                            assert!(depth > 0.005, "{digit:?} of {fingers:?}: {depth}");
                        }
                    }
                }
            }
            let stretched = HandPose {
                frame_from_wrist: Pose::IDENTITY,
                digits: rig.stretched(),
            };
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
            let search = Search {
                max_attempts: 400,
                ..Search::guided(&held_out, &rig)
            };
            let Some(grasp) = search.run().grasp else { continue };
            found += 1;
            for digit in missing(&rig) {
                let touches = grasp
                    .contacts
                    .iter()
                    .any(|contact| contact.part.digit() == Some(digit));
                assert!(!touches, "{digit:?} of {fingers:?}");
                assert_eq!(grasp.bend_ratios[digit.index()], None);
            }
            let touching = |digit: Digit| {
                grasp
                    .contacts
                    .iter()
                    .any(|contact| contact.part.digit() == Some(digit))
            };
            assert!(fingers.iter().any(|&finger| touching(finger)), "{fingers:?}");
        }
        println!("{fingers:?}: {found} of {}", holdouts().len());
        assert!(found >= 12, "{fingers:?}: {found}");
    }
}
