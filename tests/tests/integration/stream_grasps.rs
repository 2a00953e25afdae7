//! Streams of grasps: better ones as they are found, or the best that differ.

use std::{collections::HashSet, time::Duration};

use bytes::Bytes;
use grasp_proto::v1::{self, stream_grasps_response::Event};
use grasp_tests::TestServer;
use tokio::{net::TcpStream, time::Instant};
use tonic::{Code, IntoRequest, Request, Status};

use crate::{
    browser::framed,
    fixtures::{
        blamed_fields, bounded, floating_remote, held_remote, impossible, impossible_at_once, milliseconds,
        reason, seconds, until,
    },
};

/// What a stream consists of.
#[derive(Debug)]
struct Streamed {
    grasps: Vec<v1::StreamedGrasp>,
    /// When each came.
    times: Vec<Instant>,
    summary: v1::StreamSummary,
    /// From the call to the end.
    took: Duration,
}

impl Streamed {
    fn totals(&self) -> Vec<f32> {
        self.grasps.iter().map(total).collect()
    }
}

fn grasp(streamed: &v1::StreamedGrasp) -> &v1::Grasp {
    streamed.grasp.as_ref().expect("every message has a grasp")
}

fn total(streamed: &v1::StreamedGrasp) -> f32 {
    grasp(streamed).score.as_ref().expect("it is rated").total
}

/// Reads a stream to its end.
async fn stream(
    server: &TestServer,
    request: impl IntoRequest<v1::StreamGraspsRequest>,
) -> Result<Streamed, Status> {
    let mut client = server.grasps().await;
    let start = Instant::now();
    let mut messages = client.stream_grasps(request).await?.into_inner();
    let (mut grasps, mut times, mut summary) = (Vec::new(), Vec::new(), None);
    while let Some(message) = bounded("a message", messages.message()).await? {
        assert!(summary.is_none(), "the summary is the last message");
        match message.event.expect("every message has an event") {
            Event::Grasp(grasp) => {
                times.push(Instant::now());
                grasps.push(grasp);
            }
            Event::Summary(last) => summary = Some(last),
        }
    }
    Ok(Streamed {
        grasps,
        times,
        summary: summary.expect("a summary ends the stream"),
        took: start.elapsed(),
    })
}

/// As many attempts as need no end by the clock, so that the search is the same each time.
fn attempts(number: u64, holdout: v1::FindGraspRequest) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        max_attempts: Some(number),
        budget: Some(seconds(10)),
        ..holdout
    }
}

fn every_better(holdout: v1::FindGraspRequest) -> v1::StreamGraspsRequest {
    v1::StreamGraspsRequest {
        holdout: Some(holdout),
        most_per_second: Some(1000.0),
        alternatives: None,
    }
}

