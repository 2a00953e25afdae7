//! `ObjectService`: create, get, list.

use grasp_proto::v1;
use grasp_tests::{TestServer, recorded::data_folder_or_skip};
use tonic::{Code, Request};
use tonic_types::StatusExt as _;

use crate::{
    fixtures::{BOX_OBJ, blamed_fields, bounded, box_request, reason},
    parts::{forbidden, with_object},
};

async fn get(server: &TestServer, name: &str) -> Result<v1::GraspObject, tonic::Status> {
    let request = v1::GetObjectRequest {
        name: name.to_owned(),
    };
    let answer = server.objects().await.get_object(request).await?;
    Ok(answer.into_inner())
}

async fn all_names(server: &TestServer, page_size: i32) -> Vec<String> {
    let mut client = server.objects().await;
    let mut names = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = v1::ListObjectsRequest {
            page_size,
            page_token,
            ..Default::default()
        };
        let page = client.list_objects(request).await.unwrap().into_inner();
        names.extend(page.objects.into_iter().map(|object| object.name));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return names;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn lists_and_describes_the_built_in_objects() {
    let server = TestServer::start().await;
    assert_eq!(
        all_names(&server, 0).await,
        ["objects/remote", "objects/scalpel", "objects/scissors"]
    );
    for (name, mass) in [("remote", 0.13), ("scalpel", 0.02), ("scissors", 0.05)] {
        let object = get(&server, &format!("objects/{name}")).await.unwrap();
        assert!(object.built_in);
        assert_eq!(object.mass_kg, mass);
        assert!(object.triangle_count > 100);
        assert_eq!(object.content_hash.len(), 64);
        let forbidden: usize = object.regions.iter().map(|region| region.triangles.len()).sum();
        assert_eq!(forbidden, object.forbidden_triangle_count as usize);
        assert_eq!(forbidden > 0, name != "scissors");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_created_object_matches_its_request() {
    let server = TestServer::start().await;
    let request = with_object(box_request("crate"), |object| {
        object.regions = vec![forbidden(&[], &[0, 1, 1])];
        object.friction = Some(0.6);
        object.meters_per_unit = Some(2.0);
        object.z_up = true;
        object.parts = vec!["shell".to_owned()];
    });
    let given = request.object.clone().unwrap();
    let created = server.objects().await.create_object(request).await;
    let object = created.unwrap().into_inner();
    assert_eq!(object, get(&server, "objects/crate").await.unwrap());
    assert!(!object.built_in);
    assert_eq!(object.triangle_count, 12);
    assert_eq!(object.forbidden_triangle_count, 2);
    // What was written is read back.
    let written = |object: &v1::GraspObject| v1::GraspObject {
        name: object.name.clone(),
        labels: object.labels.clone(),
        mass_kg: object.mass_kg,
        friction: object.friction,
        regions: object.regions.clone(),
        known_grips: object.known_grips.clone(),
        meters_per_unit: object.meters_per_unit,
        z_up: object.z_up,
        parts: object.parts.clone(),
        ..Default::default()
    };
    assert_eq!(written(&object), written(&given));
    let centre = glam::Vec3::from(object.center_of_mass.unwrap());
    assert!(centre.abs().max_element() < 1e-6, "{centre}");
    let mut edges = object.bounding_box.unwrap().half_extents().to_array();
    edges.sort_by(f32::total_cmp);
    for (edge, expected) in edges.into_iter().zip([0.02, 0.03, 0.04]) {
        assert!((edge - expected).abs() < 1e-4, "{edges:?}");
    }
    assert_eq!(all_names(&server, 1).await.len(), 4);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_name_that_is_none_is_named() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    for name in [
        "",
        "crate",
        "objects/",
        "objects/Crate",
        "objects/a/b",
        "rigs/crate",
    ] {
        let request = with_object(box_request("crate"), |object| name.clone_into(&mut object.name));
        let status = client.create_object(request).await.unwrap_err();
        assert_eq!(blamed_fields(&status), ["object.name"], "{name}: {status}");
    }
    let status = client
        .create_object(v1::CreateObjectRequest::default())
        .await
        .unwrap_err();
    assert_eq!(blamed_fields(&status), ["object"], "{status}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_a_name_that_is_taken() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    client.create_object(box_request("crate")).await.unwrap();
    for id in ["crate", "remote"] {
        let status = client.create_object(box_request(id)).await.unwrap_err();
        assert_eq!(
            (status.code(), reason(&status)),
            (Code::AlreadyExists, "OBJECT_EXISTS".to_owned())
        );
        let details = status.get_error_details();
        assert_eq!(
            details.resource_info().unwrap().resource_name,
            format!("objects/{id}")
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unknown_object_is_not_found() {
    let server = TestServer::start().await;
    let status = get(&server, "objects/nothing").await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::NotFound, "OBJECT_NOT_FOUND".to_owned())
    );
    let find = v1::FindGraspRequest::new("objects/nothing");
    let status = server.grasps().await.find_grasp(find).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    let details = status.get_error_details();
    assert_eq!(
        details.resource_info().unwrap().resource_type,
        "grasp/GraspObject"
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_evicted_object_is_reported_as_evicted() {
    let server = TestServer::start_with(|config| config.store.objects = 2).await;
    let mut client = server.objects().await;
    for id in ["a", "b", "c"] {
        client.create_object(box_request(id)).await.unwrap();
    }
    let status = get(&server, "objects/a").await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::NotFound, "OBJECT_EVICTED".to_owned())
    );
    assert!(
        status.message().contains("create it again"),
        "{}",
        status.message()
    );
    get(&server, "objects/b").await.unwrap();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_meshes_above_the_limits() {
    let server = TestServer::start_with(|config| {
        config.maximum_object_bytes = 4096.try_into().unwrap();
        config.maximum_object_triangles = 10.try_into().unwrap();
    })
    .await;
    let mut client = server.objects().await;
    let status = client.create_object(box_request("triangles")).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument, "{status}");
    let padded = |bytes: usize| v1::CreateObjectRequest {
        mesh: format!("{BOX_OBJ}{}", "#\n".repeat(bytes / 2)).into_bytes(),
        ..box_request("bytes")
    };
    let status = client.create_object(padded(8192)).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument, "{status}");
    // Beyond the transport's limit.
    let status = client.create_object(padded(4 << 20)).await.unwrap_err();
    assert_eq!(status.code(), Code::OutOfRange, "{status}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn broken_files_do_not_break_the_server() {
    let Some(folder) = data_folder_or_skip("broken_files_do_not_break_the_server") else {
        return;
    };
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    let mut files: Vec<_> = std::fs::read_dir(folder.join("ugly"))
        .expect("the folder of ugly files")
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    for (number, path) in files.iter().enumerate() {
        let request = v1::CreateObjectRequest {
            mesh: std::fs::read(path).unwrap(),
            ..box_request(&format!("ugly-{number}"))
        };
        match bounded("an answer", client.create_object(Request::new(request))).await {
            Ok(answer) => assert!(answer.into_inner().triangle_count > 0),
            Err(status) => assert_eq!(
                status.code(),
                Code::InvalidArgument,
                "{}: {status}",
                path.display()
            ),
        }
    }
    client
        .create_object(box_request("after"))
        .await
        .expect("the server still works");
    server.stop().await;
}
