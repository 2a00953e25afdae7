//! Meshes as viewers get them.

use grasp_client::code_name;
use grasp_import::{Import, MeshLimits, read_mesh};
use grasp_proto::v1::{self, get_mesh_response::Part};
use grasp_tests::TestServer;
use tonic::{Code, Status};

use crate::fixtures::{blamed_fields, box_request, sha256};

/// The header and the file of an object's mesh.
async fn mesh(server: &TestServer, name: &str) -> Result<(v1::MeshHeader, Vec<u8>), Status> {
    let request = v1::GetMeshRequest {
        name: name.to_owned(),
    };
    let mut parts = server.objects().await.get_mesh(request).await?.into_inner();
    let Some(Part::Header(header)) = parts.message().await?.and_then(|first| first.part) else {
        panic!("the header comes first");
    };
    let mut file = Vec::new();
    while let Some(response) = parts.message().await? {
        let Some(Part::Piece(piece)) = response.part else {
            panic!("pieces follow the header");
        };
        assert!(!piece.is_empty() && piece.len() <= 256 << 10);
        file.extend(piece);
    }
    Ok((header, file))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_arrives_whole_and_can_be_created_again() {
    let server = TestServer::start().await;
    let (header, file) = mesh(&server, "objects/remote").await.unwrap();
    assert_eq!(header.total_bytes, file.len() as u64);
    assert_eq!(header.sha256, sha256(&file));
    let original = header.object.unwrap();
    // Read by the server itself, the file is the same shape again.
    let copy = v1::CreateObjectRequest {
        mesh: file,
        mass_kg: original.mass_kg,
        forbidden: (original.forbidden_triangle_count > 0).then(|| v1::ForbiddenSurfaces {
            groups: vec!["forbidden".to_owned()],
            triangles: Vec::new(),
        }),
        ..box_request("copy")
    };
    let copy = server.objects().await.create_object(copy).await.unwrap();
    let copy = copy.into_inner().object.unwrap();
    assert_eq!(copy.triangle_count, original.triangle_count);
    assert_eq!(copy.vertex_count, original.vertex_count);
    assert_eq!(copy.forbidden_triangle_count, original.forbidden_triangle_count);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn forbidden_triangles_are_a_primitive_of_their_own() {
    let server = TestServer::start().await;
    let request = v1::CreateObjectRequest {
        forbidden: Some(v1::ForbiddenSurfaces {
            groups: Vec::new(),
            triangles: vec![3, 4, 9],
        }),
        ..box_request("crate")
    };
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
