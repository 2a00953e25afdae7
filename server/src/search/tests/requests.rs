//! Requests of any kind that clients may send, most of them ordinary.

use std::ops::RangeInclusive;

use super::*;

/// Built-in rigs, and one that is not.
static RIGS: [&str; 3] = ["adult", "thesis", "nobody"];

/// Any number that a client may send, most of them ordinary.
pub(super) fn number(ordinary: std::ops::Range<f32>) -> impl Strategy<Value = f32> {
    prop_oneof![1000 => ordinary, 1 => any::<f32>(), 1 => Just(0.0)]
}

pub(super) fn vector(ordinary: f32) -> impl Strategy<Value = Vec3> {
    let coordinate = || number(-ordinary..ordinary);
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array)
}

/// Mostly unit quaternions.
pub(super) fn quaternion() -> impl Strategy<Value = Quat> {
    let turned = [-2.0_f32..2.0, -2.0_f32..2.0, -2.0_f32..2.0]
        .prop_map(|turn| Quat::from_scaled_axis(Vec3::from_array(turn)));
    let any = any::<[f32; 4]>().prop_map(Quat::from_array);
    prop_oneof![500 => turned, 1 => any]
}

prop_compose! {
    pub(super) fn any_pose(ordinary: f32)(
        position in option::of(vector(ordinary)),
        orientation in option::of(quaternion()),
    ) -> v1::Pose {
        v1::Pose { position: position.map(Into::into), orientation: orientation.map(Into::into) }
    }
}

/// Boxed, like all strategies that others repeat: without optimisation, nested value trees outgrow a test's stack of 2 MiB.
pub(super) fn pose(ordinary: f32) -> BoxedStrategy<Option<v1::Pose>> {
    option::weighted(0.998, any_pose(ordinary)).boxed()
}

prop_compose! {
    /// A hand in any pose, seldom with a joint that is anywhere.
    pub(super) fn tracked_hand()(
        position in vector(1.0),
        orientation in quaternion(),
        stray in option::weighted(0.1, (0..25_usize, pose(0.12), number(0.0..0.05))),
        handedness in prop_oneof![Just(Handedness::Left), Just(Handedness::Right)],
        is_webxr in any::<bool>(),
    ) -> v1::HandJoints {
        let set = if is_webxr { fixtures::JointSet::WebXr } else { fixtures::JointSet::OpenXr };
        let hand = fixtures::joints_of_a_rig(handedness).transformed(Pose { position, orientation });
        let mut hand = fixtures::sent(&hand, Convention::OpenXr, set);
        if let Some((joint, pose, radius)) = stray {
            hand.joints[joint] = v1::JointPose { pose, radius };
        }
        hand
    }
}

/// The digits of a built-in rig, given as shares of their ranges.
pub(super) fn digits(rig: &str, shares: &[[f32; 3]]) -> [Option<v1::DigitAngles>; 5] {
    let hand = hands::hand(rig, Handedness::Right);
    let hand = hand
        .or_else(|| hands::hand("adult", Handedness::Right))
        .expect("it is built in");
    let within = |range: AngleRange, share: f32| range.min + share * (range.max - range.min);
    std::array::from_fn(|digit| {
        let (limits, share) = (hand.rig.digits[digit].limits, shares[digit]);
        Some(v1::DigitAngles {
            base_yaw: within(limits.base_yaw, share[0]),
            base_pitch: within(limits.base_pitch, share[1]),
            second_pitch: within(limits.second_pitch, share[2]),
            third_pitch: None,
        })
    })
}

pub(super) fn shares() -> impl Strategy<Value = Vec<[f32; 3]>> {
    collection::vec([number(0.0..1.0), number(0.0..1.0), number(0.0..1.0)], 5)
}

prop_compose! {
    /// A posed hand of one of some rigs, placed at the object or in the client's frame.
    pub(super) fn posed_hand(rigs: &'static [&'static str], handedness: RangeInclusive<i32>, is_at_object: bool)(
        shares in shares(),
        wrist in pose(0.2),
        handedness in handedness,
        rig in sample::select(rigs),
        scale in option::weighted(0.3, number(0.5..2.0)),
    ) -> v1::HandPose {
        let hand = v1::HandPose {
            rig: format!("rigs/{rig}"),
            handedness,
            scale: scale.filter(|_| rigs.len() > 1),
            ..v1::HandPose::default()
        };
        let hand = hand.with_digits(digits(rig, &shares));
        if is_at_object {
            v1::HandPose { object_from_wrist: wrist, ..hand }
        } else {
            v1::HandPose { client_from_wrist: wrist, ..hand }
        }
    }
}

/// A client's own grasp, seldom of an unknown rig, with a digit missing or bent at will, or missing itself.
pub(super) fn grasp() -> BoxedStrategy<Option<Grasp>> {
    let angles = proptest::array::uniform4(number(-1.5..1.5)).prop_map(v1::DigitAngles::new);
    let stray = option::weighted(0.1, (0..5_usize, option::of(angles))).boxed();
    let posed = |is_at_object| {
        (posed_hand(&RIGS, 0..=2, is_at_object), stray.clone()).prop_map(|(hand, stray)| {
            let mut digits = hand.digits().map(Option::<&_>::cloned);
            if let Some((digit, angles)) = stray {
                digits[digit] = angles;
            }
            Some(Grasp::Pose(hand.with_digits(digits)))
        })
    };
    prop_oneof![
        15 => posed(true),
        15 => posed(false),
        10 => tracked_hand().prop_map(|hand| Some(Grasp::Joints(hand))),
        1 => Just(None),
    ]
    .boxed()
}

