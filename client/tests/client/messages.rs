//! What makes messages pleasant.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_client::{
    Handedness, std_duration,
    v1::{
        Contact, CurrentGrasp, DigitAngles, FindGraspRequest, Grasp, HandPose, Holdout, JointPose, NodePose,
        Pose, Shape, Track, TrackFrame,
    },
    wire_duration,
};

/// A hand of the rig `adult` whose wrist is here in the client's frame.
fn hand(x: f32) -> HandPose {
    HandPose::new("rigs/adult", Handedness::Left)
        .with_client_from_wrist(Pose::new(Vec3::X * x, Quat::IDENTITY))
}

#[test]
fn poses_map_points_and_inverses_map_them_back() {
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let a_from_b = Pose::new(Vec3::new(1.0, 2.0, 3.0), turn);
    let b_from_c = Pose::new(Vec3::X, Quat::IDENTITY);
    // By hand: c's origin lies at +x in b, and a quarter turn about z takes +x to +y.
    let origin = (a_from_b * b_from_c).transform_point(Vec3::ZERO);
    assert!(origin.abs_diff_eq(Vec3::new(1.0, 3.0, 3.0), 1e-6), "{origin}");
    let back = a_from_b.inverse().transform_point(origin);
    assert!(back.abs_diff_eq(Vec3::X, 1e-6), "{back}");
}

#[test]
fn durations_round_trip_and_malformed_ones_are_zero() {
    let duration = Duration::new(3, 250_000_001);
    assert_eq!(std_duration(wire_duration(duration)), duration);
    assert_eq!(wire_duration(Duration::MAX).seconds, i64::MAX);
    for (seconds, nanos) in [(-1, 0), (i64::MIN, i32::MIN), (0, -1)] {
        let malformed = prost_types::Duration { seconds, nanos };
        assert_eq!(std_duration(malformed), Duration::ZERO);
    }
}

#[test]
fn tracks_leave_out_what_frames_contain_and_frames_what_is_the_tracks() {
    let mut request = FindGraspRequest::new("objects/remote")
        .with_client_from_object(Pose::new(Vec3::X, Quat::IDENTITY))
        .with_hand(hand(0.0))
        .with_hand(hand(1.0))
        .with_obstacle(Shape::ball(Vec3::ZERO, 0.1))
        .with_current(CurrentGrasp::new(hand(2.0)));
    request.holdout_mut().scale = Some(1.5);
    request.holdout_mut().mass_kg = Some(0.2);
    let track = Track::from(request.clone());
    let fixed = Holdout {
        scale: Some(1.5),
        mass_kg: Some(0.2),
        ..Holdout::new("objects/remote")
    };
    assert_eq!((track.holdout, track.current), (Some(fixed), Some(hand(2.0))));
    let holdout = request.holdout.unwrap();
    assert_eq!(holdout.presenting_hand, Some(hand(0.0).into()));
    assert_eq!(holdout.other_hands, [hand(1.0).into()]);
    let frame = TrackFrame::of(7, holdout.clone()).captured_at(Duration::from_millis(70));
    assert_eq!(
        (frame.sequence, frame.capture_time()),
        (7, Some(Duration::from_millis(70)))
    );
    let moving = Holdout {
        scale: None,
        mass_kg: None,
        ..holdout
    };
    assert_eq!(frame.holdout, Some(moving));
}

#[test]
fn a_grasp_to_hold_on_to_has_no_more_than_requests_are_read_for() {
    let answered = HandPose {
        joints: vec![JointPose::default()],
        model: vec![NodePose::default()],
        ..hand(1.0).with_digits([Some(DigitAngles::new([0.1; 4])); 5])
    };
    let kept = HandPose {
        joints: Vec::new(),
        model: Vec::new(),
        ..answered.clone()
    };
    let grasp = Grasp {
        hand: Some(answered),
        ..Grasp::default()
    };
    assert_eq!(grasp.current().grasp, Some(kept));
}

#[test]
fn contacts_are_moved_to_the_clients_frame() {
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let client_from_object = Pose::new(Vec3::Y, turn);
    let object_from_wrist = Pose::new(Vec3::new(0.1, 0.2, 0.3), Quat::from_rotation_x(0.4));
    let contact = Contact {
        position: Some(Vec3::X.into()),
        normal: Some(Vec3::X.into()),
        force: Some((2.0 * Vec3::NEG_X).into()),
        triangle: 5,
        ..Contact::default()
    };
    let hand = HandPose::new("rigs/adult", Handedness::Right)
        .with_client_from_wrist(client_from_object * object_from_wrist)
        .with_object_from_wrist(object_from_wrist);
    let grasp = Grasp {
        hand: Some(hand),
        contacts: vec![contact],
        ..Grasp::default()
    };
    let [moved] = grasp.client_contacts()[..] else {
        panic!("it has one")
    };
    for (vector, expected) in [
        (moved.position(), 2.0 * Vec3::Y),
        (moved.normal(), Vec3::Y),
        (moved.force(), 2.0 * Vec3::NEG_Y),
    ] {
        assert!(vector.abs_diff_eq(expected, 1e-6), "{vector} is not {expected}");
    }
    assert_eq!(moved.triangle, 5);
}
