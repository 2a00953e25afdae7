//! Hands with fewer than five digits, as in cartoons, take and give.

use grasp_assets::holdouts::{BuiltInHoldout, holdout, holdouts};
use grasp_characters::{
    Character, Style,
    names::{mixamo, webxr},
};
use grasp_client::{
    AtlasUse, Digit, FindRequest, Grasp, GraspClient, HandAngles, Handedness, JointPose, NewRig,
    PresentingHand, ReceivingHand, built_in::request_for,
};
use grasp_proto::v1;
use grasp_synthesis::model::hand;
use grasp_tests::TestServer;

use crate::{
    fixtures::{assert_blamed, blamed_fields, floating_remote},
    own_models::{drawn, measure},
};

/// The joints of each digit.
const JOINTS: [std::ops::RangeInclusive<usize>; 5] = [2..=5, 6..=10, 11..=15, 16..=20, 21..=25];

const FOUR: &[hand::Digit] = &[hand::Digit::Index, hand::Digit::Middle, hand::Digit::Ring];
const THREE: &[hand::Digit] = &[hand::Digit::Index, hand::Digit::Middle];
const ALL: [Digit; 5] = [
    Digit::Thumb,
    Digit::Index,
    Digit::Middle,
    Digit::Ring,
    Digit::Little,
];

const WIRE_DIGITS: [v1::Digit; 5] = [
    v1::Digit::Thumb,
    v1::Digit::Index,
    v1::Digit::Middle,
    v1::Digit::Ring,
    v1::Digit::Little,
];

fn cartoon(fingers: &'static [hand::Digit]) -> Vec<u8> {
    let style = Style {
        name: mixamo,
        units_per_metre: 100.0,
        fingers,
        ..Style::PLAIN
    };
    Character::new(&style).glb
}

fn taken_by(rig: &str, holdout: &BuiltInHoldout) -> FindRequest {
    FindRequest {
        receiving_hand: ReceivingHand {
            rig: Some(rig.to_owned()),
            handedness: Some(Handedness::Right),
            ..Default::default()
        },
        budget: Some(std::time::Duration::from_secs(20)),
        plan_key_frames: true,
        ..request_for(holdout)
    }
}

