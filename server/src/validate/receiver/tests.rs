use glam::{Mat3, Quat};

use super::*;
use crate::answer::{vector, wire_pose};
use grasp_synthesis::base::pose::Pose;
use v1::receiver::Body;

const CONVENTIONS: [Convention; 4] = [
    Convention::OpenXr,
    Convention::Unity,
    Convention::Unreal,
    Convention::Godot,
];

fn surroundings(convention: Convention) -> Surroundings {
    Surroundings {
        convention,
        object: Some(Vec3::new(0.1, 1.0, -0.4)),
        validity: Validity::Physical,
        takes_both_hands: false,
        chooses_hand: false,
    }
}

fn checked(
    sent: Option<v1::Receiver>,
    stance: v1::ReceiverStance,
    surroundings: &Surroundings,
) -> (Stances, Violations) {
    let mut violations = Violations::default();
    let stances = stances(sent, stance.into(), surroundings, &mut violations);
    (stances, violations)
}

fn arms(stances: &Stances) -> [Arm; 2] {
    [Handedness::Left, Handedness::Right].map(|side| match stances.of(side) {
        Stance::At(arm) => arm,
        other => panic!("{other:?} is no arm"),
    })
}

fn with_shoulder(shoulder: Vec3) -> v1::Receiver {
    v1::Receiver {
        body: Some(Body::ClientShoulder(vector(shoulder))),
        ..Default::default()
    }
}

fn standing(client_from_root: Pose, height: f32) -> v1::Receiver {
    v1::Receiver {
        body: Some(Body::Standing(v1::StandingBody {
            client_from_root: Some(wire_pose(client_from_root)),
            height,
        })),
        ..Default::default()
    }
}

#[test]
fn a_body_means_the_same_in_every_convention() {
    let shoulder = Vec3::new(0.3, 1.4, -0.9);
    // Two steps in front of the object, turned by 30° about the vertical.
    let root = Pose {
        position: Vec3::new(0.2, 0.1, -1.0),
        orientation: Quat::from_rotation_y(0.5),
    };
    let expected_standing = [-1.0, 1.0].map(|side| {
        let beside = Mat3::from_rotation_y(0.5) * Vec3::new(side * 0.129 * 1.8, 0.0, 0.0);
        Vec3::new(0.2, 0.1 + 0.818 * 1.8, -1.0) + beside
    });
    for convention in CONVENTIONS {
        let unit = convention.length_from_openxr(1.0);
        let around = surroundings(convention);
        let sent = v1::Receiver {
            upper_arm_length: Some(0.28 * unit),
            forearm_length: Some(0.24 * unit),
            ..with_shoulder(convention.point_from_openxr(shoulder))
        };
        let (stances, violations) = checked(Some(sent), v1::ReceiverStance::Unspecified, &around);
        assert!(violations.is_empty(), "{convention:?}: {violations:?}");
        for arm in arms(&stances) {
            assert!(arm.shoulder.distance(shoulder) < 1e-5, "{convention:?}");
            assert!((arm.upper_arm - 0.28).abs() < 1e-6 && (arm.forearm - 0.24).abs() < 1e-6);
        }
        let sent = standing(convention.pose_from_openxr(root), 1.8 * unit);
        let (stances, violations) = checked(Some(sent), v1::ReceiverStance::FacingGiver, &around);
        assert!(violations.is_empty(), "{convention:?}: {violations:?}");
        for (arm, expected) in arms(&stances).into_iter().zip(expected_standing) {
            assert!(
                arm.shoulder.distance(expected) < 1e-5,
                "{convention:?}: {} {expected}",
                arm.shoulder
            );
            assert!((arm.upper_arm - 0.186 * 1.8).abs() < 1e-6 && (arm.forearm - 0.146 * 1.8).abs() < 1e-6);
        }
    }
}

#[test]
fn a_body_faces_its_engines_forward_with_the_right_shoulder_on_its_right() {
    // Forward and up in the engine's axes; right is to the right of a body that faces forward.
    for (convention, right) in [
        (Convention::OpenXr, Vec3::X),
        (Convention::Godot, Vec3::X),
        (Convention::Unity, Vec3::X),
        (Convention::Unreal, Vec3::Y),
    ] {
        let sent = standing(Pose::IDENTITY, convention.length_from_openxr(1.7));
        let (stances, violations) = checked(
            Some(sent),
            v1::ReceiverStance::Unspecified,
            &surroundings(convention),
        );
        assert!(violations.is_empty(), "{violations:?}");
        let [left, right_arm] = arms(&stances).map(|arm| convention.point_from_openxr(arm.shoulder));
        assert!(
            (right_arm - left).normalize_or_zero().distance(right) < 1e-5,
            "{convention:?}"
        );
    }
}

#[test]
fn without_a_body_the_stance_decides() {
    for (sent, expected) in [
        (v1::ReceiverStance::Unspecified, Stance::Facing),
        (v1::ReceiverStance::FacingGiver, Stance::Facing),
        (v1::ReceiverStance::Any, Stance::Any),
    ] {
        let (stances, violations) = checked(None, sent, &surroundings(Convention::OpenXr));
        assert!(violations.is_empty());
        assert_eq!(stances, Stances::both(expected));
    }
}

