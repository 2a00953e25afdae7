use glam::Quat;
use grasp_assets::hands::hand;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{mesh::TriangleMesh, tapered_capsule::TaperedCapsule},
    model::hand::{
        Handedness,
        joints::{index, openxr_from_thesis_frame},
    },
};

use super::*;
use crate::{
    hands::{PosedHand, posed},
    parts::capsule,
};

const CLIENT_FROM_OBJECT: Vec3 = Vec3::new(0.0, 0.0, 0.01);

fn rod() -> TriangleMesh {
    let solid = TaperedCapsule::new(Vec3::NEG_X * 0.1, Vec3::X * 0.1, 0.012, 0.012);
    let rod = capsule("rod", &solid, Vec3::ONE);
    TriangleMesh::new(rod.positions, rod.triangles).expect("a valid mesh")
}

/// A stretched hand, in both frames, with its joints.
fn stretched(handedness: Handedness, frame_from_wrist: Pose) -> v1::HandPose {
    let rig = &hand("adult", handedness).expect("a built-in hand").rig;
    let wrist = openxr_from_thesis_frame(frame_from_wrist);
    let joints = posed(rig, wrist, rig.stretched()).joints;
    let sent = |pose: Pose| v1::Pose::new(pose.position, pose.orientation);
    let side = match handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    };
    let digits = rig
        .stretched()
        .map(|digit| Some(v1::DigitAngles::new(digit.to_array())));
    let object_from_wrist = Pose::from_position(-CLIENT_FROM_OBJECT) * wrist;
    v1::HandPose {
        joints: joints
            .map(|joint| v1::JointPose::new(sent(joint.pose), joint.radius))
            .into(),
        ..v1::HandPose::new("rigs/adult", side)
            .with_client_from_wrist(sent(wrist))
            .with_object_from_wrist(sent(object_from_wrist))
            .with_digits(digits)
    }
}

fn handover() -> Handover {
    let turned = Quat::from_rotation_z(3.0) * Quat::from_rotation_x(0.4);
    let mark = |position: Vec3, force: Vec3, digit: v1::Digit| v1::Contact {
        position: Some(position.into()),
        normal: Some(position.normalize_or(Vec3::Y).into()),
        force: Some(force.into()),
        digit: digit.into(),
        phalanx: 3,
        ..v1::Contact::default()
    };
    let behind = Pose::from_position(Vec3::new(0.05, -0.1, -0.03));
    let giver = stretched(Handedness::Left, behind);
    let receiver = stretched(Handedness::Right, Pose::new(Vec3::new(-0.05, 0.1, 0.03), turned));
    Handover {
        object: Part::object(&rod(), &[0, 5, 9, 100_000], Vec3::ONE, Finish::Satin),
        holdout: v1::Holdout {
            client_from_object: Some(v1::Pose::new(CLIENT_FROM_OBJECT, Quat::IDENTITY)),
            presenting_hand: Some(giver.into()),
            ..v1::Holdout::default()
        },
        grasps: vec![v1::Grasp {
            hand: Some(receiver),
            contacts: vec![
                mark(Vec3::Y * 0.012, Vec3::new(0.0, -4.0, 1.0), v1::Digit::Thumb),
                mark(Vec3::Y * -0.012, Vec3::Y * 2.0, v1::Digit::Index),
                mark(Vec3::new(0.01, -0.012, 0.0), Vec3::ZERO, v1::Digit::Index),
                mark(Vec3::new(0.02, 0.012, 0.0), Vec3::NEG_Y, v1::Digit::Unspecified),
            ],
            ..v1::Grasp::default()
        }],
        model: None,
    }
}

fn part<'a>(parts: &'a [Part], name: &str) -> &'a Part {
    let found = parts.iter().find(|part| part.name == name);
    found.unwrap_or_else(|| panic!("no part is named {name}"))
}

#[test]
fn names_parts_by_content() {
    let parts = handover().parts().unwrap();
    let names: Vec<&str> = parts.iter().map(|part| part.name.as_str()).collect();
    let expected = "object giver_hand giver_sleeve receiver_hand receiver_sleeve contact_thumb_third force_thumb_third \
         contact_index_third force_index_third contact_index_third_2 contact_palm force_palm";
    assert_eq!(names.join(" "), expected);
    let extras = part(&parts, "force_thumb_third").extras.as_ref().unwrap();
    assert_eq!([&extras["digit"], &extras["phalanx"]], ["thumb", "third"]);
    let newtons = extras["force_n"].as_f64().unwrap();
    assert!((newtons - 17.0_f64.sqrt()).abs() < 1e-6);
    // The arrow ends at the contact.
    let thumb = &handover().grasps[0].client_contacts()[0];
    let along = thumb.force().normalize_or_zero();
    let [low, high] = reach(part(&parts, "force_thumb_third"), thumb.position(), along);
    assert!(
        high.abs() < 1e-6 && (low + MAX_ARROW).abs() < 1e-5,
        "{low} to {high}"
    );
}

