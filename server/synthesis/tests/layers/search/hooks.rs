//! Objects that hang: found by hooked fingers, and held by them.

use grasp_synthesis::physical::hanging::MAX_SWING;

use crate::prelude::*;

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
