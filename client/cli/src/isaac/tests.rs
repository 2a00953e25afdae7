use std::fs;

use super::*;

const GRASP: &str = "
  mine:
    confidence: 1
    position: [0, 0.1, 0]
    orientation: {w: 1, xyz: [0, 0, 0]}
    cspace_position: {thumb_base_yaw: 0, thumb_base_pitch: 0.5, thumb_second_pitch: 1}";

fn object(z_up: bool) -> GraspObject {
    GraspObject {
        name: "objects/mug".to_owned(),
        z_up,
        ..GraspObject::default()
    }
}

fn path(name: &str) -> std::path::PathBuf {
    std::env::temp_dir().join(format!("{}-{name}", std::process::id()))
}

/// The grasps of a text.
fn parsed(name: &str, text: &str, gripper: Option<&Gripper>) -> Result<Vec<(String, HandPose)>, String> {
    let path = path(name);
    fs::write(&path, text).unwrap();
    let grasps = read(&path, &object(false), gripper);
    fs::remove_file(path).unwrap();
    grasps.map_err(|failure| failure.message)
}

/// A hand with four digits; the last joint of one follows the one before.
fn hand(wrist: Pose) -> HandPose {
    let digit = |number: usize| {
        let at = |angle: usize| (number * 4 + angle) as f32 / 17.0 - 0.7;
        let angles = DigitAngles::new([at(0), at(1), at(2), at(3)]);
        let third_pitch = angles.third_pitch.filter(|_| number != 2);
        (number != 3).then_some(DigitAngles {
            third_pitch,
            ..angles
        })
    };
    let hand = HandPose {
        scale: Some(1.1),
        ..HandPose::new("rigs/mine", Handedness::Left)
    };
    hand.with_digits(std::array::from_fn(digit))
        .with_object_from_wrist(wrist)
}

fn named(name: &str, hand: HandPose) -> NamedGrasp {
    NamedGrasp {
        name: name.to_owned(),
        hand,
        confidence: 0.75,
        pre_grasp: None,
    }
}

#[test]
fn grasps_are_read_as_they_were_written_and_in_their_order() {
    let wrist = Pose::new(
        Vec3::new(0.1, 1.0 / 3.0, -0.2),
        Quat::from_xyzw(0.1, 0.7, 0.1, 0.7).normalize(),
    );
    let open = named(
        "open: \"yes\"",
        hand(Pose::default()).with_object_from_wrist(wrist),
    );
    let grasps = [open, named("again", hand(wrist))];
    for z_up in [false, true] {
        let path = path(&format!("round-trip-{z_up}"));
        write(&path, &object(z_up), &grasps).unwrap();
        let mut read = read(&path, &object(z_up), None).unwrap();
        fs::remove_file(path).unwrap();
        if z_up {
            // Turned there and back.
            for (_, hand) in &mut read {
                let turned = hand.object_from_wrist.replace(wrist).unwrap();
                assert!(turned.position().distance(wrist.position()) < 1e-6);
                assert!(turned.orientation().dot(wrist.orientation()).abs() > 1.0 - 1e-6);
            }
        }
        let written = grasps
            .iter()
            .map(|grasp| (grasp.name.clone(), grasp.hand.clone()));
        assert_eq!(read, written.collect::<Vec<_>>());
    }
}

#[test]
fn files_have_the_keys_and_the_axes_that_other_programs_read() {
    let path = path("keys");
    let wrist = Pose::new(Vec3::new(1.0, 2.0, 3.0), Quat::IDENTITY);
    let pre_grasp = Some(hand(wrist));
    let grasp = NamedGrasp {
        pre_grasp,
        ..named("mine", hand(wrist))
    };
    write(&path, &object(true), &[grasp]).unwrap();
    let written: Value = yaml_serde::from_slice(&fs::read(&path).unwrap()).unwrap();
    fs::remove_file(path).unwrap();
    assert_eq!(written["format"], "isaac_grasp");
    assert_eq!(written["format_version"], 1.0);
    assert_eq!(written["object_frame"], "objects/mug");
    assert_eq!(written["gripper_frame"], "rigs/mine/left/1.1");
    let grasp = &written["grasps"]["mine"];
    assert_eq!(grasp["confidence"], 0.75);
    // +Z up, as in the object's mesh file.
    for (place, expected) in [1.0, -3.0, 2.0].into_iter().enumerate() {
        assert!((grasp["position"][place].as_f64().unwrap() - expected).abs() < 1e-6);
    }
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!((grasp["orientation"]["w"].as_f64().unwrap() - half).abs() < 1e-6);
    assert!((grasp["orientation"]["xyz"][0].as_f64().unwrap() - half).abs() < 1e-6);
    assert!(grasp["cspace_position"]["thumb_base_yaw"].is_number());
    assert_eq!(grasp["pregrasp_cspace_position"], grasp["cspace_position"]);
}

