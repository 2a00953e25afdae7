//! What a new server knows before it serves. A process of its own, as one that asks a hand has things found out for all.

use grasp_assets::hands::{RIG_NAMES, hand};
use grasp_synthesis::model::hand::{Handedness, rig::RigGuide};
use grasp_tests::TestServer;

/// What search derives of each built-in hand.
fn guides() -> impl Iterator<Item = &'static RigGuide> {
    let rigs = RIG_NAMES.into_iter();
    rigs.flat_map(|rig| {
        [Handedness::Left, Handedness::Right]
            .map(|handedness| &hand(rig, handedness).expect("it is built in").rig.guide)
    })
}

#[tokio::test]
async fn no_call_waits_for_what_search_derives_of_a_hand() {
    assert_eq!(guides().filter(|guide| guide.is_derived()).count(), 0);
    let server = TestServer::start().await;
    for guide in guides() {
        assert!(guide.is_derived());
    }
    server.stop().await;
}
