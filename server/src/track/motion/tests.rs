//! Against motions whose velocity is known.

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::model::hand::{Handedness, joints::HandJoints};

use super::*;
use crate::{
    answer::wire_pose,
    convention::Convention,
    rigs::store::RigStore,
    validate::{find_query, fixtures},
};

const AHEAD: Duration = Duration::from_millis(50);

/// Time between frames, in microseconds: about 90 Hz.
const FRAME: u64 = 11_111;

fn at(frame: u64) -> Duration {
    Duration::from_micros(frame * FRAME)
}

/// A query with the object there, and the built-in giver's hand held fast to it.
fn query(client_from_object: Pose) -> FindQuery {
    let joints = fixtures::joints_of_a_rig(Handedness::Left).transformed(client_from_object);
    let sent = fixtures::sent(&joints, Convention::OpenXr, v1::JointSet::Openxr26);
    let hand = v1::PresentingHand {
        form: Some(v1::presenting_hand::Form::Joints(sent)),
    };
    query_with(client_from_object, Some(hand))
}

fn query_with(client_from_object: Pose, presenting_hand: Option<v1::PresentingHand>) -> FindQuery {
    let request = v1::FindGraspRequest {
        object: "objects/any".to_owned(),
        client_from_object: Some(wire_pose(client_from_object)),
        presenting_hand,
        ..Default::default()
    };
    find_query(request, ("adult", &RigStore::new(0, None)), |_| true).expect("the request is valid")
}

fn joints(query: &FindQuery) -> &HandJoints {
    match &query.presenting_hand {
        Some(GiverHand::Jointed(hand)) => &hand.joints,
        _ => panic!("the giver's joints are known"),
    }
}

/// A body that turns about the vertical axis through a point beside it, and drifts.
fn turning(time: Duration) -> Pose {
    let seconds = time.as_secs_f32();
    Pose::new(
        Vec3::new(0.3 * seconds, 1.2, -0.1 * seconds),
        Quat::from_rotation_y(1.5 * seconds),
    )
}

fn assert_same(a: Pose, b: Pose, tolerance: f32) {
    let (distance, angle) = (
        a.position.distance(b.position),
        a.orientation.angle_between(b.orientation),
    );
    assert!(
        distance < tolerance && angle < 1e-3 + tolerance,
        "{distance} m, {angle} rad"
    );
}

#[test]
fn predicts_constant_velocities_exactly() {
    let mut motion = Motion::new(AHEAD);
    for frame in 0..20 {
        let now = at(frame);
        let mut predicted = query(turning(now));
        motion.predict(frame, now, &mut predicted);
        let expected = if frame == 0 {
            turning(now)
        } else {
            turning(now + AHEAD)
        };
        assert_same(predicted.client_from_object, expected, 1e-4);
    }
    let error = motion.last_error().expect("predictions have come true");
    // A straight line between two frames is shorter than the arc that hands turn along.
    assert!(
        error.object_distance < 1e-4 && error.object_angle < 1e-3,
        "{error:?}"
    );
    assert_eq!(error.sequence, 19);
}

#[test]
fn turning_hands_keep_the_lengths_of_their_bones() {
    let mut motion = Motion::new(AHEAD);
    for frame in 0..4 {
        let now = at(frame);
        let seen = query(turning(now));
        let mut predicted = query(turning(now));
        motion.predict(frame, now, &mut predicted);
        let (seen, predicted) = (joints(&seen), joints(&predicted));
        for joint in 2..JOINT_COUNT {
            let bone = |hand: &HandJoints| {
                let [from, to] = [joint - 1, joint].map(|joint| hand.joints[joint].pose.position);
                from.distance(to)
            };
            let is_first = index::FIRST_OF_DIGIT.contains(&joint);
            assert!(
                is_first || (bone(seen) - bone(predicted)).abs() < 1e-5,
                "joint {joint}"
            );
        }
    }
}

#[test]
fn reports_how_far_off_a_sudden_stop_was() {
    let mut motion = Motion::new(AHEAD);
    let speed = 0.5;
    let place = |frame: u64| Pose::from_position(Vec3::X * speed * at(frame.min(10)).as_secs_f32());
    for frame in 0..=14 {
        let mut moved = query(place(frame));
        motion.predict(frame, at(frame), &mut moved);
    }
    // The last prediction whose time has come is that of frame 9, for 50 ms later; the object stopped at frame 10.
    let expected = speed * (at(9) + AHEAD).saturating_sub(at(10)).as_secs_f32();
    let error = motion.last_error().expect("predictions have come true");
    assert!(
        (error.object_distance - expected).abs() < 1e-5,
        "{error:?}, {expected}"
    );
    assert!(
        (error.giver_distance.unwrap() - expected).abs() < 1e-4,
        "{error:?}"
    );
    assert!(error.object_angle < 1e-3);
}

#[test]
fn moves_meshes_with_what_they_hold_and_only_then() {
    let mesh = |pose: Pose| v1::PresentingHand {
        form: Some(v1::presenting_hand::Form::Mesh(v1::HandMesh {
            client_coordinates: [Vec3::ZERO, Vec3::X * 0.1, Vec3::Y * 0.1, Vec3::Z * 0.1]
                .into_iter()
                .flat_map(|vertex| pose.transform_point(vertex).to_array())
                .collect(),
            triangles: vec![0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3],
            client_from_wrist: None,
        })),
    };
    let mut motion = Motion::new(AHEAD);
    for frame in 0..5 {
        let now = turning(at(frame));
        let mut predicted = query_with(now, Some(mesh(now)));
        motion.predict(frame, at(frame), &mut predicted);
        let Some(GiverHand::Meshed(hand)) = &predicted.presenting_hand else {
            panic!("the giver is a mesh");
        };
        let expected = predicted.client_from_object.transform_point(Vec3::X * 0.1);
        assert!(hand.positions[1].distance(expected) < 1e-4);
    }
}

#[test]
fn knows_no_velocity_after_a_gap_or_at_one_time() {
    let mut motion = Motion::new(AHEAD);
    let mut see = |sequence, time: Duration, x: f32| {
        let mut moved = query(Pose::from_position(Vec3::X * x));
        motion.predict(sequence, time, &mut moved);
        moved.client_from_object.position.x
    };
    assert_eq!(see(0, Duration::ZERO, 0.0), 0.0);
    assert_eq!(see(1, Duration::ZERO, 0.1), 0.1, "no time has passed");
    assert_eq!(see(2, Duration::from_secs(1), 0.2), 0.2, "a second has passed");
    let after = see(3, Duration::from_millis(1020), 0.3);
    assert!((after - 0.55).abs() < 1e-5, "{after}");
}

#[test]
fn remembers_a_bounded_number_of_frames() {
    let mut motion = Motion::new(Duration::from_millis(500));
    for frame in 0..10_000 {
        let mut moved = query_with(turning(Duration::from_micros(frame)), None);
        motion.predict(frame, Duration::from_micros(frame), &mut moved);
    }
    assert!(motion.seen.len() <= MOST_SEEN && motion.predictions.len() <= MOST_PREDICTIONS);
}
