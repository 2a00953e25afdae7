//! Hands with fewer than five digits.

use crate::rig_at_rest;
use grasp_characters::{
    Character, Style,
    names::{mixamo, webxr},
};
use grasp_synthesis::model::hand::{
    Digit, Handedness,
    joints::{JOINT_NAMES, index},
};

use crate::tests::rigs::{adult, adult_at_rest, messages, read, source};

const HANDS: [&[Digit]; 6] = [
    &[Digit::Index, Digit::Middle, Digit::Ring],
    &[Digit::Index, Digit::Middle, Digit::Little],
    &[Digit::Index, Digit::Ring, Digit::Little],
    &[Digit::Middle, Digit::Ring, Digit::Little],
    &[Digit::Index, Digit::Middle],
    &[Digit::Index, Digit::Little],
];

#[test]
fn hands_keep_the_fingers_that_they_have() {
    for fingers in HANDS {
        for (name, units_per_metre) in [
            (mixamo as fn(Handedness, usize) -> Option<String>, 100.0),
            (webxr, 1.0),
        ] {
            let style = Style {
                name,
                units_per_metre,
                fingers,
                ..Style::PLAIN
            };
            let imported = read(&Character::new(&style).glb).unwrap();
            for hand in [&imported.left, &imported.right] {
                let (rig, adult) = (&hand.rig, adult(hand.rig.handedness));
                assert!(rig.fingers().eq(fingers.iter().copied()), "{fingers:?}");
                assert!(rig.has(Digit::Thumb));
                for digit in Digit::ALL.into_iter().filter(|&digit| rig.has(digit)) {
                    let pairs = rig
                        .digit(digit)
                        .lengths
                        .into_iter()
                        .zip(adult.digit(digit).lengths);
                    for (own, whole) in pairs {
                        assert!(
                            (own - whole).abs() < 2e-3,
                            "{fingers:?} {digit:?}: {own} for {whole}"
                        );
                    }
                    let tip = index::TIP_OF_DIGIT[digit.index()];
                    let ratio = rig.joint_radii[tip - 1] / adult.joint_radii[tip - 1];
                    let thickness = 1.0 + 0.15 * (4 - fingers.len()) as f32;
                    assert!(
                        (ratio / thickness - 1.0).abs() < 0.15,
                        "{fingers:?} {digit:?}: {ratio}"
                    );
                }
                // The palm is as broad as that of four fingers.
                let at = |digit: Digit| rig.digit(digit).wrist_from_base.position;
                let whole = |digit: Digit| adult.digit(digit).wrist_from_base.position;
                let breadth = at(Digit::Index).distance(at(Digit::Little));
                let expected = whole(Digit::Index).distance(whole(Digit::Little));
                assert!((breadth - expected).abs() < 2e-3, "{fingers:?}: {breadth}");
                let posed = hand.binding.as_ref().unwrap().joints();
                for (node, joint) in posed {
                    // The root need not be a joint.
                    let digit = joint.and_then(|joint| {
                        (0..5).find(|&digit| {
                            (index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]).contains(&joint)
                        })
                    });
                    assert!(digit.is_none_or(|digit| rig.has(Digit::ALL[digit])), "{node}");
                }
            }
        }
    }
}

#[test]
fn joints_at_rest_without_radii_are_no_finger() {
    let mut rest = adult_at_rest(Handedness::Right);
    for joint in &mut rest.joints[index::FIRST_OF_DIGIT[3]..=index::TIP_OF_DIGIT[3]] {
        joint.radius = 0.0;
        joint.pose.position.x = f32::NAN;
    }
    let rig = rig_at_rest(&[rest], source(&[])).unwrap().right.rig;
    assert!(rig.fingers().eq([Digit::Index, Digit::Middle, Digit::Little]));
    let at = |digit: Digit| rig.digit(digit).wrist_from_base.position;
    let middle = at(Digit::Middle).midpoint(at(Digit::Little));
    assert!(at(Digit::Ring).distance(middle) < 1e-5);
    assert_eq!(rig.digit(Digit::Ring).lengths, [0.0; 3]);
}

#[test]
fn hands_that_cannot_oppose_are_refused_by_name() {
    fn index_only(side: Handedness, joint: usize) -> Option<String> {
        webxr(side, joint).filter(|_| joint < index::FIRST_OF_DIGIT[2])
    }
    fn thumbless(side: Handedness, joint: usize) -> Option<String> {
        let is_thumb = (index::FIRST_OF_DIGIT[0]..=index::TIP_OF_DIGIT[0]).contains(&joint);
        webxr(side, joint).filter(|_| !is_thumb)
    }
    let named = |name, fingers| {
        let style = Style {
            name,
            fingers,
            ..Style::PLAIN
        };
        messages(read(&Character::new(&style).glb))
    };
    let whole = Style::PLAIN.fingers;
    let found = named(thumbless, whole);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found
            .iter()
            .all(|message| message.contains("hand, thumb: is missing; without a thumb")),
        "{found:?}"
    );
    let found = named(index_only, whole);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found
            .iter()
            .all(|message| message.contains("lacks the middle finger, ring finger, little finger")),
        "{found:?}"
    );
}

#[test]
fn unknown_bones_below_the_wrist_are_no_missing_finger() {
    fn odd(side: Handedness, joint: usize) -> Option<String> {
        let is_little = joint >= index::FIRST_OF_DIGIT[4];
        let name = mixamo(side, joint);
        if is_little {
            name.map(|_| format!("{side:?} spare {}", JOINT_NAMES[joint].len() + joint))
        } else {
            name
        }
    }
    let style = Style {
        name: odd,
        ..Style::PLAIN
    };
    let found = messages(read(&Character::new(&style).glb));
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found.iter().all(
            |message| message.contains("little finger: has no nodes with its names")
                && message.contains("spare")
        ),
        "{found:?}"
    );
}
