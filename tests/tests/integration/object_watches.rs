//! Watching objects.

use std::{collections::BTreeMap, time::Duration};

use grasp_proto::v1::{self, ObjectChange};
use grasp_tests::TestServer;
use tonic::{Code, Status, Streaming};

use crate::fixtures::{
    assert_status, blamed_fields, bounded, box_request, create, delete, until, update, update_of, with_object,
};

async fn watch(
    server: &TestServer,
    filter: &str,
    include_present: bool,
) -> Result<Streaming<v1::WatchObjectsResponse>, Status> {
    let request = v1::WatchObjectsRequest {
        filter: filter.to_owned(),
        include_present,
    };
    Ok(server.objects().await.watch_objects(request).await?.into_inner())
}

async fn message(stream: &mut Streaming<v1::WatchObjectsResponse>) -> v1::WatchObjectsResponse {
    let news = bounded("a message", stream.message()).await;
    news.unwrap().expect("the stream goes on")
}

/// The next message as changes and the id of the object, and the object.
async fn next(
    stream: &mut Streaming<v1::WatchObjectsResponse>,
) -> (Vec<ObjectChange>, String, v1::GraspObject) {
    let news = message(stream).await;
    let changes = news.changes().collect();
    let object = news.object.unwrap_or_default();
    let id = object
        .name
        .strip_prefix("objects/")
        .unwrap_or_default()
        .to_owned();
    (changes, id, object)
}

