//! Objects and rigs that are saved outlast the server, however it ends, and their time in memory.

mod damage;

use std::{fs, time::Duration};

use grasp_proto::v1;
use grasp_server::{Config, ServeError, Server, config::StorePlace};
use grasp_tests::TestServer;
use tonic::{Code, Status};

use crate::{
    fixtures::{
        BOX_OBJ, Folder, assert_status, bounded, box_request, create, delete, floating_remote, forbidden,
        get, labels, list, mesh, reason, reproducible, sha256, update, update_of, with_object,
    },
    own_hands::{new_rig, right_hand_of},
};

/// A server that saves in a folder, and keeps `in_memory` objects in memory.
async fn start(folder: &Folder, in_memory: usize) -> TestServer {
    TestServer::start_with(|config| {
        config.place = StorePlace::Folder(folder.path().to_owned());
        config.store.objects = in_memory;
    })
    .await
}

fn config_for(folder: &Folder) -> Config {
    Config {
        builder_threads: 0,
        place: StorePlace::Folder(folder.path().to_owned()),
        ..Config::default()
    }
}

async fn all(server: &TestServer) -> Vec<v1::GraspObject> {
    let request = v1::ListObjectsRequest {
        view: v1::ObjectView::Full.into(),
        ..Default::default()
    };
    list(server, request).await
}

