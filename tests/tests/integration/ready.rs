//! A new server derives search data of its hands before it serves.
//!
//! It runs in its own process: any other test that searches derives the data first, for the whole process.

use std::{env, process::Command};

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

/// Set for the process in which the test runs alone.
const ALONE: &str = "GRASP_TEST_ALONE";

#[tokio::test]
async fn hands_are_prepared_before_the_server_serves() {
    if env::var_os(ALONE).is_none() {
        let mut test = Command::new(env::current_exe().expect("the test is a program"));
        test.args(["--exact", "ready::hands_are_prepared_before_the_server_serves"]);
        let output = test.env(ALONE, "1").output().expect("it runs again");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && text.contains("1 passed"), "{text}");
        return;
    }
    assert_eq!(rigs().filter(|rig| rig.is_derived()).count(), 0);
    let server = TestServer::start().await;
    for rig in rigs() {
        assert!(rig.is_derived());
    }
    server.stop().await;
}
