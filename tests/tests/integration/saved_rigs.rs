//! Created rigs outlast the server.

use std::{fs, path::Path};

use grasp_proto::v1;
use grasp_server::{Config, ServeError, Server, config::StorePlace};
use grasp_tests::TestServer;
use tonic::{Code, Status};

use crate::{
    fixtures::{Folder, bounded, floating_remote, reason},
    own_hands::{new_rig, right_hand_of},
    parts::reproducible,
};

fn save_in(folder: &Path) -> impl FnOnce(&mut Config) {
    let place = StorePlace::Folder(folder.to_owned());
    move |config| config.place = place
}

async fn start(folder: &Folder) -> TestServer {
    TestServer::start_with(save_in(folder.path())).await
}

async fn all(server: &TestServer) -> Vec<v1::HandRig> {
    let page = server
        .rigs()
        .await
        .list_rigs(v1::ListRigsRequest::default())
        .await
        .unwrap();
    page.into_inner().rigs
}

async fn create(server: &TestServer, id: &str) -> Result<v1::HandRig, Status> {
    let answer = server.rigs().await.create_rig(new_rig(id, 1.0)).await?;
    Ok(answer.into_inner())
}

async fn delete(server: &TestServer, id: &str) -> Result<(), Status> {
    let name = format!("rigs/{id}");
    let mut client = server.rigs().await;
    client.delete_rig(v1::DeleteRigRequest { name }).await.map(|_| ())
}

/// A search with a rig that always has the same answer.
fn find(rig: &str) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        receiver: Some(right_hand_of(rig, None)),
        ..reproducible(floating_remote())
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_keeps_rigs_and_their_grasps() {
    let folder = Folder::absent("saved-rigs");
    let server = start(&folder).await;
    let client = server.client().await;
    client.create_rig(&new_rig("large", 1.1)).await.unwrap();
    create(&server, "gone").await.unwrap();
    delete(&server, "gone").await.unwrap();
    let before = all(&server).await;
    let grasp_before = client.find_grasp(&find("rigs/large")).await.unwrap().grasps;
    assert_eq!(grasp_before.len(), 1);
    drop(client);
    server.stop().await;

    let server = start(&folder).await;
    assert_eq!(all(&server).await, before);
    let client = server.client().await;
    let grasp_after = client.find_grasp(&find("rigs/large")).await.unwrap().grasps;
    assert_eq!(grasp_before, grasp_after);
    let again = create(&server, "large").await.unwrap_err();
    assert_eq!(again.code(), Code::AlreadyExists);
    delete(&server, "large").await.unwrap();
    drop(client);
    server.stop().await;

    let server = start(&folder).await;
    assert_eq!(all(&server).await.len(), before.len() - 1);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_rig_is_data_loss_by_name_until_its_file_is_back_or_it_is_deleted() {
    let folder = Folder::absent("saved-rigs-damage");
    let server = start(&folder).await;
    let before = create(&server, "mine").await.unwrap();
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
        let server = start(&folder).await;
        let get = || async {
            let name = "rigs/mine".to_owned();
            let answer = server.rigs().await.get_rig(v1::GetRigRequest { name }).await?;
            Ok::<_, Status>(answer.into_inner())
        };
        let status = get().await.unwrap_err();
        assert_eq!((status.code(), reason(&status)), damage);
        let client = server.client().await;
        let error = client.find_grasp(&find("rigs/mine")).await.unwrap_err();
        assert_eq!(error.call().unwrap().code, Code::DataLoss, "{error}");
        assert_eq!(
            create(&server, "mine").await.unwrap_err().code(),
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
    let server = start(&folder).await;
    delete(&server, "mine").await.unwrap();
    create(&server, "mine").await.unwrap();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_failing_disk_fails_the_call_and_leaves_no_rig() {
    let folder = Folder::absent("saved-rigs-failure");
    let server = start(&folder).await;
    // A folder in place of the record cannot be replaced by a file.
    fs::create_dir_all(folder.path().join("rigs/mine/x")).unwrap();
    let status = create(&server, "mine").await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::Unavailable, "STORE_FAILED".to_owned())
    );
    assert!(all(&server).await.iter().all(|rig| rig.built_in));
    fs::remove_dir_all(folder.path().join("rigs/mine")).unwrap();
    create(&server, "mine").await.unwrap();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_with_too_low_limits_for_saved_rigs_does_not_start() {
    let folder = Folder::absent("saved-rigs-limits");
    let server = start(&folder).await;
    create(&server, "mine").await.unwrap();
    server.stop().await;
    let mut config = Config {
        builder_threads: 0,
        ..Config::default()
    };
    save_in(folder.path())(&mut config);
    config.maximum_object_bytes = 1024.try_into().unwrap();
    let server = tokio::task::spawn_blocking(|| Server::new(config))
        .await
        .unwrap()
        .unwrap();
    let listener = tokio::net::TcpListener::bind("[::1]:0").await.unwrap();
    let ended = bounded(
        "the end of the start",
        server.serve(listener, std::future::pending()),
    )
    .await;
    let Err(ServeError::Store(error)) = ended else {
        panic!("the rig would be lost to its clients without a word: {ended:?}");
    };
    let text = error.to_string();
    assert!(text.contains("rigs/mine") && text.contains("1 to 1024"), "{text}");
    assert!(folder.path().join("rigs/mine").exists());
}
