//! Hands move without jumps, to the answered grasps.

use grasp_synthesis::model::hand::joints::index;

use grasp_client::v1::CurrentGraspStatus;

use super::*;
use crate::track::{apply, key};

const FRAME: f32 = 1.0 / 90.0;

/// A grasp of a right hand at an object that is at the client's origin.
fn grasp(position: Vec3, turn: f32, bend: f32) -> v1::Grasp {
    v1::Grasp {
        hand: Some(hand(position, Quat::from_rotation_z(turn), bend)),
        contacts: vec![v1::Contact::default()],
        ..v1::Grasp::default()
    }
}

fn hand(position: Vec3, orientation: Quat, bend: f32) -> v1::HandPose {
    let wrist = v1::Pose::new(position, orientation);
    let digit = v1::DigitAngles {
        base_pitch: bend,
        second_pitch: bend,
        ..v1::DigitAngles::default()
    };
    v1::HandPose::new("rigs/adult", v1::Handedness::Right)
        .with_client_from_wrist(wrist)
        .with_object_from_wrist(wrist)
        .with_digits([Some(digit); 5])
}

/// Where the wrist is in either frame.
fn wrist_of(grasp: &v1::Grasp) -> Pose {
    synthesis_pose(grasp.object_from_wrist())
}

fn at(x: f32) -> v1::Grasp {
    grasp(Vec3::new(x, 0.02, 0.09), 0.2, 0.6)
}

fn waiting() -> Receiver {
    Receiver::waiting_for(&at(0.0), Pose::IDENTITY).expect("a built-in rig")
}

fn wrist(receiver: &Receiver) -> Pose {
    receiver.joints().joints[index::WRIST].pose
}

/// Advances for some seconds at a still object.
fn rest(receiver: &mut Receiver, seconds: f32) {
    for _ in 0..(seconds / FRAME) as usize {
        receiver.advance(FRAME, Pose::IDENTITY);
    }
}

#[test]
fn waits_and_then_approaches_open_from_the_side_of_its_wrist() {
    let mut receiver = waiting();
    let start = wrist(&receiver).position;
    rest(&mut receiver, 1.0);
    assert_eq!(wrist(&receiver).position, start, "it waits");
    let grasp = at(0.0);
    let target = wrist_of(&grasp);
    assert!(start.distance(target.position) > 0.15);
    receiver.take(&grasp, false);
    let mut nearest_open = f32::INFINITY;
    for _ in 0..200 {
        receiver.advance(FRAME, Pose::IDENTITY);
        let bend = receiver.posture.digits[1].second_pitch;
        let distance = wrist(&receiver).position.distance(target.position);
        if bend < 0.4 {
            nearest_open = nearest_open.min(distance);
        }
        // Fingers closed this far would push the object away.
        assert!(bend < 0.5 || distance < 0.05, "closed {distance} m before");
        assert!(wrist(&receiver).position.z > target.position.z - 1e-3);
    }
    assert!(nearest_open < 0.05, "{nearest_open} m");
    // Wrist and fingers have arrived.
    let expected = posed(
        &receiver.rig,
        target,
        synthesis_digits(grasp.hand.as_ref().unwrap()),
    );
    for (found, expected) in receiver.joints().joints.iter().zip(&expected.joints) {
        assert!(found.pose.position.distance(expected.pose.position) < 1e-4);
    }
}

#[test]
fn corrects_without_jumps_after_any_answer() {
    // Answers at arbitrary times and places, from a multiplicative congruential generator (Lehmer).
    let mut state = 7_u64;
    let mut random = move || {
        state = state * 48_271 % 2_147_483_647;
        state as f32 / 2_147_483_647.0
    };
    let mut receiver = waiting();
    let mut object = Pose::IDENTITY;
    for frame in 0..5000 {
        if random() < 0.03 {
            let place = Vec3::new(0.3 * random() - 0.15, 0.2 * random() - 0.1, 0.2 * random() - 0.1);
            receiver.take(&grasp(place, 3.0 * random(), random()), random() < 0.5);
        } else if random() < 0.01 {
            receiver.leave(None);
        }
        let time = FRAME * frame as f32;
        let (before, moved) = (wrist(&receiver), object);
        object = Pose::new(
            Vec3::new(0.3 * time.sin(), 0.0, 0.0),
            Quat::from_rotation_y(0.5 * time.sin()),
        );
        let digits = receiver.posture.digits;
        receiver.advance(FRAME, object);
        let own = (object * moved.inverse()).transform_point(before.position);
        // The hand's own motion, whether it follows the object or not.
        let step = wrist(&receiver).position.distance(own);
        let object_step = own.distance(before.position);
        assert!(step <= TOP_SPEED * FRAME + object_step + 1e-5, "{step} m");
        let turned = angle_between(before.orientation, wrist(&receiver).orientation);
        assert!(
            turned <= (TOP_SPEED / METRES_PER_TURN + 0.5) * FRAME + 1e-4,
            "{turned} rad"
        );
        for (before, after) in digits.iter().zip(&receiver.posture.digits) {
            let bent = (after.second_pitch - before.second_pitch).abs();
            assert!(bent <= TOP_SPEED / METRES_PER_BEND * FRAME + 1e-5, "{bent} rad");
        }
    }
}

