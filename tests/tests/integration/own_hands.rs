//! Rigs of the clients' own hands. Answers pose the nodes of their models, judged by drawing the skin with code that the server does not use.

use std::time::Duration;

use glam::{Mat4, Quat, Vec3};
use gltf::{Document, scene::Transform};
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
use grasp_client::{ClientError, built_in::request_for};
use grasp_proto::v1;
use grasp_synthesis::{geometry::mesh::TriangleMesh, model::hand};
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
    assert!(matches!(gone, ClientError::NotFound(_)), "{gone}");
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
pub(crate) struct Drawn {
    /// Not finite where the skin follows other nodes than the hand's.
    pub(crate) positions: Vec<Vec3>,
    /// Those of the hand.
    pub(crate) triangles: Vec<[usize; 3]>,
}

/// Draws the hand of a GLB's only skin with the nodes of an answer's hand, as a viewer that puts the root where the answer says.
pub(crate) fn drawn(glb: &[u8], hand: &v1::HandPose) -> Drawn {
    let posed = &hand.model[..];
    let file = gltf::Gltf::from_slice(glb).unwrap();
    let blob = file.blob.as_deref();
    let root = file
        .nodes()
        .find(|node| node.name() == Some(posed[0].node.as_str()))
        .unwrap();
    let (scale, ..) = global(&file.document, root.index(), None).to_scale_rotation_translation();
    let at = posed[0].pose.expect("the root has a pose");
    let client_from_root =
        Mat4::from_scale_rotation_translation(hand.size() * scale, at.orientation(), at.position());
    let skin = file.skins().next().unwrap();
    let inverse_binds = skin.reader(|_| blob).read_inverse_bind_matrices().unwrap();
    let matrices: Vec<Mat4> = skin
        .joints()
        .zip(inverse_binds)
        .map(|(joint, inverse)| {
            let below = below_root(&file.document, joint.index(), root.index(), posed);
            let below = below.unwrap_or(Mat4::NAN);
            client_from_root * below * Mat4::from_cols_array_2d(&inverse)
        })
        .collect();
    let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| blob);
    let joints = reader.read_joints(0).unwrap().into_u16();
    let weights = reader.read_weights(0).unwrap().into_f32();
    let vertices = reader.read_positions().unwrap().zip(joints.zip(weights));
    let positions: Vec<Vec3> = vertices
        .map(|(position, (joints, weights))| {
            let moved = joints.iter().zip(weights).filter(|(_, weight)| *weight > 0.0);
            let moved = moved.map(|(&joint, weight)| {
                weight * matrices[usize::from(joint)].transform_point3(Vec3::from(position))
            });
            moved.sum()
        })
        .collect();
    let corners: Vec<usize> = reader
        .read_indices()
        .unwrap()
        .into_u32()
        .map(|corner| corner as usize)
        .collect();
    Drawn {
        triangles: corners
            .chunks(3)
            .map(|corners| [corners[0], corners[1], corners[2]])
            .filter(|corners| corners.iter().all(|&corner| positions[corner].is_finite()))
            .collect(),
        positions,
    }
}

fn local(node: &gltf::Node<'_>) -> Mat4 {
    match node.transform() {
        Transform::Matrix { matrix } => Mat4::from_cols_array_2d(&matrix),
        Transform::Decomposed {
            translation,
            rotation,
            scale,
        } => Mat4::from_scale_rotation_translation(
            Vec3::from(scale),
            Quat::from_array(rotation),
            Vec3::from(translation),
        ),
    }
}

fn parent(document: &Document, node: usize) -> Option<usize> {
    let parent = document
        .nodes()
        .find(|parent| parent.children().any(|child| child.index() == node));
    parent.map(|parent| parent.index())
}

/// The transform of a node in the scene, or in that of a node above it.
fn global(document: &Document, node: usize, above: Option<usize>) -> Mat4 {
    if Some(node) == above {
        return Mat4::IDENTITY;
    }
    let own = local(&document.nodes().nth(node).unwrap());
    parent(document, node).map_or(own, |parent| global(document, parent, above) * own)
}

/// The transform of a node in the root's frame; `None` if it is not below.
fn below_root(document: &Document, node: usize, root: usize, posed: &[v1::NodePose]) -> Option<Mat4> {
    if node == root {
        return Some(Mat4::IDENTITY);
    }
    let described = document.nodes().nth(node).unwrap();
    let mut own = local(&described);
    if let Some(posed) = posed[1..]
        .iter()
        .find(|posed| Some(posed.node.as_str()) == described.name())
    {
        let (scale, _, translation) = own.to_scale_rotation_translation();
        let pose = posed.pose.expect("a node has a pose");
        let translation = pose.position.map_or(translation, Vec3::from);
        own = Mat4::from_scale_rotation_translation(scale, pose.orientation(), translation);
    }
    Some(below_root(document, parent(document, node)?, root, posed)? * own)
}

/// The nearest point of a triangle, by projection onto its plane and its edges.
pub(crate) fn distance_to_triangle([a, b, c]: [Vec3; 3], point: Vec3) -> f32 {
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

/// The winding number of a closed mesh around a point: 1 inside, 0 outside (van Oosterom and Strackee 1983).
pub(crate) fn winding(mesh: &TriangleMesh, point: Vec3) -> f32 {
    let solid_angle = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle).map(|corner| (corner - point).as_dvec3());
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(below)
    };
    let total: f64 = (0..mesh.triangles().len()).map(solid_angle).sum();
    (total / (4.0 * std::f64::consts::PI)) as f32
}

/// How far the drawn skin is from each contact, and how deep it is in the object, in metres.
pub(crate) fn measure(skin: &Drawn, grasp: &v1::Grasp, holdout: &BuiltInHoldout) -> (Vec<f32>, f32) {
    let from_contacts = grasp
        .client_contacts()
        .iter()
        .map(|contact| {
            let to_triangle = |corners: &[usize; 3]| {
                distance_to_triangle(corners.map(|corner| skin.positions[corner]), contact.position())
            };
            skin.triangles
                .iter()
                .map(to_triangle)
                .fold(f32::INFINITY, f32::min)
        })
        .collect();
    let mesh = object(&holdout.object).unwrap().object.surface.mesh();
    let object_from_client = holdout.world_from_object.inverse();
    let (low, high) = mesh
        .positions()
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &corner| {
            (low.min(corner), high.max(corner))
        });
    let mut deepest = 0.0_f32;
    for &position in &skin.positions {
        let position = object_from_client.transform_point(position);
        // Outside the box around the mesh, it is outside the mesh.
        if position.clamp(low, high) != position {
            continue;
        }
        let near = |triangle: usize| distance_to_triangle(mesh.corners(triangle), position);
        let distance = (0..mesh.triangles().len())
            .map(near)
            .fold(f32::INFINITY, f32::min);
        if distance > deepest && distance < 0.03 && winding(mesh, position) > 0.5 {
            deepest = distance;
        }
    }
    (from_contacts, deepest)
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
            // Each time the same grasps.
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
            let (from_contacts, depth) = measure(&skin, grasp, holdout);
            contacts.extend(from_contacts);
            let answered = grasp.margin(v1::Check::Penetration).expect("it was checked");
            deepest.push(depth - answered);
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