fn alternatives(holdout: v1::FindGraspRequest, count: u32, by: &[v1::DifferBy]) -> v1::StreamGraspsRequest {
    v1::StreamGraspsRequest {
        holdout: Some(holdout),
        most_per_second: None,
        alternatives: Some(v1::Alternatives {
            count,
            differ_by: by.iter().map(|&by| by.into()).collect(),
        }),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn each_grasp_is_better_and_the_last_is_the_best() {
    let server = TestServer::start().await;
    let mut streamed_grasps = 0;
    for (seed, holdout) in [(1, floating_remote()), (2, held_remote()), (3, held_remote())] {
        let holdout = attempts(
            400,
            v1::FindGraspRequest {
                seed: Some(seed),
                ..holdout
            },
        );
        let streamed = stream(&server, every_better(holdout.clone())).await.unwrap();
        let totals = streamed.totals();
        assert!(totals.is_sorted_by(|a, b| a < b), "{totals:?}");
        streamed_grasps += totals.len();
        let times: Vec<_> = streamed
            .grasps
            .iter()
            .map(|grasp| Duration::try_from(grasp.found_after.unwrap()).unwrap())
            .collect();
        assert!(times.is_sorted(), "{times:?}");
        let summary = &streamed.summary;
        assert_eq!(summary.outcome(), v1::Outcome::Found);
        assert_eq!(summary.sent as usize, totals.len());
        let report = summary.report.as_ref().unwrap();
        // The same attempts in one answer.
        let found = v1::FindGraspRequest {
            choice: v1::Choice::BestWithinBudget.into(),
            ..holdout
        };
        let found = server
            .grasps()
            .await
            .find_grasp(found)
            .await
            .unwrap()
            .into_inner();
        let last = streamed.grasps.last().unwrap();
        assert_eq!(found.grasp.as_ref(), Some(grasp(last)));
        assert_eq!(found.report.unwrap().candidates, report.candidates);
        assert_eq!(last.source(), report.source());
    }
    assert!(streamed_grasps > 6, "{streamed_grasps}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_more_grasps_are_sent_than_wanted_per_second() {
    let server = TestServer::start().await;
    let mut skipped = 0;
    for seed in 0..4 {
        let holdout = v1::FindGraspRequest {
            seed: Some(seed),
            ..held_remote()
        };
        let request = v1::StreamGraspsRequest {
            most_per_second: Some(2.0),
            ..every_better(attempts(300, holdout))
        };
        let streamed = stream(&server, request).await.unwrap();
        // The last one comes when the search ends.
        let (_, but_last) = streamed.times.split_last().unwrap();
        for pair in but_last.windows(2) {
            assert!(pair[1] - pair[0] > Duration::from_millis(450), "{pair:?}");
        }
        assert!(streamed.totals().is_sorted_by(|a, b| a < b));
        skipped += streamed.summary.skipped;
    }
    assert!(skipped > 0);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_has_the_budget_it_is_given_or_the_servers_default() {
    let server = TestServer::start_with(|config| config.budgets.default = Duration::from_millis(150)).await;
    let budget = |streamed: Streamed| streamed.summary.report.unwrap().budget;
    let default = stream(
        &server,
        every_better(v1::FindGraspRequest {
            budget: None,
            ..floating_remote()
        }),
    );
    assert_eq!(budget(default.await.unwrap()), Some(milliseconds(150)));
    let given = stream(
        &server,
        every_better(v1::FindGraspRequest {
            budget: Some(milliseconds(70)),
            ..floating_remote()
        }),
    );
    assert_eq!(budget(given.await.unwrap()), Some(milliseconds(70)));
    server.stop().await;
}

/// The direction of the object's axes that the back of the hand faces most. In `OpenXR`, +y of the wrist points out of the
/// back of the hand.
fn side(grasp: &v1::Grasp) -> (usize, bool) {
    let q = grasp.object_from_wrist.unwrap().orientation.unwrap();
    let back = [
        2.0 * (q.x * q.y - q.w * q.z),
        1.0 - 2.0 * (q.x * q.x + q.z * q.z),
        2.0 * (q.y * q.z + q.w * q.x),
    ];
    let axis = (0..3)
        .max_by(|&a, &b| back[a].abs().total_cmp(&back[b].abs()))
        .unwrap();
    (axis, back[axis] < 0.0)
}

#[tokio::test(flavor = "multi_thread")]
async fn alternatives_differ_and_the_best_comes_first() {
    use v1::DifferBy::{Approach, Region, Type};
    let server = TestServer::start().await;
    let holdout = attempts(400, held_remote());
    let best = stream(&server, every_better(holdout.clone())).await.unwrap();
    let best = grasp(best.grasps.last().unwrap()).clone();
    for by in [&[][..], &[Approach], &[Type], &[Approach, Type], &[Region]] {
        let streamed = stream(&server, alternatives(holdout.clone(), 6, by))
            .await
            .unwrap();
        assert!(
            (2..=6).contains(&streamed.grasps.len()),
            "{by:?}: {}",
            streamed.grasps.len()
        );
        assert_eq!(streamed.summary.sent as usize, streamed.grasps.len());
        let totals = streamed.totals();
        assert!(totals.is_sorted_by(|a, b| a >= b), "{totals:?}");
        assert_eq!(grasp(&streamed.grasps[0]), &best, "{by:?}");
        let is_by = |what| by.contains(&what) || (by.is_empty() && what == Approach);
        let classes: HashSet<_> = streamed
            .grasps
            .iter()
            .map(|streamed| {
                let grasp = grasp(streamed);
                let approach = is_by(Approach).then(|| (side(grasp), grasp.handedness));
                let grasp_type = is_by(Type).then_some(grasp.r#type);
                (approach, grasp_type)
            })
            .collect();
        if !is_by(Region) {
            assert_eq!(classes.len(), streamed.grasps.len(), "{by:?} {classes:?}");
        }
        // Fewer are the first of more.
        let fewer = stream(&server, alternatives(holdout.clone(), 2, by))
            .await
            .unwrap();
        let first_two = streamed.grasps[..2].iter().map(grasp);
        assert!(fewer.grasps.iter().map(grasp).eq(first_two), "{by:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_grasp_there_is_only_a_summary() {
    let server = TestServer::start().await;
    let hopeless = v1::FindGraspRequest {
        budget: Some(milliseconds(60)),
        ..impossible(&server).await
    };
    for request in [every_better(hopeless.clone()), alternatives(hopeless, 3, &[])] {
        let streamed = stream(&server, request).await.unwrap();
        assert!(streamed.grasps.is_empty());
        assert_eq!(
            (
                streamed.summary.outcome(),
                streamed.summary.sent,
                streamed.summary.skipped
            ),
            (v1::Outcome::BudgetExhausted, 0, 0)
        );
        let report = streamed.summary.report.unwrap();
        assert_eq!(report.limits.len(), 1, "{report:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_is_reported_at_once() {
    let server = TestServer::start().await;
    let wrong = v1::StreamGraspsRequest {
        holdout: Some(v1::FindGraspRequest {
            choice: v1::Choice::FirstValid.into(),
            reproducible: true,
            only_attempt: Some(3),
            standing: Some(v1::StandingGrasp::default()),
            hands: v1::Hands::Both.into(),
            friction: Some(-1.0),
            ..floating_remote()
        }),
        most_per_second: None,
        alternatives: Some(v1::Alternatives {
            count: 33,
            differ_by: vec![v1::DifferBy::Type.into(), 99],
        }),
    };
    let status = stream(&server, wrong).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let blamed = blamed_fields(&status);
    for field in [
        "alternatives.count",
        "alternatives.differ_by[1]",
        "holdout.choice",
        "holdout.reproducible",
        "holdout.only_attempt",
        "holdout.standing",
        "holdout.hands",
        "holdout.friction",
    ] {
        assert!(blamed.iter().any(|blamed| blamed == field), "{field}: {blamed:?}");
    }
    for rate in [0.0, -1.0, 1001.0, f32::NAN, f32::INFINITY] {
        let wrong = v1::StreamGraspsRequest {
            most_per_second: Some(rate),
            ..every_better(floating_remote())
        };
        let status = stream(&server, wrong).await.unwrap_err();
        assert_eq!(blamed_fields(&status), ["most_per_second"], "{rate}");
    }
    let status = stream(&server, v1::StreamGraspsRequest::default())
        .await
        .unwrap_err();
    assert_eq!(blamed_fields(&status), ["holdout"]);
    let absent = every_better(v1::FindGraspRequest {
        object: "objects/nothing".to_owned(),
        ..floating_remote()
    });
    let status = stream(&server, absent).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_summary_comes_before_the_deadline() {
    // A reserve that a busy machine does not exceed.
    let server =
        TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::from_secs(1)).await;
    let mut request = Request::new(every_better(v1::FindGraspRequest {
        budget: Some(seconds(10)),
        ..floating_remote()
    }));
    request.set_timeout(Duration::from_secs(3));
    let streamed = stream(&server, request).await.unwrap();
    assert!(streamed.took < Duration::from_secs(3), "{:?}", streamed.took);
    let budget = Duration::try_from(streamed.summary.report.unwrap().budget.unwrap()).unwrap();
    // Less 1 % of the deadline, by which clients round.
    assert!(
        budget <= Duration::from_millis(1970) && budget > Duration::from_secs(1),
        "{budget:?}"
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_reserve_grows_with_the_delays_of_summaries() {
    let server = TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::ZERO).await;
    let message = every_better(v1::FindGraspRequest {
        max_attempts: Some(1),
        budget: None,
        ..impossible_at_once(&server).await
    });
    let mut budgets = Vec::new();
    for _ in 0..2 {
        let mut request = Request::new(message.clone());
        request.set_timeout(Duration::from_millis(500));
        let streamed = stream(&server, request).await.unwrap();
        budgets.push(streamed.summary.report.unwrap().budget.unwrap().nanos);
    }
    // No delay was known to the first; that of its summary, over threads and through the codec, exceeds a microsecond.
    assert!((499_990_000..=500_000_000).contains(&budgets[0]), "{budgets:?}");
    assert!((125_000_000..budgets[0]).contains(&budgets[1]), "{budgets:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dropped_stream_stops_its_search() {
    let server = TestServer::start().await;
    let request = every_better(v1::FindGraspRequest {
        budget: Some(seconds(10)),
        ..floating_remote()
    });
    let mut messages = server
        .grasps()
        .await
        .stream_grasps(request)
        .await
        .unwrap()
        .into_inner();
    bounded("a grasp", messages.message())
        .await
        .unwrap()
        .expect("it has a grasp");
    assert_eq!(server.gauges().searches(), 1);
    drop(messages);
    until("the end of the search", || server.gauges().searches() == 0).await;
    until("the end of the call", || server.gauges().calls() == 0).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_needs_the_place_of_a_search() {
    let server = TestServer::start_with(|config| config.maximum_searches = 1.try_into().unwrap()).await;
    let request = every_better(v1::FindGraspRequest {
        budget: Some(seconds(10)),
        ..impossible(&server).await
    });
    let first = server
        .grasps()
        .await
        .stream_grasps(request.clone())
        .await
        .unwrap();
    let status = stream(&server, request).await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::ResourceExhausted, "TOO_MANY_SEARCHES".to_owned())
    );
    drop(first);
    until("the end of the search", || server.gauges().searches() == 0).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn shutdown_ends_streams() {
    let server = TestServer::start().await;
    let request = every_better(v1::FindGraspRequest {
        budget: Some(seconds(10)),
        ..impossible(&server).await
    });
    let mut messages = server
        .grasps()
        .await
        .stream_grasps(request)
        .await
        .unwrap()
        .into_inner();
    until("the search", || server.gauges().searches() == 1).await;
    let stopping = server.begin_stop();
    let status = bounded("the end of the stream", messages.message())
        .await
        .unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::Unavailable, "SHUTTING_DOWN".to_owned())
    );
    bounded("the end of the server", stopping.stopped()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_stops_reading_ends_its_search() {
    let server = TestServer::start_with(|config| {
        config.budgets.maximum = Duration::from_mins(5);
        config.workers = 1.try_into().unwrap();
    })
    .await;
    let socket = TcpStream::connect(server.address()).await.unwrap();
    // Its window has room for no message.
    let (sender, connection) = h2::client::Builder::new()
        .initial_window_size(0)
        .handshake::<_, Bytes>(socket)
        .await
        .unwrap();
    let connection = tokio::spawn(connection);
    let mut sender = sender.ready().await.unwrap();
    let uri = format!("{}/grasp.v1.GraspService/StreamGrasps", server.endpoint());
    let request = http::Request::post(uri)
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .body(())
        .unwrap();
    let (answer, mut body) = sender.send_request(request, false).unwrap();
    let holdout = v1::FindGraspRequest {
        budget: Some(seconds(300)),
        ..held_remote()
    };
    let message = Bytes::from(framed(&every_better(holdout)));
    body.send_data(message, true).unwrap();
    let _answer = bounded("headers", answer).await.unwrap();
    until("the search", || server.gauges().searches() == 1).await;
    // Well before the budget ends.
    until("the end of the search", || server.gauges().searches() == 0).await;
    until("the end of the call", || server.gauges().calls() == 0).await;
    connection.abort();
    server.stop().await;
}
