//! Places by which an object may hang.

use grasp_synthesis::propose::hooks::HangingPlaces;

use crate::prelude::*;

fn places(object: GraspObject, up: Vec3) -> HangingPlaces {
    let object = prepared(&Arc::new(object));
    HangingPlaces::of(object.object(), object.surface_pairs(), up, Stop::NEVER).expect("nothing stops it")
}

#[test]
fn a_box_hangs_by_its_handle() {
    for up in [
        Vec3::Y,
        Quat::from_rotation_x(0.35) * Vec3::Y,
        Quat::from_rotation_z(-0.35) * Vec3::Y,
    ] {
        let found = places(lunch_box(0.04), up);
        assert!(found.places().len() > 5, "{up}: {found:?}");
        for place in found.places() {
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
    assert!(places(lunch_box(0.008), Vec3::Y).places().is_empty());
    assert!(places(lunch_box(0.04), Vec3::NEG_Y).places().is_empty());
    for (name, object) in [
        ("bar", bar()),
        ("plate", plate()),
        ("sphere", object_of(sphere(0.02, 16), &[])),
    ] {
        for up in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert!(places(object.clone(), up).places().is_empty(), "{name} {up}");
        }
    }
}

#[test]
fn an_upright_ring_hangs_by_its_top() {
    let found = places(object_of(torus(0.05, 0.006, 24), &[]), Vec3::Y);
    assert!(!found.places().is_empty());
    for place in found.places() {
        assert!(place.underside.y > 0.03 && place.along.z.abs() < 0.3, "{place:?}");
    }
}

#[test]
fn only_a_wide_bow_has_room_for_four_fingers() {
    for (radius, is_broad) in [(0.09, true), (0.03, false)] {
        let found = places(object_of(torus(radius, 0.005, 32), &[]), Vec3::Y);
        let broad = found.places().iter().filter(|place| place.is_broad).count();
        assert!(!found.places().is_empty());
        assert_eq!(
            broad > found.places().len() / 2,
            is_broad,
            "{radius} m: {broad} of {found:?}"
        );
    }
}

#[test]
fn probing_stops() {
    let object = prepared(&Arc::new(lunch_box(0.047)));
    let probed = HangingPlaces::of(
        object.object(),
        object.surface_pairs(),
        Vec3::Y,
        Stop::when(&|| true),
    );
    assert!(probed.is_err());
}