prop_compose! {
    /// Some triangles near the object, closed or not.
    pub(super) fn hand_mesh()(
        client_coordinates in collection::vec(number(-0.1..0.1), 24),
        mut triangles in collection::vec(0..8_u32, 12),
        client_from_wrist in option::of(pose(0.2)),
    ) -> v1::HandMesh {
        // A tetrahedron as well.
        triangles.extend([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]);
        v1::HandMesh { client_coordinates, triangles, client_from_wrist: client_from_wrist.flatten() }
    }
}

/// A hand to keep clear of.
pub(super) fn giver() -> BoxedStrategy<v1::PresentingHand> {
    prop_oneof![
        2 => tracked_hand().prop_map(v1::PresentingHand::from),
        1 => posed_hand(&RIGS[..2], 1..=2, false).prop_map(v1::PresentingHand::from),
        1 => hand_mesh().prop_map(v1::PresentingHand::from),
    ]
    .boxed()
}

prop_compose! {
    /// A body near the object, seldom one that is anywhere.
    pub(super) fn receiver()(
        shoulder in option::of(vector(1.0)),
        root in pose(1.0),
        body_height in number(0.8..2.5),
        upper_arm_length in option::weighted(0.3, number(0.1..0.6)),
        forearm_length in option::weighted(0.3, number(0.1..0.6)),
        max_reach in option::weighted(0.2, number(0.3..1.0)),
    ) -> v1::Receiver {
        use v1::receiver::Body;
        let (body, height) = match shoulder {
            Some(shoulder) => (Body::ClientShoulder(shoulder.into()), 0.0),
            None => (Body::ClientFromRoot(root.unwrap_or_default()), body_height),
        };
        let body = Some(body);
        v1::Receiver { body, height, upper_arm_length, forearm_length, max_reach, ..v1::Receiver::default() }
    }
}

prop_compose! {
    pub(super) fn current()(side in 1..=2_i32)(
        grasp in posed_hand(&["thesis"], side..=side, true),
        hand in option::of(posed_hand(&["thesis"], side..=side, true)),
        min_score_gain in option::of(number(0.0..1.0)),
        committed in any::<bool>(),
    ) -> v1::CurrentGrasp {
        v1::CurrentGrasp { grasp: Some(grasp), hand, min_score_gain, committed }
    }
}

prop_compose! {
    /// Searches of any kind, most of them valid.
    pub(super) fn request()(
        presenting_hand in option::of(giver()),
        other_hand in option::weighted(0.2, giver()),
        obstacles in any_obstacles(),
        client_from_object in pose(2.0),
        up in option::of(vector(1.0)),
        (strategy, bend_ratios, convention, handedness) in (0..8_i32, 0..8_i32, 0..6_i32, 0..3_i32),
        (seed, replay_attempt) in any::<(Option<u64>, Option<u64>)>(),
        (is_reproducible, both_hands, changes_only) in any::<(bool, bool, bool)>(),
        friction in option::of(number(0.05..2.0)),
        receiver in option::weighted(0.2, receiver().boxed()),
        current in option::weighted(0.3, current().boxed()),
    ) -> v1::FindGraspRequest {
        let choice = [v1::GraspChoice::Unspecified, v1::GraspChoice::Reproducible][usize::from(is_reproducible)];
        // Only GUIDED holds on to a grasp: most requests that are to have it.
        let is_guided = current.is_some() && strategy % 4 != 0;
        v1::FindGraspRequest {
            holdout: Some(v1::Holdout {
                client_from_object,
                presenting_hand,
                up: up.map(Into::into),
                other_hands: other_hand.into_iter().collect(),
                obstacles,
                ..v1::Holdout::new("objects/any")
            }),
            receiver: Some(v1::Receiver {
                handedness,
                both_hands,
                // Both hands have no body and no current grasp.
                ..receiver.filter(|_| !both_hands).unwrap_or_default()
            }),
            requirements: Some(v1::Requirements {
                friction,
                thesis: Some(v1::ThesisOptions {
                    strategy: if is_guided { v1::Strategy::Guided.into() } else { strategy },
                    bend_ratios,
                    ..v1::ThesisOptions::default()
                }),
                ..v1::Requirements::default()
            }),
            search: Some(v1::SearchOptions {
                max_attempts: Some(2),
                choice: choice.into(),
                seed,
                // A replay names its hand.
                replay_attempt: replay_attempt.filter(|_| handedness > 0 && current.is_none()),
                ..v1::SearchOptions::default()
            }),
            output: Some(v1::OutputOptions { convention, key_frames: !both_hands, changes_only, packed: false }),
            current: current.filter(|_| !both_hands),
        }
    }
}

/// Edges of objects from a speck to a beam, in metres.
pub(super) fn edges() -> impl Strategy<Value = f32> {
    prop_oneof![Just(0.002), Just(0.05), Just(9.0)]
}
