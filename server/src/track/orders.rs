//! Tracks in many orders: frames come while others are answered, clients leave, and tracks end.

use std::sync::{
    LazyLock,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use http::HeaderMap;
use shuttle::future::{spawn, yield_now};
use tokio::sync::oneshot;

use super::*;
use crate::{
    access::{Caller, Owner},
    call::CallContext,
    client::Client,
    metrics::Metrics,
    sync::{Mutex, locked, orders::in_many_orders, wait_for},
    validate::track_query,
};

/// Not real: stand-ins for time end waits at any moment.
const IDLE: Duration = Duration::from_secs(1);

static RIGS: LazyLock<RigStore> = LazyLock::new(|| RigStore::new(0, None));
static METRICS: LazyLock<Arc<Metrics>> = LazyLock::new(Arc::default);

fn new_inbox(is_pushed: bool) -> Arc<Inbox> {
    let track = v1::Track {
        holdout: Some(v1::Holdout {
            object: "objects/block".to_owned(),
            ..Default::default()
        }),
        ..Default::default()
    };
    let query = track_query(track, is_pushed, ("adult", &RIGS), |_| true).expect("it is valid");
    Arc::new(Inbox::new(query.intake))
}

/// The number of the latest frame of a track.
type LatestNumber = AtomicU64;

fn put(inbox: &Inbox, number: &LatestNumber, sequence: u64, answers_read: Option<u64>, reply: Option<Reply>) {
    let frame = v1::TrackFrame {
        sequence,
        answers_read,
        ..Default::default()
    };
    let call = CallContext::arriving(&HeaderMap::new(), Client::Local, &METRICS);
    let put = inbox.put(frame, call.clone(), reply, |intake, frame| {
        if number.fetch_max(sequence, Relaxed) > sequence {
            return Ok(None);
        }
        // Wrong frames are answered, too.
        intake.check(frame, call.arrived, ("adult", &RIGS), |_| true)
    });
    put.expect("it is a frame");
}

/// The end of a pushed frame: its answer, or that of the track.
type Pushed = Option<v1::TrackAnswer>;

async fn push(tracks: &OpenTracks, name: &str, number: &LatestNumber, sequence: u64) -> Pushed {
    let (reply, answer) = oneshot::channel();
    // Does not hold the track while it waits.
    put(
        &*tracks.inbox(name, &Caller::default()).ok()?,
        number,
        sequence,
        None,
        Some(reply),
    );
    let answer = answer.await.ok()?;
    Some(answer.expect("no answer fails"))
}

/// Frames are pushed at the same time, one by a client that leaves; the track ends when it is deleted, or idle. Each frame is answered,
/// overtaken, or ended with the track, and nothing is left of the track once its name is gone.
fn pushed_frames_are_answered_once() {
    let tracks = Arc::new(OpenTracks::new(1));
    let number = Arc::new(LatestNumber::new(0));
    let inbox = new_inbox(true);
    let gone = Arc::downgrade(&inbox);
    let answered = Arc::new(Mutex::new(Vec::new()));
    let answers = {
        let place = tracks.places.take(&Client::Local).expect("it is free");
        let (inbox, answered) = (Arc::clone(&inbox), Arc::clone(&answered));
        async move {
            let _place = place;
            while let Ok(Some(PendingFrame { latest, reply, .. })) = inbox.latest(0, IDLE).await {
                let sequence = latest.sequence();
                locked(&answered).push(sequence);
                yield_now().await;
                let answer = v1::TrackAnswer {
                    sequence,
                    current: Some(v1::CurrentGraspReport::default()),
                    ..Default::default()
                };
                // The client may have left.
                let _ = reply.expect("it was pushed").send(Ok(answer));
            }
        }
    };
    let name = tracks.open(Owner::default(), inbox, answers);
    let push_two = |first: u64| {
        let (tracks, number, name) = (Arc::clone(&tracks), Arc::clone(&number), name.clone());
        spawn(async move {
            let mut pushed = Vec::new();
            for sequence in [first, first + 3] {
                pushed.push((sequence, push(&tracks, &name, &number, sequence).await));
            }
            pushed
        })
    };
    let [one, other, left] = [1, 2, 3].map(push_two);
    left.abort();
    let pushed = wait_for(async { [one.await, other.await, left.await] });
    // It may have ended before.
    let deleted = wait_for(tracks.delete(&name, &Caller::default()));
    assert_eq!(tracks.places.taken(), 0);
    assert!(tracks.inbox(&name, &Caller::default()).is_err());
    assert!(deleted.is_err() || gone.strong_count() == 0);
    let answered = locked(&answered);
    assert!(answered.is_sorted_by(|a, b| a < b), "{answered:?}");
    for (sequence, answer) in pushed.into_iter().flatten().flatten() {
        let Some(answer) = answer else { continue };
        assert_eq!(answer.sequence, sequence);
        assert_eq!(answer.current.is_some(), answered.contains(&sequence));
    }
}

/// Frames come on a stream whose client does not say in time that it has read their answers, and then the stream ends: its last
/// frame is answered before its end.
fn the_last_frame_of_a_stream_is_answered() {
    const LAST: u64 = 9;
    let inbox = new_inbox(false);
    let sender = {
        let inbox = Arc::clone(&inbox);
        spawn(async move {
            let number = LatestNumber::new(0);
            for sequence in 1..=LAST {
                put(&inbox, &number, sequence, Some(sequence / 4), None);
                yield_now().await;
            }
            inbox.end(Ok(()));
        })
    };
    let answered = wait_for(async {
        let mut answered = Vec::new();
        loop {
            match inbox.latest(answered.len() as u64, IDLE).await {
                Ok(Some(frame)) => answered.push(frame.latest.sequence()),
                Ok(None) => return answered,
                // It goes on, as if it had waited for less.
                Err(ServiceError::TrackIdle { .. }) => {}
                Err(error) => panic!("{error}"),
            }
        }
    });
    assert!(answered.is_sorted_by(|a, b| a < b), "{answered:?}");
    assert_eq!(answered.last(), Some(&LAST));
    wait_for(sender).expect("nothing aborts it");
}

#[test]
fn pushed_frames_are_answered_once_in_every_order() {
    LazyLock::force(&RIGS);
    LazyLock::force(&METRICS);
    in_many_orders(pushed_frames_are_answered_once);
}

#[test]
fn the_last_frame_of_a_stream_is_answered_in_every_order() {
    LazyLock::force(&RIGS);
    LazyLock::force(&METRICS);
    in_many_orders(the_last_frame_of_a_stream_is_answered);
}
