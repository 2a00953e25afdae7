//! `ObjectService`: objects and their meshes are created, read, changed and deleted.

use std::time::Duration;

use grasp_client::code_name;
use grasp_proto::v1;
use grasp_tests::{TestServer, recorded::data_folder_or_skip};
use tonic::{Code, Request, Status};
use tonic_types::StatusExt as _;

use crate::fixtures::{
    BOX_OBJ, assert_status, blamed_fields, bounded, box_request, create, delete, forbidden, get, impossible,
    masked, until, update, update_of, with, with_object,
};

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
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_a_name_that_is_taken() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    client.create_object(box_request("crate")).await.unwrap();
    for id in ["crate", "remote"] {
        let status = client.create_object(box_request(id)).await.unwrap_err();
        assert_status(&status, Code::AlreadyExists, "OBJECT_EXISTS");
        let details = status.get_error_details();
        assert_eq!(
            details.resource_info().unwrap().resource_name,
            format!("objects/{id}")
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unknown_object_is_not_found() {
    let server = TestServer::start().await;
    let status = get(&server, "objects/nothing").await.unwrap_err();
    assert_status(&status, Code::NotFound, "OBJECT_NOT_FOUND");
    let find = v1::FindGraspRequest::new("objects/nothing");
    let status = server.grasps().await.find_grasp(find).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    let details = status.get_error_details();
    assert_eq!(
        details.resource_info().unwrap().resource_type,
        "grasp/GraspObject"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn an_evicted_object_is_reported_as_evicted() {
    let server = TestServer::start_with(|config| config.store.objects = 2).await;
    let mut client = server.objects().await;
    for id in ["a", "b", "c"] {
        client.create_object(box_request(id)).await.unwrap();
    }
    let status = get(&server, "objects/a").await.unwrap_err();
    assert_status(&status, Code::NotFound, "OBJECT_EVICTED");
    assert!(
        status.message().contains("create it again"),
        "{}",
        status.message()
    );
    get(&server, "objects/b").await.unwrap();
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
}

const REQUEST_ID: &str = "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683";

/// A change of the object's mass.
fn heavier(name: &str, mass_kg: f32) -> v1::UpdateObjectRequest {
    update_of(name, |object| object.mass_kg = mass_kg)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repeated_request_answers_the_object_it_created() {
    let server = TestServer::start().await;
    let request = v1::CreateObjectRequest {
        request_id: REQUEST_ID.to_owned(),
        ..with_object(box_request("crate"), |object| {
            object.labels = [("level".to_owned(), "kitchen".to_owned())].into();
        })
    };
    let first = create(&server, request.clone()).await.unwrap();
    assert_eq!(first.labels["level"], "kitchen");
    assert_eq!(create(&server, request.clone()).await.unwrap(), first);
    let others = [
        with_object(request.clone(), |object| object.mass_kg = 0.2),
        with_object(request.clone(), |object| {
            "objects/other".clone_into(&mut object.name);
        }),
        v1::CreateObjectRequest {
            mesh: format!("{BOX_OBJ}#").into_bytes(),
            ..request.clone()
        },
    ];
    for other in others {
        let status = create(&server, other).await.unwrap_err();
        assert_status(&status, Code::FailedPrecondition, "REQUEST_ID_REUSED");
        assert!(status.message().contains(REQUEST_ID), "{status}");
    }
    let without_id = v1::CreateObjectRequest {
        request_id: String::new(),
        ..request.clone()
    };
    let status = create(&server, without_id).await.unwrap_err();
    assert_status(&status, Code::AlreadyExists, "OBJECT_EXISTS");
    // After a change, the answer is the object as it is now.
    let changed = update(&server, heavier("objects/crate", 0.4)).await.unwrap();
    assert_eq!(create(&server, request).await.unwrap(), changed);
}

#[tokio::test(flavor = "multi_thread")]
async fn equal_requests_at_the_same_time_create_one_object() {
    let server = TestServer::start().await;
    let request = v1::CreateObjectRequest {
        request_id: REQUEST_ID.to_owned(),
        ..box_request("crate")
    };
    let answers = [(); 4].map(|()| {
        let (mut client, request) = (server.objects_lazily(), request.clone());
        tokio::spawn(async move { client.create_object(request).await })
    });
    let mut etags = Vec::new();
    for answer in answers {
        let object = answer.await.unwrap().expect("each is answered").into_inner();
        etags.push(object.etag);
    }
    etags.dedup();
    assert_eq!(etags.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_update_changes_what_it_names() {
    let server = TestServer::start().await;
    let before = create(&server, box_request("crate")).await.unwrap();
    let change = |object: &mut v1::GraspObject| {
        object.mass_kg = 0.4;
        object.friction = Some(0.8);
        object.center_of_mass = Some(v1::Vector3 {
            x: 0.001,
            y: 0.0,
            z: 0.0,
        });
        object.regions = vec![forbidden(&[], &[0, 1])];
        object.labels = [("level".to_owned(), "cellar".to_owned())].into();
    };
    let request = update_of(&before.name, |object| {
        change(object);
        object.etag.clone_from(&before.etag);
    });
    let after = update(&server, request).await.unwrap();
    let expected = v1::GraspObject {
        forbidden_triangle_count: 2,
        etag: after.etag.clone(),
        update_time: after.update_time,
        content_hash: after.content_hash.clone(),
        ..with(before.clone(), change)
    };
    assert_eq!(after, expected);
    assert_ne!(after.etag, before.etag);
    assert_ne!(after.content_hash, before.content_hash);
    // The same object, created like this.
    let twin = with_object(box_request("twin"), |object| {
        object.regions = vec![forbidden(&[], &[0, 1])];
    });
    assert_eq!(
        create(&server, twin).await.unwrap().content_hash,
        after.content_hash
    );

    // The mask selects; what it lists and the request omits returns to the default.
    let request = masked(
        &["friction", "center_of_mass", "regions", "labels"],
        heavier(&before.name, 9.0),
    );
    let reset = update(&server, request).await.unwrap();
    let expected = v1::GraspObject {
        mass_kg: 0.4,
        etag: reset.etag.clone(),
        update_time: reset.update_time,
        ..before.clone()
    };
    assert_eq!(reset, expected);
    // Nothing is different: the state stays.
    let same = heavier(&before.name, 0.4);
    assert_eq!(update(&server, same).await.unwrap(), reset);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stale_etag_aborts() {
    let server = TestServer::start().await;
    let before = create(&server, box_request("crate")).await.unwrap();
    let request = update_of(&before.name, |object| {
        object.labels = [("n".to_owned(), "1".to_owned())].into();
        object.etag.clone_from(&before.etag);
    });
    let after = update(&server, request.clone()).await.unwrap();
    let status = update(&server, request).await.unwrap_err();
    assert_status(&status, Code::Aborted, "OBJECT_CHANGED");
    assert!(status.message().contains(&after.etag), "{status}");
    let request = v1::DeleteObjectRequest {
        name: before.name.clone(),
        etag: before.etag,
        allow_missing: true,
    };
    let mut objects = server.objects().await;
    let status = objects.delete_object(request).await.unwrap_err();
    assert_eq!(status.code(), Code::Aborted);
    let request = v1::DeleteObjectRequest {
        name: before.name,
        etag: after.etag,
        allow_missing: false,
    };
    objects.delete_object(request).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deleted_object_is_gone_and_its_searches_finish() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(Duration::from_millis(600));
    let mut grasps = server.grasps().await;
    let call = tokio::spawn(async move { grasps.find_grasp(request).await });
    until("the search", || server.gauges().searches() == 1).await;
    let name = "objects/untouchable";
    delete(&server, name).await.unwrap();
    let status = delete(&server, name).await.unwrap_err();
    assert_status(&status, Code::NotFound, "OBJECT_NOT_FOUND");
    let lenient = v1::DeleteObjectRequest {
        name: name.to_owned(),
        allow_missing: true,
        ..Default::default()
    };
    server.objects().await.delete_object(lenient).await.unwrap();
    let listed = server
        .objects()
        .await
        .list_objects(v1::ListObjectsRequest::default())
        .await;
    assert_eq!(listed.unwrap().into_inner().objects.len(), 3);
    // The name is free again while the search still runs.
    create(&server, box_request("untouchable")).await.unwrap();
    assert_eq!(server.gauges().searches(), 1);
    let answer = bounded("the answer", call)
        .await
        .unwrap()
        .expect("the search finishes");
    assert_eq!(answer.into_inner().outcome(), v1::Outcome::BudgetExhausted);
}

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
    let copy = create(&server, copy).await.unwrap();
    assert_eq!(copy.triangle_count, original.triangle_count);
    assert_eq!(copy.forbidden_triangle_count, original.forbidden_triangle_count);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_of_no_object_is_not_found() {
    let server = TestServer::start().await;
    let status = mesh(&server, "objects/nothing").await.unwrap_err();
    assert_eq!(code_name(status.code()), "NOT_FOUND");
    let status = mesh(&server, "nothing").await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert_eq!(blamed_fields(&status), ["name"]);
}
