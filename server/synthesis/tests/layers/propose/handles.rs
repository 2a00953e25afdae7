//! Hands at handles and hooks.

use grasp_synthesis::{geometry::handles::Handle, propose::handles::HangingPlaces};

use crate::prelude::*;

fn handles(mesh: TriangleMesh) -> Vec<Handle> {
    places(object_of(mesh, &[]))
}

fn places(object: GraspObject) -> Vec<Handle> {
    prepared(&Arc::new(object)).handles().places().to_vec()
}

#[test]
fn rods_are_handles_however_they_lie() {
    let mut random = Random::new(31);
    for _ in 0..12 {
        let radius = random.between(0.005, 0.025);
        let half = random.between(0.08, 0.5);
        let (turn, offset) = (random.rotation(), 0.2 * random.in_cube());
        let found = handles(moved(&cylinder_mesh(radius, half, 24, 12), turn, offset));
        assert!(found.len() > 20, "{radius} {half} {}", found.len());
        let axis = turn * Vec3::Y;
        for handle in found {
            let from_axis = (handle.middle - offset).reject_from_normalized(axis).length();
            assert!(handle.axis.dot(axis).abs() > 0.98, "{radius} {half}: {handle:?}");
            assert!(from_axis < 0.5 * radius, "{radius} {half}: {handle:?}");
            // The part goes on for three fingers' breadth.
            assert!(
                (handle.middle - offset).dot(axis).abs() < half - 0.015,
                "{half}: {handle:?}"
            );
        }
    }
}

/// A pot with an ear of 24 mm around its middle and a bar that sticks out opposite; 9 cm wide, 300 g.
fn pot() -> GraspObject {
    let ear = Quat::IDENTITY;
    let mesh = Parts::default()
        .cylinder(Vec3::ZERO, 0.045, 0.05, 48)
        .torus(Vec3::X * 0.047, ear, [0.024, 0.006], 24)
        .cuboid(Vec3::X * -0.085, Vec3::new(0.05, 0.008, 0.008), 6)
        .mesh();
    GraspObject::new(mesh, 0.3, Vec3::ZERO, None, &[]).expect("the object is sound")
}

#[test]
fn the_ear_of_a_pot_is_its_handle_and_a_spout_is_not() {
    let pot = Arc::new(pot());
    assert!(pot.parts().is_handled);
    let main: Vec<&Handle> = prepared(&pot).handles().main().collect();
    assert!(main.len() >= 4, "{}", main.len());
    assert!(main.iter().all(|handle| handle.middle.x > 0.045), "{main:?}");
    // Points off the ear are not on the handle.
    assert!(!prepared(&pot).handles().contain(Vec3::new(-0.085, 0.008, 0.0)));
    assert!(!prepared(&pot).handles().contain(Vec3::new(0.0, 0.05, 0.0)));
}

#[test]
fn shapes_that_fingers_cannot_wrap_have_no_handle() {
    for (name, mesh) in [
        ("ball", sphere(0.025, 24)),
        ("wire", cylinder_mesh(0.002, 0.2, 12, 4)),
        ("post", cylinder_mesh(0.05, 0.3, 32, 8)),
        ("die", cuboid(Vec3::splat(0.012), 4)),
        ("crate", cuboid(Vec3::splat(0.2), 4)),
    ] {
        assert!(handles(mesh).is_empty(), "{name}");
    }
    assert!(places(plate()).is_empty());
}

fn hook_places(object: GraspObject, up: Vec3) -> HangingPlaces {
    let object = prepared(&Arc::new(object));
    HangingPlaces::of(object.object(), &object.surface_pairs, up, Stop::NEVER).expect("nothing stops it")
}

#[test]
fn a_box_hangs_by_its_handle() {
    for up in [
        Vec3::Y,
        Quat::from_rotation_x(0.35) * Vec3::Y,
        Quat::from_rotation_z(-0.35) * Vec3::Y,
    ] {
        let found = hook_places(lunch_box(0.04), up);
        assert!(found.places.len() > 5, "{up}: {found:?}");
        for place in &found.places {
            // The bar's underside is 40 mm above the lid; a tilted finger touches it near an edge.
            let height = place.underside.y - 0.13;
            assert!(
                height.abs() < 0.006 && place.underside.x.abs() < 0.065,
                "{up}: {place:?}"
            );
            // Next to a post, a finger finds the handle's underside farther down.
            let nears_post = place.underside.x.abs() > 0.03;
            assert!(nears_post || place.along.x.abs() > 0.95, "{up}: {place:?}");
        }
    }
}

#[test]
fn there_is_nothing_to_hang_by_without_room_or_below_the_weight() {
    assert!(hook_places(lunch_box(0.008), Vec3::Y).places.is_empty());
    assert!(hook_places(lunch_box(0.04), Vec3::NEG_Y).places.is_empty());
    for (name, object) in [
        ("bar", bar()),
        ("plate", plate()),
        ("sphere", object_of(sphere(0.02, 16), &[])),
    ] {
        for up in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert!(hook_places(object.clone(), up).places.is_empty(), "{name} {up}");
        }
    }
}

#[test]
fn only_a_wide_bow_has_room_for_four_fingers() {
    for (radius, is_broad) in [(0.09, true), (0.03, false)] {
        let found = hook_places(object_of(torus(radius, 0.005, 32), &[]), Vec3::Y);
        let broad = found.places.iter().filter(|place| place.is_broad).count();
        assert!(!found.places.is_empty());
        assert_eq!(
            broad > found.places.len() / 2,
            is_broad,
            "{radius} m: {broad} of {found:?}"
        );
    }
}
