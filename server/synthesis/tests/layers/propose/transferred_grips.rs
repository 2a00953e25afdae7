//! Grips transferred from primitives to objects like them.

use glam::EulerRot;
use grasp_assets::atlases::held_primitives;
use grasp_synthesis::{
    known::primitives::{HeldPrimitive, TransferredGrips},
    rating::assessment::GraspContext,
};

use crate::prelude::*;

fn primitives_of_the_right_hand() -> &'static Arc<[HeldPrimitive]> {
    let (_, held) = held_primitives()
        .iter()
        .find(|(hand, _)| hand.rig.handedness == Handedness::Right)
        .expect("there are grips for the right hand");
    held
}

/// The grips transferred to an object from the primitives of the right hand.
fn transferred_to(object: &GraspObject) -> TransferredGrips {
    TransferredGrips::of(object, primitives_of_the_right_hand())
}

fn chosen(transferred: &TransferredGrips, only_passing: bool, presented: &Presented) -> Vec<Entry> {
    let around = surroundings(object("remote"), presented, right());
    let grips = transferred.away_from(only_passing, &around, Stop::NEVER);
    grips.expect("nothing stops it").entries().to_vec()
}

fn unconstrained(transferred: &TransferredGrips) -> Vec<Entry> {
    chosen(transferred, false, &NO_GIVER)
}

#[test]
fn a_primitive_gets_its_own_grips_in_all_its_turns() {
    let held = &primitives_of_the_right_hand()[3];
    let own: Arc<[HeldPrimitive]> = [held.clone()].into();
    let transferred = TransferredGrips::of(&held.primitive.object(), &own);
    // All four turns of a box fit it. The few grips by palm and fingers, or by thumb and palm, are not transferred.
    let by_thumb_and_finger = |entry: &&Entry| {
        let touches = |digit| touches(&entry.contacts, digit);
        touches(Digit::Thumb) && Digit::ALL[1..].iter().any(|&finger| touches(finger))
    };
    let all = 4 * held.grips.entries().iter().filter(by_thumb_and_finger).count();
    assert_eq!(transferred.len(), all.min(1024));
    // All of them hold the box, but the closure screen drops contacts on edges, whose normals are those of neither
    // face.
    let passing = transferred.passing();
    assert!(5 * passing > 3 * transferred.len(), "{passing} of {all}");
    let grips = unconstrained(&transferred);
    assert!(!grips.is_empty());
    // A turn that maps a box to itself keeps each coordinate or negates it.
    let size = |entry: &Entry| entry.grip.pose.frame_from_wrist.position.abs();
    for grip in grips {
        let is_own = |own: &Entry| {
            own.grip.pose.digits == grip.grip.pose.digits && size(own).distance(size(&grip)) < 1e-5
        };
        assert!(held.grips.entries().iter().any(is_own), "{}", size(&grip));
    }
}

/// A box that resembles some primitives, turned and moved, with forbidden triangles, of which there are two per face.
fn bar(half: Vec3, object_from_bar: Pose, forbidden: &[u32]) -> GraspObject {
    let Pose {
        position,
        orientation,
    } = object_from_bar;
    let mesh = moved(&cuboid(half, 1), orientation, position);
    GraspObject::new(mesh, 0.1, position, None, forbidden).expect("it is sound")
}

#[test]
fn transferred_grips_touch_a_similar_box_in_any_pose() {
    let half = Vec3::new(0.07, 0.014, 0.006);
    let turn = Quat::from_euler(EulerRot::XYZ, 0.4, -1.1, 2.0);
    let object_from_bar = Pose::new(Vec3::new(0.3, -0.2, 0.1), turn);
    let transferred = transferred_to(&bar(half, object_from_bar, &[]));
    assert!(transferred.len() > 200, "{}", transferred.len());
    let surface = oriented_box(object_from_bar, half);
    for entry in unconstrained(&transferred) {
        let nearest = |is_thumb: bool| {
            let of_part = entry.contacts.iter().filter(|contact| {
                let digit = contact.part.digit();
                digit.is_some_and(|digit| (digit == Digit::Thumb) == is_thumb)
            });
            let off = of_part.map(|contact| surface.signed_distance(contact.position).abs());
            off.fold(f32::INFINITY, f32::min)
        };
        for off in [nearest(true), nearest(false)] {
            assert!(off < 0.0021, "a digit is {off} m off the surface");
        }
    }
}

#[test]
fn screened_grips_avoid_forbidden_surfaces() {
    let half = Vec3::new(0.014, 0.006, 0.07);
    let object_from_bar = Pose::new(Vec3::new(0.3, -0.2, 0.1), Quat::from_rotation_y(0.7));
    // The face at +x, as a flat box.
    let end = oriented_box(
        object_from_bar * Pose::from_position(Vec3::X * half.x),
        half.with_x(0.0),
    );
    let touches_end = |entry: &Entry| {
        let mut contacts = entry.contacts.iter();
        contacts.any(|contact| end.distance(contact.position) < 0.0029)
    };
    let free = transferred_to(&bar(half, object_from_bar, &[]));
    let transferred = transferred_to(&bar(half, object_from_bar, &[0, 1]));
    assert_eq!(transferred.len(), free.len());
    let count = transferred.passing();
    assert!((100..free.passing()).contains(&count), "{count}");
    assert!(unconstrained(&transferred).iter().any(touches_end));
    for entry in chosen(&transferred, true, &NO_GIVER) {
        assert!(!touches_end(&entry), "a contact is at the forbidden end");
    }
}

#[test]
fn excluded_types_are_not_transferred_and_interruption_yields_nothing() {
    let transferred = transferred_to(object("remote"));
    let all = unconstrained(&transferred);
    let unwanted = all[0].classification.grasp_type.expect("it has a type");
    let requirements = Requirements {
        excluded_types: [unwanted].into_iter().collect(),
        ..Requirements::default()
    };
    let around = GraspContext {
        requirements: &requirements,
        ..surroundings(object("remote"), &NO_GIVER, right())
    };
    let grips = transferred.away_from(false, &around, Stop::NEVER);
    let grips = grips.expect("nothing stops it");
    let is_wanted = |entry: &Entry| entry.classification.grasp_type != Some(unwanted);
    assert!(!grips.entries().is_empty() && grips.entries().iter().all(is_wanted));
    assert!(
        transferred
            .away_from(false, &around, Stop::when(&|| true))
            .is_err()
    );
}

#[test]
fn a_giver_gets_the_grips_least_in_its_way() {
    for holdout in tracked_holdouts() {
        let transferred = transferred_to(&holdout.object);
        let presented = Presented::of(&holdout);
        let giver = presented.hands.first().expect("there is one");
        let clear = |entry: &Entry| giver.clearance(&entry.tracked_solids(right()), 0.0).is_some();
        let count = |grips: &[Entry]| grips.iter().filter(|entry| clear(entry)).count();
        let near = chosen(&transferred, false, &presented);
        let any = unconstrained(&transferred);
        assert_eq!(near.len(), any.len());
        assert!(count(&near) >= count(&any), "{} of {}", count(&near), count(&any));
    }
}
