//! Grips of the right hand as those of the left one, on objects that are symmetric.

use grasp_synthesis::{physical::grip::PosedDigits, propose::mirror::Mirror};

use crate::prelude::*;

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
    let left = adult(Handedness::Left);
    let (of_right, of_left, mirror) = both(&object);
    let scene = object_scene(&object);
    let mut gripper = Gripper::default();
    let mut holds = |rig, entry: &Entry| {
        gripper
            .hold_posed(&scene, rig, &entry.grip.pose, &NO_GIVER, PosedDigits::Still)
            .is_ok()
    };
    let (mut held, mut missing) = (0, 0);
    let mut images = of_left.atlas.entries().iter().peekable();
    for original in of_right.atlas.entries() {
        let wrist = mirror.wrist(original.grip.pose.frame_from_wrist);
        let is_image = |image: &&Entry| image.grip.pose.frame_from_wrist == wrist;
        let Some(image) = images.next_if(is_image) else {
            missing += 1;
            continue;
        };
        if holds(right(), original) {
            held += 1;
            assert!(holds(left, image), "a mirror image does not hold");
        }
        for contact in &image.contacts {
            let [a, b, c] = object.mesh.corners(contact.triangle as usize);
            let across = (b - a).cross(c - a).normalize_or(Vec3::Y);
            assert!((contact.position - a).dot(across).abs() < 2e-3);
        }
    }
    assert!(images.next().is_none());
    // Those that touch sharp edges, of which a cuboid has many.
    assert!(held > 100 && 8 * missing <= held, "{held} {missing}");
}

#[test]
fn mirrored_holdouts_have_answers_of_like_score() {
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
            let search = guided(&holdout).rig(adult(hand)).atlas(&grown.atlas);
            let outcome = search.run();
            assert!(outcome.grasp.is_some());
            outcome.value
        });
        // All edges of this one are sharp.
        assert!((found[0] - found[1]).abs() < 0.03, "{up}: {found:?}");
    }
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