async fn label(server: &TestServer, id: &str, value: &str) {
    let request = update_of(&format!("objects/{id}"), |object| {
        object.labels = [("level".to_owned(), value.to_owned())].into();
    });
    update(server, request).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn tells_of_present_objects_then_of_every_change() {
    let server = TestServer::start_with(|config| config.store.objects = 2).await;
    create(&server, box_request("a")).await.unwrap();
    let mut stream = watch(&server, "", true).await.unwrap();
    for id in ["a", "remote", "scalpel", "scissors"] {
        let (changes, of, object) = next(&mut stream).await;
        assert_eq!((changes, of.as_str()), (vec![ObjectChange::Present], id));
        assert!(object.triangle_count > 0);
    }
    let (changes, id, _) = next(&mut stream).await;
    assert_eq!((changes, id.as_str()), (vec![ObjectChange::PresentEnd], ""));

    create(&server, box_request("b")).await.unwrap();
    assert_eq!(next(&mut stream).await.0, [ObjectChange::Created]);
    label(&server, "b", "attic").await;
    let (changes, id, object) = next(&mut stream).await;
    assert_eq!((changes, id.as_str()), (vec![ObjectChange::Updated], "b"));
    assert_eq!(object.labels["level"], "attic");
    // Makes room by evicting the one that was used least recently.
    create(&server, box_request("c")).await.unwrap();
    let (changes, id, object) = next(&mut stream).await;
    assert_eq!((changes, id.as_str()), (vec![ObjectChange::Evicted], "a"));
    assert_eq!(object.triangle_count, 0);
    assert_eq!(next(&mut stream).await.1, "c");
    delete(&server, "objects/c").await.unwrap();
    let (changes, id, _) = next(&mut stream).await;
    assert_eq!((changes, id.as_str()), (vec![ObjectChange::Deleted], "c"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_filter_shows_only_objects_that_match() {
    let server = TestServer::start().await;
    for id in ["a", "b"] {
        create(&server, box_request(id)).await.unwrap();
    }
    let mut stream = watch(&server, "labels.level = \"attic\"", true).await.unwrap();
    assert_eq!(next(&mut stream).await.0, [ObjectChange::PresentEnd]);
    for (id, value, expected) in [
        ("a", "cellar", None),
        ("b", "attic", Some(ObjectChange::Created)),
        ("a", "attic", Some(ObjectChange::Created)),
        ("b", "cellar", Some(ObjectChange::Deleted)),
    ] {
        label(&server, id, value).await;
        if let Some(expected) = expected {
            let (changes, of, _) = next(&mut stream).await;
            assert_eq!((changes, of.as_str()), (vec![expected], id));
        }
    }
    delete(&server, "objects/b").await.unwrap();
    delete(&server, "objects/a").await.unwrap();
    let (changes, id, _) = next(&mut stream).await;
    assert_eq!((changes, id.as_str()), (vec![ObjectChange::Deleted], "a"));
    let status = watch(&server, "level", false).await.unwrap_err();
    assert_eq!(blamed_fields(&status), ["filter"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn tells_when_an_atlas_is_useful_and_complete() {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let mut stream = watch(&server, "labels.mine = \"\"", false).await.unwrap();
    let request = with_object(box_request("crate"), |object| {
        object.labels = [("mine".to_owned(), String::new())].into();
    });
    create(&server, request).await.unwrap();
    let mut seen = Vec::new();
    while !seen.contains(&ObjectChange::AtlasUseful) {
        let news = message(&mut stream).await;
        assert_eq!(news.object.as_ref().unwrap().name, "objects/crate");
        let changes: Vec<_> = news.changes().collect();
        let is_useful = changes.contains(&ObjectChange::AtlasUseful);
        assert_eq!(news.atlases.is_empty(), !is_useful, "{news:?}");
        for atlas in &news.atlases {
            let side = match atlas.handedness() {
                v1::Handedness::Left => "left",
                _ => "right",
            };
            assert_eq!(atlas.name, format!("objects/crate/atlases/{side}"));
            assert!(atlas.entry_count >= 100, "{atlas:?}");
        }
        seen.extend(changes);
    }
    assert_eq!(seen, [ObjectChange::Created, ObjectChange::AtlasUseful]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_watcher_that_does_not_read_gets_the_latest_state_of_each_object() {
    let server = TestServer::start().await;
    create(&server, box_request("a")).await.unwrap();
    let mut stream = watch(&server, "", false).await.unwrap();
    // Far more than the transport and the server hold.
    let changes = 2000;
    for n in 0..changes {
        label(&server, "a", &format!("{n:0>60}")).await;
    }
    let mut messages = 0;
    loop {
        let (_, _, object) = next(&mut stream).await;
        messages += 1;
        if object.labels["level"] == format!("{:0>60}", changes - 1) {
            break;
        }
    }
    assert!(messages <= changes, "{messages}");
}

#[tokio::test(flavor = "multi_thread")]
async fn watches_are_limited_and_end_with_their_clients() {
    let server = TestServer::start_with(|config| config.streams.watchers = 1.try_into().unwrap()).await;
    let stream = watch(&server, "", false).await.unwrap();
    let status = watch(&server, "", false).await.unwrap_err();
    assert_status(&status, Code::ResourceExhausted, "TOO_MANY_WATCHERS");
    assert_eq!(server.gauges().calls(), 1);
    drop(stream);
    until("the end of the call", || server.gauges().calls() == 0).await;
    bounded("a free place", async {
        while watch(&server, "", false).await.is_err() {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn watches_end_with_unavailable_at_shutdown() {
    let server = TestServer::start_with(|config| config.drain = Duration::from_hours(1)).await;
    let mut stream = watch(&server, "", false).await.unwrap();
    let stopping = server.begin_stop();
    let status = bounded("the end", stream.message()).await.unwrap_err();
    assert_status(&status, Code::Unavailable, "SHUTTING_DOWN");
    bounded("the shutdown", stopping.stopped()).await;
}

/// Creates, labels and deletes a few objects in an order that the seed decides; others do the same at the same time.
async fn meddle(server: &TestServer, mut seed: u64) {
    let mut client = server.objects().await;
    for _ in 0..25 {
        // Knuth's MMIX generator; its high bits are the random ones.
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let id = format!("o{}", (seed >> 40) % 5);
        let name = format!("objects/{id}");
        let result = match (seed >> 50) % 4 {
            0 => client.create_object(box_request(&id)).await.map(|_| ()),
            1 => {
                let request = v1::DeleteObjectRequest {
                    name,
                    ..Default::default()
                };
                client.delete_object(request).await.map(|_| ())
            }
            _ => {
                let request = update_of(&name, |object| {
                    object.labels = [("seed".to_owned(), seed.to_string())].into();
                });
                client.update_object(request).await.map(|_| ())
            }
        };
        if let Err(status) = result {
            // The others were quicker.
            assert!(
                matches!(status.code(), Code::AlreadyExists | Code::NotFound),
                "{status}"
            );
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_watcher_is_told_adds_up_to_the_list_however_clients_interleave() {
    let server = TestServer::start_with(|config| config.maximum_uploads = 16.try_into().unwrap()).await;
    let mut stream = watch(&server, "", true).await.unwrap();
    tokio::join!(
        meddle(&server, 1),
        meddle(&server, 2),
        meddle(&server, 3),
        meddle(&server, 4)
    );
    let listed = server
        .objects()
        .await
        .list_objects(v1::ListObjectsRequest::default())
        .await
        .unwrap();
    let listed: BTreeMap<String, v1::GraspObject> = listed
        .into_inner()
        .objects
        .into_iter()
        .map(|object| (object.name.clone(), object))
        .collect();
    let mut view = BTreeMap::new();
    while view != listed {
        let (changes, _, object) = next(&mut stream).await;
        match changes.last() {
            Some(ObjectChange::Deleted) => {
                view.remove(&object.name).expect("it was reported before");
            }
            Some(ObjectChange::PresentEnd) => {}
            _ => {
                view.insert(object.name.clone(), object);
            }
        }
    }
}
