//! A new server derives search data of its hands before it serves.
//!
//! It runs in its own process: any other test that searches derives the data first, for the whole process.

use grasp_assets::hands::{RIG_NAMES, hand};
use grasp_synthesis::model::hand::{Handedness, rig::RigGuide};
use grasp_tests::TestServer;

/// The derived data of each built-in hand.
fn guides() -> impl Iterator<Item = &'static RigGuide> {
    let rigs = RIG_NAMES.into_iter();
    rigs.flat_map(|rig| {
        [Handedness::Left, Handedness::Right]
            .map(|handedness| &hand(rig, handedness).expect("it is built in").rig.guide)
    })
}

#[tokio::test]
async fn hands_are_prepared_before_the_server_serves() {
    assert_eq!(guides().filter(|guide| guide.is_derived()).count(), 0);
    let server = TestServer::start().await;
    for guide in guides() {
        assert!(guide.is_derived());
    }
    server.stop().await;
}
