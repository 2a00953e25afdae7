//! `ObjectService`: objects and their meshes are created, listed, read, changed and deleted.

use std::{fs, time::Duration};

use grasp_proto::v1;
use grasp_tests::{TestServer, recorded::data_folder_or_skip};
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::fixtures::{
    BOX_OBJ, Folder, assert_status, bounded, box_request, create, delete, forbidden, get, impossible, labels,
    list, masked, mesh, until, update, update_of, with, with_object,
};

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
    let object = create(&server, request).await.unwrap();
    assert_eq!(object, get(&server, "objects/crate").await.unwrap());
    assert!(!object.built_in);
    assert_eq!((object.triangle_count, object.forbidden_triangle_count), (12, 2));
    let written = |object: &v1::GraspObject| v1::GraspObject {
        name: object.name.clone(),
        mass_kg: object.mass_kg,
        friction: object.friction,
        regions: object.regions.clone(),
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
}

#[tokio::test(flavor = "multi_thread")]
async fn taken_unknown_and_evicted_names_are_told_apart() {
    let server = TestServer::start_with(|config| config.store.objects = 2).await;
    for id in ["a", "b", "c"] {
        create(&server, box_request(id)).await.unwrap();
    }
    for id in ["c", "remote"] {
        let status = create(&server, box_request(id)).await.unwrap_err();
        assert_status(&status, Code::AlreadyExists, "OBJECT_EXISTS");
        let details = status.get_error_details();
        let resource = details.resource_info().unwrap();
        assert_eq!(resource.resource_name, format!("objects/{id}"));
    }
    let status = get(&server, "objects/a").await.unwrap_err();
    assert_status(&status, Code::NotFound, "OBJECT_EVICTED");
    assert!(status.message().contains("create it again"), "{status}");
    get(&server, "objects/b").await.unwrap();
    let status = get(&server, "objects/nothing").await.unwrap_err();
    assert_status(&status, Code::NotFound, "OBJECT_NOT_FOUND");
    let status = mesh(&server, "objects/nothing").await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
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
async fn rejects_meshes_above_the_limits() {
    let server = TestServer::start_with(|config| {
        config.maximum_object_bytes = 4096.try_into().unwrap();
        config.maximum_object_triangles = 10.try_into().unwrap();
    })
    .await;
    let padded = |bytes: usize| v1::CreateObjectRequest {
        mesh: format!("{BOX_OBJ}{}", "#\n".repeat(bytes / 2)).into_bytes(),
        ..box_request("bytes")
    };
    // The last is beyond the transport's limit.
    for (request, code) in [
        (box_request("triangles"), Code::InvalidArgument),
        (padded(8192), Code::InvalidArgument),
        (padded(4 << 20), Code::OutOfRange),
    ] {
        let status = create(&server, request).await.unwrap_err();
        assert_eq!(status.code(), code, "{status}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn broken_files_do_not_break_the_server() {
    let Some(folder) = data_folder_or_skip("broken_files_do_not_break_the_server") else {
        return;
    };
    let server = TestServer::start().await;
    let files = fs::read_dir(folder.join("ugly")).expect("the folder of ugly files");
    for (number, file) in files.enumerate() {
        let path = file.unwrap().path();
        let request = v1::CreateObjectRequest {
            mesh: fs::read(&path).unwrap(),
            ..box_request(&format!("ugly-{number}"))
        };
        match bounded("an answer", create(&server, request)).await {
            Ok(object) => assert!(object.triangle_count > 0),
            Err(status) => assert_eq!(
                status.code(),
                Code::InvalidArgument,
                "{}: {status}",
                path.display()
            ),
        }
    }
    create(&server, box_request("after"))
        .await
        .expect("the server still works");
}

/// A request with an id that repeats it.
fn with_request_id(request: v1::CreateObjectRequest) -> v1::CreateObjectRequest {
    v1::CreateObjectRequest {
        request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".to_owned(),
        ..request
    }
}

/// A change of the object's mass.
fn heavier(name: &str, mass_kg: f32) -> v1::UpdateObjectRequest {
    update_of(name, |object| object.mass_kg = mass_kg)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repeated_request_answers_the_object_it_created() {
    let server = TestServer::start().await;
    let request = with_request_id(box_request("crate"));
    let first = create(&server, request.clone()).await.unwrap();
    assert_eq!(create(&server, request.clone()).await.unwrap(), first);
    for other in [
        with_object(request.clone(), |object| object.mass_kg = 0.2),
        with_object(request.clone(), |object| {
            "objects/other".clone_into(&mut object.name);
        }),
        with(request.clone(), |request| request.mesh.push(b'#')),
    ] {
        let status = create(&server, other).await.unwrap_err();
        assert_status(&status, Code::FailedPrecondition, "REQUEST_ID_REUSED");
        assert!(status.message().contains(&request.request_id), "{status}");
    }
    // After a change, the answer is the object as it is now.
    let changed = update(&server, heavier("objects/crate", 0.4)).await.unwrap();
    assert_eq!(create(&server, request).await.unwrap(), changed);
}

#[tokio::test(flavor = "multi_thread")]
async fn equal_requests_at_the_same_time_create_one_object() {
    let server = TestServer::start_with(|config| config.maximum_uploads = 16.try_into().unwrap()).await;
    let answers = [(); 4].map(|()| {
        let mut client = server.objects_lazily();
        tokio::spawn(async move { client.create_object(with_request_id(box_request("crate"))).await })
    });
    let mut etags = Vec::new();
    for answer in answers {
        etags.push(answer.await.unwrap().expect("each is answered").into_inner().etag);
    }
    etags.dedup();
    assert_eq!(etags.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_update_changes_the_fields_it_names() {
    let server = TestServer::start().await;
    let before = create(&server, box_request("crate")).await.unwrap();
    let change = |object: &mut v1::GraspObject| {
        object.mass_kg = 0.4;
        object.friction = Some(0.8);
        object.center_of_mass = Some((0.001 * glam::Vec3::X).into());
        object.regions = vec![forbidden(&[], &[0, 1])];
        object.labels = labels(&[("level", "cellar")]);
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
    let twin = create(&server, twin).await.unwrap();
    assert_eq!(twin.content_hash, after.content_hash);

    // The mask selects; listed fields that the request omits return to the default.
    let mask = ["friction", "center_of_mass", "regions", "labels"];
    let request = masked(&mask, heavier(&before.name, 9.0));
    let reset = update(&server, request).await.unwrap();
    let expected = v1::GraspObject {
        mass_kg: 0.4,
        etag: reset.etag.clone(),
        update_time: reset.update_time,
        ..before.clone()
    };
    assert_eq!(reset, expected);
    // An update without a difference keeps the state.
    let same = heavier(&before.name, 0.4);
    assert_eq!(update(&server, same).await.unwrap(), reset);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stale_etag_aborts() {
    let server = TestServer::start().await;
    let before = create(&server, box_request("crate")).await.unwrap();
    let request = update_of(&before.name, |object| {
        object.labels = labels(&[("n", "1")]);
        object.etag.clone_from(&before.etag);
    });
    let after = update(&server, request.clone()).await.unwrap();
    let status = update(&server, request).await.unwrap_err();
    assert_status(&status, Code::Aborted, "OBJECT_CHANGED");
    assert!(status.message().contains(&after.etag), "{status}");
    let mut objects = server.objects().await;
    for (etag, code) in [(before.etag, Code::Aborted), (after.etag, Code::Ok)] {
        let request = v1::DeleteObjectRequest {
            name: before.name.clone(),
            etag,
            allow_missing: true,
        };
        let deleted = objects.delete_object(request).await;
        assert_eq!(deleted.map_or_else(|status| status.code(), |_| Code::Ok), code);
    }
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
    assert_eq!(list(&server, v1::ListObjectsRequest::default()).await.len(), 3);
    // The name is free again while the search still runs.
    create(&server, box_request("untouchable")).await.unwrap();
    assert_eq!(server.gauges().searches(), 1);
    let answer = bounded("the answer", call)
        .await
        .unwrap()
        .expect("the search finishes");
    assert_eq!(answer.into_inner().outcome(), v1::Outcome::BudgetExhausted);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_arrives_whole_and_can_be_created_again() {
    let server = TestServer::start().await;
    let (etag, file) = mesh(&server, "objects/remote").await.unwrap();
    let original = get(&server, "objects/remote").await.unwrap();
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
async fn lists_are_filtered_sorted_and_paged_and_whole_if_requested() {
    let server = TestServer::start().await;
    let mut created = Vec::new();
    for (id, own) in [
        ("pan", labels(&[("level", "kitchen"), ("owner", "Ada L.")])),
        ("cup", labels(&[("level", "kitchen"), ("fragile", "")])),
        ("saw", labels(&[("level", "cellar")])),
    ] {
        let hand =
            v1::HandPose::new("rigs/adult", v1::Handedness::Left).with_object_from_wrist(v1::Pose::default());
        let request = with_object(box_request(id), |object| {
            object.labels = own;
            object.regions = vec![forbidden(&[], &[0])];
            object.known_grips = vec![v1::KnownGrip::new("never", v1::Preference::Forbidden, hand)];
        });
        created.push(create(&server, request).await.unwrap());
    }
    for (filter, order_by, expected) in [
        ("labels.level = \"kitchen\"", "create_time", &["pan", "cup"][..]),
        ("name = \"objects/sc*\"", "name desc", &["scissors", "scalpel"]),
        (
            "labels.level = \"kitchen\" AND labels.owner = \"Ada L.\" AND name = \"objects/p*\"",
            "",
            &["pan"],
        ),
        ("labels.level = \"attic\"", "", &[]),
        ("", "", &["cup", "pan", "remote", "saw", "scalpel", "scissors"]),
    ] {
        for page_size in [0, 1, 2] {
            let request = v1::ListObjectsRequest {
                page_size,
                filter: filter.to_owned(),
                order_by: order_by.to_owned(),
                ..Default::default()
            };
            let names: Vec<String> = list(&server, request)
                .await
                .into_iter()
                .map(|object| object.name)
                .collect();
            let expected: Vec<String> = expected.iter().map(|id| format!("objects/{id}")).collect();
            assert_eq!(names, expected, "{filter}");
        }
    }
    for (view, is_whole) in [
        (v1::ObjectView::Unspecified, false),
        (v1::ObjectView::Basic, false),
        (v1::ObjectView::Full, true),
    ] {
        let request = v1::ListObjectsRequest {
            view: view.into(),
            order_by: "create_time".to_owned(),
            filter: "name = \"objects/pan*\"".to_owned(),
            ..Default::default()
        };
        let expected = with(created[0].clone(), |object| {
            if !is_whole {
                object.regions.clear();
                object.known_grips.clear();
            }
        });
        assert_eq!(list(&server, request).await, [expected], "{view:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_of_the_folder_are_never_evicted_changed_or_deleted() {
    let folder = Folder::empty("stay");
    fs::write(folder.path().join("shelf.obj"), BOX_OBJ).unwrap();
    fs::write(
        folder.path().join("shelf.toml"),
        "mass_kg = 0.1\nlabels.level = \"cellar\"\n",
    )
    .unwrap();
    let server = TestServer::start_with(|config| {
        config.objects_directory = Some(folder.path().to_owned());
        config.store.objects = 1;
    })
    .await;
    for id in ["first", "second"] {
        create(&server, box_request(id)).await.unwrap();
    }
    let status = create(&server, box_request("shelf")).await.unwrap_err();
    assert_eq!(status.code(), Code::AlreadyExists);
    let listed = list(&server, v1::ListObjectsRequest::default()).await;
    let names: Vec<&str> = listed
        .iter()
        .map(|object| &object.name["objects/".len()..])
        .collect();
    assert_eq!(names, ["remote", "scalpel", "scissors", "second", "shelf"]);
    assert_eq!(listed[4].labels["level"], "cellar");
    let status = update(&server, heavier("objects/shelf", 1.0)).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    let status = delete(&server, "objects/shelf").await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    server.stop().await;
}
