//! What opening a track costs.

use std::{fmt, time::Duration};

use grasp_proto::v1;
use grasp_tests::TestServer;
use serde::Serialize;

use crate::figures::core::process_time;

/// Milliseconds of processor time of client and server together, per opened track.
#[derive(Debug, Serialize)]
pub(crate) struct Opens {
    opened: u32,
    /// Of the remote.
    opening: f64,
    /// Of a search for a grasp, for comparison.
    finding: f64,
}

/// Opens tracks one after the other, on one connection.
pub(crate) async fn measure(opened: u32) -> Opens {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let mut client = server.grasps().await;
    let holdout = v1::FindGraspRequest {
        object: "objects/remote".to_owned(),
        ..Default::default()
    };
    let mut took = [Duration::ZERO; 2];
    // The first round prepares the object.
    for round in 0..=opened {
        let start = process_time();
        let setup = v1::TrackSetup {
            holdout: Some(holdout.clone()),
            policy: None,
        };
        let request = v1::OpenTrackRequest { setup: Some(setup) };
        let track = client.open_track(request).await.expect("the setup is right");
        let mut track = track.into_inner();
        track.message().await.expect("the track is open");
        drop(track);
        let middle = process_time();
        client
            .find_grasp(holdout.clone())
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
            "a track opens in {:.2} ms of processor time, its client's included, the mean of {}; a grasp is found in {:.2} ms",
            self.opening, self.opened, self.finding
        )
    }
}
