//! Objects of a folder, and created objects at rest.

use crate::fixtures::{Folder, box_request, reproducible, update_of, with_object};
use grasp_proto::v1;
use grasp_tests::TestServer;
use std::{fs, time::Duration};
use tonic::Code;

/// Writes an object's two files.
fn add(folder: &Folder, name: &str, obj: &str, manifest: &str) {
    for (extension, text) in [("obj", obj), ("toml", manifest)] {
        let file = folder.path().join(format!("{name}.{extension}"));
        fs::write(file, text).expect("a file can be written");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_of_the_folder_are_never_evicted_changed_or_deleted() {
    let folder = Folder::empty("stay");
    let shelf = box_request("any");
    add(
        &folder,
        "shelf",
        std::str::from_utf8(&shelf.mesh).unwrap(),
        "mass_kg = 0.1\nlabels.level = \"cellar\"\n",
    );
    let server = TestServer::start_with(|config| {
        config.objects_directory = Some(folder.path().to_owned());
        config.store.objects = 1;
    })
    .await;
    let mut client = server.objects().await;
    for id in ["first", "second"] {
        client.create_object(box_request(id)).await.unwrap();
    }
    let status = client.create_object(box_request("shelf")).await.unwrap_err();
    assert_eq!(status.code(), Code::AlreadyExists);
    let listed = client
        .list_objects(v1::ListObjectsRequest::default())
        .await
        .unwrap();
    let names: Vec<String> = listed.into_inner().objects.into_iter().map(|o| o.name).collect();
    let expected = ["remote", "scalpel", "scissors", "second", "shelf"];
    assert_eq!(names, expected.map(|id| format!("objects/{id}")));
    let filtered = v1::ListObjectsRequest {
        filter: "labels.level = \"cellar\"".to_owned(),
        ..Default::default()
    };
    let filtered = client.list_objects(filtered).await.unwrap().into_inner().objects;
    assert_eq!(filtered[0].name, "objects/shelf");
    let name = || "objects/shelf".to_owned();
    let update = update_of(&name(), |object| object.mass_kg = 1.0);
    let status = client.update_object(update).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    let delete = v1::DeleteObjectRequest {
        name: name(),
        ..Default::default()
    };
    let status = client.delete_object(delete).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    server.stop().await;
}

/// More objects than there is room for what is derived of them.
const OBJECTS: usize = 12;

/// Room for what is derived of two or three of them.
const CACHE_BYTES: usize = 3 << 19;

#[tokio::test(flavor = "multi_thread")]
async fn objects_stay_and_are_found_alike_while_what_is_derived_makes_room() {
    let server = TestServer::start_with(|config| {
        config.store.bytes = CACHE_BYTES;
    })
    .await;
    let mut objects = server.objects().await;
    for number in 0..OBJECTS {
        // Of different sizes, because equal ones share what is derived.
        let request = with_object(box_request(&format!("box-{number}")), |object| {
            object.meters_per_unit = Some(1.0 + 0.01 * number as f32);
        });
        objects.create_object(request).await.expect("it fits");
    }
    let mut rounds = Vec::new();
    for _ in 0..2 {
        let mut grasps = Vec::new();
        for number in 0..OBJECTS {
            let request = reproducible(v1::FindGraspRequest::new(format!("objects/box-{number}")))
                .receiving(v1::Handedness::Right)
                .with_budget(Duration::from_secs(10))
                .with_seed(3);
            let found = server.grasps().await.find_grasp(request).await;
            let answer = found.expect("the object is there").into_inner();
            assert_eq!(answer.outcome(), v1::Outcome::Found, "box-{number}");
            grasps.push(answer.grasps);
        }
        rounds.push(grasps);
    }
    assert_eq!(rounds[0], rounds[1]);
}
