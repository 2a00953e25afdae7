//! Objects from files of several parts: instances, levels of detail, colliders, and frames as importers make them.

use std::time::Duration;

use glam::{Mat3, Quat, Vec3};
use grasp_characters::glb;
use grasp_proto::v1;
use grasp_tests::TestServer;
use serde_json::{Value, json};
use tonic::Status;

use crate::{
    fixtures::{blamed_fields, box_request},
    own_models::distance_to_triangle,
    parts::{hand, with_object},
};

/// An L of 100 × 60 × 30 mm with legs of 20 mm, which no turn makes its own mirror image once a corner is cut.
const CORNERS: [[f32; 3]; 12] = {
    const OUTLINE: [[f32; 2]; 6] = [
        [0.0, 0.0],
        [0.06, 0.0],
        [0.06, 0.02],
        [0.02, 0.02],
        [0.02, 0.09],
        [0.0, 0.1],
    ];
    let mut corners = [[0.0; 3]; 12];
    let mut place = 0;
    while place < 6 {
        let [x, y] = OUTLINE[place];
        corners[place] = [x, y, 0.0];
        // The cut: the far end of the longer leg is thinner.
        corners[place + 6] = [x, y, if place < 4 { 0.03 } else { 0.02 }];
        place += 1;
    }
    corners
};

/// Its triangles, wound outward.
const TRIANGLES: [[u16; 3]; 20] = [
    [0, 2, 1],
    [0, 3, 2],
    [0, 4, 3],
    [0, 5, 4],
    [6, 7, 8],
    [6, 8, 9],
    [6, 9, 10],
    [6, 10, 11],
    [0, 1, 7],
    [0, 7, 6],
    [1, 2, 8],
    [1, 8, 7],
    [2, 3, 9],
    [2, 9, 8],
    [3, 4, 10],
    [3, 10, 9],
    [4, 5, 11],
    [4, 11, 10],
    [5, 0, 6],
    [5, 6, 11],
];

/// A file of nodes that may show the L as mesh 0; with the places of three instances as accessor 2.
fn file(nodes: &Value, used: &[&str]) -> Vec<u8> {
    let positions = CORNERS.iter().flatten().flat_map(|number| number.to_le_bytes());
    let indices = TRIANGLES.iter().flatten().flat_map(|index| index.to_le_bytes());
    let places = [[0.0_f32, 0.0, 0.0], [0.2, 0.0, 0.0], [0.4, 0.0, 0.0]];
    let places = places.iter().flatten().flat_map(|number| number.to_le_bytes());
    let buffer: Vec<u8> = positions.chain(indices).chain(places).collect();
    let roots: Vec<usize> = (0..nodes.as_array().map_or(0, Vec::len)).collect();
    let document = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes, "extensionsUsed": used,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 12, "type": "VEC3", "min": [0, 0, 0], "max": [0.06, 0.1, 0.03]},
            {"bufferView": 1, "componentType": 5123, "count": 60, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 144}, {"buffer": 0, "byteOffset": 144, "byteLength": 120},
            {"buffer": 0, "byteOffset": 264, "byteLength": 36}],
        "buffers": [{"byteLength": buffer.len()}],
    });
    glb(&document, buffer)
}

async fn create(
    server: &TestServer,
    id: &str,
    mesh: Vec<u8>,
    parts: &[&str],
) -> Result<v1::GraspObject, Status> {
    let request = v1::CreateObjectRequest {
        mesh,
        ..with_object(box_request(id), |object| {
            object.parts = parts.iter().map(|&part| part.to_owned()).collect();
        })
    };
    Ok(server.objects().await.create_object(request).await?.into_inner())
}