#[test]
fn draws_back_from_a_grasp_whose_straight_way_is_not_free() {
    let far = |straight: bool| {
        let mut receiver = waiting();
        receiver.take(&at(-0.05), false);
        rest(&mut receiver, 2.0);
        receiver.take(&at(0.05), straight);
        let mut farthest = 0.0_f32;
        for _ in 0..180 {
            receiver.advance(FRAME, Pose::IDENTITY);
            farthest = farthest.max(wrist(&receiver).position.z);
        }
        let end = wrist_of(&at(0.05)).position;
        assert!(wrist(&receiver).position.distance(end) < 1e-4, "it arrives");
        farthest - end.z
    };
    assert!(far(true) < 1e-3);
    assert!(far(false) > 0.04);
}

/// The least distance of the wrist from a place within two seconds.
fn nearest_to(receiver: &mut Receiver, place: Vec3) -> f32 {
    let mut nearest = f32::INFINITY;
    for _ in 0..180 {
        receiver.advance(FRAME, Pose::IDENTITY);
        nearest = nearest.min(wrist(receiver).position.distance(place));
    }
    nearest
}

#[test]
fn goes_by_planned_key_frames_and_withdraws_over_the_pose_of_an_aborted_grasp() {
    let mut receiver = waiting();
    let start = wrist(&receiver);
    assert!(receiver.is_waiting());
    let mut planned = at(0.0);
    let before = Vec3::new(0.2, 0.1, 0.09);
    planned.key_frames = vec![v1::KeyFrame {
        kind: v1::KeyFrameKind::Approach.into(),
        hand: Some(hand(before, Quat::IDENTITY, 0.0)),
    }];
    receiver.take(&planned, false);
    let nearest = nearest_to(&mut receiver, before);
    assert!(nearest <= CORNER + TOP_SPEED * FRAME, "{nearest} m");
    assert!(!receiver.is_waiting());
    rest(&mut receiver, 2.0);
    let aside = Vec3::new(0.05, 0.1, 0.12);
    receiver.leave(Some(&hand(aside, Quat::from_rotation_z(0.2), 0.6)));
    assert!(!receiver.is_waiting(), "it is still at the object");
    let nearest = nearest_to(&mut receiver, aside);
    assert!(nearest <= CORNER + TOP_SPEED * FRAME, "{nearest} m");
    assert!(receiver.is_waiting());
    assert!(wrist(&receiver).position.distance(start.position) < 1e-4);
}

#[test]
fn an_answer_of_the_wrist_alone_changes_nothing() {
    let mut receivers = [(key(&at(0.0)), waiting())].into();
    let answer = |grasp: v1::Grasp, status: CurrentGraspStatus| v1::TrackAnswer {
        current: Some(v1::CurrentGraspReport {
            status: status.into(),
            ..v1::CurrentGraspReport::default()
        }),
        grasp: Some(grasp),
        ..v1::TrackAnswer::default()
    };
    apply(&answer(at(0.0), CurrentGraspStatus::Replanned), &mut receivers);
    let mut kept = at(0.0);
    kept.hand = kept.hand.map(|hand| hand.with_digits([None; 5]));
    apply(&answer(kept, CurrentGraspStatus::Kept), &mut receivers);
    for receiver in receivers.values_mut() {
        rest(receiver, 2.0);
        assert!(receiver.posture.digits[1].second_pitch > 0.5, "it holds on");
    }
}
