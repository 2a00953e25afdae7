//! Grips transferred from primitives to objects like them.

use std::sync::Arc;

use glam::{EulerRot, Quat, Vec3};
use grasp_assets::primitives::held_primitives;
use grasp_synthesis::{
    base::{pose::Pose, stop::Stop},
    geometry::mesh::TriangleMesh,
    known::{
        entry::Entry,
        grips::Grips,
        primitives::{HeldPrimitive, Primitive},
        seed_source::SeedSource,
        transferred_grips::{Candidates, TransferredGrips},
    },
    model::{
        grasp::Contact,
        hand::{Digit, Handedness},
        holdout::Holdout,
        object::GraspObject,
        requirements::Requirements,
    },
    physical::{barriers::Barriers, scene::Presented},
    search::SearchOutcome,
};

use crate::fixtures::{hands::right, holdouts::tracked_holdouts, objects::object, searches::Search};

fn primitives_of_the_right_hand() -> &'static Arc<[HeldPrimitive]> {
    let (_, held) = held_primitives()
        .iter()
        .find(|(hand, _)| hand.rig.handedness == Handedness::Right)
        .expect("there are grips for the right hand");
    held
}

/// What an object takes over from the primitives of the right hand.
fn transferred_to(object: &GraspObject) -> TransferredGrips {
    TransferredGrips::of(object, primitives_of_the_right_hand())
}

/// All transferred grips, without a giver.
fn unconstrained(transferred: &TransferredGrips) -> Vec<Entry> {
    let grips = transferred.away_from(
        Candidates::All,
        right(),
        Barriers::NONE,
        &Requirements::default(),
        Stop::NEVER,
    );
    grips.expect("nothing stops it").entries().to_vec()
}

/// Distance of a point from the surface of a centred box.
fn from_box(half: Vec3, point: Vec3) -> f32 {
    let beyond = point.abs() - half;
    let outside = beyond.max(Vec3::ZERO).length();
    (outside + beyond.max_element().min(0.0)).abs()
}

