//! Rigs of the clients' own hands. Answers pose the nodes of their models, judged by drawing the skin with code that the server does not use.

use std::{iter::successors, time::Duration};

use glam::{Mat4, Vec3};
use gltf::{Document, Node};
use grasp_assets::{
    hands::glb,
    holdouts::{BuiltInHoldout, holdout, holdouts},
    objects::object,
};
use grasp_characters::{
    Character, Style,
    names::{bone, mixamo, vrm_1},
    webxr_hand,
};
use grasp_client::built_in::request_for;
use grasp_proto::v1;
use grasp_synthesis::model::hand;
use grasp_tests::TestServer;
use serde_json::{Value, json};
use tonic::Code;

use crate::fixtures::{
    assert_status, bounded, box_request, create, hand, receiving, reproducible, unaided, with,
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
    grasp_characters::glb(&document, file[28 + length..].to_vec())
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
    assert_status(&full, Code::ResourceExhausted, "TOO_MANY_RIGS");
    let twice = rigs.create_rig(new_rig("mine", 1.0)).await.unwrap_err();
    assert_status(&twice, Code::AlreadyExists, "RIG_EXISTS");
    let name = |name: &str| v1::DeleteRigRequest {
        name: name.to_owned(),
    };
    let built_in = rigs.delete_rig(name("rigs/adult")).await.unwrap_err();
    assert_status(&built_in, Code::FailedPrecondition, "RIG_BUILT_IN");

    let request = with(request_for(holdout("remote-hold1").unwrap()), |request| {
        "rigs/mine".clone_into(&mut request.receiver_mut().rig);
    });
    let answer = client.find_grasp(&request).await.unwrap();
    assert_eq!(answer.hand().expect("it can be taken").rig, "rigs/mine");
    client.delete_rig("rigs/mine").await.unwrap();
    let gone = client.get_rig("rigs/mine").await.unwrap_err();
    assert_eq!(gone.code(), Some(Code::NotFound), "{gone}");
    let refused = client.find_grasp(&request).await.unwrap_err();
    assert!(refused.to_string().contains("rigs/mine"), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_own_hand_gets_an_atlas_which_a_rig_of_the_same_hand_shares() {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let client = server.client().await;
    create(&server, box_request("block")).await.unwrap();
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
}

/// The adult's hands as a program with Mixamo's names writes them.
const MIXAMO: Style = Style {
    name: mixamo,
    units_per_metre: 100.0,
    ..Style::PLAIN
};

/// The same as VRM 1.0.
const VRM: Style = Style {
    name: bone,
    extensions: vrm_1,
    ..Style::PLAIN
};

/// A skin in the client's frame.
struct DrawnSkin {
    /// Vertices; not finite where the skin follows nodes outside the hand.
    positions: Vec<Vec3>,
    /// Triangles of the hand.
    triangles: Vec<[usize; 3]>,
}

/// A node and those above it.
fn upward<'a>(document: &'a Document, node: Node<'a>) -> impl Iterator<Item = Node<'a>> {
    successors(Some(node), |node| {
        let mut nodes = document.nodes();
        nodes.find(|parent| parent.children().any(|child| child.index() == node.index()))
    })
}

/// Draws the hand of a GLB's only skin with the nodes of an answer's hand, as a viewer that puts the root where the answer says.
fn drawn(glb: &[u8], hand: &v1::HandPose) -> DrawnSkin {
    let file = gltf::Gltf::from_slice(glb).unwrap();
    let blob = file.blob.as_deref();
    let (root_pose, posed) = hand.model.split_first().expect("the root is posed");
    let local = |node: &Node<'_>| Mat4::from_cols_array_2d(&node.transform().matrix());
    let is_root = |node: &Node<'_>| node.name() == Some(root_pose.node.as_str());
    let root = file.nodes().find(is_root).unwrap();
    let global = upward(&file, root).fold(Mat4::IDENTITY, |below, node| local(&node) * below);
    let (scale, ..) = global.to_scale_rotation_translation();
    let at = root_pose.pose.expect("the root has a pose");
    let client_from_root =
        Mat4::from_scale_rotation_translation(hand.size() * scale, at.orientation(), at.position());
    let as_posed = |node: &Node<'_>| {
        let own = posed
            .iter()
            .find(|posed| Some(posed.node.as_str()) == node.name());
        let Some(pose) = own.map(|posed| posed.pose.expect("a node has a pose")) else {
            return local(node);
        };
        let (scale, _, translation) = local(node).to_scale_rotation_translation();
        let translation = pose.position.map_or(translation, Vec3::from);
        Mat4::from_scale_rotation_translation(scale, pose.orientation(), translation)
    };
    let skin = file.skins().next().unwrap();
    let inverse_binds = skin.reader(|_| blob).read_inverse_bind_matrices().unwrap();
    let matrix = |(joint, inverse): (Node<'_>, [[f32; 4]; 4])| {
        if !upward(&file, joint.clone()).any(|node| is_root(&node)) {
            return Mat4::NAN;
        }
        let below = upward(&file, joint).take_while(|node| !is_root(node));
        let below = below.fold(Mat4::IDENTITY, |below, node| as_posed(&node) * below);
        client_from_root * below * Mat4::from_cols_array_2d(&inverse)
    };
    let matrices: Vec<Mat4> = skin.joints().zip(inverse_binds).map(matrix).collect();
    let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| blob);
    let joints = reader.read_joints(0).unwrap().into_u16();
    let weights = reader.read_weights(0).unwrap().into_f32();
    let skinned = |(position, (joints, weights)): ([f32; 3], ([u16; 4], [f32; 4]))| {
        let moved = joints
            .into_iter()
            .zip(weights)
            .filter(|(_, weight)| *weight > 0.0);
        let point = |joint: u16| matrices[usize::from(joint)].transform_point3(Vec3::from(position));
        moved.map(|(joint, weight)| weight * point(joint)).sum()
    };
    let vertices = reader.read_positions().unwrap().zip(joints.zip(weights));
    let positions: Vec<Vec3> = vertices.map(skinned).collect();
    let corners: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    let (corners, _) = corners.as_chunks::<3>();
    let triangles = corners
        .iter()
        .map(|corners| corners.map(|corner| corner as usize));
    DrawnSkin {
        triangles: triangles
            .filter(|corners| corners.iter().all(|&corner| positions[corner].is_finite()))
            .collect(),
        positions,
    }
}

