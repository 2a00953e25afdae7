//! Rigs of the clients' own hands.

use grasp_assets::{
    hands::glb,
    holdouts::{holdout, holdouts},
};
use grasp_client::{
    ClientError, FindAnswer, FindRequest, Handedness, NewRig, Outcome, PresentingHand, ReceivingHand,
    RigSource, built_in::request_for,
};
use grasp_proto::v1;
use grasp_synthesis::model::hand;
use grasp_tests::TestServer;
use serde_json::{Value, json};
use tonic::Code;

use crate::fixtures::{assert_blamed, blamed_fields, bounded, box_request, floating_remote, reason};

/// The built-in right hand as a model, `scale` times as large by its armature.
pub(crate) fn model(scale: f32) -> Vec<u8> {
    let file = glb("adult", hand::Handedness::Right).expect("the rig is built in");
    let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
    let mut document: Value = serde_json::from_slice(&file[20..20 + length]).unwrap();
    let nodes = document["nodes"].as_array_mut().unwrap();
    let armature = nodes.len();
    nodes.push(json!({ "name": "Armature", "scale": [scale, scale, scale], "children": [0] }));
    document["scenes"][0]["nodes"] = json!([armature, armature - 1]);
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &file[20 + length..];
    let mut changed = file[..8].to_vec();
    changed.extend(((20 + text.len() + rest.len()) as u32).to_le_bytes());
    changed.extend((text.len() as u32).to_le_bytes());
    changed.extend(b"JSON");
    changed.extend(text);
    changed.extend(rest);
    changed
}

/// A request to create a rig of a model with a right hand.
pub(crate) fn new_rig(id: &str, scale: f32) -> NewRig {
    NewRig {
        handedness: Some(Handedness::Right),
        ..NewRig::of_model(id, model(scale))
    }
}

