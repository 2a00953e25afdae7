//! Hands with fewer than five digits, as in cartoons, take and give.

use grasp_assets::holdouts::{BuiltInHoldout, holdout, holdouts};
use grasp_characters::{
    Character, Style,
    names::{mixamo, webxr},
};
use grasp_client::GraspClient;
use grasp_proto::v1::{self, Digit, presenting_hand::Form};
use grasp_synthesis::model::hand;
use grasp_tests::TestServer;

use crate::{
    fixtures::{assert_blamed, blamed_fields, built_in_request, floating_remote, of_thesis, unaided},
    own_models::{drawn, measure},
    parts::{hand as hand_of, reproducible, with},
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

fn cartoon(fingers: &'static [hand::Digit]) -> Vec<u8> {
    let style = Style {
        name: mixamo,
        units_per_metre: 100.0,
        fingers,
        ..Style::PLAIN
    };
    Character::new(&style).glb
}

fn taken_by(rig: &str, holdout: &BuiltInHoldout) -> v1::FindGraspRequest {
    let request = built_in_request(holdout)
        .receiving(v1::Handedness::Right)
        .with_budget(std::time::Duration::from_secs(20))
        .with_key_frames();
    with(request, |request| rig.clone_into(&mut request.receiver_mut().rig))
}

/// The digits that a hand of a rig has.
fn digits_of(hand: &v1::RigHand) -> Vec<Digit> {
    hand.limits.iter().map(v1::DigitLimits::digit).collect()
}

/// Nothing in a grasp is of a digit that the hand does not have.
fn assert_only(digits: &[Digit], grasp: &v1::Grasp, holdout: &str) {
    let has = |digit: usize| digits.contains(&ALL[digit]);
    for contact in &grasp.contacts {
        let digit = contact.digit();
        assert!(
            digit == Digit::Unspecified || digits.contains(&digit),
            "{holdout}: {contact:?}"
        );
    }
    let frames = grasp.key_frames.iter();
    let posed = frames.map(|frame| frame.hand.as_ref().expect("a key frame has a hand"));
    for hand in posed.chain([hand_of(grasp)]) {
        for (digit, range) in JOINTS.into_iter().enumerate() {
            let are_missing = hand.joints[range]
                .iter()
                .all(|joint| *joint == v1::JointPose::default());
            assert_eq!(are_missing, !has(digit), "{holdout}: digit {digit}");
            assert_eq!(hand.digits()[digit].is_some(), has(digit), "{holdout}: {digit}");
        }
    }
    let names = ["Thumb", "Index", "Middle", "Ring", "Pinky"];
    let model = &hand_of(grasp).model;
    for (digit, name) in names.iter().enumerate() {
        let is_posed = model.iter().any(|node| node.node.contains(name));
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
            .create_rig(&v1::CreateRigRequest::of_model(id, glb.clone()))
            .await
            .unwrap();
        for hand in &rig.hands {
            assert_eq!(digits_of(hand), digits);
            for (digit, range) in JOINTS.into_iter().enumerate() {
                let is_there = digits.contains(&ALL[digit]);
                let joints = &hand.stretched_joints[range];
                assert!(
                    joints
                        .iter()
                        .all(|joint| (*joint == v1::JointPose::default()) != is_there)
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
            // Each time the same grasps, whose contacts are compared with the drawn skin.
            let request = reproducible(taken_by(&rig.name, holdout).with_seed(1));
            let answer = client.find_grasp(&unaided(request)).await.unwrap();
            let Some(grasp) = answer.grasp() else {
                continue;
            };
            found += 1;
            assert_only(digits, grasp, &holdout.name);
            let skin = drawn(&glb, hand_of(grasp));
            let (from_contacts, depth) = measure(&skin, grasp, holdout);
            contacts.extend(from_contacts);
            let penetration = grasp.margin(v1::Check::Penetration);
            deeper.push(depth - penetration.expect("it was checked"));
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
    let rig = v1::CreateRigRequest::of_model("four", cartoon(FOUR));
    client.create_rig(&rig).await.unwrap();
    (server, client)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hand_of_four_digits_gives() {
    let (server, client) = with_four_digits().await;
    let mut request = built_in_request(holdout("remote-hold1").unwrap());
    let giver = request.holdout_mut().presenting_hand.as_mut();
    let Some(Form::Pose(giver)) = giver.and_then(|giver| giver.form.as_mut()) else {
        panic!("the giver is given by angles");
    };
    // Within the limits of either rig.
    let bent = v1::DigitAngles {
        base_pitch: 0.1,
        second_pitch: 0.1,
        ..Default::default()
    };
    "rigs/four".clone_into(&mut giver.rig);
    let [thumb, index, middle, ring, _] = [Some(bent); 5];
    *giver = giver.clone().with_digits([thumb, index, middle, ring, None]);
    let answer = client.find_grasp(&request).await.unwrap();
    let grasp = answer.grasp().expect("it can be taken");
    let clearance = grasp.margin(v1::Check::GiverClearance);
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
    let with_four = with(floating_remote(), |request| {
        "rigs/four".clone_into(&mut request.receiver_mut().rig);
    });
    let thesis = of_thesis(with_four.clone());
    assert_blamed(&server, thesis, &["receiver.rig"]).await;
    let little = with(with_four, |request| {
        request.requirements_mut().must_touch = vec![Digit::Little.into()];
    });
    assert_blamed(&server, little, &["requirements.must_touch"]).await;

    let style = Style {
        name: thumbless,
        ..Style::PLAIN
    };
    let refused = client
        .create_rig(&v1::CreateRigRequest::of_model(
            "thumbless",
            Character::new(&style).glb,
        ))
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
    let mut rigs = server.rigs().await;
    let mut adult = client.get_rig("rigs/adult").await.unwrap();
    let stretched = adult.hands.remove(1).stretched_joints;
    let described = |id: &str, missing: &[usize]| {
        let mut joints = stretched.clone();
        for &digit in missing {
            joints[JOINTS[digit].clone()].fill(v1::JointPose::default());
        }
        v1::CreateRigRequest {
            rig_id: id.to_owned(),
            joints: vec![v1::HandJoints::new(v1::Handedness::Right, joints)],
            ..Default::default()
        }
    };
    for (id, missing) in [("no-ring", &[3][..]), ("no-middle", &[2]), ("two", &[1, 2])] {
        let rig = client.create_rig(&described(id, missing)).await.unwrap();
        let digits: Vec<_> = ALL
            .into_iter()
            .enumerate()
            .filter(|(digit, _)| !missing.contains(digit))
            .map(|(_, digit)| digit)
            .collect();
        assert_eq!(digits_of(&rig.hands[0]), digits);
        assert!(rig.hands[0].mirrored);
        let sent = &described(id, missing).joints[0].joints;
        let again = &rig.hands[1].stretched_joints;
        assert_eq!(again.len(), sent.len());
        for (joint, (again, sent)) in again.iter().zip(sent).enumerate() {
            assert_eq!(again.pose.is_some(), sent.pose.is_some(), "{id}: {joint}");
        }
        let request = taken_by(&format!("rigs/{id}"), holdout("remote-hold1").unwrap());
        assert!(
            client.find_grasp(&request).await.unwrap().grasp().is_some(),
            "{id}"
        );
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