#[test]
fn places_object_and_colours_forbidden_triangles_red() {
    let object = rod();
    let parts = handover().parts().unwrap();
    let drawn = part(&parts, "object");
    for (index, &triangle) in drawn.triangles.iter().enumerate() {
        let expected = object.corners(index).map(|p| p + CLIENT_FROM_OBJECT);
        assert_eq!(drawn.corners(triangle), expected);
        let is_red = triangle.map(|v| {
            let colour = drawn.vertex_colour(v);
            colour.x > 3.0 * colour.y
        });
        assert_eq!(is_red, [[0, 5, 9].contains(&index); 3], "triangle {index}");
    }
}

/// How far a part reaches along a direction from a point: least and most.
fn reach(part: &Part, from: Vec3, direction: Vec3) -> [f32; 2] {
    let along = part.positions.iter().map(|&p| (p - from).dot(direction));
    along.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

fn drawn_receiver(handover: &Handover) -> PosedHand {
    receiver(handover.grasps[0].hand.as_ref().unwrap()).unwrap()
}

#[test]
fn hands_are_skinned_as_the_core_does_and_sleeves_start_at_their_wrists() {
    let handover = handover();
    let parts = handover.parts().unwrap();
    let hand = drawn_receiver(&handover);
    let expected = hand.skin.posed(&hand.joints);
    assert_eq!(part(&parts, "receiver_hand").positions, expected);
    let joints = &hand.joints.joints;
    let wrist = joints[index::WRIST].pose.position;
    let to_fingers = (joints[index::TIP_OF_DIGIT[2]].pose.position - wrist).normalize_or_zero();
    let [low, high] = reach(part(&parts, "receiver_sleeve"), wrist, to_fingers);
    assert!((-0.02..0.02).contains(&high) && low < -0.1, "{low} to {high}");
}

#[test]
fn a_known_arm_has_sleeves_from_wrist_to_shoulder_that_cover_the_skin() {
    let mut handover = handover();
    let receiver = drawn_receiver(&handover);
    let wrist = receiver.joints.joints[index::WRIST].pose;
    // A wrist that is bent by 50 degrees.
    let forearm = wrist.transform_vector(Vec3::new(0.0, 0.76, 0.64) * 0.25);
    let elbow = wrist.position + forearm;
    let shoulder = elbow + Vec3::new(-0.2, 0.2, 0.1);
    handover.grasps[0].arm = Some(v1::Arm {
        client_shoulder: Some(shoulder.into()),
        client_elbow: Some(elbow.into()),
        ..v1::Arm::default()
    });
    let parts = handover.parts().unwrap();
    assert!(parts.iter().all(|part| part.name != "receiver_sleeve"));
    let along = forearm.normalize_or_zero();
    let [low, high] = reach(part(&parts, "receiver_forearm"), wrist.position, along);
    let is_long = (0.0..0.02).contains(&low) && (high - 0.25).abs() < 0.01;
    assert!(is_long, "{low} to {high}");
    let upper = part(&parts, "receiver_upper_arm");
    let [low, high] = reach(upper, elbow, (shoulder - elbow).normalize_or_zero());
    assert!(low < -0.03 && high > 0.33, "{low} to {high}");
    // The skin in front of the wrist stays, and that behind the cuff is within the sleeve.
    let skin = &part(&parts, "receiver_hand").positions;
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
    let (width, height) = (150, 120);
    let image = handover().draw(ViewSize { width, height }).unwrap();
    assert_eq!((image.width, image.height), (150, 120));
    let count = |is_wanted: fn([i32; 3]) -> bool| {
        let pixels = image.rgb.chunks(3);
        let pixels = pixels.map(|pixel| [0, 1, 2].map(|channel| i32::from(pixel[channel])));
        pixels.filter(|pixel| is_wanted(*pixel)).count()
    };
    assert!(count(|[r, _, b]| b > r + 20) > 100, "the giver's sleeve is blue");
    let marks = count(|[r, _, b]| r > 200 && r > b + 120);
    assert!(marks > 5, "contacts are yellow, forces orange");
    let skin = count(|[r, _, b]| r > b + 30 && r < 200);
    assert!(skin > 500, "the receiver's hand is brown");
}
