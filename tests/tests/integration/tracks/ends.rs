//! How tracks end, and what they never do: wait, queue, or go on for nobody.

use std::time::Duration;

use grasp_proto::v1::{self, track_holdout_request::Message};
use grasp_tests::TestServer;
use tonic::{Code, Request};

use super::{Tracked, frame, setup, swaying};
use crate::fixtures::{blamed_fields, bounded, milliseconds, reason, until};

#[tokio::test(flavor = "multi_thread")]
async fn a_slow_reader_gets_the_answer_to_its_latest_frame() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    track.ask(frame(0, swaying(0))).await;
    let last = 400;
    for sequence in 1..=last {
        track.send(frame(sequence, swaying(sequence))).await;
    }
    let mut answered = 0_u64;
    let mut skipped = 0_u64;
    let mut before = 0;
    loop {
        let answer = track.next().await.unwrap();
        assert!(answer.sequence > before, "answers are in order");
        // Every frame is answered or overtaken by the next one that is.
        assert_eq!(answer.sequence - before, 1 + u64::from(answer.skipped_frames));
        before = answer.sequence;
        answered += 1;
        skipped += u64::from(answer.skipped_frames);
        if before == last {
            break;
        }
    }
    assert_eq!(answered + skipped, last);
    assert!(skipped > 0, "frames that come at once overtake each other");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reader_that_reads_nothing_causes_no_work_and_gets_the_latest() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    track.ask(frame(0, swaying(0))).await;
    // Far more than the transport holds of answers that nobody reads.
    let last = 3000;
    for sequence in 1..=last {
        track.send(frame(sequence, swaying(sequence))).await;
    }
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert!(
        server.gauges().unread_bytes() < 1 << 20,
        "{}",
        server.gauges().unread_bytes()
    );
    let mut answers = 0;
    loop {
        answers += 1;
        if track.next().await.unwrap().sequence == last {
            break;
        }
    }
    assert!(answers < last, "{answers}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_setup_is_rejected_with_every_violation() {
    let server = TestServer::start().await;
    let of_frames = frame(0, swaying(0));
    let wrong = v1::TrackSetup {
        holdout: Some(v1::FindGraspRequest {
            object: "remote".to_owned(),
            client_from_object: of_frames.client_from_object,
            presenting_hand: of_frames.presenting_hand.clone(),
            validity: v1::Validity::Thesis.into(),
            hands: v1::Hands::Both.into(),
            only_attempt: Some(3),
            standing: Some(v1::StandingGrasp {
                present: Some(v1::HandAtObject::default()),
                better_by: Some(0.1),
                committed: true,
                hand: None,
            }),
            ..Default::default()
        }),
        policy: Some(v1::TrackPolicy {
            better_by: Some(1.5),
            least_time_between_changes: Some(milliseconds(-1)),
            predict_ahead: Some(milliseconds(501)),
            detail: 7,
            grace: Some(crate::fixtures::seconds(6)),
            may_change_hand: true,
        }),
    };
    let status = Tracked::start(&server, Message::Setup(wrong))
        .await
        .err()
        .unwrap();
    let blamed = blamed_fields(&status);
    for field in [
        "setup.holdout.object",
        "setup.holdout.client_from_object",
        "setup.holdout.presenting_hand",
        "setup.holdout.validity",
        "setup.holdout.hands",
        "setup.holdout.only_attempt",
        "setup.holdout.standing.hand",
        "setup.holdout.standing.present",
        "setup.holdout.standing.better_by",
        "setup.holdout.standing.committed",
        "setup.policy.better_by",
        "setup.policy.least_time_between_changes",
        "setup.policy.predict_ahead",
        "setup.policy.detail",
        "setup.policy.grace",
    ] {
        assert!(
            blamed.iter().any(|blamed| blamed == field),
            "{field} in {blamed:?}"
        );
    }
    let status = Tracked::start(&server, Message::Frame(of_frames))
        .await
        .err()
        .unwrap();
    assert_eq!(blamed_fields(&status), ["setup"]);
    let missing = v1::TrackSetup {
        holdout: Some(v1::FindGraspRequest {
            object: "objects/missing".to_owned(),
            ..Default::default()
        }),
        policy: None,
    };
    let status = Tracked::start(&server, Message::Setup(missing))
        .await
        .err()
        .unwrap();
    assert_eq!(status.code(), Code::NotFound);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tracks_are_limited_and_end_with_their_clients() {
    let server = TestServer::start_with(|config| config.streams.tracks = 1.try_into().unwrap()).await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    track.ask(frame(0, swaying(0))).await;
    let second = Tracked::start(&server, Message::Setup(setup(v1::TrackPolicy::default()))).await;
    let status = second.err().unwrap();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::ResourceExhausted, "TOO_MANY_TRACKS".to_owned())
    );
    // A client that goes away in the middle of a search for which there is much time.
    let blocked = crate::fixtures::impossible(&server).await;
    drop(track);
    let gone = async {
        until("a free place", || server.gauges().tracks() == 0).await;
        until("the end of the call", || server.gauges().calls() == 0).await;
    };
    tokio::time::timeout(Duration::from_secs(1), gone)
        .await
        .expect("tracks of clients that are gone are freed within a second");
    let setup = v1::TrackSetup {
        holdout: Some(v1::FindGraspRequest {
            client_from_object: None,
            presenting_hand: None,
            budget: Some(crate::fixtures::seconds(10)),
            ..blocked.clone()
        }),
        policy: None,
    };
    let track = Tracked::start(&server, Message::Setup(setup)).await.unwrap();
    track
        .send(v1::TrackFrame {
            client_from_object: blocked.client_from_object,
            presenting_hand: blocked.presenting_hand,
            ..Default::default()
        })
        .await;
    until("a search", || server.gauges().searches() == 1).await;
    drop(track);
    tokio::time::timeout(
        Duration::from_secs(1),
        until("the end of the search", || server.gauges().searches() == 0),
    )
    .await
    .expect("searches of clients that are gone stop within a second");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tracks_end_with_their_frames_their_deadline_or_without_either() {
    let server = TestServer::start_with(|config| {
        config.streams.track_idle = Duration::from_millis(300);
        config.drain = Duration::from_hours(1);
    })
    .await;
    // The last frame is answered, then the track ends well.
    let Tracked { frames, mut answers } = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let message = Some(Message::Frame(frame(0, swaying(0))));
    frames.send(v1::TrackHoldoutRequest { message }).await.unwrap();
    drop(frames);
    let last = bounded("an answer", answers.message()).await.unwrap();
    assert_eq!(last.unwrap().answer.unwrap().sequence, 0);
    assert_eq!(bounded("the end", answers.message()).await.unwrap(), None);

    let mut idle = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    idle.ask(frame(0, swaying(0))).await;
    let status = idle.next().await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::DeadlineExceeded, "TRACK_IDLE".to_owned())
    );

    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_open_track_ends_at_its_deadline() {
    let server = TestServer::start().await;
    let request = v1::OpenTrackRequest {
        setup: Some(setup(v1::TrackPolicy::default())),
    };
    let mut request = Request::new(request);
    request.set_timeout(Duration::from_secs(2));
    let mut open = server
        .grasps()
        .await
        .open_track(request)
        .await
        .unwrap()
        .into_inner();
    bounded("the name", open.message()).await.unwrap();
    let status = bounded("the end", open.message()).await.unwrap_err();
    assert_eq!(status.code(), Code::DeadlineExceeded, "{status:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tracks_end_with_unavailable_at_shutdown() {
    let server = TestServer::start_with(|config| config.drain = Duration::from_hours(1)).await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    track.ask(frame(0, swaying(0))).await;
    let stopping = server.begin_stop();
    let status = track.next().await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::Unavailable, "SHUTTING_DOWN".to_owned())
    );
    bounded("the shutdown", stopping.stopped()).await;
}