#[test]
fn arm_lengths_default_to_an_adults() {
    let sent = with_shoulder(Vec3::new(0.1, 1.2, 0.0));
    let (stances, _) = checked(
        Some(sent),
        v1::ReceiverStance::Unspecified,
        &surroundings(Convention::OpenXr),
    );
    for arm in arms(&stances) {
        assert_eq!((arm.upper_arm, arm.forearm), (UPPER_ARM_LENGTH, FOREARM_LENGTH));
    }
}

/// The fields that a receiver's violations name.
fn blamed(sent: v1::Receiver, stance: v1::ReceiverStance, surroundings: &Surroundings) -> Vec<String> {
    let (stances, violations) = checked(Some(sent), stance, surroundings);
    if !violations.is_empty() {
        // Whatever is wrong, the value is usable.
        for side in [Handedness::Left, Handedness::Right] {
            assert!(!matches!(stances.of(side), Stance::At(arm) if !arm.shoulder.is_finite()));
        }
    }
    violations
        .listed
        .into_iter()
        .map(|violation| violation.field)
        .collect()
}

#[test]
fn every_field_of_a_body_is_checked() {
    let near = Vec3::new(0.1, 1.2, 0.0);
    let root = Pose::IDENTITY;
    let turned = Pose {
        orientation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.5),
        ..root
    };
    let far = Pose::from_position(Vec3::new(4.0, 0.0, 0.0));
    let bones = |upper_arm_length, forearm_length| v1::Receiver {
        upper_arm_length,
        forearm_length,
        ..with_shoulder(near)
    };
    let cases: [(v1::Receiver, &[&str]); 15] = [
        (v1::Receiver::default(), &["receiver"]),
        (
            with_shoulder(Vec3::splat(f32::NAN)),
            &["receiver.client_shoulder"],
        ),
        (
            with_shoulder(Vec3::new(0.1, 4.1, -0.4)),
            &["receiver.client_shoulder"],
        ),
        (bones(Some(0.09), None), &["receiver.upper_arm_length"]),
        (bones(Some(f32::NAN), None), &["receiver.upper_arm_length"]),
        (bones(None, Some(0.61)), &["receiver.forearm_length"]),
        (
            bones(Some(-0.3), Some(f32::INFINITY)),
            &["receiver.upper_arm_length", "receiver.forearm_length"],
        ),
        (standing(root, 0.0), &["receiver.standing.height"]),
        (standing(root, 0.79), &["receiver.standing.height"]),
        (standing(root, 2.51), &["receiver.standing.height"]),
        (standing(root, f32::NAN), &["receiver.standing.height"]),
        (
            standing(turned, 1.7),
            &["receiver.standing.client_from_root.orientation"],
        ),
        (
            standing(Pose::from_position(Vec3::splat(f32::INFINITY)), 1.7),
            &["receiver.standing.client_from_root.position"],
        ),
        (
            standing(turned, 3.0),
            &[
                "receiver.standing.client_from_root.orientation",
                "receiver.standing.height",
            ],
        ),
        (standing(far, 1.7), &["receiver.standing"]),
    ];
    for (sent, fields) in cases {
        let around = surroundings(Convention::OpenXr);
        assert_eq!(
            blamed(sent, v1::ReceiverStance::Unspecified, &around),
            fields,
            "{sent:?}"
        );
    }
    assert!(
        blamed(
            bones(Some(0.1), Some(0.6)),
            v1::ReceiverStance::Unspecified,
            &surroundings(Convention::OpenXr)
        )
        .is_empty()
    );
}

#[test]
fn bounds_are_in_the_clients_unit() {
    let (_, violations) = checked(
        Some(standing(Pose::IDENTITY, 1.8)),
        v1::ReceiverStance::Unspecified,
        &surroundings(Convention::Unreal),
    );
    assert_eq!(
        violations.listed[0].description,
        "is 1.8; it must be 80 to 250 (0.8 to 2.5 m)"
    );
    let (_, violations) = checked(
        Some(with_shoulder(Vec3::new(40.0, 10.0, 500.0))),
        v1::ReceiverStance::Unspecified,
        &surroundings(Convention::Unreal),
    );
    let text = &violations.listed[0].description;
    assert!(text.ends_with("it must be within 300 (3 m)"), "{text}");
}

#[test]
fn a_body_excludes_what_does_not_know_it() {
    let near = with_shoulder(Vec3::new(0.1, 1.2, 0.0));
    let around = surroundings(Convention::OpenXr);
    assert_eq!(
        blamed(near, v1::ReceiverStance::Any, &around),
        ["receiver_stance"]
    );
    let thesis = Surroundings {
        validity: Validity::Thesis,
        ..around
    };
    assert_eq!(
        blamed(near, v1::ReceiverStance::Unspecified, &thesis),
        ["receiver"]
    );
    let both = Surroundings {
        takes_both_hands: true,
        ..around
    };
    assert_eq!(blamed(near, v1::ReceiverStance::Unspecified, &both), ["receiver"]);
    let either = Surroundings {
        chooses_hand: true,
        ..around
    };
    let fields = blamed(near, v1::ReceiverStance::Unspecified, &either);
    assert_eq!(fields, ["receiving_hand.handedness"]);
    let standing = standing(Pose::IDENTITY, 1.7);
    assert!(blamed(standing, v1::ReceiverStance::Unspecified, &either).is_empty());
    // A wrong pose of the object is not blamed on the body.
    let lost = Surroundings {
        object: None,
        ..around
    };
    assert!(
        blamed(
            with_shoulder(Vec3::splat(99.0)),
            v1::ReceiverStance::Unspecified,
            &lost
        )
        .is_empty()
    );
}