/// The distance of a point from a triangle, by projection onto its plane and its edges.
fn distance_to_triangle([a, b, c]: [Vec3; 3], point: Vec3) -> f32 {
    let normal = (b - a).cross(c - a);
    let inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|&(from, to)| (to - from).cross(point - from).dot(normal) >= 0.0);
    if inside && normal.length() > 0.0 {
        return (point - a).dot(normal).abs() / normal.length();
    }
    let to_edge = |from: Vec3, to: Vec3| {
        let along = ((point - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
        (from + (to - from) * along).distance(point)
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

impl DrawnSkin {
    /// The distance of a point from the skin in metres.
    fn distance(&self, point: Vec3) -> f32 {
        let triangles = self.triangles.iter();
        let distances = triangles
            .map(|corners| distance_to_triangle(corners.map(|corner| self.positions[corner]), point));
        distances.fold(f32::INFINITY, f32::min)
    }

    /// How deep the skin is in the object of a holdout, in metres.
    fn depth(&self, holdout: &BuiltInHoldout) -> f32 {
        let surface = &object(&holdout.object).unwrap().object.surface;
        let object_from_client = holdout.world_from_object.inverse();
        let finite = self.positions.iter().filter(|position| position.is_finite());
        let inside = finite
            .map(|&position| object_from_client.transform_point(position))
            .filter(|&position| surface.contains(position));
        let depths =
            inside.filter_map(|position| Some(surface.closest_point_within(position, 0.03)?.distance));
        depths.fold(0.0, f32::max)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_drawn_skin_touches_where_the_answer_says() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let mut models = vec![
        ("twin", model(1.0), None),
        ("small", model(0.85), None),
        ("grown", model(0.85), Some(1.2)),
        ("mixamo", Character::new(&MIXAMO).glb, None),
        ("vrm", Character::new(&VRM).glb, None),
    ];
    match webxr_hand() {
        Some(glb) => models.push(("webxr", glb, None)),
        None => println!("skipped: the WebXR hand, which tests/foreign/run fetches, is not there"),
    }
    for (id, glb, scale) in models {
        let rig = v1::CreateRigRequest {
            handedness: v1::Handedness::Right.into(),
            ..v1::CreateRigRequest::of_model(id, glb.clone())
        };
        client.create_rig(&rig).await.unwrap();
        let (mut contacts, mut deepest): (Vec<f32>, Vec<f32>) = (Vec::new(), Vec::new());
        let seeded = (1..=3).flat_map(|seed| holdouts().iter().map(move |holdout| (seed, holdout)));
        for (seed, holdout) in seeded {
            // Reproducible, so that each run measures the same grasps.
            let request = v1::FindGraspRequest {
                receiver: Some(right_hand_of(&format!("rigs/{id}"), scale)),
                ..unaided(reproducible(request_for(holdout)))
            };
            let request = request.with_budget(Duration::from_secs(20)).with_seed(seed);
            let answer = client.find_grasp(&request).await.unwrap();
            let Some(grasp) = answer.grasp() else {
                continue;
            };
            assert_eq!(hand(grasp).scale, scale);
            let skin = drawn(&glb, hand(grasp));
            let in_client = grasp.client_contacts();
            contacts.extend(in_client.iter().map(|contact| skin.distance(contact.position())));
            let answered = grasp.margin(v1::Check::Penetration).expect("it was checked");
            deepest.push(skin.depth(holdout) - answered);
        }
        contacts.sort_by(f32::total_cmp);
        deepest.sort_by(f32::total_cmp);
        println!("{id}: contacts {contacts:?}, deeper than answered {deepest:?}");
        assert!(contacts[contacts.len() / 2] < 0.0005, "{id}: {contacts:?}");
        assert!(contacts[contacts.len() * 9 / 10] < 0.001, "{id}: {contacts:?}");
        // Flesh yields by 2 mm where it is pressed, and skin folds between a bent finger and the palm.
        assert!(contacts[contacts.len() - 1] < 0.0025, "{id}: {contacts:?}");
        assert!(deepest[deepest.len() * 9 / 10] < 0.0005, "{id}: {deepest:?}");
        assert!(deepest[deepest.len() - 1] < 0.0016, "{id}: {deepest:?}");
    }
}