#[test]
fn primitives_are_named_by_their_edges_in_millimetres() {
    assert_eq!(Primitive::ALL[0].name(), "box-160x10x5");
    for primitive in Primitive::ALL {
        let [x, y, z] = primitive.half_extents.to_array();
        assert!(x >= y && y >= z, "{}", primitive.name());
        let around = primitive.object().bounding_box;
        let volume = 8.0 * around.half_extents.element_product();
        assert!((volume / (8.0 * x * y * z) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn a_primitive_gets_its_own_grips_in_all_its_turns() {
    let held = &primitives_of_the_right_hand()[3];
    let own: Arc<[HeldPrimitive]> = [held.clone()].into();
    let transferred = TransferredGrips::of(&held.primitive.object(), &own);
    // All four turns of a box fit it. The few grips by palm and fingers, or by thumb and palm, are not transferred.
    let by_thumb_and_finger = |entry: &&Entry| {
        let touches = |digit: Digit| {
            entry
                .contacts
                .iter()
                .any(|contact| contact.part.digit() == Some(digit))
        };
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

/// A box that resembles some primitives, turned and moved.
fn bar(half: Vec3, object_from_bar: Pose) -> GraspObject {
    bar_with(half, object_from_bar, &[])
}

/// [`bar`] with forbidden triangles: two per face, in the order of -z, +z, -y, +y, -x and +x.
fn bar_with(half: Vec3, object_from_bar: Pose, forbidden: &[u32]) -> GraspObject {
    let primitive = Primitive { half_extents: half };
    let mesh = primitive.object();
    let mesh = mesh.surface.mesh();
    let moved = mesh
        .positions()
        .iter()
        .map(|&point| object_from_bar.transform_point(point));
    let mesh = TriangleMesh::new(moved.collect(), mesh.triangles().to_vec()).expect("it is sound");
    GraspObject::new(mesh, 0.1, object_from_bar.position, None, forbidden).expect("it is sound")
}

#[test]
fn transferred_grips_touch_a_similar_box_in_any_pose() {
    let half = Vec3::new(0.07, 0.014, 0.006);
    let turn = Quat::from_euler(EulerRot::XYZ, 0.4, -1.1, 2.0);
    let object_from_bar = Pose::new(Vec3::new(0.3, -0.2, 0.1), turn);
    let transferred = transferred_to(&bar(half, object_from_bar));
    assert!(transferred.len() > 200, "{}", transferred.len());
    let bar_from_object = object_from_bar.inverse();
    for entry in unconstrained(&transferred) {
        let nearest = |is_thumb: bool| {
            let of_part = entry.contacts.iter().filter(|contact| {
                let digit = contact.part.digit();
                digit.is_some_and(|digit| (digit == Digit::Thumb) == is_thumb)
            });
            of_part
                .map(|contact| from_box(half, bar_from_object.transform_point(contact.position)))
                .fold(f32::INFINITY, f32::min)
        };
        for off in [nearest(true), nearest(false)] {
            assert!(off < 0.0021, "a digit is {off} m off the surface");
        }
    }
}

/// The transferred grips that pass the closure screen, without a giver.
fn passing(transferred: &TransferredGrips) -> Vec<Entry> {
    let grips = transferred.away_from(
        Candidates::Passing,
        right(),
        Barriers::NONE,
        &Requirements::default(),
        Stop::NEVER,
    );
    grips.expect("nothing stops it").entries().to_vec()
}

#[test]
fn screened_grips_avoid_forbidden_surfaces() {
    let half = Vec3::new(0.014, 0.006, 0.07);
    let object_from_bar = Pose::new(Vec3::new(0.3, -0.2, 0.1), Quat::from_rotation_y(0.7));
    let bar_from_object = object_from_bar.inverse();
    let touches_end = |entry: &Entry| {
        let end = |contact: &Contact| {
            let beyond = bar_from_object.transform_point(contact.position) - Vec3::X * half.x;
            let to_face = Vec3::new(
                beyond.x.abs(),
                (beyond.y.abs() - half.y).max(0.0),
                (beyond.z.abs() - half.z).max(0.0),
            );
            to_face.length() < 0.0029
        };
        entry.contacts.iter().any(end)
    };
    let free = transferred_to(&bar(half, object_from_bar));
    let forbidding = bar_with(half, object_from_bar, &[10, 11]);
    let transferred = transferred_to(&forbidding);
    assert_eq!(transferred.len(), free.len());
    assert!(
        (100..free.passing()).contains(&transferred.passing()),
        "{}",
        transferred.passing()
    );
    assert!(
        unconstrained(&transferred).iter().any(touches_end),
        "some touch that end"
    );
    for entry in passing(&transferred) {
        assert!(!touches_end(&entry), "a contact is at the forbidden end");
    }
}

#[test]
fn all_grips_are_kept_where_none_passes_the_screen() {
    let all_faces: Vec<u32> = (0..12).collect();
    let forbidding = bar_with(Vec3::new(0.07, 0.014, 0.006), Pose::IDENTITY, &all_faces);
    let transferred = transferred_to(&forbidding);
    assert!(!transferred.is_empty());
    assert_eq!(transferred.passing(), 0);
    assert_eq!(passing(&transferred), unconstrained(&transferred));
}

#[test]
fn an_object_like_no_primitive_gets_no_grips() {
    let transferred = transferred_to(&bar(Vec3::splat(2.0), Pose::IDENTITY));
    assert!(transferred.is_empty(), "{}", transferred.len());
    assert!(unconstrained(&transferred).is_empty());
    let nothing: Arc<[HeldPrimitive]> = [].into();
    assert!(TransferredGrips::of(object("remote"), &nothing).is_empty());
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
    let rest = transferred
        .away_from(
            Candidates::All,
            right(),
            Barriers::NONE,
            &requirements,
            Stop::NEVER,
        )
        .expect("nothing stops it");
    assert!(!rest.entries().is_empty());
    for entry in rest.entries() {
        assert_ne!(entry.classification.grasp_type, Some(unwanted));
    }
    assert!(
        transferred
            .away_from(
                Candidates::All,
                right(),
                Barriers::NONE,
                &requirements,
                Stop::when(&|| true)
            )
            .is_err()
    );
}

#[test]
fn a_giver_gets_the_grips_least_in_its_way() {
    for holdout in tracked_holdouts() {
        let transferred = transferred_to(&holdout.object);
        let giver = Presented::of(&holdout).giver.expect("there is one");
        let chosen_for = |barriers| {
            let grips = transferred.away_from(
                Candidates::All,
                right(),
                barriers,
                &Requirements::default(),
                Stop::NEVER,
            );
            grips.expect("nothing stops it")
        };
        let clear = |entry: &Entry| giver.clearance(&entry.tracked_solids(right()), 0.0).is_some();
        let count = |grips: &Grips| grips.entries().iter().filter(|entry| clear(entry)).count();
        let (chosen, any) = (chosen_for(Barriers::of_giver(&giver)), chosen_for(Barriers::NONE));
        assert_eq!(chosen.entries().len(), any.entries().len());
        assert!(
            count(&chosen) >= count(&any),
            "{} of {}",
            count(&chosen),
            count(&any)
        );
    }
}

fn search(holdout: &Holdout, seeds: SeedSource, seed: u64, workers: usize) -> SearchOutcome {
    let search = Search {
        seed,
        seeds,
        max_attempts: 200,
        workers,
        ..Search::guided(holdout, right())
    };
    search.run()
}

#[test]
fn transferred_grips_halve_the_attempts_and_keep_searches_reproducible() {
    let mut found = [0, 0];
    for holdout in tracked_holdouts() {
        let transferred = Arc::new(transferred_to(&holdout.object));
        for seed in 0..3 {
            let from_transferred = || SeedSource::Transferred(Arc::clone(&transferred));
            let one = search(&holdout, from_transferred(), seed, 1);
            let three = search(&holdout, from_transferred(), seed, 3);
            assert_eq!(one.grasp, three.grasp);
            assert_eq!(one.report.attempt, three.report.attempt);
            let without = search(&holdout, SeedSource::Nothing, seed, 1);
            for (found, outcome) in found.iter_mut().zip([one, without]) {
                *found += outcome.report.attempts;
            }
        }
    }
    let [with, without] = found;
    assert!(
        2 * with < without,
        "{with} attempts with transferred grips, {without} without"
    );
}
