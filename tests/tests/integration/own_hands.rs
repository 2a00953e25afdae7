//! Rigs of the clients' own hands.

use std::time::Duration;

use grasp_assets::{
    hands::glb,
    holdouts::{holdout, holdouts},
};
use grasp_client::{ClientError, built_in::request_for};
use grasp_proto::v1::{self, presenting_hand::Form};
use grasp_synthesis::model::hand;
use grasp_tests::TestServer;
use serde_json::{Value, json};
use tonic::Code;

use crate::{
    fixtures::{assert_blamed, blamed_fields, bounded, box_request, floating_remote, reason, receiving},
    parts::with,
};

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
pub(crate) fn new_rig(id: &str, scale: f32) -> v1::CreateRigRequest {
    v1::CreateRigRequest {
        handedness: v1::Handedness::Right.into(),
        ..v1::CreateRigRequest::of_model(id, model(scale))
    }
}

/// A receiver whose right hand of a rig is posed.
pub(crate) fn right_hand_of(rig: &str, scale: Option<f32>) -> v1::Receiver {
    v1::Receiver {
        rig: rig.to_owned(),
        scale,
        ..receiving(v1::Handedness::Right)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn rigs_are_created_listed_used_and_deleted() {
    let server = TestServer::start_with(|config| config.maximum_rigs = 1.try_into().unwrap()).await;
    let client = server.client().await;
    let created = client.create_rig(&new_rig("mine", 1.0)).await.unwrap();
    assert_eq!(created.name, "rigs/mine");
    let [left, right] = &created.hands[..] else {
        panic!("{created:?}");
    };
    assert!(left.mirrored && left.nodes.is_empty() && !right.mirrored);
    assert_eq!((right.nodes[0].node.as_str(), right.nodes.len()), ("wrist", 25));
    assert_eq!(right.nodes[0].joint, "wrist");
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
    let full = rigs.create_rig(new_rig("more", 1.0)).await.unwrap_err();
    assert_eq!(
        (full.code(), reason(&full).as_str()),
        (Code::ResourceExhausted, "TOO_MANY_RIGS")
    );
    let twice = rigs.create_rig(new_rig("mine", 1.0)).await.unwrap_err();
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

    let request = with(request_for(holdout("remote-hold1").unwrap()), |request| {
        "rigs/mine".clone_into(&mut request.receiver_mut().rig);
    });
    let answer = client.find_grasp(&request).await.unwrap();
    assert_eq!(answer.hand().expect("it can be taken").rig, "rigs/mine");
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
        joints: vec![v1::HandJoints::default(); 3],
        ..Default::default()
    };
    let status = rigs.create_rig(wrong).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let fields = blamed_fields(&status);
    for field in [
        "rig_id",
        "joints",
        "joint_map",
        "joint_map[0].node",
        "joint_map[0].joint",
        "limits[0].digit",
        "limits[0].min",
        "limits[0].max",
        "handedness",
    ] {
        assert!(fields.iter().any(|blamed| blamed == field), "{field}: {fields:?}");
    }
    // Exactly one of models and joints.
    for models in [Vec::new(), vec![model(1.0)]] {
        let joints = vec![v1::HandJoints::default(); models.len()];
        let request = v1::CreateRigRequest {
            rig_id: "mine".to_owned(),
            models,
            joints,
            ..Default::default()
        };
        let fields = blamed_fields(&rigs.create_rig(request).await.unwrap_err());
        assert!(fields.contains(&"models".to_owned()), "{fields:?}");
    }
    let mut three = model(1.0);
    let at = three
        .windows(11)
        .position(|bytes| bytes == b"\"pinky-fing")
        .unwrap();
    three[at + 1] = b'x';
    let request = v1::CreateRigRequest {
        models: vec![three],
        joint_map: vec![v1::RigNode {
            node: "nowhere".to_owned(),
            joint: "wrist".to_owned(),
            ..Default::default()
        }],
        ..new_rig("three", 1.0)
    };
    let status = rigs.create_rig(request).await.unwrap_err();
    assert!(
        blamed_fields(&status).contains(&"joint_map[0]".to_owned()),
        "{status:?}"
    );
    for scale in [0.0, 0.49, 2.01, f32::NAN] {
        let request = with(floating_remote(), |request| {
            request.receiver_mut().scale = Some(scale);
        });
        assert_blamed(&server, request, &["receiver.scale"]).await;
    }
    // A rig has one name.
    let request = with(floating_remote(), |request| {
        "adult".clone_into(&mut request.receiver_mut().rig);
    });
    assert_blamed(&server, request, &["receiver.rig"]).await;
    server.stop().await;
}

/// How a rig answers the built-in holdouts.
#[derive(Debug, Default)]
struct Figures {
    found: usize,
    deepest: f32,
}

async fn figures(server: &TestServer, receiver: v1::Receiver) -> Figures {
    let client = server.client().await;
    let mut figures = Figures::default();
    for holdout in holdouts() {
        let request = v1::FindGraspRequest {
            receiver: Some(receiver.clone()),
            ..request_for(holdout).with_budget(Duration::from_secs(5))
        };
        let answer = client.find_grasp(&request).await.unwrap();
        figures.found += usize::from(answer.outcome() == v1::Outcome::Found);
        let depth = answer
            .grasp()
            .map(|grasp| grasp.margin(v1::Check::Penetration).expect("it was checked"));
        figures.deepest = figures.deepest.max(depth.unwrap_or(0.0));
    }
    figures
}

#[tokio::test(flavor = "multi_thread")]
async fn own_hands_take_the_built_in_objects() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let all = holdouts().len();
    for (id, scale) in [("twin", 1.0), ("small", 0.85), ("large", 1.2)] {
        client.create_rig(&new_rig(id, scale)).await.unwrap();
        let own = figures(&server, right_hand_of(&format!("rigs/{id}"), None)).await;
        println!("{id}: {own:?} of {all}");
        assert!(own.found + 1 >= all, "{id}: {own:?}");
        // As for the built-in hands.
        assert!(own.deepest <= 0.0021, "{id}: {own:?}");
    }
    let scaled = figures(&server, right_hand_of("rigs/adult", Some(0.8))).await;
    println!("adult at 0.8: {scaled:?} of {all}");
    assert!(scaled.found + 1 >= all && scaled.deepest <= 0.0021, "{scaled:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_described_hand_is_its_twin_and_gives_like_it() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let adult = client.get_rig("rigs/adult").await.unwrap();
    let hands = adult.hands.iter();
    let described = v1::CreateRigRequest {
        rig_id: "twin".to_owned(),
        joints: hands
            .map(|hand| v1::HandJoints::new(hand.handedness(), hand.stretched_joints.clone()))
            .collect(),
        limits: adult.hands[1].limits.clone(),
        ..Default::default()
    };
    let twin = client.create_rig(&described).await.unwrap();
    for (own, other) in twin.hands.iter().zip(&adult.hands) {
        assert!(!own.mirrored && own.nodes.is_empty());
        for (own, other) in own.stretched_joints.iter().zip(&other.stretched_joints) {
            let distance = own.position().distance(other.position());
            assert!(
                distance < 5e-4 && (own.radius - other.radius).abs() < 1e-6,
                "{distance}"
            );
        }
    }
    // A giver of the twin's rig is where one of the adult's is, whatever its size.
    let request = |rig: &str, scale| {
        let mut request = request_for(holdout("remote-hold1").unwrap());
        let giver = request.holdout_mut().presenting_hand.as_mut();
        if let Some(Form::Pose(giver)) = giver.and_then(|giver| giver.form.as_mut()) {
            // Within the limits of either.
            let bent = v1::DigitAngles {
                base_pitch: 0.1,
                second_pitch: 0.1,
                ..Default::default()
            };
            *giver = v1::HandPose {
                scale,
                client_from_wrist: giver.client_from_wrist,
                ..v1::HandPose::new(rig, giver.handedness())
            }
            .with_digits([Some(bent); 5]);
        }
        request.with_seed(3)
    };
    for scale in [None, Some(0.7)] {
        let mut clearances = Vec::new();
        for rig in ["rigs/adult", "rigs/twin"] {
            let answer = client.find_grasp(&request(rig, scale)).await.unwrap();
            let grasp = answer.grasp();
            clearances.push(grasp.map(|grasp| grasp.margin(v1::Check::GiverClearance).is_some()));
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
        let request = v1::FindGraspRequest {
            receiver: Some(right_hand_of(rig, None)),
            ..v1::FindGraspRequest::new("objects/block").with_budget(Duration::from_secs(5))
        };
        let answer = Box::pin(client.find_grasp(&request)).await.unwrap();
        let atlases = answer.origin.expect("every answer has an origin").atlases;
        atlases.iter().map(|atlas| atlas.entry_count).sum::<u32>()
    };
    client.create_rig(&new_rig("first", 0.9)).await.unwrap();
    assert_eq!(ask("rigs/first").await, 0);
    bounded("the growth of an own hand's atlas", async {
        while ask("rigs/first").await == 0 {
            // Builders hardly work while searches run.
            tokio::time::sleep(Duration::from_millis(500)).await;
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
