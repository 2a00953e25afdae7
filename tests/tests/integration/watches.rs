//! Watching objects.

use std::{collections::BTreeMap, time::Duration};

use grasp_proto::v1::{self, ObjectChange};
use grasp_tests::TestServer;
use tonic::{Code, Status, Streaming};

use crate::fixtures::{
    assert_status, bounded, box_request, create, delete, labels, list, until, update, update_of, with_object,
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

/// The last change of the next message, and its object.
async fn next(stream: &mut Streaming<v1::WatchObjectsResponse>) -> (ObjectChange, v1::GraspObject) {
    let news = message(stream).await;
    let change = news.changes().next_back().expect("a message has a change");
    (change, news.object.unwrap_or_default())
}

async fn label(server: &TestServer, id: &str, value: &str) {
    let request = update_of(&format!("objects/{id}"), |object| {
        object.labels = labels(&[("level", value)]);
    });
    update(server, request).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn tells_of_present_objects_then_of_every_change() {
    let server = TestServer::start_with(|config| config.store.objects = 2).await;
    create(&server, box_request("a")).await.unwrap();
    let mut stream = watch(&server, "", true).await.unwrap();
    let mut attic = watch(&server, "labels.level = \"attic\"", false).await.unwrap();
    for (expected, name) in [
        (ObjectChange::Present, "objects/a"),
        (ObjectChange::Present, "objects/remote"),
        (ObjectChange::Present, "objects/scalpel"),
        (ObjectChange::Present, "objects/scissors"),
        (ObjectChange::PresentEnd, ""),
    ] {
        let (change, object) = next(&mut stream).await;
        assert_eq!((change, object.name.as_str()), (expected, name));
        assert_eq!(object.triangle_count > 0, expected == ObjectChange::Present);
    }
    create(&server, box_request("b")).await.unwrap();
    assert_eq!(next(&mut stream).await.0, ObjectChange::Created);
    label(&server, "b", "attic").await;
    assert_eq!(next(&mut stream).await.0, ObjectChange::Updated);
    // Makes room by evicting the object that was used least recently.
    create(&server, box_request("c")).await.unwrap();
    let (change, object) = next(&mut stream).await;
    assert_eq!(
        (change, object.name.as_str()),
        (ObjectChange::Evicted, "objects/a")
    );
    assert_eq!(object.triangle_count, 0);
    assert_eq!(next(&mut stream).await.1.name, "objects/c");
    delete(&server, "objects/c").await.unwrap();
    let (change, object) = next(&mut stream).await;
    assert_eq!(
        (change, object.name.as_str()),
        (ObjectChange::Deleted, "objects/c")
    );
    let (change, object) = next(&mut attic).await;
    assert_eq!(
        (change, object.name.as_str()),
        (ObjectChange::Created, "objects/b")
    );
    assert_eq!(object.labels["level"], "attic");
}

#[tokio::test(flavor = "multi_thread")]
async fn tells_when_an_atlas_is_useful() {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let mut stream = watch(&server, "labels.mine = \"\"", false).await.unwrap();
    let request = with_object(box_request("crate"), |object| {
        object.labels = labels(&[("mine", "")]);
    });
    create(&server, request).await.unwrap();
    let mut seen = Vec::new();
    while !seen.contains(&ObjectChange::AtlasUseful) {
        let news = message(&mut stream).await;
        let changes: Vec<_> = news.changes().collect();
        assert_eq!(
            news.atlases.is_empty(),
            !changes.contains(&ObjectChange::AtlasUseful),
            "{news:?}"
        );
        for atlas in &news.atlases {
            assert!(
                atlas.name.starts_with("objects/crate/atlases/") && atlas.entry_count >= 100,
                "{atlas:?}"
            );
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
    let mut messages = 1;
    while next(&mut stream).await.1.labels["level"] != format!("{:0>60}", changes - 1) {
        messages += 1;
    }
    assert!(messages <= changes, "{messages}");
}

#[tokio::test(flavor = "multi_thread")]
async fn watches_are_limited_and_end_with_their_clients_or_the_server() {
    let server = TestServer::start_with(|config| {
        config.streams.watchers = 1.try_into().unwrap();
        config.drain = Duration::from_hours(1);
    })
    .await;
    let stream = watch(&server, "", false).await.unwrap();
    let status = watch(&server, "", false).await.unwrap_err();
    assert_status(&status, Code::ResourceExhausted, "TOO_MANY_WATCHERS");
    assert_eq!(server.gauges().calls(), 1);
    drop(stream);
    until("the end of the call", || server.gauges().calls() == 0).await;
    let mut stream = bounded("a free place", async {
        loop {
            if let Ok(stream) = watch(&server, "", false).await {
                return stream;
            }
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    })
    .await;
    let stopping = server.begin_stop();
    let status = bounded("the end", stream.message()).await.unwrap_err();
    assert_status(&status, Code::Unavailable, "SHUTTING_DOWN");
    bounded("the shutdown", stopping.stopped()).await;
}

/// Creates, labels and deletes a few objects in an order that the seed decides; others do the same at the same time.
async fn meddle(server: &TestServer, mut seed: u64) {
    for _ in 0..25 {
        // Knuth's MMIX generator; its high bits are the random ones.
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let id = format!("o{}", (seed >> 40) % 5);
        let name = format!("objects/{id}");
        let result = match (seed >> 50) % 4 {
            0 => create(server, box_request(&id)).await.map(drop),
            1 => delete(server, &name).await,
            _ => {
                let request = update_of(&name, |object| {
                    object.labels = labels(&[("seed", &seed.to_string())]);
                });
                update(server, request).await.map(drop)
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
    let listed = list(&server, v1::ListObjectsRequest::default()).await.into_iter();
    let listed: BTreeMap<_, _> = listed.map(|object| (object.name.clone(), object)).collect();
    let mut view = BTreeMap::new();
    while view != listed {
        let (change, object) = next(&mut stream).await;
        match change {
            ObjectChange::Deleted => {
                view.remove(&object.name).expect("it was reported before");
            }
            ObjectChange::PresentEnd => {}
            _ => {
                view.insert(object.name.clone(), object);
            }
        }
    }
}
