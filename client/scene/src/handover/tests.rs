use glam::Quat;
use grasp_assets::hands::hand;
use grasp_synthesis::model::hand::{HandPose, Handedness};

use super::*;
use crate::primitives::capsule;

fn rod() -> TriangleMesh {
    let rod = capsule(
        "rod",
        Vec3::new(-0.1, 0.0, 0.0),
        Vec3::new(0.1, 0.0, 0.0),
        0.012,
        [1.0; 4],
    );
    TriangleMesh::new(rod.positions, rod.triangles).expect("a valid mesh")
}

fn posed(handedness: Handedness, frame_from_wrist: Pose) -> PosedHand<'static> {
    let hand = hand("adult", handedness).expect("a built-in hand");
    let pose = HandPose {
        frame_from_wrist,
        digits: hand.rig.stretched(),
    };
    PosedHand {
        skin: &hand.skin,
        joints: HandJoints::of_pose(&hand.rig, &pose),
    }
}

fn handover(object: &TriangleMesh) -> HandoverScene<'_> {
    let turned = Quat::from_rotation_z(3.0) * Quat::from_rotation_x(0.4);
    let mark = |position: Vec3, force: Vec3, digit| ContactMark {
        position,
        normal: position.normalize_or(Vec3::Y),
        force,
        digit,
        phalanx: digit.map(|_| Phalanx::Third),
    };
    HandoverScene {
        forbidden: &[0, 5, 9, 100_000],
        giver: Some(posed(
            Handedness::Left,
            Pose::from_position(Vec3::new(0.05, -0.1, -0.03)),
        )),
        receiver: Some(posed(
            Handedness::Right,
            Pose::new(Vec3::new(-0.05, 0.1, 0.03), turned),
        )),
        contacts: vec![
            mark(
                Vec3::new(0.0, 0.012, 0.0),
                Vec3::new(0.0, -4.0, 1.0),
                Some(Digit::Thumb),
            ),
            mark(
                Vec3::new(0.0, -0.012, 0.0),
                Vec3::new(0.0, 2.0, 0.0),
                Some(Digit::Index),
            ),
            mark(Vec3::new(0.01, -0.012, 0.0), Vec3::ZERO, Some(Digit::Index)),
            mark(Vec3::new(0.02, 0.012, 0.0), Vec3::NEG_Y, None),
        ],
        ..HandoverScene::new(object, Pose::from_position(Vec3::new(0.0, 0.0, 0.01)))
    }
}

fn part<'a>(scene: &'a Scene, name: &str) -> &'a Part {
    let found = scene.parts.iter().find(|part| part.name == name);
    found.unwrap_or_else(|| panic!("no part is named {name}"))
}

#[test]
fn names_parts_by_content() {
    let object = rod();
    let scene = handover(&object).to_scene();
    let names: Vec<&str> = scene.parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "object",
            "giver_hand",
            "giver_nails",
            "giver_sleeve",
            "receiver_hand",
            "receiver_nails",
            "receiver_sleeve",
            "contact_thumb_third",
            "force_thumb_third",
            "contact_index_third",
            "force_index_third",
            "contact_index_third_2",
            "contact_palm",
            "force_palm",
        ]
    );
    let extras = part(&scene, "force_thumb_third").extras.as_ref().expect("extras");
    assert_eq!(extras["digit"], "thumb");
    assert_eq!(extras["phalanx"], "third");
    let newtons = extras["force_n"].as_f64().expect("a number");
    assert!((newtons - 17.0_f64.sqrt()).abs() < 1e-6);
}

#[test]
fn places_object_and_colours_forbidden_triangles_red() {
    let object = rod();
    let scene = handover(&object).to_scene();
    let drawn = part(&scene, "object");
    for (index, triangle) in drawn.triangles.iter().enumerate() {
        let corners = triangle.map(|v| drawn.positions[v as usize]);
        assert_eq!(
            corners,
            object.corners(index).map(|p| p + Vec3::new(0.0, 0.0, 0.01))
        );
        let is_red = triangle.map(|v| {
            let colour = drawn.vertex_colour(v);
            colour.x > 3.0 * colour.y
        });
        assert_eq!(is_red, [[0, 5, 9].contains(&index); 3], "triangle {index}");
    }
}

