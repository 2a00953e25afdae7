//! A new server derives search data of its hands before it serves.
//!
//! It runs in its own process: any other test that searches derives the data first, for the whole process.

use grasp_assets::hands::{RIG_NAMES, hand};
use grasp_synthesis::{model::hand::Handedness, propose::prepared::PreparedRig};
use grasp_tests::TestServer;

/// The rig of each built-in hand.
fn rigs() -> impl Iterator<Item = &'static PreparedRig> {
    let names = RIG_NAMES.into_iter();
    names.flat_map(|rig| {
        [Handedness::Left, Handedness::Right]
            .map(|handedness| &hand(rig, handedness).expect("it is built in").rig)
    })
}

#[tokio::test]
async fn hands_are_prepared_before_the_server_serves() {
    assert_eq!(rigs().filter(|rig| rig.is_derived()).count(), 0);
    let server = TestServer::start().await;
    for rig in rigs() {
        assert!(rig.is_derived());
    }
    server.stop().await;
}
