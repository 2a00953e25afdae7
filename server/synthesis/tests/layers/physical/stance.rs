//! Whether two hands suit one body.

use glam::Mat3;
use grasp_synthesis::physical::stance::suits_one_body;

use crate::prelude::*;

/// A wrist at `position` whose fingers point along `fingers` and whose palm faces `palm`.
fn wrist(position: Vec3, fingers: Vec3, palm: Vec3) -> Pose {
    let axes = Mat3::from_cols(fingers.cross(palm), fingers, palm);
    Pose::new(position, Quat::from_mat3(&axes))
}

fn suits(right: Pose, left: Pose) -> bool {
    let hands = [
        (&**adult(Handedness::Right), right),
        (&**adult(Handedness::Left), left),
    ];
    let [a, b] = hands;
    assert_eq!(suits_one_body([a, b], UP), suits_one_body([b, a], UP));
    suits_one_body(hands, UP)
}

/// Hands beside the middle; forward is -z, right is +x.
#[test]
fn hands_suit_one_body_as_arms_allow() {
    let at = |x: f32, fingers: Vec3, palm: Vec3| wrist(Vec3::X * x, fingers, palm);
    let inward = |x: f32| {
        let palm = Vec3::NEG_X;
        [at(x, Vec3::NEG_Z, palm), at(-x, Vec3::NEG_Z, -palm)]
    };
    let below = |right: Vec3, left: Vec3| [at(0.2, right, Vec3::Y), at(-0.2, left, Vec3::Y)];
    let stacked = |splay: f32| {
        [1.0, -1.0].map(|side| {
            let turn = Quat::from_rotation_y(side * splay);
            // The palms are one above the other.
            let place = side * Vec3::new(0.1 * splay.sin(), 0.1, 0.0);
            wrist(place, turn * Vec3::NEG_Z, turn * Vec3::NEG_X * side)
        })
    };
    for (what, [right, left], expected) in [
        ("palms on both sides of a box", inward(0.2), true),
        ("crossed hands", inward(-0.1), false),
        ("hands farther apart than arms reach", inward(0.7), false),
        (
            "palms that carry from below",
            below(Vec3::NEG_Z, Vec3::NEG_Z),
            true,
        ),
        (
            "forearms that point at each other",
            below(Vec3::NEG_X, Vec3::X),
            false,
        ),
        (
            "forearms from opposite sides",
            [at(0.2, Vec3::NEG_Z, Vec3::NEG_X), at(-0.2, Vec3::Z, Vec3::NEG_X)],
            false,
        ),
        (
            "thumbs down",
            [at(0.2, Vec3::NEG_Z, Vec3::X), at(-0.2, Vec3::NEG_Z, Vec3::NEG_X)],
            false,
        ),
        ("one above the other, elbows apart", stacked(0.4), true),
        ("one above the other, elbows together", stacked(0.0), false),
    ] {
        assert_eq!(suits(right, left), expected, "{what}");
    }
}

#[test]
fn two_right_hands_do_not_suit_one_body() {
    let hands = [0.2, -0.2].map(|x| (&**right(), wrist(Vec3::X * x, Vec3::NEG_Z, Vec3::Y)));
    assert!(!suits_one_body(hands, UP));
}
