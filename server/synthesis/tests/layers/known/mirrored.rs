//! Grips of the right hand as those of the left one, on objects that are symmetric.

use std::sync::Arc;

use glam::Vec3;
use grasp_synthesis::{
    known::growth::Grown,
    model::{hand::Handedness, holdout::Holdout, object::GraspObject},
    physical::grip::{Gripper, PosedDigits},
    propose::mirror::Mirror,
};

use crate::fixtures::{
    atlases::grown_to,
    hands::{adult, right},
    meshes::Parts,
    objects::{lunch_box, object_of, prepared},
    proposals::{NO_GIVER, object_scene},
    searches::Search,
};

/// A bar with a thinner one at its end: symmetric about two planes, but not about the third.
fn club() -> Arc<GraspObject> {
    let mesh = Parts::default()
        .cuboid(Vec3::ZERO, Vec3::new(0.02, 0.06, 0.015), 6)
        .cuboid(Vec3::Y * 0.1, Vec3::new(0.012, 0.05, 0.01), 6)
        .mesh();
    Arc::new(object_of(mesh, &[]))
}

/// The grips of a growth with the right hand, and their mirror images.
fn both(object: &Arc<GraspObject>) -> (Grown, Grown, Mirror) {
    let mirror = Mirror::of_symmetric(prepared(object)).expect("it is symmetric");
    let of_right = grown_to(object, right(), 150).kept();
    let of_left = of_right.clone().mirrored(mirror, object, adult(Handedness::Left));
    (of_right, of_left, mirror)
}

#[test]
fn mirror_images_of_grips_hold_a_symmetric_object() {
    let object = club();
    let (of_right, of_left, mirror) = both(&object);
    let scene = object_scene(&object);
    let mut gripper = Gripper::default();
    let mut next = of_left.atlas.entries().iter().peekable();
    for original in of_right.atlas.entries() {
        let wrist = mirror.wrist(original.grip.pose.frame_from_wrist);
        let Some(image) = next.next_if(|image| image.grip.pose.frame_from_wrist == wrist) else {
            continue;
        };
        let pose = &image.grip.pose;
        let held = gripper.hold_posed(&scene, adult(Handedness::Left), pose, &NO_GIVER, PosedDigits::Still);
        let (held, _) = held.expect("the mirror image holds");
        assert!((held.epsilon - original.grip.epsilon).abs() < 0.05 * original.grip.epsilon);
        for (one, other) in original.contacts.iter().zip(&image.contacts) {
            assert!(mirror.point(one.position).distance(other.position) < 1e-6);
            let [a, b, c] = object.mesh.corners(other.triangle as usize);
            let across = (b - a).cross(c - a).normalize();
            assert!((other.position - a).dot(across).abs() < 2e-3);
        }
    }
    assert!(next.peek().is_none(), "mirror images keep the order of their originals");
    let [originals, images] = [&of_right, &of_left].map(|grown| grown.atlas.entries().len());
    assert!(images > 100 && 10 * images >= 9 * originals, "{images} of {originals}");
}

#[test]
fn mirrored_holdouts_have_mirrored_answers_of_equal_score() {
    let object = club();
    let (of_right, of_left, mirror) = both(&object);
    for up in [
        Vec3::Y,
        Vec3::X,
        Vec3::Z,
        Vec3::new(0.6, 0.0, 0.8),
        Vec3::new(-0.48, -0.6, 0.64),
    ] {
        let found = [
            (Handedness::Right, &of_right, up),
            (Handedness::Left, &of_left, mirror.direction(up)),
        ]
        .map(|(hand, grown, up)| {
            let holdout = Holdout::new(Arc::clone(&object), None, up).expect("up is a unit vector");
            let search = Search {
                atlas: Some(Arc::clone(&grown.atlas)),
                ..Search::guided(&holdout, adult(hand))
            };
            let outcome = search.run();
            (outcome.grasp.expect("it is held").pose, outcome.value)
        });
        let [(one, of_one), (other, of_other)] = found;
        assert!((of_one - of_other).abs() < 1e-3, "{up}: {of_one} {of_other}");
        let image = mirror.wrist(one.frame_from_wrist);
        assert!(image.position.distance(other.frame_from_wrist.position) < 1e-5);
    }
}

#[test]
fn growth_goes_on_from_the_hand_that_grew() {
    let object = club();
    let mirror = Mirror::of_symmetric(prepared(&object)).expect("it is symmetric");
    let part = grown_to(&object, right(), 20).kept();
    let image = part.clone().mirrored(mirror, &object, adult(Handedness::Left));
    assert_eq!(image.original(), &part);
    assert_ne!(image.atlas, part.atlas);
}

#[test]
fn only_symmetric_objects_have_a_plane_of_symmetry() {
    assert!(Mirror::of_symmetric(prepared(&Arc::new(lunch_box(0.05)))).is_some());
    let bent = Parts::default()
        .cuboid(Vec3::ZERO, Vec3::new(0.02, 0.06, 0.015), 6)
        .cuboid(Vec3::new(0.03, 0.05, 0.01), Vec3::new(0.03, 0.01, 0.004), 6);
    let bent = bent.cuboid(Vec3::new(0.0, -0.05, 0.03), Vec3::new(0.006, 0.01, 0.03), 6);
    assert_eq!(
        Mirror::of_symmetric(prepared(&Arc::new(object_of(bent.mesh(), &[])))),
        None
    );
    // What may not be touched counts, and so does where the weight is.
    let mesh = || {
        Parts::default()
            .cuboid(Vec3::ZERO, Vec3::new(0.02, 0.06, 0.015), 1)
            .mesh()
    };
    let forbidden = object_of(mesh(), &[0, 4, 8]);
    assert_eq!(Mirror::of_symmetric(prepared(&Arc::new(forbidden))), None);
    let aside = GraspObject::new(mesh(), 0.1, Vec3::splat(0.005), None, &[]);
    let aside = Arc::new(aside.expect("the object is sound"));
    assert_eq!(Mirror::of_symmetric(prepared(&aside)), None);
}
