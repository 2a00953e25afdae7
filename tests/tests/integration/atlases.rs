//! Atlases: they grow in the background, are reported, used and kept on disk, and stop growing with the server.

use std::{fs, path::PathBuf, time::Duration};

use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::fixtures::{Folder, bounded, box_request, find, reproducible, unaided, with};

/// Least number of grips in a first published atlas of an object that is easy to hold.
const FIRST: u32 = 100;

/// A server that builds atlases and keeps them in a folder.
async fn start(folder: &Folder) -> TestServer {
    TestServer::start_with(|config| {
        config.builder_threads = 1;
        config.atlas_directory = Some(folder.path().to_owned());
    })
    .await
}

/// A server whose atlas of a built-in object is complete for the default rig's right hand, and its folder.
pub(crate) async fn with_complete_atlas(object_name: &str) -> (TestServer, Folder) {
    let folder = Folder::empty(&format!("complete-{object_name}"));
    let server = start(&folder).await;
    let state = state(&server, &format!("objects/{object_name}"), 1).await;
    assert_eq!(state.growth(), v1::AtlasGrowth::Complete);
    (server, folder)
}

/// The state of an object's atlas for a hand: "left" or "right".
async fn atlas_of(server: &TestServer, object: &str, side: &str) -> v1::Atlas {
    let name = format!("{object}/atlases/{side}");
    let request = v1::GetAtlasRequest { name: name.clone() };
    let answer = server.objects().await.get_atlas(request).await;
    let atlas = answer.expect("it is there").into_inner();
    assert_eq!(atlas.name, name);
    assert_eq!(atlas.stamp.is_empty(), atlas.entry_count == 0);
    atlas
}

/// Waits until an object's atlas for the right hand has `least` grips, and returns its state.
pub(crate) async fn state(server: &TestServer, name: &str, least: u32) -> v1::Atlas {
    bounded("the growth of an atlas", async {
        loop {
            let atlas = atlas_of(server, name, "right").await;
            if atlas.entry_count >= least {
                return atlas;
            }
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    })
    .await
}

async fn create_box(server: &TestServer) {
    let created = server.objects().await.create_object(box_request("block")).await;
    created.expect("it can be created");
    for side in ["left", "right"] {
        let growth = atlas_of(server, "objects/block", side).await.growth();
        assert_ne!(growth, v1::AtlasGrowth::Complete);
        assert_ne!(growth, v1::AtlasGrowth::Unspecified);
    }
}

/// A request for a grasp of the box.
fn block() -> v1::FindGraspRequest {
    v1::FindGraspRequest::new("objects/block").with_budget(Duration::from_secs(10))
}

/// The atlases that an answer's search used.
fn used(answer: &v1::FindGraspResponse) -> &[v1::Atlas] {
    &answer
        .origin
        .as_ref()
        .expect("every answer has an origin")
        .atlases
}

/// The only atlas that an answer's search used.
fn only_used(answer: &v1::FindGraspResponse) -> &v1::Atlas {
    let [atlas] = used(answer) else {
        panic!("{answer:?}");
    };
    atlas
}

#[tokio::test(flavor = "multi_thread")]
async fn an_atlas_grows_answers_requests_and_survives_a_restart() {
    let folder = Folder::absent("atlases");
    let server = start(&folder).await;
    create_box(&server).await;
    let first = state(&server, "objects/block", FIRST).await;
    let second = state(&server, "objects/block", first.entry_count + 1).await;
    assert_ne!(first.stamp, second.stamp);

    let request = block().receiving(v1::Handedness::Right);
    let request = with(request, |request| {
        "rigs/adult".clone_into(&mut request.receiver_mut().rig);
    });
    let answer = find(&server, request.clone()).await;
    assert_eq!(answer.source(), v1::GraspSource::Atlas);
    let atlas = only_used(&answer);
    assert_eq!(atlas.name, "objects/block/atlases/right");
    assert_eq!(atlas.handedness(), v1::Handedness::Right);
    assert!(atlas.entry_count >= second.entry_count);
    assert_eq!(atlas.stamp.len(), 16);
    let answer = find(&server, unaided(request)).await;
    assert_eq!(used(&answer), []);
    assert_eq!(answer.source(), v1::GraspSource::Search);
    server.stop().await;

    // The next server starts with the grips that the last one knew.
    let server = start(&folder).await;
    create_box(&server).await;
    let read = state(&server, "objects/block", 1).await;
    assert!(
        read.entry_count >= second.entry_count,
        "{read:?} after {second:?}"
    );
    server.stop().await;

    // Damaged files are built again, and replaced before the new atlas is reported.
    let damaged = damage(&folder);
    let server = start(&folder).await;
    create_box(&server).await;
    state(&server, "objects/block", 1).await;
    server.stop().await;
    let is_replaced = |(path, bytes): &(PathBuf, Vec<u8>)| fs::read(path).expect("it is there") != *bytes;
    assert!(damaged.iter().any(is_replaced));
}

/// Requests for both hands of a rig that has no atlas yet, each with the answers to two calls.
async fn asked_twice(server: &TestServer) -> Vec<(v1::FindGraspRequest, [v1::FindGraspResponse; 2])> {
    let mut asked = Vec::new();
    for handedness in [v1::Handedness::Left, v1::Handedness::Right] {
        let request = with(block().receiving(handedness), |request| {
            "rigs/thesis".clone_into(&mut request.receiver_mut().rig);
        });
        let first = find(server, request.clone()).await;
        let again = find(server, request.clone()).await;
        asked.push((request, [first, again]));
    }
    asked
}

/// The stamps of the learned grips that an answer's search used.
fn learned_stamps(answer: &v1::FindGraspResponse) -> Vec<&str> {
    let stamps = used(answer).iter().map(|atlas| atlas.learned_stamp.as_str());
    stamps.filter(|stamp| !stamp.is_empty()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_grasp_found_answers_the_next_request() {
    let folder = Folder::absent("learned");
    let server = start(&folder).await;
    create_box(&server).await;
    let mut learned = 0;
    for (request, [first, again]) in asked_twice(&server).await {
        assert_eq!(first.source(), v1::GraspSource::Search);
        assert_eq!(learned_stamps(&first), [""; 0]);
        // The atlas may have been faster.
        if again.source() == v1::GraspSource::Learned {
            learned += 1;
            assert!(again.grasp().is_some());
            assert_eq!(again.grasps, first.grasps);
            assert_eq!(again.attempts(), 0);
            assert_eq!(again.origin.as_ref().unwrap().attempt, None);
            let atlas = only_used(&again);
            assert!(atlas.learned_count > 0);
            assert_eq!(atlas.learned_stamp.len(), 16);
        } else {
            assert_eq!(again.source(), v1::GraspSource::Atlas);
        }
        for request in [unaided(request.clone()), reproducible(request.with_seed(2))] {
            let answer = find(&server, request).await;
            assert_eq!(answer.source(), v1::GraspSource::Search);
            assert_eq!(learned_stamps(&answer), [""; 0]);
        }
    }
    assert!(learned > 0, "both atlases were there before the second request");
    server.stop().await;
}

/// Flips a bit in every atlas of a folder; returns the damaged files.
fn damage(folder: &Folder) -> Vec<(PathBuf, Vec<u8>)> {
    let files = fs::read_dir(folder.path()).expect("there is a folder");
    let damage = |path: PathBuf| {
        let mut bytes = fs::read(&path).expect("it is there");
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&path, &bytes).expect("it can be written");
        (path, bytes)
    };
    files
        .map(|file| damage(file.expect("it can be listed").path()))
        .collect()
}
