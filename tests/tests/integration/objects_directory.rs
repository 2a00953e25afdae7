//! The folder of objects that the server loads at start.

use std::fs;

use grasp_assets::objects::{BuiltInObject, Manifest, object};
use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    fixtures::{Folder, box_request, held_remote},
    parts::{reproducible, update_of, with},
};

/// Writes an object's two files.
fn add(folder: &Folder, name: &str, obj: &str, manifest: &str) {
    for (extension, text) in [("obj", obj), ("toml", manifest)] {
        let file = folder.path().join(format!("{name}.{extension}"));
        fs::write(file, text).expect("a file can be written");
    }
}

/// A manifest of the built-in object.
fn manifest_of(built_in: &BuiltInObject) -> String {
    let about = Manifest::parse(built_in.manifest).expect("it is part of the program");
    let [x, y, z] = about.centre_of_mass_m.to_array();
    format!(
        "mass_kg = {}\ncenter_of_mass = [{x:?}, {y:?}, {z:?}]\nfriction = {}\n\
         [[regions]]\nname = \"front\"\npreference = \"forbidden\"\ngroups = {:?}\n",
        about.mass_kg, about.friction, about.forbidden_groups
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn a_built_in_object_from_the_folder_gets_the_same_grasp() {
    let folder = Folder::empty("alike");
    let remote = object("remote").expect("it is built in");
    add(&folder, "my-remote", remote.obj, &manifest_of(remote));
    let server =
        TestServer::start_with(|config| config.objects_directory = Some(folder.path().to_owned())).await;
    let mut objects = server.objects().await;
    let mut get = async |name: &str| {
        let request = v1::GetObjectRequest {
            name: name.to_owned(),
        };
        let answer = objects.get_object(request).await;
        answer.expect("it is there").into_inner()
    };
    let (built_in, ours) = (get("objects/remote").await, get("objects/my-remote").await);
    assert!(built_in.built_in && !ours.built_in);
    assert_eq!(ours.content_hash, built_in.content_hash);

    let mut grasps = Vec::new();
    for object in [built_in.name, ours.name] {
        let request = with(reproducible(held_remote()), |request| {
            request.holdout_mut().object = object;
            // The folder's manifest sets it, while the built-in object has no friction of its own, which decides which
            // grips of primitives a default search starts near.
            request.requirements_mut().friction = Some(0.5);
            request.requirements_mut().thesis = Some(v1::ThesisOptions {
                thesis_validity: true,
                ..Default::default()
            });
        });
        let answer = server.grasps().await.find_grasp(request).await.unwrap();
        let found = answer.into_inner().grasps;
        assert!(!found.is_empty(), "the remote can be grasped");
        grasps.push(found);
    }
    assert_eq!(grasps[0], grasps[1]);
    server.stop().await;
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
        filter: "level=cellar".to_owned(),
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