#[tokio::test(flavor = "multi_thread")]
async fn instances_of_an_optional_extension_are_part_of_the_object() {
    let server = TestServer::start().await;
    let instances = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}});
    let bytes = file(
        &json!([{"mesh": 0, "extensions": instances}]),
        &["EXT_mesh_gpu_instancing"],
    );
    let object = create(&server, "chain", bytes, &[]).await.unwrap();
    assert_eq!(object.triangle_count, 60);
    assert_eq!(
        object.warnings,
        ["3 parts are disconnected: they share no vertex"]
    );
    // The L's legs of 20 mm, the first to the third 400 mm apart.
    let longest = 2.0 * object.bounding_box.unwrap().half_extents().max_element();
    assert!((longest - 0.46).abs() < 0.01, "{longest}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn parts_that_are_not_seen_are_left_out_and_named_ones_read() {
    let server = TestServer::start().await;
    let nodes = json!([
        {"name": "hook", "mesh": 0},
        {"name": "UCX_hook", "mesh": 0, "translation": [0.5, 0.0, 0.0]},
        {"name": "hook_LOD1", "mesh": 0, "translation": [1.0, 0.0, 0.0]},
        {"name": "ghost", "mesh": 0, "translation": [1.5, 0.0, 0.0],
         "extensions": {"KHR_node_visibility": {"visible": false}}},
    ]);
    let bytes = file(&nodes, &["KHR_node_visibility", "ACME_bulges"]);
    let hook = create(&server, "hook", bytes.clone(), &[]).await.unwrap();
    assert_eq!(hook.triangle_count, 20);
    for name in ["UCX_hook", "hook_LOD1", "ghost", "ACME_bulges"] {
        let says = |warning: &String| warning.contains(&format!("\"{name}\""));
        assert!(hook.warnings.iter().any(says), "{name} in {:?}", hook.warnings);
    }
    let all = ["hook", "UCX_hook", "hook_LOD1", "ghost"];
    let whole = create(&server, "whole", bytes.clone(), &all).await.unwrap();
    assert_eq!(whole.triangle_count, 80);
    let status = create(&server, "none", bytes, &["hook", "lid"])
        .await
        .unwrap_err();
    assert_eq!(blamed_fields(&status), ["object.parts[1]"]);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn contacts_lie_on_the_mesh_as_the_named_importer_turns_it() {
    let server = TestServer::start().await;
    create(&server, "hook", file(&json!([{"mesh": 0}]), &[]), &[])
        .await
        .unwrap();
    let flip_z = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
    let flip_x = Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::Z);
    let keep_forward = Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::NEG_X);
    let swap = Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::Y);
    for (convention, axes, unit) in [
        (v1::Convention::Openxr, Mat3::IDENTITY, 1.0),
        (v1::Convention::Godot, Mat3::IDENTITY, 1.0),
        (v1::Convention::Unity, flip_z, 1.0),
        (v1::Convention::UnityFlipX, flip_x, 1.0),
        (v1::Convention::Unreal, keep_forward, 100.0),
        (v1::Convention::UnrealXzy, swap, 100.0),
    ] {
        // As the importer has it.
        let imported = CORNERS.map(|corner| unit * (axes * Vec3::from_array(corner)));
        let off_surface = |point: Vec3| {
            let corners = TRIANGLES.map(|triangle| triangle.map(|corner| imported[usize::from(corner)]));
            let distances = corners.map(|corners| distance_to_triangle(corners, point));
            distances.into_iter().fold(f32::INFINITY, f32::min)
        };
        // An object that is not turned in the engine; and one that is, where the contacts in the client's frame are on it, too.
        let turned = v1::Pose::new(
            unit * Vec3::new(0.3, 1.1, 0.2),
            Quat::from_xyzw(0.1, 0.7, 0.1, 0.7),
        );
        for pose in [v1::Pose::default(), turned] {
            let request = v1::FindGraspRequest::new("objects/hook")
                .with_client_from_object(pose)
                .with_convention(convention)
                .with_budget(Duration::from_secs(10))
                .with_seed(3);
            let answer = server
                .grasps()
                .await
                .find_grasp(request.clone())
                .await
                .unwrap()
                .into_inner();
            let grasp = answer.grasp().expect("it can be held");
            let turn = pose.orientation().normalize();
            for (contact, in_client) in grasp.contacts.iter().zip(grasp.client_contacts()) {
                let of_client = turn.inverse() * (in_client.position() - pose.position());
                for at in [contact.position(), of_client] {
                    let off = off_surface(at) / unit;
                    assert!(off < 2e-4, "{convention:?}: {off} m off the surface");
                }
            }
            // The grasp is valid where it is answered.
            let validate = v1::ValidateGraspRequest::from(request).with_pose(hand(grasp).clone());
            let verdict = server
                .grasps()
                .await
                .validate_grasp(validate)
                .await
                .unwrap()
                .into_inner();
            assert!(verdict.valid, "{convention:?}: {:?}", verdict.verdicts);
        }
    }
    server.stop().await;
}
