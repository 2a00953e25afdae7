//! Streams: objects that are watched, and grasps, better ones as they are found or the best that differ.

use std::{
    collections::{BTreeMap, HashSet},
    time::Duration,
};

use grasp_proto::v1::{self, ObjectChange, stream_grasps_request::Sent};
use grasp_tests::TestServer;
use tokio::time::Instant;
use tonic::{Code, Status, Streaming};

use crate::fixtures::{
    assert_status, bounded, box_request, create, delete, find, floating_remote, held_remote, labels, list,
    until, update, update_of, with, with_object,
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
async fn messages_to_a_watcher_add_up_to_the_list_however_clients_interleave() {
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

/// The messages of a stream.
#[derive(Debug)]
struct Streamed {
    /// Every message but the last, with a grasp each.
    messages: Vec<v1::FindGraspResponse>,
    /// When each came.
    times: Vec<Instant>,
    /// The last message: how the search ended.
    end: v1::FindGraspResponse,
}

impl Streamed {
    fn grasps(&self) -> Vec<&v1::Grasp> {
        self.messages
            .iter()
            .map(|message| message.grasp().expect("it has a grasp"))
            .collect()
    }

    fn scores(&self) -> Vec<f32> {
        let grasps = self.grasps().into_iter();
        grasps.map(|grasp| grasp.score.expect("it is rated")).collect()
    }
}

/// Reads a stream to its end.
async fn stream(server: &TestServer, request: v1::StreamGraspsRequest) -> Result<Streamed, Status> {
    let mut client = server.grasps().await;
    let mut messages = client.stream_grasps(request).await?.into_inner();
    let (mut streamed, mut times, mut end) = (Vec::new(), Vec::new(), None);
    while let Some(message) = bounded("a message", messages.message()).await? {
        assert!(end.is_none(), "the outcome is in the last message");
        assert!(message.report.is_some() && message.origin.is_some() && message.current.is_none());
        if message.outcome() == v1::Outcome::Unspecified {
            assert_eq!(message.grasps.len(), 1, "{message:?}");
            times.push(Instant::now());
            streamed.push(message);
        } else {
            assert_eq!(message.grasps, []);
            end = Some(message);
        }
    }
    Ok(Streamed {
        messages: streamed,
        times,
        end: end.expect("an outcome ends the stream"),
    })
}

/// A search bounded by attempts and not by the clock, so that it is the same each time.
fn attempts(number: u64, request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    with(request.with_budget(Duration::from_secs(10)), |request| {
        request.search_mut().max_attempts = Some(number);
    })
}

fn at_most(rate_hz: f32, request: v1::FindGraspRequest) -> v1::StreamGraspsRequest {
    v1::StreamGraspsRequest {
        sent: Some(Sent::MaxRateHz(rate_hz)),
        ..request.into()
    }
}

fn every_better(request: v1::FindGraspRequest) -> v1::StreamGraspsRequest {
    at_most(1000.0, request)
}

fn alternatives(request: v1::FindGraspRequest, count: u32, by: &[v1::DifferBy]) -> v1::StreamGraspsRequest {
    v1::StreamGraspsRequest {
        sent: Some(Sent::Alternatives(v1::Alternatives {
            count,
            differ_by: by.iter().map(|&by| by.into()).collect(),
        })),
        ..request.into()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn each_grasp_is_better_and_the_last_is_the_best() {
    let server = TestServer::start().await;
    let mut streamed_grasps = 0;
    for (seed, request) in [(1, floating_remote()), (2, held_remote()), (3, held_remote())] {
        let request = attempts(400, request.with_seed(seed));
        let streamed = stream(&server, every_better(request.clone())).await.unwrap();
        let scores = streamed.scores();
        assert!(scores.is_sorted_by(|a, b| a < b), "{scores:?}");
        streamed_grasps += scores.len();
        let messages = streamed.messages.iter();
        let times: Vec<_> = messages.map(v1::FindGraspResponse::search_time).collect();
        assert!(times.is_sorted() && times[0] > Duration::ZERO, "{times:?}");
        assert_eq!(streamed.end.outcome(), v1::Outcome::Found);
        // The same attempts in one answer.
        let found = with(request, |request| {
            request.search_mut().choice = v1::GraspChoice::BestWithinBudget.into();
        });
        let found = find(&server, found).await;
        let last = streamed.messages.last().unwrap();
        assert_eq!(found.grasps, last.grasps);
        assert_eq!(found.attempts(), streamed.end.attempts());
        assert_eq!(last.origin, streamed.end.origin);
    }
    assert!(streamed_grasps > 6, "{streamed_grasps}");
}

#[tokio::test(flavor = "multi_thread")]
async fn no_more_grasps_are_sent_than_wanted_per_second() {
    let server = TestServer::start().await;
    let mut skipped = 0;
    for seed in 0..4 {
        let request = attempts(300, held_remote().with_seed(seed));
        let all = stream(&server, every_better(request.clone())).await.unwrap();
        let streamed = stream(&server, at_most(2.0, request)).await.unwrap();
        // The last one comes when the search ends.
        let (_, but_last) = streamed.times.split_last().unwrap();
        for pair in but_last.windows(2) {
            assert!(pair[1] - pair[0] > Duration::from_millis(450), "{pair:?}");
        }
        assert!(streamed.scores().is_sorted_by(|a, b| a < b));
        assert_eq!(streamed.scores().last(), all.scores().last());
        skipped += all.messages.len().saturating_sub(streamed.messages.len());
    }
    assert!(skipped > 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn alternatives_differ_and_the_best_comes_first() {
    use v1::DifferBy::{Approach, Region, Type};
    let server = TestServer::start().await;
    let holdout = attempts(400, held_remote());
    let best = stream(&server, every_better(holdout.clone())).await.unwrap();
    let best = best.grasps()[best.messages.len() - 1].clone();
    for by in [&[][..], &[Type], &[Approach, Type], &[Region]] {
        let streamed = stream(&server, alternatives(holdout.clone(), 6, by))
            .await
            .unwrap();
        let grasps = streamed.grasps();
        assert!((2..=6).contains(&grasps.len()), "{by:?}: {}", grasps.len());
        let scores = streamed.scores();
        assert!(scores.is_sorted_by(|a, b| a >= b), "{scores:?}");
        assert_eq!(grasps[0], &best, "{by:?}");
        let types: HashSet<_> = grasps.iter().map(|grasp| grasp.r#type).collect();
        assert!(by != [Type] || types.len() == grasps.len(), "{types:?}");
        // Fewer are the first of more.
        let fewer = stream(&server, alternatives(holdout.clone(), 2, by))
            .await
            .unwrap();
        assert_eq!(fewer.grasps(), grasps[..2], "{by:?}");
    }
}
