//! Grips that are mirrored, resized or rounded.

use grasp_synthesis::{
    known::moved_grips::on_resized, physical::grip::PosedDigits, propose::both_hands::Mirror,
};

use crate::prelude::*;

#[test]
fn mirror_images_of_grips_hold_a_symmetric_object() {
    // A bar with a thinner one at its end: symmetric about two planes, but not about the third.
    let club = Parts::default()
        .cuboid(Vec3::ZERO, Vec3::new(0.02, 0.06, 0.015), 6)
        .cuboid(Vec3::Y * 0.1, Vec3::new(0.012, 0.05, 0.01), 6);
    let object = Arc::new(object_of(club.mesh(), &[]));
    let left = adult(Handedness::Left);
    let mirror = Mirror::of_symmetric(prepared(&object)).expect("it is symmetric");
    let of_right = grown_to(&object, right(), 150).kept();
    let of_left = of_right.clone().mirrored(mirror, &object, left);
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
    // Grips at the sharp edges of the cuboid are missing.
    assert!(held > 100 && 8 * missing <= held, "{held} {missing}");
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
    // Forbidden triangles and the centre of mass must be symmetric, too.
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

const SCALES: [f32; 4] = [0.5, 0.8, 1.25, 2.0];

fn middle(entry: &Entry, is_counted: impl Fn(HandPart) -> bool) -> Option<Vec3> {
    let counted: Vec<Vec3> = entry
        .contacts
        .iter()
        .filter(|contact| is_counted(contact.part))
        .map(|contact| contact.position)
        .collect();
    (!counted.is_empty()).then(|| counted.iter().sum::<Vec3>() / counted.len() as f32)
}

#[test]
fn contacts_stay_on_the_surface_and_hands_where_they_hold_it() {
    let atlas = complete_atlas("scissors");
    for scale in SCALES {
        let resized_object = resized(object("scissors"), scale);
        for entry in atlas.entries().iter().step_by(50) {
            let moved = entry.on_resized(scale);
            for contact in &moved.contacts {
                let nearest = resized_object
                    .surface
                    .closest_point_within(contact.position, 1e-3 * scale);
                let distance = nearest.map(|nearest| nearest.distance);
                assert!(distance.is_some_and(|d| d < 2e-4 * scale), "{scale} {distance:?}");
            }
            // Seen from the wrist, the palm's contacts, or else all, are where they were.
            let from_wrist = |of: &Entry| {
                let place = middle(of, |part| part == HandPart::Palm).or_else(|| middle(of, |_| true));
                let wrist_from_object = of.grip.pose.frame_from_wrist.inverse();
                wrist_from_object.transform_point(place.expect("it touches"))
            };
            assert!(from_wrist(entry).distance(from_wrist(&moved)) < 1e-5);
            assert_eq!(entry.grip.pose.digits, moved.grip.pose.digits);
        }
    }
}

const HALF: Vec3 = Vec3::new(0.015, 0.08, 0.015);

#[test]
fn a_hand_follows_the_surface() {
    let own = Arc::new(bar());
    let grown = grown_to(&own, right(), 60).kept();
    let scene = object_scene(&own);
    let mut gripper = Gripper::default();
    for scale in [0.8, 1.05, 1.2, 1.5] {
        let other = resized(&own, scale);
        let on_other = object_scene(&other);
        let (mut all, mut held) = (0, 0);
        for entry in grown.atlas.entries().iter().step_by(3) {
            let pose = &entry.grip.pose;
            let hand = on_resized([&scene, &on_other], scale, right(), pose);
            all += 1;
            let grip = gripper.hold_posed(&on_other, right(), &hand, &NO_GIVER, PosedDigits::Settled);
            if grip.is_err() {
                continue;
            }
            held += 1;
            for contact in &gripper.contacts {
                let beyond = contact.position.abs() - scale * HALF;
                assert!(beyond.max_element().abs() < 1e-4, "{scale}: {beyond}");
            }
            // The wrist keeps its place at the surface, except as far as the digits need.
            let grown_by = (scale - 1.0).abs() * pose.frame_from_wrist.position.length();
            let shift = hand
                .frame_from_wrist
                .position
                .distance(pose.frame_from_wrist.position);
            assert!(shift < grown_by + 0.02, "{scale}: {shift} m");
        }
        assert!(10 * held >= 9 * all, "{scale}: {held} of {all}");
    }
}
