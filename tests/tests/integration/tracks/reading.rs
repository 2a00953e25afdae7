//! Clients that do not read for a while.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;

use super::{Tracked, created::Created, frame, swaying};

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
    let mut track = Tracked::remote(&server).await;
    let last = 150;
    for sequence in 0..=last {
        track.send(after(0, sequence)).await;
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let mut answers = Vec::new();
    while answers.last() != Some(&last) {
        answers.push(track.next().await.unwrap().sequence);
    }
    assert!(answers.len() <= FEW + 1, "{answers:?}");
    // Who reads on has an answer to each frame.
    for sequence in last + 1..last + 30 {
        track.ask(after(FEW as u64 + sequence - last, sequence)).await;
    }
    // Who has a call for each frame has read the answers before.
    let pushed = Created::remote(&server).await;
    for sequence in 0..3 * FEW as u64 {
        pushed.ask(after(0, sequence)).await;
    }
    server.stop().await;
}
