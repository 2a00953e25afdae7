//! Motions that no hand makes are not predicted.

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;
use grasp_tests::TestServer;

use super::{Tracked, remote, time_of};
use crate::fixtures::milliseconds;

/// Where answers say that the object is, for the frames of a motion.
async fn answered(
    server: &TestServer,
    moves: impl Fn(u64) -> Pose,
    frames: u64,
) -> Vec<(Pose, Option<v1::PredictionError>)> {
    let track = v1::Track {
        prediction_horizon: Some(milliseconds(30)),
        ..remote()
    };
    let mut track = Tracked::of(server, track).await;
    let mut places = Vec::new();
    for sequence in 0..frames {
        let holdout = v1::Holdout {
            client_from_object: Some(grasp_tests::wire_pose(moves(sequence))),
            ..Default::default()
        };
        let frame = v1::TrackFrame::of(sequence, holdout).captured_at(time_of(sequence));
        let answer = track.ask(frame).await;
        let grasp = answer.grasp.expect("a free object can be taken");
        let hand = grasp.hand.expect("it is set");
        places.push((super::pose_of(hand.client_from_object()), answer.last_prediction));
    }
    places
}

#[tokio::test(flavor = "multi_thread")]
async fn teleports_and_snap_turns_are_answered_where_they_end() {
    let server = TestServer::start().await;
    let turned = Quat::from_rotation_y(0.5);
    let still = Pose::from_position(Vec3::X * 0.3);
    for jump in [
        Pose::from_position(Vec3::X * 1.5),
        Pose::from_position(Vec3::X * 0.08),
        Pose::new(turned * Vec3::X * 0.3 - Vec3::X * 0.3, turned),
    ] {
        let moves = |frame: u64| if frame < 6 { still } else { jump * still };
        for (frame, (place, error)) in (0..).zip(answered(&server, moves, 12).await) {
            let expected = moves(frame);
            assert!(
                place.position.distance(expected.position) < 1e-4
                    && place.orientation.angle_between(expected.orientation) < 2e-3,
                "{jump:?}, frame {frame}: {place:?}"
            );
            // What no prediction foresees is none of its errors.
            assert!(
                error.is_none_or(|error| error.object_distance < 1e-4),
                "{error:?}"
            );
        }
    }
    server.stop().await;
}
