//! Grips of primitives, and what objects borrow of them.

use std::sync::{Arc, atomic::AtomicBool};

use glam::{EulerRot, Quat, Vec3};
use grasp_assets::{
    hands::hand,
    holdouts::holdouts,
    objects::object,
    primitives::{grips, held_primitives},
};
use grasp_synthesis::{
    base::{clock::Clock, pose::Pose},
    geometry::mesh::TriangleMesh,
    known::{
        entry::Entry,
        grips::Grips,
        primitives::{HeldPrimitive, Primitive},
        recent_grips::RecentGrips,
        seed_source::SeedSource,
        transferred_grips::{Among, Borrowed},
    },
    base::mechanisms::Mechanisms,
    model::{
        bend_ratios::BendRatioChoice,
        constraints::Constraints,
        grasp::Contact,
        hand::{Digit, Handedness, joints::HandJoints, rig::Rig},
        holdout::{Holdout, PresentingHand},
        object::GraspObject,
        strategy::{Choice, Strategy, Validity},
    },
    physical::scene::Presented,
    search::{SearchOutcome, find_grasp, settings::SearchSettings},
};

fn right() -> &'static Rig {
    &hand("adult", Handedness::Right).expect("it is built in").rig
}

fn known_by_the_right() -> &'static Arc<[HeldPrimitive]> {
    let (_, held) = held_primitives()
        .iter()
        .find(|(hand, _)| hand.rig.handedness == Handedness::Right)
        .expect("the right hand knows primitives");
    held
}

fn unconstrained(borrowed: &Borrowed) -> Vec<Entry> {
    let grips = borrowed.beside(Among::All, right(), None, &Constraints::default(), &|| false);
    grips.expect("nobody interrupts").entries().to_vec()
}

/// How far a point is from the skin of a centred box: the closed form.
fn from_box(half: Vec3, point: Vec3) -> f32 {
    let beyond = point.abs() - half;
    let outside = beyond.max(Vec3::ZERO).length();
    (outside + beyond.max_element().min(0.0)).abs()
}

#[test]
fn both_hands_know_all_primitives_by_many_grips_that_touch_them() {
    assert_eq!(held_primitives().len(), 2);
    for (hand, held) in held_primitives() {
        let primitives: Vec<Primitive> = held.iter().map(|held| held.primitive).collect();
        assert_eq!(primitives, Primitive::ALL);
        for held in held.iter() {
            let name = held.primitive.name();
            assert!(grips(held.primitive, &hand.rig).is_some());
            let entries = held.grips.entries();
            assert!((50..1000).contains(&entries.len()), "{name}: {}", entries.len());
            for contact in entries.iter().flat_map(|entry| &entry.contacts) {
                let off = from_box(held.primitive.half_extents, contact.position);
                assert!(off < 1e-5, "{name}: a contact is off by {off}");
            }
        }
    }
}