fn held_out(name: &str) -> v1::FindGraspRequest {
    reproducible(v1::FindGraspRequest::new(name))
        .with_budget(Duration::from_secs(10))
        .with_seed(7)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_keeps_objects_labels_etags_and_request_ids() {
    let folder = Folder::absent("saved-restart");
    let server = start(&folder, 10).await;
    let request = v1::CreateObjectRequest {
        request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".to_owned(),
        ..with_object(box_request("crate"), |object| {
            object.labels = labels(&[("level", "kitchen")]);
        })
    };
    create(&server, request.clone()).await.unwrap();
    create(&server, box_request("gone")).await.unwrap();
    let change = update_of("objects/crate", |object| {
        object.mass_kg = 0.4;
        let avoided = v1::Region {
            shapes: vec![v1::Shape::ball(glam::Vec3::ZERO, 0.012)],
            ..v1::Region::new("middle", v1::Preference::Avoided)
        };
        object.regions = vec![avoided, forbidden(&[], &[0, 1])];
        let hand =
            v1::HandPose::new("rigs/adult", v1::Handedness::Left).with_object_from_wrist(v1::Pose::default());
        object.known_grips = vec![v1::KnownGrip::new("never", v1::Preference::Forbidden, hand)];
    });
    update(&server, change).await.unwrap();
    delete(&server, "objects/gone").await.unwrap();
    let before = all(&server).await;
    let grasp_before = server.grasps().await.find_grasp(held_out("objects/crate")).await;
    server.stop().await;

    let server = start(&folder, 10).await;
    let after = all(&server).await;
    let created = |objects: &[v1::GraspObject]| -> Vec<v1::GraspObject> {
        let created = objects.iter().filter(|object| !object.built_in);
        created.cloned().collect()
    };
    assert_eq!(created(&after), created(&before));
    assert_eq!(
        create(&server, request.clone()).await.unwrap(),
        created(&before)[0]
    );
    let other = with_object(request, |object| object.mass_kg = 3.0);
    let status = create(&server, other).await.unwrap_err();
    assert_eq!(reason(&status), "REQUEST_ID_REUSED");
    // The object built again is the object that was saved: the same grasp, and the same mesh.
    let grasp_after = server.grasps().await.find_grasp(held_out("objects/crate")).await;
    let [before, after] = [grasp_before, grasp_after].map(|answer| answer.unwrap().into_inner());
    assert!(before.grasp().is_some());
    assert_eq!(before.grasps, after.grasps);
    let mut terms = after.grasps.iter().flat_map(|grasp| &grasp.score_terms);
    assert!(terms.any(|term| term.name == "off_avoided"), "{after:?}");
    let stale = update_of("objects/crate", |object| {
        "stale".clone_into(&mut object.etag);
        object.mass_kg = 1.0;
    });
    let status = server.objects().await.update_object(stale).await.unwrap_err();
    assert_eq!(status.code(), Code::Aborted);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_out_of_memory_is_found_again_by_its_name() {
    let folder = Folder::absent("saved-rest");
    // Two in memory, because a call may still run when its answer has arrived.
    let server = start(&folder, 2).await;
    let names = ["a", "b", "c", "d"].map(|id| format!("objects/{id}"));
    let mut created = Vec::new();
    for id in ["a", "b", "c", "d"] {
        created.push(create(&server, box_request(id)).await.unwrap());
    }
    let mut changes = server
        .objects()
        .await
        .watch_objects(v1::WatchObjectsRequest::default())
        .await
        .unwrap()
        .into_inner();
    for (name, created) in names.iter().zip(&created) {
        assert_eq!(&get(&server, name).await.unwrap(), created);
        let answer = server.grasps().await.find_grasp(held_out(name)).await.unwrap();
        assert!(answer.into_inner().grasp().is_some(), "{name}");
    }
    for name in &names {
        mesh(&server, name).await.unwrap();
    }
    // Calls at the same time do not get into each other's way.
    let read = || mesh(&server, &names[0]);
    let (a, b, c, d) = tokio::join!(read(), read(), read(), read());
    assert!([a, b, c, d].iter().all(Result::is_ok));
    let label = update_of(&names[1], |object| {
        object.labels = labels(&[("level", "hall")]);
    });
    update(&server, label).await.unwrap();
    let heavier = update_of(&names[2], |object| object.mass_kg = 0.4);
    update(&server, heavier).await.unwrap();
    assert_eq!(get(&server, &names[2]).await.unwrap().mass_kg, 0.4);
    // Watchers see only the changes.
    for expected in [&names[1], &names[2]] {
        let report = bounded("a report", changes.message()).await.unwrap().unwrap();
        assert_eq!(report.changes, [i32::from(v1::ObjectChange::Updated)]);
        assert_eq!(&report.object.unwrap().name, expected);
    }
    let silence = tokio::time::timeout(Duration::from_millis(50), changes.message()).await;
    assert!(silence.is_err(), "{silence:?}");
    server.stop().await;
}

async fn all_rigs(server: &TestServer) -> Vec<v1::HandRig> {
    let page = server
        .rigs()
        .await
        .list_rigs(v1::ListRigsRequest::default())
        .await
        .unwrap();
    page.into_inner().rigs
}

async fn create_rig(server: &TestServer, id: &str) -> Result<v1::HandRig, Status> {
    let answer = server.rigs().await.create_rig(new_rig(id, 1.0)).await?;
    Ok(answer.into_inner())
}

async fn delete_rig(server: &TestServer, id: &str) -> Result<(), Status> {
    let name = format!("rigs/{id}");
    let mut client = server.rigs().await;
    client.delete_rig(v1::DeleteRigRequest { name }).await.map(|_| ())
}

/// A search with a rig that always has the same answer.
fn held_out_to(rig: &str) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        receiver: Some(right_hand_of(rig, None)),
        ..reproducible(floating_remote())
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_keeps_rigs_and_their_grasps() {
    let folder = Folder::absent("saved-rigs");
    let server = start(&folder, 10).await;
    let client = server.client().await;
    client.create_rig(&new_rig("large", 1.1)).await.unwrap();
    create_rig(&server, "gone").await.unwrap();
    delete_rig(&server, "gone").await.unwrap();
    let before = all_rigs(&server).await;
    let grasp_before = client
        .find_grasp(&held_out_to("rigs/large"))
        .await
        .unwrap()
        .grasps;
    assert_eq!(grasp_before.len(), 1);
    drop(client);
    server.stop().await;

    let server = start(&folder, 10).await;
    assert_eq!(all_rigs(&server).await, before);
    let client = server.client().await;
    let grasp_after = client
        .find_grasp(&held_out_to("rigs/large"))
        .await
        .unwrap()
        .grasps;
    assert_eq!(grasp_before, grasp_after);
    let again = create_rig(&server, "large").await.unwrap_err();
    assert_eq!(again.code(), Code::AlreadyExists);
    delete_rig(&server, "large").await.unwrap();
    drop(client);
    server.stop().await;

    let server = start(&folder, 10).await;
    assert_eq!(all_rigs(&server).await.len(), before.len() - 1);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_rig_is_data_loss_by_name_until_its_file_is_back_or_it_is_deleted() {
    let folder = Folder::absent("saved-rigs-damage");
    let server = start(&folder, 10).await;
    let before = create_rig(&server, "mine").await.unwrap();
    server.stop().await;
    let path = folder.path().join("rigs/mine");
    let whole = fs::read(&path).unwrap();
    let mut changed = whole.clone();
    let middle = changed.len() / 2;
    changed[middle] ^= 1;
    let damage = (Code::DataLoss, "RIG_DAMAGED".to_owned());
    for wrong in [Some(&changed[..]), Some(&whole[..middle]), None] {
        match wrong {
            Some(bytes) => fs::write(&path, bytes).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        let server = start(&folder, 10).await;
        let get = || async {
            let name = "rigs/mine".to_owned();
            let answer = server.rigs().await.get_rig(v1::GetRigRequest { name }).await?;
            Ok::<_, Status>(answer.into_inner())
        };
        let status = get().await.unwrap_err();
        assert_eq!((status.code(), reason(&status)), damage);
        let client = server.client().await;
        let error = client.find_grasp(&held_out_to("rigs/mine")).await.unwrap_err();
        assert_eq!(error.call().unwrap().code, Code::DataLoss, "{error}");
        assert_eq!(
            create_rig(&server, "mine").await.unwrap_err().code(),
            Code::AlreadyExists
        );
        fs::write(&path, &whole).unwrap();
        let back = bounded("the rig to be back", async {
            loop {
                if let Ok(rig) = get().await {
                    break rig;
                }
                tokio::time::sleep(std::time::Duration::from_millis(50)).await;
            }
        });
        assert_eq!(back.await, before);
        drop(client);
        server.stop().await;
    }
    fs::write(&path, &changed).unwrap();
    let server = start(&folder, 10).await;
    delete_rig(&server, "mine").await.unwrap();
    create_rig(&server, "mine").await.unwrap();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_failing_disk_fails_the_call_and_leaves_no_rig() {
    let folder = Folder::absent("saved-rigs-failure");
    let server = start(&folder, 10).await;
    // A folder in place of the record cannot be replaced by a file.
    fs::create_dir_all(folder.path().join("rigs/mine/x")).unwrap();
    let status = create_rig(&server, "mine").await.unwrap_err();
    assert_status(&status, Code::Unavailable, "STORE_FAILED");
    assert!(all_rigs(&server).await.iter().all(|rig| rig.built_in));
    fs::remove_dir_all(folder.path().join("rigs/mine")).unwrap();
    create_rig(&server, "mine").await.unwrap();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_with_too_low_limits_for_saved_rigs_does_not_start() {
    let folder = Folder::absent("saved-rigs-limits");
    let server = start(&folder, 10).await;
    create_rig(&server, "mine").await.unwrap();
    server.stop().await;
    let mut config = config_for(&folder);
    config.maximum_object_bytes = 1024.try_into().unwrap();
    let server = tokio::task::spawn_blocking(|| Server::new(config))
        .await
        .unwrap()
        .unwrap();
    let listener = tokio::net::TcpListener::bind("[::1]:0").await.unwrap();
    let ended = bounded(
        "the end of the start",
        server.serve([listener.into()], std::future::pending()),
    )
    .await;
    let Err(ServeError::Store(error)) = ended else {
        panic!("the rig would be lost to its clients without a word: {ended:?}");
    };
    let text = error.to_string();
    assert!(text.contains("rigs/mine") && text.contains("1 to 1024"), "{text}");
    assert!(folder.path().join("rigs/mine").exists());
}