#[test]
fn arrows_end_at_the_contact_and_point_along_the_force() {
    let object = rod();
    let handover = handover(&object);
    let scene = handover.to_scene();
    for (contact, name, share) in [
        (0, "force_thumb_third", 1.0),
        (1, "force_index_third", 2.0 / 17.0_f32.sqrt()),
    ] {
        let contact = &handover.contacts[contact];
        let along = contact.force.normalize_or_zero();
        let arrow = part(&scene, name);
        let reach = arrow.positions.iter().map(|&p| (p - contact.position).dot(along));
        let (low, high) = reach.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), r| {
            (l.min(r), h.max(r))
        });
        assert!(high.abs() < 1e-6, "{name} ends {high} m after the contact");
        assert!((low + MAX_ARROW * share).abs() < 1e-5, "{name} begins at {low} m");
    }
}

#[test]
fn sleeves_start_at_wrist_and_point_away_from_fingers() {
    let object = rod();
    let handover = handover(&object);
    let scene = handover.to_scene();
    for (name, hand) in [
        ("giver_sleeve", &handover.giver),
        ("receiver_sleeve", &handover.receiver),
    ] {
        let joints = &hand.as_ref().expect("a hand").joints.joints;
        let wrist = joints[index::WRIST].pose.position;
        let to_fingers = joints[index::TIP_OF_DIGIT[2]].pose.position - wrist;
        let reach = part(&scene, name)
            .positions
            .iter()
            .map(|&p| (p - wrist).dot(to_fingers.normalize_or_zero()));
        let (low, high) = reach.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), r| {
            (l.min(r), h.max(r))
        });
        assert!(
            (-0.02..0.02).contains(&high) && low < -0.1,
            "{name} reaches from {low} to {high}"
        );
    }
}

#[test]
fn a_known_arm_takes_the_place_of_the_receivers_sleeve() {
    let object = rod();
    let arm = ArmJoints {
        shoulder: Vec3::new(-0.5, 0.3, 0.2),
        elbow: Vec3::new(-0.3, 0.1, 0.1),
    };
    let handover = HandoverScene {
        arm: Some(arm),
        ..handover(&object)
    };
    let scene = handover.to_scene();
    let wrist = handover.receiver.as_ref().expect("a hand").joints.joints[index::WRIST];
    let is_there = |name: &str| scene.parts.iter().any(|part| part.name == name);
    assert!(is_there("giver_sleeve") && !is_there("receiver_sleeve"));
    for (name, ends) in [
        ("receiver_forearm", [wrist.pose.position, arm.elbow]),
        ("receiver_upper_arm", [arm.elbow, arm.shoulder]),
    ] {
        for end in ends {
            let positions = &part(&scene, name).positions;
            let nearest = positions
                .iter()
                .map(|p| p.distance(end))
                .fold(f32::INFINITY, f32::min);
            assert!(nearest < 0.04, "{name} is {nearest} m from {end}");
        }
    }
}

#[test]
fn every_digit_has_a_nail_on_its_skin() {
    let object = rod();
    let handover = handover(&object);
    let scene = handover.to_scene();
    let (skin, nails) = (part(&scene, "receiver_hand"), part(&scene, "receiver_nails"));
    let joints = &handover.receiver.as_ref().expect("a hand").joints.joints;
    for tip in index::TIP_OF_DIGIT {
        let joint = joints[tip];
        let near = |p: &&Vec3| p.distance(joint.pose.position) < 2.5 * joint.radius;
        let of_tip: Vec<_> = nails.positions.iter().filter(near).collect();
        assert!(
            of_tip.len() > 50,
            "joint {tip} has {} vertices of a nail",
            of_tip.len()
        );
        let centre = of_tip.iter().copied().sum::<Vec3>() / of_tip.len() as f32;
        // Out of the back of the finger, not out of its pad.
        let local = joint.pose.inverse().transform_point(centre);
        assert!(
            local.y > 0.3 * joint.radius,
            "the nail of joint {tip} is at {local}"
        );
        let closest = skin
            .positions
            .iter()
            .map(|p| p.distance(centre))
            .fold(f32::INFINITY, f32::min);
        assert!(
            closest < 4e-3,
            "the nail of joint {tip} floats {closest} m off the skin"
        );
    }
}

#[test]
fn picture_shows_two_views() {
    let object = rod();
    let options = RenderOptions {
        width: 150,
        height: 120,
        supersampling: 2,
        ..RenderOptions::default()
    };
    let image = handover(&object).render(options);
    assert!(image.width() > 300 && image.height() == 120);
    let left: Vec<_> = (0..150).map(|x| image.pixel(x, 60)).collect();
    let right: Vec<_> = (0..150)
        .map(|x| image.pixel(image.width() - 150 + x, 60))
        .collect();
    assert_ne!(left, right);
}
