//! Objects from STL and GLB files.

use glam::Vec3;
use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    fixtures::{BOX_OBJ, blamed_fields, box_request, floating_remote},
    parts::{forbidden, with, with_object},
};

/// The corners of the box's triangles, in the order in which OBJ's quads are split.
fn triangles_of_the_box() -> Vec<[Vec3; 3]> {
    let numbers = |line: &str| -> Vec<f32> { line.split(' ').map(|word| word.parse().unwrap()).collect() };
    let of_kind = |kind: &'static str| BOX_OBJ.lines().filter_map(move |line| line.strip_prefix(kind));
    let vertices: Vec<Vec3> = of_kind("v ")
        .map(|line| Vec3::from_slice(&numbers(line)))
        .collect();
    of_kind("f ")
        .flat_map(|line| {
            let corners: Vec<Vec3> = numbers(line)
                .iter()
                .map(|&vertex| vertices[vertex as usize - 1])
                .collect();
            [
                [corners[0], corners[1], corners[2]],
                [corners[0], corners[2], corners[3]],
            ]
        })
        .collect()
}

/// The box in millimetres with +Z up, as binary STL.
fn stl() -> Vec<u8> {
    let triangles = triangles_of_the_box();
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        for Vec3 { x, y, z } in triangle {
            bytes.extend(
                [x, -z, y]
                    .iter()
                    .flat_map(|metres| (metres * 1000.0).to_le_bytes()),
            );
        }
        bytes.extend([0, 0]);
    }
    bytes
}

/// The box as GLB, half as large in a node that doubles it.
fn glb() -> Vec<u8> {
    let corners = triangles_of_the_box();
    let numbers = corners
        .iter()
        .flatten()
        .flat_map(|corner| (*corner * 0.5).to_array());
    let binary: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
    let (count, length) = (3 * corners.len(), binary.len());
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"name":"crate","scale":[2,2,2]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"buffers":[{{"byteLength":{length}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{length}}}],"accessors":[{{"bufferView":0,"componentType":5126,
        "count":{count},"type":"VEC3","min":[-1,-1,-1],"max":[1,1,1]}}]}}"#
    );
    json.extend(std::iter::repeat_n(
        ' ',
        json.len().next_multiple_of(4) - json.len(),
    ));
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_bytes()), (b"BIN\0", binary.as_slice())] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

async fn create(
    server: &TestServer,
    request: v1::CreateObjectRequest,
) -> Result<v1::GraspObject, tonic::Status> {
    Ok(server.objects().await.create_object(request).await?.into_inner())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_object_is_created_from_every_format() {
    let server = TestServer::start().await;
    let reference = create(&server, box_request("from-obj")).await.unwrap();
    let from_stl = v1::CreateObjectRequest {
        mesh: stl(),
        ..with_object(box_request("from-stl"), |object| {
            object.meters_per_unit = Some(1e-3);
            object.z_up = true;
        })
    };
    let from_glb = v1::CreateObjectRequest {
        mesh: glb(),
        ..box_request("from-glb")
    };
    for request in [from_stl, from_glb] {
        let object = create(&server, request).await.unwrap();
        assert_eq!(object.warnings, [""; 0]);
        assert_eq!(object.triangle_count, reference.triangle_count);
        let [found, expected] =
            [&object, &reference].map(|object| object.bounding_box.unwrap().half_extents.unwrap());
        assert!((found.x - expected.x).abs() < 1e-6 && (found.y - expected.y).abs() < 1e-6);
        let request = with(floating_remote(), |request| {
            request.holdout_mut().object = object.name;
        });
        let answer = server
            .grasps()
            .await
            .find_grasp(request)
            .await
            .unwrap()
            .into_inner();
        assert!(answer.grasp().is_some(), "{:?}", answer.outcome());
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nodes_of_a_scene_can_be_forbidden() {
    let server = TestServer::start().await;
    let request = v1::CreateObjectRequest {
        mesh: glb(),
        ..with_object(box_request("forbidden"), |object| {
            object.regions = vec![forbidden(&["crate"], &[])];
        })
    };
    let object = create(&server, request).await.unwrap();
    assert_eq!(object.forbidden_triangle_count, object.triangle_count);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_mesh_is_refused_by_what_it_is() {
    let server = TestServer::start().await;
    for (mesh, expected) in [
        (&b"Kaydara FBX Binary  \0"[..], "an FBX scene"),
        (&stl()[..300], "is cut off: it claims 12 triangles and has 4"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 9\nend_header\n",
            "a point cloud",
        ),
    ] {
        let request = v1::CreateObjectRequest {
            mesh: mesh.to_vec(),
            ..box_request("wrong")
        };
        let status = create(&server, request).await.unwrap_err();
        assert_eq!(
            (status.code(), blamed_fields(&status)),
            (Code::InvalidArgument, vec!["mesh".to_owned()])
        );
        assert!(
            status.message().contains(expected),
            "{expected}: {}",
            status.message()
        );
    }
    server.stop().await;
}