#[test]
fn primitives_are_named_by_their_edges_and_are_as_large_as_they_say() {
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
fn a_primitive_borrows_its_own_grips_where_they_are() {
    let known = known_by_the_right();
    let held = &known[3];
    let own: Arc<[HeldPrimitive]> = [held.clone()].into();
    let borrowed = Borrowed::of(&held.primitive.object(), &own);
    // All four turns of a box fit it. A few hands hold by palm and fingers, or by thumb and palm: those are not borrowed.
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
    assert_eq!(borrowed.len(), all.min(1024));
    // All of them hold the box; what presses on an edge does not press as either face does, and is left out.
    let passing = borrowed.passing();
    assert!(4 * passing > 3 * borrowed.len(), "{passing} of {all}");
    let laid = unconstrained(&borrowed);
    assert!(!laid.is_empty());
    // A turn that leaves a box as it is leaves a coordinate what it is, or negates it.
    let size = |entry: &Entry| entry.grip.pose.frame_from_wrist.position.abs();
    for laid in laid {
        let is_own = |own: &Entry| {
            own.grip.pose.digits == laid.grip.pose.digits && size(own).distance(size(&laid)) < 1e-5
        };
        assert!(held.grips.entries().iter().any(is_own), "{}", size(&laid));
    }
}

/// A box that is like some primitives, turned about and away from its origin.
fn bar(half: Vec3, object_from_bar: Pose) -> GraspObject {
    bar_with(half, object_from_bar, &[])
}

/// The same with forbidden triangles: two a face, in the order of -z, +z, -y, +y, -x and +x.
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
fn borrowed_grips_touch_what_is_like_the_box_wherever_it_lies() {
    let half = Vec3::new(0.07, 0.014, 0.006);
    let turn = Quat::from_euler(EulerRot::XYZ, 0.4, -1.1, 2.0);
    let object_from_bar = Pose::new(Vec3::new(0.3, -0.2, 0.1), turn);
    let borrowed = Borrowed::of(&bar(half, object_from_bar), known_by_the_right());
    assert!(borrowed.len() > 200, "{}", borrowed.len());
    let bar_from_object = object_from_bar.inverse();
    for entry in unconstrained(&borrowed) {
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
            assert!(off < 0.0021, "a digit is off by {off}");
        }
    }
}

/// The grips among those that promise something, of no giver.
fn passing(borrowed: &Borrowed) -> Vec<Entry> {
    let grips = borrowed.beside(Among::Passing, right(), None, &Constraints::default(), &|| false);
    grips.expect("nobody interrupts").entries().to_vec()
}

