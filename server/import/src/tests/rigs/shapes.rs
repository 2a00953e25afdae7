//! Bones, widths and sides of imported hands.

use crate::{RigSource, read_rig, rig_at_rest};
use grasp_assets::hands::glb;
use grasp_synthesis::model::hand::Handedness;

use grasp_characters::{Character, Style};

use crate::tests::rigs::{LIMITS, adult, adult_at_rest, differences, read, source};

#[test]
fn built_in_hands_give_back_their_rigs() {
    for side in [Handedness::Left, Handedness::Right] {
        let file = glb("adult", side).expect("the rig is built in");
        let source = RigSource {
            side: Some(side),
            ..source(&[])
        };
        let rig = read_rig(file, source, LIMITS).unwrap();
        let hands = [(&rig.left, Handedness::Left), (&rig.right, Handedness::Right)];
        for (hand, its_side) in hands {
            assert_eq!(hand.rig.handedness, its_side);
            assert_eq!(
                (hand.is_mirrored, hand.binding.is_none()),
                (its_side != side, its_side != side)
            );
            let [places, directions, radii] = differences(&hand.rig, adult(its_side));
            assert!(places.0 < 5e-4, "{places:?}");
            assert!(directions.0 < 1e-3, "{directions:?}");
            assert!(radii.0 < 0.2, "{radii:?}");
        }
    }
}

#[test]
fn size_follows_the_hand() {
    for size in [0.5, 1.0, 1.6] {
        let read = read(&Character::new(&Style { size, ..Style::PLAIN }).glb).unwrap();
        for hand in [&read.left, &read.right] {
            let adult = adult(hand.rig.handedness);
            assert!((hand.rig.reach / adult.reach / size - 1.0).abs() < 2e-3);
            for (own, other) in hand.rig.joint_radii.iter().zip(adult.joint_radii) {
                assert!(
                    (own / other / size - 1.0).abs() < 0.2,
                    "{own} for {}",
                    other * size
                );
            }
        }
    }
}

#[test]
fn joints_at_rest_give_the_rig_that_they_are_of() {
    for side in [Handedness::Left, Handedness::Right] {
        let rig = rig_at_rest(&[adult_at_rest(side)], source(&[])).unwrap();
        for hand in [&rig.left, &rig.right] {
            let [places, directions, radii] = differences(&hand.rig, adult(hand.rig.handedness));
            assert!(
                places.0 < 1e-5 && directions.0 < 1e-3 && radii.0 < 0.02,
                "{places:?} {directions:?} {radii:?}"
            );
            assert_eq!(hand.is_mirrored, hand.rig.handedness != side);
        }
    }
}
