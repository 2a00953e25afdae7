//! Objects and rigs saved by version 0.1 are read unchanged.
//!
//! The folder beside this file is one that a server of that version wrote: `objects/bottle` in a file in millimetres whose z points
//! up, with everything that a client can give an object, `objects/plain` with nothing of it, and `rigs/ada` from the joints of
//! `rigs/adult`.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use glam::Vec3;
use grasp_client::json::from_json;
use grasp_proto::v1;
use grasp_server::config::StorePlace;
use grasp_tests::TestServer;
use tonic::Code;

use crate::fixtures::{
    Folder, assert_status, box_request, create, find, list, mesh, reproducible, update, update_of,
};

/// A copy of the folder.
fn copy(test: &str) -> Folder {
    let folder = Folder::absent(test);
    let source: PathBuf = [env!("CARGO_MANIFEST_DIR"), "tests", "integration", "saved_by_0_1"]
        .iter()
        .collect();
    copy_folder(&source, folder.path());
    folder
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("the temporary directory can be written to");
    for entry in fs::read_dir(from).expect("it is there") {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name())).unwrap();
        if path.is_dir() {
            copy_folder(&path, &to.join(name));
        } else {
            fs::copy(&path, to.join(name)).unwrap();
        }
    }
}

async fn start(folder: &Folder) -> TestServer {
    let place = StorePlace::Folder(folder.path().to_owned());
    TestServer::start_with(|config| config.place = place).await
}

/// The created objects, whole.
async fn objects(server: &TestServer) -> Vec<v1::GraspObject> {
    let request = v1::ListObjectsRequest {
        view: v1::ObjectView::Full.into(),
        ..Default::default()
    };
    let mut objects = list(server, request).await;
    objects.retain(|object| !object.built_in);
    objects
}

/// The bottle and the plain object as that version answered them.
fn saved() -> [v1::GraspObject; 2] {
    let json: serde_json::Value = serde_json::from_str(include_str!("saved_by_0_1.json")).unwrap();
    [0, 1].map(|place| from_json(&json[place]).expect("it is an object"))
}

/// An object whose box and centre of mass, which are computed, are those of the other if they are close to them.
fn settled(object: &v1::GraspObject, to: &v1::GraspObject) -> v1::GraspObject {
    let numbers = |object: &v1::GraspObject| {
        let solid = object.bounding_box.unwrap_or_default();
        let pose = solid.pose.unwrap_or_default();
        let centre = Vec3::from(object.center_of_mass.unwrap_or_default());
        [solid.half_extents(), pose.position(), centre]
    };
    let pairs = numbers(object).into_iter().zip(numbers(to));
    if pairs.into_iter().all(|(a, b)| a.distance(b) < 1e-6) {
        v1::GraspObject {
            bounding_box: to.bounding_box,
            center_of_mass: to.center_of_mass,
            ..object.clone()
        }
    } else {
        object.clone()
    }
}

fn assert_same(found: &[v1::GraspObject], expected: &[v1::GraspObject]) {
    let names = |objects: &[v1::GraspObject]| -> Vec<String> {
        objects.iter().map(|object| object.name.clone()).collect()
    };
    assert_eq!(names(found), names(expected));
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(&settled(found, expected), expected);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_are_as_they_were() {
    let folder = copy("saved-by-0-1");
    let server = start(&folder).await;
    let at_rest = objects(&server).await;
    assert_same(&at_rest, &saved());
    for object in &at_rest {
        mesh(&server, &object.name).await.unwrap();
    }
    assert_same(&objects(&server).await, &at_rest);

    // The id of the request that created it is remembered.
    let reused = v1::CreateObjectRequest {
        request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".to_owned(),
        ..box_request("other")
    };
    let status = create(&server, reused).await.unwrap_err();
    assert_status(&status, Code::FailedPrecondition, "REQUEST_ID_REUSED");

    // The preferred grip is still preferred.
    let request = reproducible(v1::FindGraspRequest::new("objects/bottle").with_seed(1))
        .with_budget(Duration::from_secs(10));
    let request = v1::FindGraspRequest {
        receiver: Some(v1::Receiver {
            handedness: v1::Handedness::Right.into(),
            scale: Some(0.9),
            ..Default::default()
        }),
        ..request
    };
    let answer = find(&server, request).await;
    assert_eq!(answer.source(), v1::GraspSource::KnownGrip);

    // A change leaves the other fields as they were.
    let heavier = update_of("objects/bottle", |object| object.mass_kg = 0.4);
    let changed = update(&server, heavier).await.unwrap();
    server.stop().await;
    let server = start(&folder).await;
    let [bottle, plain] = saved();
    let expected = v1::GraspObject {
        mass_kg: 0.4,
        etag: changed.etag,
        update_time: changed.update_time,
        ..bottle
    };
    let expected = [expected, plain];
    assert_same(&objects(&server).await, &expected);
    // The same after its mesh is read from the file.
    mesh(&server, "objects/bottle").await.unwrap();
    assert_same(&objects(&server).await, &expected);
    let status = create(&server, box_request("plain")).await.unwrap_err();
    assert_eq!(status.code(), Code::AlreadyExists);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn rigs_are_as_they_were() {
    let folder = copy("saved-rig-by-0-1");
    let server = start(&folder).await;
    let rig = |name: &str| v1::GetRigRequest {
        name: name.to_owned(),
    };
    let mut client = server.rigs().await;
    let ada = client.get_rig(rig("rigs/ada")).await.unwrap().into_inner();
    let adult = client.get_rig(rig("rigs/adult")).await.unwrap().into_inner();
    assert!(!ada.built_in && ada.hands[0].mirrored && !ada.hands[1].mirrored);
    let [own, model] = [&ada.hands[1], &adult.hands[1]];
    assert_eq!(own.stretched_joints.len(), model.stretched_joints.len());
    for (own, model) in own.stretched_joints.iter().zip(&model.stretched_joints) {
        assert!(
            own.position().distance(model.position()) < 1e-3,
            "{own:?} {model:?}"
        );
    }
    let limits = |hand: &v1::RigHand| -> Vec<(v1::Digit, [f32; 2])> {
        let pitches = hand.limits.iter().map(|limits| {
            let [min, max] = [limits.min, limits.max].map(Option::unwrap_or_default);
            (limits.digit(), [min.base_pitch, max.base_pitch])
        });
        pitches.collect()
    };
    let mut expected = limits(model);
    expected[1].1[1] = 1.2;
    assert_eq!(limits(own), expected);
    let request = v1::FindGraspRequest {
        receiver: Some(v1::Receiver {
            rig: "rigs/ada".to_owned(),
            ..Default::default()
        }),
        ..v1::FindGraspRequest::new("objects/plain").with_budget(Duration::from_secs(10))
    };
    let answer = find(&server, request).await;
    assert_eq!(answer.hand().expect("it is found").rig, "rigs/ada");
    server.stop().await;
}
