//! Repeated creation, changes and deletion of objects.

use std::time::Duration;

use grasp_client::ClientError;
use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::{Code, Status};

use crate::{
    atlases::state,
    fixtures::{BOX_OBJ, blamed_fields, bounded, box_request, impossible, reason, until},
    parts::{forbidden, masked, update_of, with, with_object},
};

const REQUEST_ID: &str = "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683";

async fn create(server: &TestServer, request: v1::CreateObjectRequest) -> Result<v1::GraspObject, Status> {
    let answer = server.objects().await.create_object(request).await?;
    Ok(answer.into_inner())
}

async fn update(server: &TestServer, request: v1::UpdateObjectRequest) -> Result<v1::GraspObject, Status> {
    let answer = server.objects().await.update_object(request).await?;
    Ok(answer.into_inner())
}

async fn delete(server: &TestServer, request: v1::DeleteObjectRequest) -> Result<(), Status> {
    server.objects().await.delete_object(request).await.map(|_| ())
}

/// A change of the object's mass.
fn heavier(name: &str, mass_kg: f32) -> v1::UpdateObjectRequest {
    update_of(name, |object| object.mass_kg = mass_kg)
}

fn cause(status: &Status) -> (Code, String) {
    (status.code(), reason(status))
}

fn refused(code: Code, reason: &str) -> (Code, String) {
    (code, reason.to_owned())
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
        assert_eq!(
            cause(&status),
            refused(Code::FailedPrecondition, "REQUEST_ID_REUSED")
        );
        assert!(status.message().contains(REQUEST_ID), "{status}");
    }
    let without_id = v1::CreateObjectRequest {
        request_id: String::new(),
        ..request.clone()
    };
    let status = create(&server, without_id).await.unwrap_err();
    assert_eq!(cause(&status), refused(Code::AlreadyExists, "OBJECT_EXISTS"));
    // After a change, the answer is the object as it is now.
    let changed = update(&server, heavier("objects/crate", 0.4)).await.unwrap();
    assert_eq!(create(&server, request).await.unwrap(), changed);
    server.stop().await;
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
    server.stop().await;
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
    server.stop().await;
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
    assert_eq!(cause(&status), refused(Code::Aborted, "OBJECT_CHANGED"));
    assert!(status.message().contains(&after.etag), "{status}");
    let request = v1::DeleteObjectRequest {
        name: before.name.clone(),
        etag: before.etag,
        allow_missing: true,
    };
    let status = delete(&server, request).await.unwrap_err();
    assert_eq!(status.code(), Code::Aborted);
    let request = v1::DeleteObjectRequest {
        name: before.name,
        etag: after.etag,
        allow_missing: false,
    };
    delete(&server, request).await.unwrap();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn built_in_objects_are_read_only() {
    let server = TestServer::start().await;
    let status = update(&server, heavier("objects/remote", 1.0)).await.unwrap_err();
    assert_eq!(
        cause(&status),
        refused(Code::FailedPrecondition, "OBJECT_READ_ONLY")
    );
    let request = v1::DeleteObjectRequest {
        name: "objects/remote".to_owned(),
        ..Default::default()
    };
    let status = delete(&server, request).await.unwrap_err();
    assert_eq!(
        cause(&status),
        refused(Code::FailedPrecondition, "OBJECT_READ_ONLY")
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_changes_are_named_all_at_once() {
    let server = TestServer::start().await;
    create(&server, box_request("crate")).await.unwrap();
    let request = masked(&["mass_kg", "mesh"], heavier("crate", -1.0));
    let status = update(&server, request).await.unwrap_err();
    assert_eq!(
        blamed_fields(&status),
        ["object.name", "update_mask.paths[1]", "object.mass_kg"]
    );
    let request = update_of("objects/crate", |object| {
        object.regions = vec![forbidden(&["lid"], &[12])];
    });
    let status = update(&server, request).await.unwrap_err();
    assert_eq!(
        blamed_fields(&status),
        ["object.regions[0].groups[0]", "object.regions[0].triangles[0]"]
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deleted_object_is_gone_and_its_searches_finish() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(Duration::from_millis(600));
    let mut grasps = server.grasps().await;
    let call = tokio::spawn(async move { grasps.find_grasp(request).await });
    until("the search", || server.gauges().searches() == 1).await;
    let request = v1::DeleteObjectRequest {
        name: "objects/untouchable".to_owned(),
        ..Default::default()
    };
    delete(&server, request.clone()).await.unwrap();
    let status = delete(&server, request.clone()).await.unwrap_err();
    assert_eq!(cause(&status), refused(Code::NotFound, "OBJECT_NOT_FOUND"));
    let lenient = v1::DeleteObjectRequest {
        allow_missing: true,
        ..request
    };
    delete(&server, lenient).await.unwrap();
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
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn searches_use_the_changed_object() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(Duration::from_secs(10));
    let allowed = masked(&["regions"], update_of("objects/untouchable", |_| {}));
    update(&server, allowed).await.unwrap();
    let answer = server.grasps().await.find_grasp(request).await.unwrap();
    assert_eq!(answer.into_inner().outcome(), v1::Outcome::Found);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn labels_leave_the_atlas_alone_and_a_new_mass_starts_another() {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let name = create(&server, box_request("crate")).await.unwrap().name;
    let grips = state(&server, &name, 1).await.entry_count;
    let labelled = update_of(&name, |object| {
        object.labels = [("n".to_owned(), "1".to_owned())].into();
    });
    update(&server, labelled).await.unwrap();
    assert!(state(&server, &name, 0).await.entry_count >= grips);
    update(&server, heavier(&name, 0.3)).await.unwrap();
    assert_eq!(state(&server, &name, 0).await.entry_count, 0);
    state(&server, &name, 1).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_client_creates_changes_and_deletes() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let new = with_object(box_request("crate"), |object| {
        object.labels = [("level".to_owned(), "kitchen".to_owned())].into();
    });
    let object = client.create_object(&new).await.unwrap();
    // Another call is another request.
    assert!(matches!(
        client.create_object(&new).await,
        Err(ClientError::AlreadyExists(_))
    ));
    let change = update_of(&object.name, |change| {
        change.etag.clone_from(&object.etag);
        change.friction = Some(0.9);
    });
    let changed = client.update_object(&change).await.unwrap();
    assert_eq!((changed.friction, &changed.labels), (Some(0.9), &object.labels));
    let error = client.update_object(&change).await.unwrap_err();
    assert!(matches!(error, ClientError::Aborted(_)), "{error}");
    client
        .delete_object(object.name.as_str(), Some(changed.etag))
        .await
        .unwrap();
    let error = client.get_object(object.name.as_str()).await.unwrap_err();
    assert!(matches!(error, ClientError::NotFound(_)), "{error}");
    let error = client.delete_object("objects/remote", None).await.unwrap_err();
    assert!(matches!(error, ClientError::FailedPrecondition(_)), "{error}");
    server.stop().await;
}
