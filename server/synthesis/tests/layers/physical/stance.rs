//! Whether two hands suit one body.

use glam::{Mat3, Quat, Vec3};
use grasp_synthesis::{base::pose::Pose, model::hand::Handedness, physical::stance::suits_one_body};

use crate::fixtures::{hands::adult, holdouts::UP};

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
    assert_eq!(
        suits_one_body([a, b], UP),
        suits_one_body([b, a], UP),
        "the order matters"
    );
    suits_one_body(hands, UP)
}

/// Forward is -z, right is +x.
fn palms_inward(right_x: f32, left_x: f32) -> bool {
    suits(
        wrist(Vec3::X * right_x, Vec3::NEG_Z, Vec3::NEG_X),
        wrist(Vec3::X * left_x, Vec3::NEG_Z, Vec3::X),
    )
}

#[test]
fn palms_on_both_sides_of_a_box_suit_one_body() {
    assert!(palms_inward(0.2, -0.2));
}

#[test]
fn crossed_hands_do_not() {
    assert!(!palms_inward(-0.1, 0.1));
}

#[test]
fn hands_farther_apart_than_arms_reach_do_not() {
    assert!(!palms_inward(0.7, -0.7));
}

#[test]
fn palms_that_carry_from_below_do() {
    assert!(suits(
        wrist(Vec3::X * 0.2, Vec3::NEG_Z, Vec3::Y),
        wrist(Vec3::X * -0.2, Vec3::NEG_Z, Vec3::Y),
    ));
}

#[test]
fn forearms_from_opposite_sides_do_not() {
    assert!(!suits(
        wrist(Vec3::X * 0.2, Vec3::NEG_X, Vec3::Y),
        wrist(Vec3::X * -0.2, Vec3::X, Vec3::Y),
    ));
    assert!(!suits(
        wrist(Vec3::X * 0.2, Vec3::NEG_Z, Vec3::NEG_X),
        wrist(Vec3::X * -0.2, Vec3::Z, Vec3::X),
    ));
}

#[test]
fn hands_with_thumbs_down_do_not() {
    assert!(!suits(
        wrist(Vec3::X * 0.2, Vec3::NEG_Z, Vec3::X),
        wrist(Vec3::X * -0.2, Vec3::NEG_Z, Vec3::NEG_X),
    ));
}

#[test]
fn one_hand_above_the_other_suits_one_body_if_the_elbows_are_apart() {
    let stacked = |splay: f32| {
        let right = Quat::from_rotation_y(splay);
        let left = Quat::from_rotation_y(-splay);
        // The palms are one above the other.
        let aside = 0.1 * splay.sin();
        let at = |x: f32, y: f32, turn: Quat, palm: Vec3| {
            wrist(Vec3::new(x, y, 0.0), turn * Vec3::NEG_Z, turn * palm)
        };
        suits(
            at(aside, 0.1, right, Vec3::NEG_X),
            at(-aside, -0.1, left, Vec3::X),
        )
    };
    assert!(stacked(0.4));
    assert!(!stacked(0.0));
}

#[test]
fn two_right_hands_do_not_suit_one_body() {
    let right = &**adult(Handedness::Right);
    let hands = [0.2, -0.2].map(|x| (right, wrist(Vec3::X * x, Vec3::NEG_Z, Vec3::Y)));
    assert!(!suits_one_body(hands, UP));
}
