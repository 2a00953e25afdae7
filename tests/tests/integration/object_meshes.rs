//! Meshes as viewers get them.

use grasp_client::code_name;
use grasp_import::{Import, MeshLimits, read_mesh};
use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::{Code, Status};

use crate::{
    fixtures::{blamed_fields, box_request},
    parts::{forbidden, with_object},
};

/// The etag of the state that an object's mesh belongs to, and its file.
async fn mesh(server: &TestServer, name: &str) -> Result<(String, Vec<u8>), Status> {
    let request = v1::GetMeshRequest {
        name: name.to_owned(),
    };
    let mut parts = server.objects().await.get_mesh(request).await?.into_inner();
    let (mut etag, mut file) = (None, Vec::new());
    while let Some(v1::GetMeshResponse { piece, etag: state }) = parts.message().await? {
        assert!(!piece.is_empty() && piece.len() <= 128 << 10);
        assert_eq!(state.is_empty(), etag.is_some(), "only the first message has it");
        etag.get_or_insert(state);
        file.extend(piece);
    }
    Ok((etag.expect("there is a message"), file))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_arrives_whole_and_can_be_created_again() {
    let server = TestServer::start().await;
    let (etag, file) = mesh(&server, "objects/remote").await.unwrap();
    // The header of a GLB has its length.
    let length = u32::from_le_bytes(file[8..12].try_into().unwrap());
    assert_eq!(length as usize, file.len());
    let get = v1::GetObjectRequest {
        name: "objects/remote".to_owned(),
    };
    let original = server.objects().await.get_object(get).await.unwrap().into_inner();
    assert_eq!(etag, original.etag);
    // Read by the server itself, the file is the same shape again.
    let copy = v1::CreateObjectRequest {
        mesh: file,
        ..with_object(box_request("copy"), |object| {
            object.mass_kg = original.mass_kg;
            if original.forbidden_triangle_count > 0 {
                object.regions = vec![forbidden(&["forbidden"], &[])];
            }
        })
    };
    let copy = server.objects().await.create_object(copy).await.unwrap();
    let copy = copy.into_inner();
    assert_eq!(copy.triangle_count, original.triangle_count);
    assert_eq!(copy.forbidden_triangle_count, original.forbidden_triangle_count);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn forbidden_triangles_are_a_primitive_of_their_own() {
    let server = TestServer::start().await;
    let request = with_object(box_request("crate"), |object| {
        object.regions = vec![forbidden(&[], &[3, 4, 9])];
    });
    server.objects().await.create_object(request).await.unwrap();
    let (_, file) = mesh(&server, "objects/crate").await.unwrap();
    let limits = MeshLimits {
        bytes: file.len(),
        vertices: 100,
        triangles: 100,
    };
    let read = read_mesh(&file, Import::METRES, limits).expect("it is a GLB file");
    let count = |name: &str| {
        let group = read.groups.iter().find(|(group, _)| group == name);
        group.map(|(_, triangles)| triangles.len())
    };
    assert_eq!((count("surface"), count("forbidden")), (Some(9), Some(3)));
    let json = &file[20..20 + u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize];
    let json: serde_json::Value = serde_json::from_slice(json).unwrap();
    let runs = &json["meshes"][0]["primitives"][1]["extras"]["triangles"];
    assert_eq!(*runs, serde_json::json!([[3, 2], [9, 1]]));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_of_no_object_is_not_found() {
    let server = TestServer::start().await;
    let status = mesh(&server, "objects/nothing").await.unwrap_err();
    assert_eq!(code_name(status.code()), "NOT_FOUND");
    let status = mesh(&server, "nothing").await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert_eq!(blamed_fields(&status), ["name"]);
    server.stop().await;
}
