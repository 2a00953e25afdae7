//! Atlases: they grow in the background, are reported, used and kept on disk, and stop growing with the server.

use std::{fs, path::PathBuf};

use grasp_assets::{atlases::shipped_atlas, hands::hand, objects::object};
use grasp_proto::v1;
use grasp_synthesis::{known::codec::decode, model::hand::Handedness};
use grasp_tests::TestServer;

use crate::fixtures::{Folder, bounded, box_request, seconds, until};

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
    assert!(state.complete);
    (server, folder)
}

/// Waits until an object's atlas has `least` grips, and returns its state.
pub(crate) async fn state(server: &TestServer, name: &str, least: u32) -> v1::AtlasState {
    let mut client = server.objects().await;
    bounded("the growth of an atlas", async {
        loop {
            let request = v1::GetObjectRequest {
                name: name.to_owned(),
            };
            let answer = client.get_object(request).await.expect("it is there");
            let object = answer.into_inner().object.expect("an answer has the object");
            let state = object.atlas.expect("there are atlases");
            if state.entries >= least {
                return state;
            }
            assert_eq!(state.stamp.is_empty(), state.entries == 0);
            tokio::time::sleep(std::time::Duration::from_millis(1)).await;
        }
    })
    .await
}

async fn create_box(server: &TestServer) {
    let created = server.objects().await.create_object(box_request("block")).await;
    let object = created.expect("it can be created").into_inner().object.unwrap();
    let state = object.atlas.expect("there are atlases");
    assert!(!state.complete);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_atlas_grows_answers_requests_and_survives_a_restart() {
    let folder = Folder::absent("atlases");
    let server = start(&folder).await;
    create_box(&server).await;
    let first = state(&server, "objects/block", FIRST).await;
    let second = state(&server, "objects/block", first.entries + 1).await;
    assert_ne!(first.stamp, second.stamp);

    let request = v1::FindGraspRequest {
        object: "objects/block".to_owned(),
        budget: Some(seconds(10)),
        receiving_hand: Some(v1::ReceivingHand {
            rig: "adult".to_owned(),
            handedness: v1::Handedness::Right.into(),
            hand_scale: None,
        }),
        ..Default::default()
    };
    let answer = server.grasps().await.find_grasp(request.clone()).await;
    let report = answer.unwrap().into_inner().report.unwrap();
    assert!(report.atlas_entries >= second.entries);
    assert_eq!(report.source(), v1::GraspSource::Atlas);
    assert_eq!(report.atlas_stamp.len(), 16);
    let request = v1::FindGraspRequest {
        atlas: v1::AtlasUse::None.into(),
        ..request
    };
    let answer = server.grasps().await.find_grasp(request).await;
    let report = answer.unwrap().into_inner().report.unwrap();
    assert_eq!((report.atlas_entries, report.atlas_stamp.as_str()), (0, ""));
    assert_eq!(report.source(), v1::GraspSource::Search);
    server.stop().await;

    // The next server starts with the grips that the last one knew.
    let server = start(&folder).await;
    create_box(&server).await;
    let read = state(&server, "objects/block", 1).await;
    assert!(read.entries >= second.entries, "{read:?} after {second:?}");
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

/// What a server answers to requests for the right and left hand of a rig that has no atlas yet, each asked twice.
async fn asked_twice(server: &TestServer) -> Vec<(v1::FindGraspRequest, [v1::FindGraspResponse; 2])> {
    let ask = async |request: v1::FindGraspRequest| {
        let answer = server.grasps().await.find_grasp(request).await;
        answer.unwrap().into_inner()
    };
    let mut asked = Vec::new();
    for handedness in [v1::Handedness::Left, v1::Handedness::Right] {
        let request = v1::FindGraspRequest {
            object: "objects/block".to_owned(),
            budget: Some(seconds(10)),
            receiving_hand: Some(v1::ReceivingHand {
                rig: "thesis".to_owned(),
                handedness: handedness.into(),
                hand_scale: None,
            }),
            ..Default::default()
        };
        let first = ask(request.clone()).await;
        let again = ask(request.clone()).await;
        asked.push((request, [first, again]));
    }
    asked
}

fn report(answer: &v1::FindGraspResponse) -> &v1::SearchReport {
    answer.report.as_ref().expect("every answer has a report")
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_search_found_answers_the_next_request() {
    let folder = Folder::absent("learned");
    let server = start(&folder).await;
    create_box(&server).await;
    let mut learned = 0;
    for (request, [first, again]) in asked_twice(&server).await {
        assert_eq!(report(&first).source(), v1::GraspSource::Search);
        assert_eq!(report(&first).learned_stamp, "");
        // Unless the atlas was faster.
        if report(&again).source() == v1::GraspSource::Learned {
            learned += 1;
            assert!(again.grasp.is_some());
            assert_eq!(again.grasp, first.grasp);
            assert_eq!((report(&again).attempts, report(&again).attempt), (0, None));
            assert_eq!(report(&again).learned_stamp.len(), 16);
        } else {
            assert_eq!(report(&again).source(), v1::GraspSource::Atlas);
        }
        for request in [
            v1::FindGraspRequest {
                atlas: v1::AtlasUse::None.into(),
                ..request.clone()
            },
            v1::FindGraspRequest {
                reproducible: true,
                seed: Some(2),
                ..request
            },
        ] {
            let answer = server
                .grasps()
                .await
                .find_grasp(request)
                .await
                .unwrap()
                .into_inner();
            assert_eq!(report(&answer).source(), v1::GraspSource::Search);
            assert_eq!(report(&answer).learned_stamp, "");
        }
    }
    assert!(learned > 0, "both atlases were there before the second request");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_learned_if_the_server_is_not_to() {
    let folder = Folder::absent("unlearned");
    let server = TestServer::start_with(|config| {
        config.builder_threads = 1;
        config.atlas_directory = Some(folder.path().to_owned());
        config.learned_grips = 0;
    })
    .await;
    create_box(&server).await;
    for (_, answers) in asked_twice(&server).await {
        for answer in &answers {
            assert_ne!(report(answer).source(), v1::GraspSource::Learned);
            assert_eq!(report(answer).learned_stamp, "");
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn shipped_grips_are_a_complete_atlas() {
    let folder = Folder::absent("shipped");
    let server = start(&folder).await;
    for (side, handedness) in [
        (Handedness::Right, v1::Handedness::Right),
        (Handedness::Left, v1::Handedness::Left),
    ] {
        let rig = &hand("adult", side).expect("it is built in").rig;
        let remote = &object("remote").expect("it is built in").object;
        let bytes = shipped_atlas("remote", rig).expect("it is shipped");
        let shipped = decode(bytes, remote, rig).expect("it is current").atlas;
        let request = v1::FindGraspRequest {
            object: "objects/remote".to_owned(),
            budget: Some(seconds(10)),
            receiving_hand: Some(v1::ReceivingHand {
                rig: String::new(),
                handedness: handedness.into(),
                hand_scale: None,
            }),
            ..Default::default()
        };
        let ask = async |request: v1::FindGraspRequest| {
            let answer = server.grasps().await.find_grasp(request).await;
            answer
                .unwrap()
                .into_inner()
                .report
                .expect("every answer has a report")
        };
        let report = bounded("the reading of the shipped grips", async {
            loop {
                let report = ask(request.clone()).await;
                if report.source() == v1::GraspSource::Atlas {
                    break report;
                }
            }
        })
        .await;
        let of_shipped = (shipped.entries().len(), format!("{:016x}", shipped.stamp()));
        assert_eq!((report.atlas_entries as usize, report.atlas_stamp), of_shipped);
        // Reproducible answers depend on complete atlases only.
        let report = ask(v1::FindGraspRequest {
            reproducible: true,
            ..request
        })
        .await;
        assert_eq!((report.atlas_entries as usize, report.atlas_stamp), of_shipped);
    }
    let state = state(&server, "objects/remote", 1).await;
    assert!(state.complete);
    assert_eq!(state.growth(), v1::AtlasGrowth::Complete);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_atlas_answers_with_requested_types() {
    let folder = Folder::absent("types");
    let server = start(&folder).await;
    create_box(&server).await;
    state(&server, "objects/block", FIRST).await;
    let ask = async |constraints: v1::Constraints| {
        let request = v1::FindGraspRequest {
            object: "objects/block".to_owned(),
            budget: Some(seconds(10)),
            constraints: Some(constraints),
            ..Default::default()
        };
        let answer = server.grasps().await.find_grasp(request).await;
        let answer = answer.unwrap().into_inner();
        let report = answer.report.unwrap();
        assert_eq!(report.source(), v1::GraspSource::Atlas, "{report:?}");
        answer.grasp.expect("one from the atlas").r#type
    };
    // Excluding earlier answers, until there are three types.
    let mut seen: Vec<i32> = Vec::new();
    while seen.len() < 3 {
        let next = ask(v1::Constraints {
            allowed_grasp_types: (1..=33).filter(|one| !seen.contains(one)).collect(),
            excluded_grasp_types: seen.clone(),
            ..Default::default()
        });
        let next = next.await;
        assert!(next > 0 && !seen.contains(&next), "{next} after {seen:?}");
        seen.push(next);
    }
    for one in seen {
        let only = ask(v1::Constraints {
            allowed_grasp_types: vec![one],
            ..Default::default()
        });
        assert_eq!(only.await, one);
    }
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

#[tokio::test(flavor = "multi_thread")]
async fn builders_stop_with_their_server() {
    let server = TestServer::start_with(|config| config.builder_threads = 2).await;
    let gauges = server.gauges().clone();
    assert_eq!(gauges.builders(), 2);
    bounded("the end", server.stop()).await;
    until("the end of the builders", || gauges.builders() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_without_builders_reports_no_atlas() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    let listed = client.list_objects(v1::ListObjectsRequest::default());
    let objects = listed.await.unwrap().into_inner().objects;
    assert!(objects.iter().all(|object| object.atlas.is_none()));
    server.stop().await;
}

#[test]
fn an_atlas_directory_that_cannot_be_made_is_reported() {
    let folder = Folder::absent("no-folder");
    fs::write(folder.path(), "a file").expect("the temporary directory can be written to");
    let config = grasp_server::Config {
        builder_threads: 1,
        atlas_directory: Some(folder.path().join("below")),
        place: grasp_server::config::StorePlace::Memory,
        ..Default::default()
    };
    let text = grasp_server::Server::new(config)
        .expect_err("it is below a file")
        .to_string();
    assert!(
        text.starts_with("atlas_directory is ") && text.contains("below"),
        "{text}"
    );
    fs::remove_file(folder.path()).expect("it is there");
}