#[test]
fn files_of_other_programs_are_read_by_a_named_gripper() {
    let gripper = "rigs/adult/right".parse().unwrap();
    for header in [
        "format_version: 1.0\nobject_frame_link: /World/mug\ngripper_frame_link: /World/hand",
        "format_version: '1.0'\ncreated_with: graspgen",
    ] {
        let text = format!("format: isaac_grasp\n{header}\ngrasps:{GRASP}\n");
        let read = parsed("other", &text, Some(&gripper)).unwrap();
        let thumb = DigitAngles {
            base_pitch: 0.5,
            second_pitch: 1.0,
            ..DigitAngles::default()
        };
        let wrist = Pose::new(Vec3::new(0.0, 0.1, 0.0), Quat::IDENTITY);
        let hand = HandPose::new("rigs/adult", Handedness::Right);
        let hand = hand.with_digits([Some(thumb), None, None, None, None]);
        let hand = hand.with_object_from_wrist(wrist);
        assert_eq!(read, [("mine".to_owned(), hand)]);
    }
}

#[test]
fn errors_name_the_place() {
    let file = |version: &str, gripper: &str, grasps: &str| {
        format!("format: isaac_grasp\nformat_version: {version}\ngripper_frame: {gripper}\ngrasps:{grasps}\n")
    };
    let ours = |grasps: &str| file("1.0", "rigs/adult/right", grasps);
    let panda = GRASP.replace("thumb_base_yaw: 0", "panda_finger_joint1: 0.04");
    for (text, expected) in [
        ("format: other".to_owned(), "format: isaac_grasp"),
        (file("2.0", "rigs/adult/right", GRASP), "format_version"),
        (
            file("1.0", "/World/panda_hand", GRASP),
            "\"/World/panda_hand\" is not a hand",
        ),
        (
            ours(&panda),
            "grasps.mine: a hand has no joints panda_finger_joint1; it has thumb, index",
        ),
        (
            ours(&GRASP.replace("thumb_base_yaw: 0, ", "")),
            "grasps.mine: cspace_position lacks angles of the digit thumb",
        ),
        (
            ours(&GRASP.replace("cspace_position", "other")),
            "grasps.mine: cspace_position has no joints",
        ),
        (ours(&GRASP.replace("w: 1, ", "")), "missing field `w`"),
        (
            ours(&GRASP.replace("[0, 0.1, 0]", "[0, 0.1]")),
            "grasps.mine.position",
        ),
        (ours(&format!("{GRASP}{GRASP}")), "duplicate entry"),
        ("format: isaac_grasp: 1".to_owned(), "line 1"),
    ] {
        let message = parsed("wrong", &text, None).unwrap_err();
        assert!(message.contains(expected), "{message} lacks {expected}");
    }
}

#[test]
fn a_file_has_one_gripper() {
    let other = HandPose::new("rigs/mine", Handedness::Right);
    let grasps = [named("a", hand(Pose::default())), named("b", other)];
    let message = write(&path("two"), &object(false), &grasps).unwrap_err().message;
    assert!(
        message.ends_with("rigs/mine/left/1.1, rigs/mine/right; choose one"),
        "{message}"
    );
    for wrong in [
        "",
        "rigs/adult",
        "rigs//left",
        "rigs/adult/both",
        "rigs/adult/left/x",
        "objects/adult/left",
    ] {
        assert!(wrong.parse::<Gripper>().is_err(), "{wrong:?}");
    }
}