fn create(id: &str) -> v1::CreateRigRequest {
    v1::CreateRigRequest {
        rig_id: id.to_owned(),
        source: Some(v1::create_rig_request::Source::Model(model(1.0))),
        handedness: v1::Handedness::Right.into(),
        ..Default::default()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn rigs_are_created_listed_used_and_deleted() {
    let server = TestServer::start_with(|config| config.maximum_rigs = 1.try_into().unwrap()).await;
    let client = server.client().await;
    let created = client.create_rig(&new_rig("mine", 1.0)).await.unwrap();
    assert_eq!(created.name, "rigs/mine");
    let [left, right] = &created.hands;
    assert!(left.mirrored && left.root_node.is_empty() && !right.mirrored);
    assert_eq!((right.root_node.as_str(), right.nodes.len()), ("wrist", 24));
    assert_eq!(client.get_rig("rigs/mine").await.unwrap(), created);
    let names: Vec<String> = client
        .list_rigs()
        .await
        .unwrap()
        .into_iter()
        .map(|rig| rig.name)
        .collect();
    assert_eq!(names, ["rigs/adult", "rigs/mine", "rigs/thesis"]);

    let mut rigs = server.rigs().await;
    let full = rigs.create_rig(create("more")).await.unwrap_err();
    assert_eq!(
        (full.code(), reason(&full).as_str()),
        (Code::ResourceExhausted, "TOO_MANY_RIGS")
    );
    let twice = rigs.create_rig(create("mine")).await.unwrap_err();
    assert_eq!(
        (twice.code(), reason(&twice).as_str()),
        (Code::AlreadyExists, "RIG_EXISTS")
    );
    let name = |name: &str| v1::DeleteRigRequest {
        name: name.to_owned(),
    };
    let built_in = rigs.delete_rig(name("rigs/adult")).await.unwrap_err();
    assert_eq!(
        (built_in.code(), reason(&built_in).as_str()),
        (Code::FailedPrecondition, "RIG_BUILT_IN")
    );

    let request = FindRequest {
        receiving_hand: ReceivingHand {
            rig: Some("rigs/mine".to_owned()),
            ..Default::default()
        },
        ..request_for(holdout("remote-hold1").unwrap())
    };
    let grasp = client
        .find_grasp(&request)
        .await
        .unwrap()
        .grasp
        .expect("it can be taken");
    assert_eq!(grasp.rig, "rigs/mine");
    client.delete_rig("rigs/mine").await.unwrap();
    let gone = client.get_rig("rigs/mine").await.unwrap_err();
    assert!(matches!(gone, ClientError::NotFound(_)), "{gone}");
    let refused = client.find_grasp(&request).await.unwrap_err();
    assert!(refused.to_string().contains("rigs/mine"), "{refused}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_rigs_are_refused_with_every_violation() {
    let server = TestServer::start().await;
    let mut rigs = server.rigs().await;
    let wrong = v1::CreateRigRequest {
        rig_id: "Mine".to_owned(),
        limits: vec![v1::DigitLimits::default(); 4],
        joint_map: vec![v1::RigNode::default()],
        handedness: 7,
        source: Some(v1::create_rig_request::Source::Joints(v1::JointsAtRest::default())),
        ..Default::default()
    };
    let status = rigs.create_rig(wrong).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let fields = blamed_fields(&status);
    for field in [
        "rig_id",
        "joints.hands",
        "joint_map",
        "joint_map[0].node",
        "joint_map[0].joint",
        "limits",
        "limits[0].base_yaw",
        "handedness",
    ] {
        assert!(fields.iter().any(|blamed| blamed == field), "{field}: {fields:?}");
    }
    let mut three = model(1.0);
    let at = three
        .windows(11)
        .position(|bytes| bytes == b"\"pinky-fing")
        .unwrap();
    three[at + 1] = b'x';
    let request = v1::CreateRigRequest {
        source: Some(v1::create_rig_request::Source::Model(three)),
        joint_map: vec![v1::RigNode {
            node: "nowhere".to_owned(),
            joint: "wrist".to_owned(),
            ..Default::default()
        }],
        ..create("three")
    };
    let status = rigs.create_rig(request).await.unwrap_err();
    assert!(
        blamed_fields(&status).contains(&"joint_map[0]".to_owned()),
        "{status:?}"
    );
    let scaled = |hand_scale| v1::ReceivingHand {
        hand_scale: Some(hand_scale),
        ..Default::default()
    };
    for scale in [0.0, 0.49, 2.01, f32::NAN] {
        let request = v1::FindGraspRequest {
            receiving_hand: Some(scaled(scale)),
            ..floating_remote()
        };
        assert_blamed(&server, request, &["receiving_hand.hand_scale"]).await;
    }
    server.stop().await;
}

/// How a rig answers the built-in holdouts.
#[derive(Debug, Default)]
struct Figures {
    found: usize,
    deepest: f32,
}

async fn figures(server: &TestServer, hand: ReceivingHand) -> Figures {
    let client = server.client().await;
    let mut figures = Figures::default();
    for holdout in holdouts() {
        let request = FindRequest {
            receiving_hand: hand.clone(),
            budget: Some(std::time::Duration::from_secs(5)),
            ..request_for(holdout)
        };
        let FindAnswer { outcome, grasp, .. } = client.find_grasp(&request).await.unwrap();
        figures.found += usize::from(outcome == Outcome::Found);
        let margins = grasp.and_then(|grasp| grasp.margins);
        figures.deepest = figures
            .deepest
            .max(margins.map_or(0.0, |margins| margins.penetration));
    }
    figures
}

#[tokio::test(flavor = "multi_thread")]
async fn own_hands_take_the_built_in_objects() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let hand = |rig: &str, hand_scale| ReceivingHand {
        rig: Some(rig.to_owned()),
        handedness: Some(Handedness::Right),
        hand_scale,
    };
    let all = holdouts().len();
    for (id, scale) in [("twin", 1.0), ("small", 0.85), ("large", 1.2)] {
        client.create_rig(&new_rig(id, scale)).await.unwrap();
        let own = figures(&server, hand(&format!("rigs/{id}"), None)).await;
        println!("{id}: {own:?} of {all}");
        assert!(own.found + 1 >= all, "{id}: {own:?}");
        // As for the built-in hands.
        assert!(own.deepest <= 0.0021, "{id}: {own:?}");
    }
    let scaled = figures(&server, hand("adult", Some(0.8))).await;
    println!("adult at 0.8: {scaled:?} of {all}");
    assert!(scaled.found + 1 >= all && scaled.deepest <= 0.0021, "{scaled:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_described_hand_is_its_twin_and_gives_like_it() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let adult = client.get_rig("rigs/adult").await.unwrap();
    let hands = adult.hands.iter().map(|hand| grasp_client::HandJoints {
        handedness: hand.handedness,
        joint_set: grasp_client::JointSet::OpenXr26,
        joints: hand.stretched_joints.to_vec(),
    });
    let described = NewRig {
        source: RigSource::Joints(hands.collect()),
        limits: Some(adult.hands[1].limits.map(Option::unwrap)),
        ..NewRig::of_model("twin", Vec::new())
    };
    let twin = client.create_rig(&described).await.unwrap();
    for (own, other) in twin.hands.iter().zip(&adult.hands) {
        assert!(!own.mirrored && own.nodes.is_empty());
        for (own, other) in own.stretched_joints.iter().zip(&other.stretched_joints) {
            let distance = own
                .client_from_joint
                .position
                .distance(other.client_from_joint.position);
            assert!(
                distance < 5e-4 && (own.radius - other.radius).abs() < 1e-6,
                "{distance}"
            );
        }
    }
    // A giver of the twin's rig is where one of the adult's is, whatever its size.
    let request = |rig: &str, scale| {
        let mut request = request_for(holdout("remote-hold1").unwrap());
        if let Some(PresentingHand::Angles(giver)) = &mut request.presenting_hand {
            giver.rig = rig.to_owned();
            giver.hand_scale = scale;
            // Within the limits of either.
            for digit in &mut giver.digits {
                digit.base_yaw = 0.0;
                digit.base_pitch = 0.1;
                digit.second_pitch = 0.1;
                digit.third_pitch = None;
            }
        }
        FindRequest {
            seed: Some(3),
            ..request
        }
    };
    for scale in [None, Some(0.7)] {
        let mut clearances = Vec::new();
        for rig in ["adult", "rigs/adult", "rigs/twin"] {
            let answer = client.find_grasp(&request(rig, scale)).await.unwrap();
            let margins = answer.grasp.and_then(|grasp| grasp.margins);
            clearances.push(margins.map(|margins| margins.giver_clearance.is_some()));
        }
        assert!(
            clearances.iter().all(|clearance| *clearance == clearances[0]),
            "{clearances:?}"
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_own_hand_gets_an_atlas_which_a_rig_of_the_same_hand_shares() {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let client = server.client().await;
    server
        .objects()
        .await
        .create_object(box_request("block"))
        .await
        .unwrap();
    let ask = async |rig: &str| {
        let request = FindRequest {
            receiving_hand: ReceivingHand {
                rig: Some(rig.to_owned()),
                handedness: Some(Handedness::Right),
                hand_scale: None,
            },
            budget: Some(std::time::Duration::from_secs(5)),
            ..FindRequest::new("objects/block")
        };
        let answer = Box::pin(client.find_grasp(&request)).await.unwrap();
        answer.report.atlas_entries
    };
    client.create_rig(&new_rig("first", 0.9)).await.unwrap();
    assert_eq!(ask("rigs/first").await, 0);
    bounded("the growth of an own hand's atlas", async {
        while ask("rigs/first").await == 0 {
            // Builders hardly work while searches run.
            tokio::time::sleep(std::time::Duration::from_millis(500)).await;
        }
    })
    .await;
    client.delete_rig("rigs/first").await.unwrap();
    client.create_rig(&new_rig("second", 0.9)).await.unwrap();
    assert!(ask("rigs/second").await > 0);
    // A hand of another size is another hand.
    client.create_rig(&new_rig("third", 0.91)).await.unwrap();
    assert_eq!(ask("rigs/third").await, 0);
    server.stop().await;
}
