//! Panics that are injected at every kind of point: the call fails with INTERNAL, and nothing else does.

use std::sync::{
    Arc, Mutex, PoisonError,
    atomic::{AtomicU32, Ordering},
};

use grasp_proto::v1::{self, track_holdout_request::Message};
use grasp_server::FaultPoint;
use grasp_tests::TestServer;
use tonic::{Code, Status};

use crate::{
    fixtures::{
        BOX_OBJ, assert_status, box_request, delete, find, floating_remote, get, mesh, unaided, until,
    },
    uploads::{parts, upload},
};

/// Panics to inject.
const PANICS: u32 = 1000;

/// The payload of injected panics, which are not printed.
const ON_PURPOSE: &str = "injected by a test";

/// A call that passes a point.
#[derive(Clone, Copy, Debug)]
enum Call {
    Get,
    Find,
    Validate,
    Evaluate,
    Create,
    Upload,
    StreamGrasps,
    Watch,
    Mesh,
    Track,
    Push,
}

const CASES: [(FaultPoint, Call); 17] = [
    (FaultPoint::Handler, Call::Get),
    (FaultPoint::Handler, Call::Track),
    (FaultPoint::Build, Call::Create),
    (FaultPoint::Build, Call::Upload),
    (FaultPoint::Coordinator, Call::Find),
    (FaultPoint::Coordinator, Call::Validate),
    (FaultPoint::Coordinator, Call::StreamGrasps),
    (FaultPoint::Worker, Call::Find),
    (FaultPoint::Worker, Call::Evaluate),
    (FaultPoint::Stream, Call::StreamGrasps),
    (FaultPoint::Stream, Call::Watch),
    (FaultPoint::Body, Call::Find),
    (FaultPoint::Body, Call::Mesh),
    (FaultPoint::Body, Call::Track),
    (FaultPoint::Frames, Call::Track),
    (FaultPoint::Frame, Call::Track),
    (FaultPoint::Frame, Call::Push),
];

/// A search by workers.
fn search() -> v1::FindGraspRequest {
    unaided(floating_remote())
}

fn frame() -> v1::TrackFrame {
    let holdout = v1::Holdout {
        object: String::new(),
        ..floating_remote().holdout.expect("it has one")
    };
    v1::TrackFrame::of(1, holdout)
}

impl Call {
    /// Makes the call, and reads its answer to the end.
    async fn make(self, server: &TestServer) -> Result<(), Status> {
        let mut grasps = server.grasps().await;
        match self {
            Self::Get => _ = get(server, "objects/remote").await?,
            Self::Find => _ = grasps.find_grasp(search()).await?,
            Self::Validate => {
                let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Right)
                    .with_client_from_wrist(v1::Pose::default())
                    .with_digits([Some(v1::DigitAngles::new([0.0, 0.2, 0.2, 0.2])); 5]);
                let request = v1::ValidateGraspRequest::from(search()).with_pose(hand);
                _ = grasps.validate_grasp(request).await?;
            }
            Self::Evaluate => {
                let request = v1::EvaluateHoldoutRequest::from(search());
                _ = grasps.evaluate_holdout(request).await?;
            }
            Self::Create => {
                server.objects().await.create_object(box_request("made")).await?;
                delete(server, "objects/made").await?;
            }
            Self::Upload => {
                upload(server, parts("sent", BOX_OBJ.as_bytes(), 100)).await?;
                delete(server, "objects/sent").await?;
            }
            Self::StreamGrasps => {
                let mut found = grasps
                    .stream_grasps(v1::StreamGraspsRequest::from(search()))
                    .await?
                    .into_inner();
                while found.message().await?.is_some() {}
            }
            Self::Watch => {
                let request = v1::WatchObjectsRequest {
                    include_present: true,
                    ..Default::default()
                };
                let mut reports = server.objects().await.watch_objects(request).await?.into_inner();
                // Three objects, and that these were all.
                for _ in 0..4 {
                    reports.message().await?;
                }
            }
            Self::Mesh => _ = mesh(server, "objects/remote").await?,
            Self::Track => {
                let track = Message::Track(v1::Track::new("objects/remote"));
                let messages = [track, Message::Frame(frame())];
                let messages = messages.map(|message| v1::TrackHoldoutRequest {
                    message: Some(message),
                });
                let mut answers = grasps
                    .track_holdout(tokio_stream::iter(messages))
                    .await?
                    .into_inner();
                while answers.message().await?.is_some() {}
            }
            Self::Push => {
                let track = grasps
                    .create_track(v1::Track::new("objects/remote"))
                    .await?
                    .into_inner();
                let pushed = v1::TrackFrame {
                    track: track.name.clone(),
                    ..frame()
                };
                grasps.push_frame(pushed).await?;
                grasps
                    .delete_track(v1::DeleteTrackRequest { name: track.name })
                    .await?;
            }
        }
        Ok(())
    }
}

/// Does not print panics that are injected.
fn keep_quiet() {
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if panic.payload_as_str() != Some(ON_PURPOSE) {
            print(panic);
        }
    }));
}

#[tokio::test(flavor = "multi_thread")]
async fn every_panic_fails_its_call_and_no_other_and_costs_no_place() {
    keep_quiet();
    let armed: Arc<Mutex<Option<FaultPoint>>> = Arc::default();
    let injected = Arc::new(AtomicU32::new(0));
    let (of_hook, count) = (Arc::clone(&armed), Arc::clone(&injected));
    let hook = move |point| {
        let mut armed = of_hook.lock().unwrap_or_else(PoisonError::into_inner);
        if *armed == Some(point) {
            *armed = None;
            drop(armed);
            count.fetch_add(1, Ordering::Relaxed);
            std::panic::panic_any(ON_PURPOSE);
        }
    };
    // One place of each kind: the next call misses one that is lost.
    let one = || 1.try_into().unwrap();
    let adapt = |config: &mut grasp_server::Config| {
        config.maximum_searches = one();
        config.maximum_uploads = one();
        config.streams.tracks = one();
        config.streams.watchers = one();
        config.streams.upload_bytes = BOX_OBJ.len().try_into().unwrap();
    };
    let server = TestServer::start_faulty(adapt, hook).await;
    let is_idle = || {
        let gauges = server.gauges();
        gauges.searches() + gauges.calls() + gauges.tracks() == 0
    };
    let mut failed = 0;
    for number in 0..PANICS {
        let (point, call) = CASES[number as usize % CASES.len()];
        // Without a fault, which also shows that the one before cost nothing.
        if number < 2 * CASES.len() as u32 {
            let made = call.make(&server).await;
            assert!(made.is_ok(), "before {point:?} of {call:?}: {made:?}");
            until("the end of the call", is_idle).await;
        }
        *armed.lock().unwrap() = Some(point);
        let status = call.make(&server).await;
        let status = status.expect_err(&format!("{point:?} of {call:?} number {number} did not fail"));
        assert_status(&status, Code::Internal, "JOB_PANICKED");
        failed += 1;
        until("the end of the call", is_idle).await;
    }
    let injected = injected.load(Ordering::Relaxed);
    println!("{injected} panics injected, {failed} calls answered with INTERNAL");
    assert_eq!((injected, failed), (PANICS, PANICS));
    for (_, call) in CASES {
        call.make(&server)
            .await
            .unwrap_or_else(|status| panic!("{call:?}: {status:?}"));
        until("the end of the call", is_idle).await;
    }
    assert!(find(&server, floating_remote()).await.grasp().is_some());
    server.stop().await;
}
