use glam::{Mat3, Quat};
use grasp_synthesis::base::pose::Pose;

use super::*;
use crate::{
    error::Violation,
    validate::{Violations, testing::CONVENTIONS},
};

fn surroundings(convention: Convention) -> Surroundings {
    Surroundings {
        convention,
        object: Some(Vec3::new(0.1, 1.0, -0.4)),
        validity: Validity::Physical,
        takes_both_hands: false,
        chooses_hand: false,
    }
}

fn checked(sent: &v1::Receiver, surroundings: &Surroundings) -> (Stances, Vec<Violation>) {
    let violations = Violations::default();
    let stances = stances(violations.field("receiver"), sent, surroundings);
    (stances, violations.into_listed())
}

fn arms(stances: &Stances) -> [Arm; 2] {
    [Handedness::Left, Handedness::Right].map(|side| match stances.of(side) {
        Stance::At(arm) => arm,
        other => panic!("{other:?} is no arm"),
    })
}

fn with_shoulder(shoulder: Vec3) -> v1::Receiver {
    v1::Receiver {
        body: Some(Body::ClientShoulder(shoulder.into())),
        ..Default::default()
    }
}

fn standing(client_from_root: Pose, height: f32) -> v1::Receiver {
    v1::Receiver {
        body: Some(Body::ClientFromRoot(v1::Pose::new(
            client_from_root.position,
            client_from_root.orientation,
        ))),
        height,
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
        let (stances, violations) = checked(&sent, &around);
        assert!(violations.is_empty(), "{convention:?}: {violations:?}");
        for arm in arms(&stances) {
            assert!(arm.shoulder.distance(shoulder) < 1e-5, "{convention:?}");
            assert!((arm.upper_arm - 0.28).abs() < 1e-6 && (arm.forearm - 0.24).abs() < 1e-6);
        }
        let sent = standing(convention.pose_from_openxr(root), 1.8 * unit);
        let (stances, violations) = checked(&sent, &around);
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
fn without_a_shoulder_the_receiver_faces_the_giver_or_stands_anywhere() {
    for (body, expected) in [
        (None, Stance::Facing),
        (Some(Body::Anywhere(false)), Stance::Facing),
        (Some(Body::Anywhere(true)), Stance::Any),
    ] {
        let sent = v1::Receiver {
            body,
            ..Default::default()
        };
        let (stances, violations) = checked(&sent, &surroundings(Convention::OpenXr));
        assert!(violations.is_empty());
        assert_eq!(stances, Stances::both(expected, None));
    }
}

#[test]
fn a_reach_alone_takes_the_place_of_the_arm() {
    let shoulder = Vec3::new(0.3, 1.4, -0.9);
    for convention in CONVENTIONS {
        let unit = convention.length_from_openxr(1.0);
        let sent = v1::Receiver {
            max_reach: Some(0.7 * unit),
            ..with_shoulder(convention.point_from_openxr(shoulder))
        };
        // Whoever poses which hands.
        for (validity, takes_both_hands, chooses_hand) in [
            (Validity::Physical, false, true),
            (Validity::Physical, true, false),
            (Validity::Thesis, false, false),
        ] {
            let around = Surroundings {
                validity,
                takes_both_hands,
                chooses_hand,
                ..surroundings(convention)
            };
            let (stances, violations) = checked(&sent, &around);
            assert!(violations.is_empty(), "{violations:?}");
            for side in [Handedness::Left, Handedness::Right] {
                assert_eq!(stances.of(side), Stance::Facing);
                let reach = stances.reach(side).expect("a reach was sent");
                assert!(reach.shoulder.distance(shoulder) < 1e-6, "{convention:?}");
                assert!((reach.distance - 0.7).abs() < 1e-6, "{convention:?}");
            }
        }
    }
}

#[test]
fn an_arm_may_have_a_reach_around_its_own_shoulder() {
    let around = surroundings(Convention::OpenXr);
    let near = v1::Receiver {
        forearm_length: Some(0.25),
        ..with_shoulder(Vec3::new(0.1, 1.2, 0.0))
    };
    for sent in [near, standing(Pose::IDENTITY, 1.7)] {
        let (without, _) = checked(&sent, &around);
        let sent = v1::Receiver {
            max_reach: Some(0.4),
            ..sent
        };
        let (with, violations) = checked(&sent, &around);
        assert!(violations.is_empty(), "{violations:?}");
        let sides = [Handedness::Left, Handedness::Right];
        for ((side, arm), same) in sides.into_iter().zip(arms(&with)).zip(arms(&without)) {
            assert_eq!(arm, same);
            assert_eq!(without.reach(side), None);
            let reach = Reach {
                shoulder: arm.shoulder,
                distance: 0.4,
            };
            assert_eq!(with.reach(side), Some(reach));
        }
    }
}

#[test]
fn arm_lengths_default_to_an_adults() {
    let sent = with_shoulder(Vec3::new(0.1, 1.2, 0.0));
    let (stances, _) = checked(&sent, &surroundings(Convention::OpenXr));
    for arm in arms(&stances) {
        assert_eq!((arm.upper_arm, arm.forearm), (UPPER_ARM_LENGTH, FOREARM_LENGTH));
    }
}

/// The fields of a receiver that violations name.
fn blamed(sent: &v1::Receiver, surroundings: &Surroundings) -> Vec<String> {
    let (stances, violations) = checked(sent, surroundings);
    if !violations.is_empty() {
        // Whatever is wrong, the value is usable.
        for side in [Handedness::Left, Handedness::Right] {
            assert!(!matches!(stances.of(side), Stance::At(arm) if !arm.shoulder.is_finite()));
        }
    }
    let fields = violations.into_iter().map(|violation| violation.field);
    fields.map(|field| field.replace("receiver.", "")).collect()
}

#[test]
fn bounds_are_in_the_clients_unit() {
    let (_, violations) = checked(&standing(Pose::IDENTITY, 1.8), &surroundings(Convention::Unreal));
    assert_eq!(
        violations[0].description,
        "is 1.8; it must be 80 to 250 (0.8 to 2.5 m)"
    );
    let (_, violations) = checked(
        &with_shoulder(Vec3::new(40.0, 10.0, 500.0)),
        &surroundings(Convention::Unreal),
    );
    let text = &violations[0].description;
    assert!(text.ends_with("it must be within 300 (3 m)"), "{text}");
}

#[test]
fn a_body_excludes_what_does_not_know_it() {
    let near = with_shoulder(Vec3::new(0.1, 1.2, 0.0));
    let around = surroundings(Convention::OpenXr);
    let thesis = Surroundings {
        validity: Validity::Thesis,
        ..around
    };
    let both = Surroundings {
        takes_both_hands: true,
        ..around
    };
    let either = Surroundings {
        chooses_hand: true,
        ..around
    };
    // With lengths, there is an arm, whatever its reach.
    let reaching = v1::Receiver {
        max_reach: Some(0.7),
        upper_arm_length: Some(0.3),
        ..near.clone()
    };
    let standing = standing(Pose::IDENTITY, 1.7);
    for around in [&thesis, &both] {
        assert_eq!(blamed(&near, around), ["client_shoulder"]);
        assert_eq!(blamed(&reaching, around), ["client_shoulder"]);
        assert_eq!(blamed(&standing, around), ["client_from_root"]);
    }
    assert_eq!(blamed(&near, &either), ["handedness"]);
    assert_eq!(blamed(&reaching, &either), ["handedness"]);
    assert!(blamed(&standing, &either).is_empty());
    // A wrong pose of the object is not blamed on the body.
    let lost = Surroundings {
        object: None,
        ..around
    };
    assert!(blamed(&with_shoulder(Vec3::splat(99.0)), &lost).is_empty());
}
