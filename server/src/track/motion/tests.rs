//! Against motions whose velocity is known.

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{HandJoints, index},
};

use super::*;
use crate::{
    convention::Convention,
    rigs::store::RigStore,
    validate::{find_query, fixtures},
    wire::wire_pose,
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
    let sent = fixtures::sent(&joints, Convention::OpenXr, fixtures::JointSet::OpenXr);
    query_with(client_from_object, Some(sent.into()))
}

fn query_with(client_from_object: Pose, presenting_hand: Option<v1::PresentingHand>) -> FindQuery {
    let request = v1::FindGraspRequest {
        holdout: Some(v1::Holdout {
            client_from_object: Some(wire_pose(client_from_object)),
            presenting_hand,
            ..v1::Holdout::new("objects/any")
        }),
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
fn predicts_constant_velocities_and_keeps_the_lengths_of_bones() {
    let mut motion = Motion::new(AHEAD);
    for frame in 0..20 {
        let now = at(frame);
        let seen = query(turning(now));
        let mut predicted = seen.clone();
        motion.predict(now, &mut predicted);
        let time = if frame == 0 { now } else { now + AHEAD };
        assert_same(predicted.client_from_object, turning(time), 1e-4);
        let bones = |query: &FindQuery| {
            let joints = joints(query).joints.each_ref().map(|joint| joint.pose.position);
            (2..JOINT_COUNT)
                .filter(|joint| !index::FIRST_OF_DIGIT.contains(joint))
                .map(|joint| joints[joint].distance(joints[joint - 1]))
                .collect::<Vec<f32>>()
        };
        for (seen, predicted) in bones(&seen).into_iter().zip(bones(&predicted)) {
            assert!((seen - predicted).abs() < 1e-5, "{seen} {predicted}");
        }
    }
    let error = motion.last_error.expect("predictions have come true");
    // A straight line between two frames is shorter than the arc that hands turn along.
    assert!(
        error.object_distance < 1e-4 && error.object_angle < 1e-3,
        "{error:?}"
    );
}

#[test]
fn reports_how_far_off_a_sudden_stop_was() {
    let mut motion = Motion::new(AHEAD);
    let speed = 0.5;
    let place = |frame: u64| Pose::from_position(Vec3::X * speed * at(frame.min(10)).as_secs_f32());
    for frame in 0..=14 {
        let mut moved = query(place(frame));
        motion.predict(at(frame), &mut moved);
    }
    // The last prediction whose time has come is that of frame 9, for 50 ms later; the object stopped at frame 10.
    let expected = speed * (at(9) + AHEAD).saturating_sub(at(10)).as_secs_f32();
    let error = motion.last_error.expect("predictions have come true");
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
fn moves_meshes_with_the_held_object() {
    let vertices = [Vec3::ZERO, Vec3::X * 0.1, Vec3::Y * 0.1, Vec3::Z * 0.1];
    let mesh = |pose: Pose| v1::HandMesh {
        client_coordinates: vertices
            .into_iter()
            .flat_map(|vertex| pose.transform_point(vertex).to_array())
            .collect(),
        triangles: vec![0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3],
        client_from_wrist: None,
    };
    let mut motion = Motion::new(AHEAD);
    for frame in 0..5 {
        let now = turning(at(frame));
        let mut predicted = query_with(now, Some(mesh(now).into()));
        motion.predict(at(frame), &mut predicted);
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
    let mut see = |time: Duration, x: f32| {
        let mut moved = query(Pose::from_position(Vec3::X * x));
        motion.predict(time, &mut moved);
        moved.client_from_object.position.x
    };
    assert_eq!(see(Duration::ZERO, 0.0), 0.0);
    assert_eq!(see(Duration::ZERO, 0.1), 0.1, "no time has passed");
    assert_eq!(see(Duration::from_secs(1), 0.2), 0.2, "a second has passed");
    let after = see(Duration::from_millis(1020), 0.3);
    assert!((after - 0.55).abs() < 1e-5, "{after}");
}

#[test]
fn remembers_a_bounded_number_of_frames() {
    let mut motion = Motion::new(Duration::from_millis(500));
    for frame in 0..10_000 {
        let mut moved = query_with(turning(Duration::from_micros(frame)), None);
        motion.predict(Duration::from_micros(frame), &mut moved);
    }
    assert!(motion.predictions.len() <= MAX_PREDICTIONS);
}

/// Where an object is predicted at each of some frames, by their times and places.
fn predicted(frames: impl IntoIterator<Item = (Duration, Pose)>) -> Vec<Pose> {
    let mut motion = Motion::new(AHEAD);
    let predict = |(time, place)| {
        let mut moved = query_with(place, None);
        motion.predict(time, &mut moved);
        moved.client_from_object
    };
    frames.into_iter().map(predict).collect()
}

#[test]
fn impossible_motions_start_anew() {
    let still = Pose::from_position(Vec3::new(0.2, 1.0, 0.0));
    let turned = |angle| Pose::new(Vec3::ZERO, Quat::from_rotation_y(angle));
    let jumps = [
        Pose::from_position(Vec3::X * 1.5),
        Pose::from_position(Vec3::Y * 0.1),
        turned(0.4),
        turned(-1.5),
        turned(3.1),
    ];
    let drifts = [Vec3::ZERO, Vec3::X * 0.5];
    for (jump, drift) in jumps
        .into_iter()
        .flat_map(|jump| drifts.map(|drift| (jump, drift)))
    {
        let place = |frame: u64| {
            let moved = Pose::from_position(drift * at(frame).as_secs_f32()) * still;
            if frame < 8 { moved } else { jump * moved }
        };
        let answers = predicted((0..30).map(|frame| (at(frame), place(frame))));
        assert_same(answers[8], place(8), 1e-5);
        // From the next frame on, its velocity is known.
        let there = jump * Pose::from_position(drift * (at(20) + AHEAD).as_secs_f32()) * still;
        assert_same(answers[20], there, 2e-4);
    }
}

#[test]
fn quick_hands_are_no_jumps() {
    // A throw: from rest to 6 m/s within a tenth of a second, and a turn of 15 rad/s.
    let thrown = |time: Duration| {
        let seconds = (time.as_secs_f32() - 0.1).max(0.0);
        let way = if seconds < 0.1 {
            30.0 * seconds * seconds
        } else {
            0.3 + 6.0 * (seconds - 0.1)
        };
        let turned = 15.0 * (seconds - 0.05).max(0.0);
        Pose::new(Vec3::X * way, Quat::from_rotation_z(turned))
    };
    let answers = predicted((0..30).map(|frame| (at(frame), thrown(at(frame)))));
    for (frame, answer) in (0..).zip(&answers).skip(10) {
        let moved = answer.position.x - thrown(at(frame)).position.x;
        assert!(moved > 0.0, "frame {frame} is predicted");
    }
    assert_same(answers[29], thrown(at(29) + AHEAD), 2e-2);
}

#[test]
fn repeated_measurements_are_as_old_as_the_first_of_them() {
    // A tracker at 45 Hz whose frames are sent at 90 Hz.
    let measured = |frame: u64| turning(at(frame / 2 * 2));
    let answers = predicted((0..40).map(|frame| (at(frame), measured(frame))));
    for (frame, answer) in (0..).zip(&answers).skip(8) {
        assert_same(*answer, turning(at(frame) + AHEAD), 1e-3);
    }
    // A body that stops is at rest soon.
    let stopped = |frame: u64| measured(frame.min(20));
    let answers = predicted((0..40).map(|frame| (at(frame), stopped(frame))));
    for answer in &answers[24..] {
        assert_same(*answer, stopped(40), 1e-5);
    }
}

/// The square root of the mean squared distance of places from where they should be, in metres.
fn noise_of(places: &[Pose], expected: impl Fn(u64) -> Vec3, from: usize) -> f32 {
    let squares = (0..).zip(places).skip(from);
    let sum: f32 = squares
        .clone()
        .map(|(frame, place)| place.position.distance_squared(expected(frame)))
        .sum();
    (sum / squares.count() as f32).sqrt()
}

#[test]
fn noise_is_not_predicted() {
    // Half a millimetre per axis, evenly distributed.
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(state) / f64::from(u32::MAX) - 0.5) as f32
    };
    let mut noise = move || Vec3::new(random(), random(), random()) * 0.5e-3 * 12_f32.sqrt();
    let sent: Vec<Pose> = (0..300).map(|_| Pose::from_position(noise())).collect();
    let of_sent = noise_of(&sent, |_| Vec3::ZERO, 0);
    let times = |every: Duration| (0..300).map(move |frame| every * frame);
    for every in [
        Duration::from_micros(11_111),
        Duration::from_millis(1),
        Duration::from_micros(100),
    ] {
        let answers = predicted(times(every).zip(sent.iter().copied()));
        let of_answers = noise_of(&answers, |_| Vec3::ZERO, 10);
        assert!(of_answers < 1.5 * of_sent, "{every:?}: {of_sent} {of_answers}");
    }
    // A drift is seen through it.
    let drift = |frame: u64| Vec3::X * 0.5 * at(frame).as_secs_f32();
    let drifting = (0..).zip(&sent).map(|(frame, noise)| {
        let place = Pose::from_position(drift(frame) + noise.position);
        (at(frame), place)
    });
    let answers = predicted(drifting);
    let ahead = |frame: u64| drift(frame) + Vec3::X * 0.5 * AHEAD.as_secs_f32();
    let of_answers = noise_of(&answers, ahead, 10);
    assert!(of_answers < 3.0 * of_sent, "{of_sent} {of_answers}");
}

#[test]
fn neither_the_sign_of_a_quaternion_nor_a_clock_that_starts_anew_is_a_motion() {
    let turned = |frame: u64| {
        let sign = if frame.is_multiple_of(2) { 1.0 } else { -1.0 };
        Pose::new(Vec3::X, Quat::from_rotation_y(1.3) * sign)
    };
    for answer in predicted((0..10).map(|frame| (at(frame), turned(frame)))) {
        assert_same(answer, turned(0), 1e-6);
    }
    let place = |time: Duration| Pose::from_position(Vec3::X * 0.5 * time.as_secs_f32());
    let frames = (0..20).map(|frame: u64| {
        (
            at(1000 * u64::from(frame < 10) + frame % 10),
            place(at(frame % 10)),
        )
    });
    let answers = predicted(frames);
    assert_same(answers[10], place(at(0)), 1e-6);
    assert_same(answers[19], place(at(9) + AHEAD), 1e-4);
}
