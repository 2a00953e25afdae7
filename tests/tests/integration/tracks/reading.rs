//! Clients that do not read for a while.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;

use super::{Tracked, frame, open, swaying};
use crate::fixtures::bounded;

/// Answers that the server may be ahead of what was read.
const FEW: usize = 6;

/// A frame of a client that has read so many answers.
fn after(answers_read: u64, sequence: u64) -> v1::TrackFrame {
    v1::TrackFrame {
        answers_read: Some(answers_read),
        ..frame(sequence, swaying(sequence))
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reader_who_comes_back_meets_few_old_answers() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let (mut pushed, name) = open::open(&server).await;
    let last = 150;
    for sequence in 0..=last {
        track.send(after(0, sequence)).await;
        open::push(&server, &name, after(0, sequence)).await.unwrap();
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let mut streamed = Vec::new();
    while streamed.last() != Some(&last) {
        streamed.push(track.next().await.unwrap().sequence);
    }
    let mut pushed_answers = Vec::new();
    while pushed_answers.last() != Some(&last) {
        pushed_answers.push(bounded("the answer", open::next(&mut pushed)).await.sequence);
    }
    for answers in [streamed, pushed_answers] {
        assert!(answers.len() <= FEW + 1, "{answers:?}");
    }
    // Who reads on has an answer to each frame.
    for sequence in last + 1..last + 30 {
        let answer = track.ask(after(FEW as u64 + sequence - last, sequence)).await;
        assert_eq!(answer.skipped_frames, 0);
    }
    server.stop().await;
}