/// Nothing in a grasp is of a digit that the hand does not have.
fn assert_only(digits: &[Digit], grasp: &Grasp, holdout: &str) {
    let has = |digit: usize| digits.contains(&ALL[digit]);
    for contact in &grasp.contacts {
        assert!(
            contact.digit.is_none_or(|digit| digits.contains(&digit)),
            "{holdout}: {contact:?}"
        );
    }
    let posed = std::iter::once((&grasp.digits, &grasp.joints));
    let frames = grasp
        .key_frames
        .iter()
        .map(|frame| (&frame.digits, &frame.joints));
    for (angles, joints) in posed.chain(frames) {
        for (digit, range) in JOINTS.into_iter().enumerate() {
            let are_missing = joints[range].iter().all(|joint| *joint == JointPose::MISSING);
            assert_eq!(are_missing, !has(digit), "{holdout}: digit {digit}");
            if are_missing {
                assert_eq!((angles[digit].base_pitch, angles[digit].third_pitch), (0.0, None));
            }
        }
    }
    let names = ["Thumb", "Index", "Middle", "Ring", "Pinky"];
    let model = grasp.model.as_ref().expect("the hand has a model");
    for (digit, name) in names.iter().enumerate() {
        let is_posed = model.nodes.iter().any(|node| node.node.contains(name));
        assert_eq!(is_posed, has(digit), "{holdout}: {name}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn hands_take_with_the_fingers_that_they_have() {
    let server = TestServer::start().await;
    let client = server.client().await;
    for (id, fingers, digits, least) in [("four", FOUR, &ALL[..4], 13), ("three", THREE, &ALL[..3], 11)] {
        let glb = cartoon(fingers);
        let rig = client
            .create_rig(&NewRig::of_model(id, glb.clone()))
            .await
            .unwrap();
        for hand in &rig.hands {
            assert_eq!(hand.digits, digits);
            for (digit, range) in JOINTS.into_iter().enumerate() {
                let is_there = hand.digits.contains(&ALL[digit]);
                assert_eq!(hand.limits[digit].is_some(), is_there);
                let joints = &hand.stretched_joints[range];
                assert!(
                    joints
                        .iter()
                        .all(|joint| (*joint == JointPose::MISSING) != is_there)
                );
            }
        }
        assert!(
            rig.warnings
                .iter()
                .any(|warning| warning.contains("the left hand has no")),
            "{:?}",
            rig.warnings
        );
        let (mut found, mut contacts, mut deeper) = (0, Vec::new(), Vec::new());
        for holdout in holdouts() {
            let request = FindRequest {
                // Each time the same grasps, whose contacts are compared with the drawn skin.
                seed: Some(1),
                reproducible: true,
                atlas: Some(AtlasUse::None),
                ..taken_by(&rig.name, holdout)
            };
            let Some(grasp) = client.find_grasp(&request).await.unwrap().grasp else {
                continue;
            };
            found += 1;
            assert_only(digits, &grasp, &holdout.name);
            let skin = drawn(&glb, grasp.model.as_ref().unwrap());
            let (from_contacts, depth) = measure(&skin, &grasp, holdout);
            contacts.extend(from_contacts);
            deeper.push(depth - grasp.margins.as_ref().expect("it was checked").penetration);
        }
        contacts.sort_by(f32::total_cmp);
        deeper.sort_by(f32::total_cmp);
        println!("{id}: {found} found, contacts {contacts:?}, deeper {deeper:?}");
        assert!(found >= least, "{id}: {found}");
        assert!(contacts[contacts.len() / 2] < 0.0005, "{id}: {contacts:?}");
        assert!(contacts[contacts.len() * 9 / 10] < 0.001, "{id}: {contacts:?}");
        // Beside the stumps of what is missing.
        assert!(contacts[contacts.len() - 1] < 0.0025, "{id}: {contacts:?}");
        assert!(deeper[deeper.len() - 1] < 0.001, "{id}: {deeper:?}");
    }
    server.stop().await;
}

/// A server with the rig of a hand of four digits.
async fn with_four_digits() -> (TestServer, GraspClient) {
    let server = TestServer::start().await;
    let client = server.client().await;
    let rig = NewRig::of_model("four", cartoon(FOUR));
    client.create_rig(&rig).await.unwrap();
    (server, client)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hand_of_four_digits_gives() {
    let (server, client) = with_four_digits().await;
    let mut request = request_for(holdout("remote-hold1").unwrap());
    let Some(PresentingHand::Angles(HandAngles { rig, digits, .. })) = &mut request.presenting_hand else {
        panic!("the giver is given by angles");
    };
    "rigs/four".clone_into(rig);
    // Within the limits of either rig.
    for digit in digits {
        digit.base_yaw = 0.0;
        digit.base_pitch = 0.1;
        digit.second_pitch = 0.1;
        digit.third_pitch = None;
    }
    let answer = client.find_grasp(&request).await.unwrap();
    let grasp = answer.grasp.expect("it can be taken");
    let clearance = grasp.margins.and_then(|margins| margins.giver_clearance);
    assert!(
        clearance.is_some_and(|clearance| clearance > 0.0),
        "{clearance:?}"
    );
    server.stop().await;
}

fn thumbless(side: hand::Handedness, joint: usize) -> Option<String> {
    webxr(side, joint).filter(|_| !JOINTS[0].contains(&joint))
}

#[tokio::test(flavor = "multi_thread")]
async fn what_such_hands_cannot_do_is_refused_by_name() {
    let (server, client) = with_four_digits().await;
    let four = || {
        Some(v1::ReceivingHand {
            rig: "rigs/four".to_owned(),
            ..Default::default()
        })
    };
    let thesis = v1::FindGraspRequest {
        receiving_hand: four(),
        validity: v1::Validity::Thesis.into(),
        ..floating_remote()
    };
    assert_blamed(&server, thesis, &["receiving_hand.rig"]).await;
    let little = v1::FindGraspRequest {
        receiving_hand: four(),
        constraints: Some(v1::Constraints {
            must_touch: vec![v1::Digit::Little.into()],
            ..Default::default()
        }),
        ..floating_remote()
    };
    assert_blamed(&server, little, &["constraints.must_touch"]).await;

    let style = Style {
        name: thumbless,
        ..Style::PLAIN
    };
    let refused = client
        .create_rig(&NewRig::of_model("thumbless", Character::new(&style).glb))
        .await
        .unwrap_err()
        .to_string();
    assert!(refused.contains("thumb: is missing"), "{refused}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_described_hand_leaves_fingers_empty() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let adult = client.get_rig("rigs/adult").await.unwrap();
    let mut rigs = server.rigs().await;
    let stretched = rigs
        .get_rig(v1::GetRigRequest {
            name: adult.name.clone(),
        })
        .await
        .unwrap()
        .into_inner()
        .rig
        .unwrap()
        .hands
        .remove(1)
        .stretched_joints;
    let described = |id: &str, missing: &[usize]| {
        let mut joints = stretched.clone();
        for &digit in missing {
            joints[JOINTS[digit].clone()].fill(v1::JointPose::default());
        }
        v1::CreateRigRequest {
            rig_id: id.to_owned(),
            source: Some(v1::create_rig_request::Source::Joints(v1::JointsAtRest {
                hands: vec![v1::HandJoints {
                    handedness: v1::Handedness::Right.into(),
                    joint_set: v1::JointSet::Openxr26.into(),
                    joints,
                }],
            })),
            ..Default::default()
        }
    };
    for (id, missing) in [("no-ring", &[3][..]), ("no-middle", &[2]), ("two", &[1, 2])] {
        let rig = rigs
            .create_rig(described(id, missing))
            .await
            .unwrap()
            .into_inner()
            .rig
            .unwrap();
        let digits: Vec<i32> = WIRE_DIGITS
            .into_iter()
            .enumerate()
            .filter(|(digit, _)| !missing.contains(digit))
            .map(|(_, digit)| digit.into())
            .collect();
        assert_eq!(rig.hands[0].digits, digits);
        assert!(rig.hands[0].mirrored);
        let again: Vec<bool> = rig.hands[1]
            .stretched_joints
            .iter()
            .map(|joint| joint.client_from_joint.is_some())
            .collect();
        for (joint, (again, sent)) in again
            .iter()
            .zip(&described(id, missing).source.map(joints_of).unwrap())
            .enumerate()
        {
            assert_eq!(again, sent, "{id}: {joint}");
        }
        let request = taken_by(&format!("rigs/{id}"), holdout("remote-hold1").unwrap());
        assert!(client.find_grasp(&request).await.unwrap().grasp.is_some(), "{id}");
    }
    for missing in [&[0][..], &[1, 2, 3]] {
        let status = rigs.create_rig(described("wrong", missing)).await.unwrap_err();
        assert!(
            blamed_fields(&status)
                .iter()
                .any(|field| field.starts_with("joints")),
            "{status:?}"
        );
    }
    server.stop().await;
}

fn joints_of(source: v1::create_rig_request::Source) -> Vec<bool> {
    let v1::create_rig_request::Source::Joints(joints) = source else {
        panic!("it has joints");
    };
    joints.hands[0]
        .joints
        .iter()
        .map(|joint| joint.client_from_joint.is_some())
        .collect()
}
