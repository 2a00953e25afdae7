//! Grips of an object that its owner knows: tried first, or not answered.

use glam::Vec3;
use grasp_client::{
    ClientError, Convention, FallReason, FindAnswer, FindRequest, Grasp, GraspSource, HandAngles, Handedness,
    KnownGrip, NewObject, ObjectUpdate, Pose, PresentingHand, ReceivingHand,
};
use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::Code;

use crate::fixtures::{BOX_OBJ, blamed_fields, box_request};

/// What is near a banned grip unless it says otherwise, in metres and radians.
const NEAR: (f32, f32) = (0.03, 0.5);

async fn server_with_box(known_grips: Vec<KnownGrip>) -> TestServer {
    let server = TestServer::start().await;
    let object = NewObject {
        known_grips,
        ..NewObject::new("crate", BOX_OBJ, 0.1)
    };
    server
        .client()
        .await
        .create_object(&object)
        .await
        .expect("the box is sound");
    server
}

fn request(seed: u64) -> FindRequest {
    FindRequest {
        seed: Some(seed),
        reproducible: true,
        budget: Some(std::time::Duration::from_secs(10)),
        receiving_hand: ReceivingHand {
            handedness: Some(Handedness::Right),
            ..ReceivingHand::default()
        },
        ..FindRequest::new("objects/crate")
    }
}

async fn find(server: &TestServer, request: &FindRequest) -> FindAnswer {
    let answer = server.client().await.find_grasp(request).await;
    answer.expect("the request is valid")
}

/// A grasp that the service finds for the box.
async fn found(seed: u64) -> Grasp {
    let server = server_with_box(Vec::new()).await;
    let answer = find(&server, &request(seed)).await;
    server.stop().await;
    answer.grasp.expect("a box can be held")
}

fn preferred(grasp: &Grasp) -> KnownGrip {
    KnownGrip::preferred("mine", grasp.handedness, grasp.object_from_wrist, grasp.digits)
}