#[test]
fn promising_grips_are_off_what_is_forbidden() {
    let half = Vec3::new(0.07, 0.014, 0.006);
    let object_from_bar = Pose::new(Vec3::new(0.3, -0.2, 0.1), Quat::from_rotation_y(0.7));
    let bar_from_object = object_from_bar.inverse();
    let at_end = |entry: &Entry| {
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
    let free = Borrowed::of(&bar(half, object_from_bar), known_by_the_right());
    let forbidding = bar_with(half, object_from_bar, &[10, 11]);
    let borrowed = Borrowed::of(&forbidding, known_by_the_right());
    assert_eq!(borrowed.len(), free.len());
    assert!(
        (100..free.passing()).contains(&borrowed.passing()),
        "{}",
        borrowed.passing()
    );
    assert!(unconstrained(&borrowed).iter().any(at_end), "some fit there");
    for entry in passing(&borrowed) {
        assert!(!at_end(&entry), "a contact is at the forbidden end");
    }
}

#[test]
fn where_nothing_is_promising_all_are_asked_for() {
    let all_faces: Vec<u32> = (0..12).collect();
    let forbidding = bar_with(Vec3::new(0.07, 0.014, 0.006), Pose::IDENTITY, &all_faces);
    let borrowed = Borrowed::of(&forbidding, known_by_the_right());
    assert!(!borrowed.is_empty());
    assert_eq!(borrowed.passing(), 0);
    assert_eq!(passing(&borrowed), unconstrained(&borrowed));
}

#[test]
fn what_is_like_no_primitive_borrows_nothing() {
    let borrowed = Borrowed::of(&bar(Vec3::splat(2.0), Pose::IDENTITY), known_by_the_right());
    assert!(borrowed.is_empty(), "{}", borrowed.len());
    assert!(unconstrained(&borrowed).is_empty());
    let nothing: Arc<[HeldPrimitive]> = [].into();
    assert!(Borrowed::of(&object("remote").unwrap().object, &nothing).is_empty());
}

#[test]
fn what_is_not_wanted_is_not_borrowed_and_what_is_interrupted_has_no_end() {
    let borrowed = Borrowed::of(&object("remote").unwrap().object, known_by_the_right());
    let all = unconstrained(&borrowed);
    let unwanted = all[0].classification.grasp_type.expect("it is of a type");
    let constraints = Constraints {
        excluded_types: [unwanted].into_iter().collect(),
        ..Constraints::default()
    };
    let rest = borrowed
        .beside(Among::All, right(), None, &constraints, &|| false)
        .expect("nobody interrupts");
    assert!(!rest.entries().is_empty());
    for entry in rest.entries() {
        assert_ne!(entry.classification.grasp_type, Some(unwanted));
    }
    assert!(
        borrowed
            .beside(Among::All, right(), None, &constraints, &|| true)
            .is_none()
    );
}

/// The 15 holdouts, each under the gravity of its world.
fn held_out() -> impl Iterator<Item = Holdout> {
    holdouts().iter().map(|built_in| {
        let giver = &hand(&built_in.giver_rig, built_in.giver_handedness).unwrap().rig;
        let world_from_object = built_in.world_from_object;
        let object_from_world = world_from_object.inverse();
        let joints = HandJoints::of_pose(giver, &built_in.giver_pose()).transformed(object_from_world);
        Holdout::new(
            Arc::clone(&object(&built_in.object).unwrap().object),
            Some(PresentingHand::of_joints(joints)),
            object_from_world.transform_vector(Vec3::Y),
        )
        .expect("up is a unit vector")
    })
}

#[test]
fn beside_a_giver_those_come_that_are_least_in_its_way() {
    for holdout in held_out() {
        let borrowed = Borrowed::of(&holdout.object, known_by_the_right());
        let giver = Presented::of(&holdout).giver.expect("there is one");
        let beside = |giver| {
            let grips = borrowed.beside(Among::All, right(), giver, &Constraints::default(), &|| false);
            grips.expect("nobody interrupts")
        };
        let clear = |entry: &Entry| giver.clearance(&entry.tracked_solids(right()), 0.0).is_some();
        let count = |grips: &Grips| grips.entries().iter().filter(|entry| clear(entry)).count();
        let (chosen, any) = (beside(Some(&giver)), beside(None));
        assert_eq!(chosen.entries().len(), any.entries().len());
        assert!(
            count(&chosen) >= count(&any),
            "{} of {}",
            count(&chosen),
            count(&any)
        );
    }
}

/// Searches without a deadline ask for no time.
struct NoClock;

impl Clock for NoClock {
    fn now(&self) -> std::time::Duration {
        std::time::Duration::ZERO
    }
}

fn search(holdout: &Holdout, starts: SeedSource, seed: u64, workers: usize) -> SearchOutcome {
    let settings = SearchSettings {
        seed,
        strategy: Strategy::Guided,
        validity: Validity::Physical,
        bend_ratios: BendRatioChoice::OneRandom,
        friction: holdout.object.friction_under(Validity::Physical),
        constraints: Constraints::default(),
        choice: Choice::FirstValid,
        atlas: None,
        starts,
        recent: RecentGrips::default(),
        known_tried: 0,
        reproducible: true,
        first_attempt: 0,
        max_attempts: 200,
        deadline: None,
        workers,
        record_step_times: false,
        mechanisms: Mechanisms::ALL,
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(workers)
        .build()
        .expect("threads");
    find_grasp(
        &pool,
        holdout,
        right(),
        &settings,
        &NoClock,
        &AtomicBool::new(false),
    )
}

#[test]
fn attempts_that_start_from_borrowed_grips_find_more_and_are_as_reproducible() {
    let mut found = [0, 0];
    for holdout in held_out() {
        let borrowed = Arc::new(Borrowed::of(&holdout.object, known_by_the_right()));
        for seed in 0..3 {
            let from_borrowed = || SeedSource::Borrowed(Arc::clone(&borrowed));
            let one = search(&holdout, from_borrowed(), seed, 1);
            let three = search(&holdout, from_borrowed(), seed, 3);
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
        "{with} attempts with borrowed grips, {without} without"
    );
}
