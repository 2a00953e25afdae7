use glam::Quat;
use grasp_assets::hands::hand;
use grasp_synthesis::{
    geometry::tapered_capsule::TaperedCapsule,
    model::hand::{HandPose, Handedness, joints::index},
};

use super::*;

fn rod() -> TriangleMesh {
    let solid = TaperedCapsule::new(Vec3::NEG_X * 0.1, Vec3::X * 0.1, 0.012, 0.012);
    let rod = primitives::capsule("rod", &solid, Vec3::ONE);
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
            "giver_sleeve",
            "receiver_hand",
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
        let [low, high] = reach(arrow, contact.position, along);
        assert!(high.abs() < 1e-6, "{name} ends {high} m after the contact");
        assert!((low + MAX_ARROW * share).abs() < 1e-5, "{name} begins at {low} m");
    }
}

/// How far a part reaches along a direction from a point: least and most.
fn reach(part: &Part, from: Vec3, direction: Vec3) -> [f32; 2] {
    let along = part.positions.iter().map(|&p| (p - from).dot(direction));
    along.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

#[test]
fn hands_are_skinned_as_the_core_does_and_sleeves_start_at_their_wrists() {
    let object = rod();
    let handover = handover(&object);
    let scene = handover.to_scene();
    for (who, hand) in [("giver", &handover.giver), ("receiver", &handover.receiver)] {
        let hand = hand.as_ref().expect("a hand");
        assert_eq!(
            part(&scene, &format!("{who}_hand")).positions,
            hand.skin.posed(&hand.joints)
        );
        let joints = &hand.joints.joints;
        let wrist = joints[index::WRIST].pose.position;
        let to_fingers = (joints[index::TIP_OF_DIGIT[2]].pose.position - wrist).normalize_or_zero();
        let [low, high] = reach(part(&scene, &format!("{who}_sleeve")), wrist, to_fingers);
        assert!(
            (-0.02..0.02).contains(&high) && low < -0.1,
            "{who}: {low} to {high}"
        );
    }
}

#[test]
fn a_known_arm_has_sleeves_from_wrist_to_shoulder_that_cover_the_skin() {
    let object = rod();
    let posed = handover(&object);
    let receiver = posed.receiver.as_ref().expect("a hand");
    let wrist = receiver.joints.joints[index::WRIST].pose;
    // A wrist that is bent by 50 degrees.
    let forearm = (wrist * Pose::from_position(Vec3::new(0.0, 0.76, 0.64) * 0.25)).position - wrist.position;
    let arm = ArmJoints {
        shoulder: wrist.position + forearm + Vec3::new(-0.2, 0.2, 0.1),
        elbow: wrist.position + forearm,
    };
    let scene = HandoverScene {
        arm: Some(arm),
        ..posed.clone()
    }
    .to_scene();
    assert!(scene.parts.iter().all(|part| part.name != "receiver_sleeve"));
    let along = forearm.normalize_or_zero();
    let lower = part(&scene, "receiver_forearm");
    let [low, high] = reach(lower, wrist.position, along);
    assert!(
        (0.0..0.02).contains(&low) && (high - 0.25).abs() < 0.01,
        "{low} to {high}"
    );
    let upper = part(&scene, "receiver_upper_arm");
    let [low, high] = reach(upper, arm.elbow, (arm.shoulder - arm.elbow).normalize_or_zero());
    assert!(low < -0.03 && high > 0.33, "{low} to {high}");
    // The skin in front of the wrist stays, and that behind the cuff is within the sleeve.
    let skin = &part(&scene, "receiver_hand").positions;
    for (bent, straight) in skin.iter().zip(receiver.skin.posed(&receiver.joints)) {
        if wrist.inverse().transform_point(straight).z < -0.012 {
            assert_eq!(*bent, straight);
        }
        let beyond = (*bent - wrist.position).dot(along);
        let off = (*bent - wrist.position - along * beyond).length();
        let is_far = bent.distance(wrist.position) > 0.07;
        assert!(
            beyond < 0.02 || is_far || off < 0.04,
            "{bent} is {off} m off the forearm"
        );
    }
}

#[test]
fn picture_shows_hands_object_and_contacts() {
    let object = rod();
    let options = RenderOptions {
        width: 150,
        height: 120,
        supersampling: 2,
        ..RenderOptions::default()
    };
    let image = handover(&object).render_best_view(options);
    assert_eq!((image.width(), image.height()), (150, 120));
    let count = |is_wanted: fn([i32; 3]) -> bool| {
        let pixels = image.rgb().chunks(3);
        let pixels = pixels.map(|pixel| [0, 1, 2].map(|channel| i32::from(pixel[channel])));
        pixels.filter(|pixel| is_wanted(*pixel)).count()
    };
    assert!(count(|[r, _, b]| b > r + 20) > 100, "the giver's sleeve is blue");
    assert!(
        count(|[r, _, b]| r > 200 && r > b + 120) > 5,
        "contacts are yellow, forces orange"
    );
    assert!(
        count(|[r, _, b]| r > b + 30 && r < 200) > 500,
        "the receiver's hand is brown"
    );
}