fn distances(a: Pose, b: Pose) -> (f32, f32) {
    (
        a.position.distance(b.position),
        a.orientation.angle_between(b.orientation),
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn a_valid_preferred_grip_is_answered_whatever_else_there_is() {
    let grasp = found(3).await;
    let server = server_with_box(vec![preferred(&grasp)]).await;
    for choice in [None, Some(grasp_client::Choice::BestWithinBudget)] {
        for reproducible in [true, false] {
            for seed in 0..4 {
                let request = FindRequest {
                    choice,
                    reproducible: reproducible && choice.is_none(),
                    budget: Some(std::time::Duration::from_millis(300)),
                    ..request(seed)
                };
                let answer = find(&server, &request).await;
                assert_eq!(answer.report.source, Some(GraspSource::Preferred), "{request:?}");
                assert_eq!(answer.report.preferred_grip.as_deref(), Some("mine"));
                let answered = answer.grasp.expect("the source says so");
                let (shift, turn) = distances(answered.object_from_wrist, grasp.object_from_wrist);
                assert!(shift < 1e-4 && turn < 1e-3, "{shift} m, {turn} rad");
                for (new, old) in answered.digits.iter().zip(&grasp.digits) {
                    assert!((new.base_pitch - old.base_pitch).abs() < 0.02);
                }
            }
        }
    }
    // It is of the right hand only.
    let left = FindRequest {
        receiving_hand: ReceivingHand {
            handedness: Some(Handedness::Left),
            ..ReceivingHand::default()
        },
        ..request(0)
    };
    assert_ne!(
        find(&server, &left).await.report.source,
        Some(GraspSource::Preferred)
    );
    // Of either hand, it precedes others.
    let either = FindRequest {
        receiving_hand: ReceivingHand::default(),
        ..request(0)
    };
    assert_eq!(
        find(&server, &either).await.report.source,
        Some(GraspSource::Preferred)
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn fingers_of_a_preferred_grip_close_on_the_object() {
    let mut grasp = found(3).await;
    for digit in &mut grasp.digits {
        digit.second_pitch *= 0.93;
        digit.base_pitch *= 0.93;
        digit.third_pitch = digit.third_pitch.map(|angle| angle * 0.93);
    }
    let server = server_with_box(vec![preferred(&grasp)]).await;
    let answer = find(&server, &request(0)).await;
    assert_eq!(answer.report.source, Some(GraspSource::Preferred));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_preferred_grip_that_the_giver_blocks_is_not_answered() {
    let grasp = found(3).await;
    let server = server_with_box(vec![preferred(&grasp)]).await;
    // The giver holds the box with the very same grip.
    let held = FindRequest {
        presenting_hand: Some(PresentingHand::Angles(HandAngles {
            rig: "adult".to_owned(),
            handedness: Handedness::Right,
            client_from_wrist: grasp.object_from_wrist,
            digits: grasp.digits,
            hand_scale: None,
        })),
        ..request(0)
    };
    let answer = find(&server, &held).await;
    assert_ne!(answer.report.source, Some(GraspSource::Preferred));
    assert_eq!(answer.report.preferred_grip, None);
    let [passed_over] = answer.report.passed_over.as_slice() else {
        panic!("{:?}", answer.report.passed_over);
    };
    assert_eq!(
        (passed_over.name.as_str(), passed_over.fall.reason),
        ("mine", FallReason::Giver)
    );
    // Where nothing was passed over, nothing is reported.
    assert!(find(&server, &request(0)).await.report.passed_over.is_empty());
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_saved_answer_is_a_known_grip_in_the_convention_that_it_was_answered_in() {
    let in_openxr = found(3).await;
    let server = server_with_box(Vec::new()).await;
    let client = server.client().await;
    for convention in [
        Convention::OpenXr,
        Convention::Unity,
        Convention::Unreal,
        Convention::Godot,
    ] {
        let cleared = ObjectUpdate {
            known_grips: Some(Vec::new()),
            ..ObjectUpdate::default()
        };
        client
            .update_object("objects/crate", &cleared)
            .await
            .expect("the update is right");
        let asked = FindRequest {
            convention,
            ..request(3)
        };
        let saved = find(&server, &asked).await.grasp.expect("a box can be held");
        let grips = vec![KnownGrip {
            convention,
            ..preferred(&saved)
        }];
        let update = ObjectUpdate {
            known_grips: Some(grips.clone()),
            ..ObjectUpdate::default()
        };
        let changed = client.update_object("objects/crate", &update).await;
        assert_eq!(changed.expect("the update is right").known_grips, grips);
        let answer = find(&server, &request(0)).await;
        assert_eq!(
            answer.report.preferred_grip.as_deref(),
            Some("mine"),
            "{convention:?}"
        );
        let answered = answer.grasp.expect("the source says so").object_from_wrist;
        let (shift, turn) = distances(answered, in_openxr.object_from_wrist);
        assert!(
            shift < 1e-4 && turn < 1e-3,
            "{convention:?}: {shift} m, {turn} rad"
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn grips_that_cannot_be_right_are_refused_by_name() {
    let grasp = found(3).await;
    let server = server_with_box(Vec::new()).await;
    let client = server.client().await;
    let mut wrong = Vec::new();
    for convention in [Convention::Unreal, Convention::Godot] {
        let asked = FindRequest {
            convention,
            ..request(3)
        };
        let saved = find(&server, &asked).await.grasp.expect("a box can be held");
        wrong.push((preferred(&saved), "known_grips[0].convention"));
    }
    for way in [Vec3::Y, Vec3::NEG_X * 0.04] {
        let mut elsewhere = preferred(&grasp);
        elsewhere.object_from_wrist.position = way;
        wrong.push((elsewhere, "known_grips[0].object_from_wrist"));
    }
    for (grip, field) in wrong {
        let object = NewObject {
            known_grips: vec![grip.clone()],
            ..NewObject::new("refused", BOX_OBJ, 0.1)
        };
        let update = ObjectUpdate {
            known_grips: Some(vec![grip]),
            ..ObjectUpdate::default()
        };
        let created = client.create_object(&object).await.map(|_| ());
        let updated = client.update_object("objects/crate", &update).await.map(|_| ());
        for refused in [created, updated] {
            let Err(ClientError::InvalidArgument(call)) = refused else {
                panic!("{field}: {refused:?}");
            };
            let violations = &call.details.field_violations;
            assert_eq!((violations.len(), violations[0].field.as_str()), (1, field));
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_preferred_grip_follows_the_surface_to_other_sizes() {
    /// Half the edges of the box, in metres.
    const HALF: Vec3 = Vec3::new(0.02, 0.015, 0.01);
    let grasp = found(3).await;
    let server = server_with_box(vec![preferred(&grasp)]).await;
    for scale in [0.8, 0.95, 1.05, 1.1, 1.2, 1.35, 1.5] {
        let sized = FindRequest {
            object_scale: Some(scale),
            ..request(0)
        };
        let answer = find(&server, &sized).await;
        assert_eq!(
            answer.report.preferred_grip.as_deref(),
            Some("mine"),
            "{scale}: {:?}",
            answer.report.passed_over
        );
        let answered = answer.grasp.expect("the source says so");
        for contact in &answered.contacts {
            let beyond = contact.object_position.abs() - scale * HALF;
            assert!(beyond.max_element().abs() < 1e-4, "{scale}: {beyond}");
        }
        let (shift, turn) = distances(answered.object_from_wrist, grasp.object_from_wrist);
        let grown = (scale - 1.0).abs() * HALF.length();
        assert!(
            shift < grown + 0.012 && turn < 1e-3,
            "{scale}: {shift} m, {turn} rad"
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_stay_beyond_the_neighbourhood_of_banned_grips() {
    let server = server_with_box(Vec::new()).await;
    let client = server.client().await;
    let mut banned: Vec<KnownGrip> = Vec::new();
    for round in 0..6 {
        for request in [
            request(3),
            FindRequest {
                reproducible: false,
                receiving_hand: ReceivingHand::default(),
                ..request(round)
            },
        ] {
            let grasp = find(&server, &request).await.grasp.expect("a box can be held");
            for ban in banned.iter().filter(|ban| ban.handedness == grasp.handedness) {
                let (shift, turn) = distances(ban.object_from_wrist, grasp.object_from_wrist);
                assert!(
                    shift >= NEAR.0 || turn >= NEAR.1,
                    "{shift} m, {turn} rad from {}",
                    ban.name
                );
            }
            let name = format!("ban {}", banned.len());
            banned.push(KnownGrip::banned(name, grasp.handedness, grasp.object_from_wrist));
            let update = ObjectUpdate {
                known_grips: Some(banned.clone()),
                ..ObjectUpdate::default()
            };
            let changed = client.update_object("objects/crate", &update).await;
            assert_eq!(changed.expect("the update is right").known_grips, banned);
        }
    }
    // Another change keeps them; an empty list removes them.
    let heavier = ObjectUpdate {
        mass_kg: Some(0.12),
        ..ObjectUpdate::default()
    };
    let changed = client.update_object("objects/crate", &heavier).await;
    assert_eq!(changed.expect("the update is right").known_grips, banned);
    let cleared = ObjectUpdate {
        known_grips: Some(Vec::new()),
        ..ObjectUpdate::default()
    };
    let changed = client.update_object("objects/crate", &cleared).await;
    assert!(changed.expect("the update is right").known_grips.is_empty());
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_wrong_grip_is_named() {
    let server = TestServer::start().await;
    let digits = |count: usize, base_pitch: f32| {
        let digit = v1::DigitAngles {
            base_pitch,
            ..Default::default()
        };
        vec![digit; count]
    };
    let right = v1::Handedness::Right.into();
    let wrong = v1::CreateObjectRequest {
        known_grips: vec![
            v1::KnownGrip::default(),
            v1::KnownGrip {
                name: "a".to_owned(),
                r#use: v1::KnownGripUse::Preferred.into(),
                rig: "giant".to_owned(),
                handedness: right,
                hand_scale: Some(3.0),
                digits: digits(4, 0.0),
                near_metres: Some(0.1),
                ..Default::default()
            },
            v1::KnownGrip {
                name: "a".to_owned(),
                r#use: v1::KnownGripUse::Preferred.into(),
                rig: "adult".to_owned(),
                handedness: right,
                digits: digits(5, 3.0),
                ..Default::default()
            },
            v1::KnownGrip {
                name: "b".to_owned(),
                r#use: v1::KnownGripUse::Banned.into(),
                handedness: right,
                near_metres: Some(2.0),
                near_radians: Some(f32::NAN),
                ..Default::default()
            },
        ],
        ..box_request("crate")
    };
    let refused = server.objects().await.create_object(wrong).await;
    let status = refused.expect_err("it is wrong");
    assert_eq!(status.code(), Code::InvalidArgument);
    assert_eq!(
        blamed_fields(&status),
        [
            "known_grips[0].name",
            "known_grips[0].handedness",
            "known_grips[0].use",
            "known_grips[1].hand_scale",
            "known_grips[1].rig",
            "known_grips[1].digits",
            "known_grips[1].near_metres",
            "known_grips[2].name",
            "known_grips[2].digits[0].base_pitch",
            "known_grips[2].digits[1].base_pitch",
            "known_grips[2].digits[2].base_pitch",
            "known_grips[2].digits[3].base_pitch",
            "known_grips[2].digits[4].base_pitch",
            "known_grips[3].near_metres",
            "known_grips[3].near_radians",
        ]
    );
    server.stop().await;
}
