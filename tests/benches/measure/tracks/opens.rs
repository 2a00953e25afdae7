//! What creating a track costs.

use std::{fmt, time::Duration};

use grasp_proto::v1;
use grasp_tests::TestServer;
use serde::Serialize;

use crate::figures::core::process_time;

/// Milliseconds of processor time of client and server together, per track.
#[derive(Debug, Serialize)]
pub(crate) struct Opens {
    opened: u32,
    /// Of the remote.
    opening: f64,
    /// Of a search for a grasp, for comparison.
    finding: f64,
}

/// Creates and deletes tracks one after the other, on one connection.
pub(crate) async fn measure(opened: u32) -> Opens {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let mut client = server.grasps().await;
    let request = v1::FindGraspRequest::new("objects/remote");
    let mut took = [Duration::ZERO; 2];
    // The first round prepares the object.
    for round in 0..=opened {
        let start = process_time();
        let track = client.create_track(v1::Track::from(request.clone())).await;
        let name = track.expect("the track is right").into_inner().name;
        let delete = v1::DeleteTrackRequest { name };
        client.delete_track(delete).await.expect("the track is there");
        let middle = process_time();
        client
            .find_grasp(request.clone())
            .await
            .expect("the request is right");
        if round > 0 {
            took[0] += middle.saturating_sub(start);
            took[1] += process_time().saturating_sub(middle);
        }
    }
    server.stop().await;
    let [opening, finding] = took.map(|time| time.as_secs_f64() * 1e3 / f64::from(opened));
    Opens {
        opened,
        opening,
        finding,
    }
}

impl fmt::Display for Opens {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a track is created and deleted in {:.2} ms of processor time, its client's included, the mean of {}; a grasp is found in {:.2} ms",
            self.opening, self.opened, self.finding
        )
    }
}
