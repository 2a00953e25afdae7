//! Any request that passes validation is answered.

use std::cell::Cell;

use glam::{Quat, Vec3};
use grasp_assets::hands::{self, RIG_NAMES};
use grasp_synthesis::{
    base::{pose::Pose, stop::unstopped},
    model::hand::{Handedness, rig::AngleRange},
};
use proptest::{
    prelude::*,
    test_runner::{Config, RngSeed, TestRunner},
};

use super::*;
use crate::{
    budget::effective_budget,
    config,
    convention::Convention,
    objects::{StoredObject, tests::tetrahedron},
    rigs::store::RigStore,
    validate::{any_obstacles, find_query, fixtures},
};

/// Any number that a client may send, most of them ordinary.
pub(in crate::search) fn number(ordinary: std::ops::Range<f32>) -> impl Strategy<Value = f32> {
    prop_oneof![1000 => ordinary, 1 => any::<f32>(), 1 => Just(0.0)]
}

fn vector(ordinary: f32) -> impl Strategy<Value = v1::Vector3> {
    [
        number(-ordinary..ordinary),
        number(-ordinary..ordinary),
        number(-ordinary..ordinary),
    ]
    .prop_map(|[x, y, z]| v1::Vector3 { x, y, z })
}

/// Mostly unit quaternions.
fn quaternion() -> impl Strategy<Value = v1::Quaternion> {
    let turned = (-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0, -4.0_f32..4.0).prop_map(|(x, y, z, angle)| {
        let axis = Vec3::new(x, y, z).normalize_or(Vec3::X);
        let [x, y, z, w] = Quat::from_axis_angle(axis, angle).to_array();
        v1::Quaternion { x, y, z, w }
    });
    let any = any::<[f32; 4]>().prop_map(|[x, y, z, w]| v1::Quaternion { x, y, z, w });
    prop_oneof![500 => turned, 1 => any]
}

/// Boxed, like all strategies that others repeat: without optimisation, nested value trees outgrow a test's stack of 2 MiB.
pub(in crate::search) fn pose(ordinary: f32) -> BoxedStrategy<Option<v1::Pose>> {
    let pose = (
        proptest::option::of(vector(ordinary)),
        proptest::option::of(quaternion()),
    );
    proptest::option::weighted(
        0.998,
        pose.prop_map(|(position, orientation)| v1::Pose {
            position,
            orientation,
        }),
    )
    .boxed()
}

/// A hand in any pose, seldom with a joint that is anywhere.
pub(in crate::search) fn tracked_hand() -> BoxedStrategy<v1::presenting_hand::Form> {
    let moved = (vector(1.0), quaternion()).prop_map(|(v, q)| Pose {
        position: Vec3::new(v.x, v.y, v.z),
        orientation: Quat::from_xyzw(q.x, q.y, q.z, q.w),
    });
    let stray = (0..25_usize, pose(0.12), number(0.0..0.05));
    (
        moved,
        proptest::option::weighted(0.1, stray),
        any::<bool>(),
        any::<bool>(),
    )
        .prop_map(|(client_from_hand, stray, is_left, is_webxr)| {
            let (handedness, set) = (
                if is_left {
                    Handedness::Left
                } else {
                    Handedness::Right
                },
                if is_webxr {
                    v1::JointSet::Webxr25
                } else {
                    v1::JointSet::Openxr26
                },
            );
            let hand = fixtures::joints_of_a_rig(handedness).transformed(client_from_hand);
            let mut hand = fixtures::sent(&hand, Convention::OpenXr, set);
            if let Some((joint, client_from_joint, radius)) = stray {
                hand.joints[joint] = v1::JointPose {
                    client_from_joint,
                    radius,
                };
            }
            v1::presenting_hand::Form::Joints(hand)
        })
        .boxed()
}

/// Angles given as shares of their ranges.
fn angled_hand() -> BoxedStrategy<v1::presenting_hand::Form> {
    let shares = proptest::collection::vec([number(0.0..1.0), number(0.0..1.0), number(0.0..1.0)], 5);
    let scale = proptest::option::weighted(0.3, number(0.5..2.0));
    (shares, pose(0.2), 1..=2_i32, 0..RIG_NAMES.len(), scale)
        .prop_map(|(shares, client_from_wrist, handedness, rig, hand_scale)| {
            let rig = RIG_NAMES[rig];
            let hand = hands::hand(rig, Handedness::Right).expect("the rig is built in");
            let within = |range: AngleRange, share: f32| range.min + share * (range.max - range.min);
            let digits = hand.rig.digits.iter().zip(shares);
            v1::presenting_hand::Form::Angles(v1::HandAngles {
                rig: rig.to_owned(),
                handedness,
                client_from_wrist,
                hand_scale,
                digits: digits
                    .map(|(digit, share)| v1::DigitAngles {
                        base_yaw: within(digit.limits.base_yaw, share[0]),
                        base_pitch: within(digit.limits.base_pitch, share[1]),
                        second_pitch: within(digit.limits.second_pitch, share[2]),
                        third_pitch: None,
                    })
                    .collect(),
            })
        })
        .boxed()
}

/// Some triangles near the object, closed or not.
fn hand_mesh() -> BoxedStrategy<v1::presenting_hand::Form> {
    let coordinates = proptest::collection::vec(number(-0.1..0.1), 24);
    let triangles = proptest::collection::vec(0..8_u32, 12).prop_map(|mut corners| {
        // A tetrahedron as well.
        corners.extend([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]);
        corners
    });
    (coordinates, triangles, proptest::option::of(pose(0.2)))
        .prop_map(|(client_coordinates, triangles, client_from_wrist)| {
            v1::presenting_hand::Form::Mesh(v1::HandMesh {
                client_coordinates,
                triangles,
                client_from_wrist: client_from_wrist.flatten(),
            })
        })
        .boxed()
}

/// A body near the object, seldom one that is anywhere.
fn receiver() -> BoxedStrategy<v1::Receiver> {
    use v1::receiver::Body;
    let bone = || proptest::option::weighted(0.3, number(0.1..0.6));
    let body = prop_oneof![
        vector(1.0).prop_map(Body::ClientShoulder),
        (pose(1.0), number(0.8..2.5)).prop_map(|(client_from_root, height)| {
            Body::Standing(v1::StandingBody {
                client_from_root,
                height,
            })
        }),
    ];
    (body, bone(), bone())
        .prop_map(|(body, upper_arm_length, forearm_length)| v1::Receiver {
            body: Some(body),
            upper_arm_length,
            forearm_length,
        })
        .boxed()
}

/// A hand of the default rig near the object, seldom anywhere.
fn hand_at_object(handedness: i32) -> BoxedStrategy<v1::HandAtObject> {
    let shares = proptest::collection::vec([number(0.0..1.0), number(0.0..1.0), number(0.0..1.0)], 5);
    (shares, pose(0.15))
        .prop_map(move |(shares, object_from_wrist)| {
            let hand = hands::hand("thesis", Handedness::Right).expect("the rig is built in");
            let within = |range: AngleRange, share: f32| range.min + share * (range.max - range.min);
            let digits = hand.rig.digits.iter().zip(shares);
            v1::HandAtObject {
                rig: "thesis".to_owned(),
                handedness,
                hand_scale: None,
                object_from_wrist,
                digits: digits
                    .map(|(digit, share)| v1::DigitAngles {
                        base_yaw: within(digit.limits.base_yaw, share[0]),
                        base_pitch: within(digit.limits.base_pitch, share[1]),
                        second_pitch: within(digit.limits.second_pitch, share[2]),
                        third_pitch: None,
                    })
                    .collect(),
            }
        })
        .boxed()
}

fn standing() -> BoxedStrategy<v1::StandingGrasp> {
    let sides =
        (1..=2_i32).prop_flat_map(|side| (hand_at_object(side), proptest::option::of(hand_at_object(side))));
    (sides, proptest::option::of(number(0.0..1.0)), any::<bool>())
        .prop_map(|((hand, present), better_by, committed)| v1::StandingGrasp {
            hand: Some(hand),
            present,
            better_by,
            committed,
        })
        .boxed()
}

/// Searches of any kind, most of them valid.
pub(in crate::search) fn request() -> impl Strategy<Value = v1::FindGraspRequest> {
    let hand = || {
        let form = prop_oneof![2 => tracked_hand(), 1 => angled_hand(), 1 => hand_mesh()];
        form.prop_map(|form| v1::PresentingHand { form: Some(form) })
    };
    let others = (proptest::option::weighted(0.2, hand()), any_obstacles());
    (
        (proptest::option::of(hand()), others),
        pose(2.0),
        proptest::option::of(vector(1.0)),
        (0..8_i32, 0..8_i32, 0..6_i32),
        any::<(Option<u64>, Option<u64>, bool, bool)>(),
        (
            proptest::option::of(number(0.05..2.0)),
            0..3_i32,
            proptest::option::weighted(0.2, receiver()),
            proptest::option::weighted(0.3, standing()),
        ),
    )
        .prop_map(
            |(
                (presenting_hand, (other_hand, obstacles)),
                client_from_object,
                up,
                enums,
                (seed, only_attempt, reproducible, both_hands),
                (friction, handedness, receiver, standing),
            )| {
                v1::FindGraspRequest {
                    object: "objects/any".to_owned(),
                    client_from_object,
                    presenting_hand,
                    up,
                    max_attempts: Some(2),
                    // Only GUIDED holds on to a grasp: most requests that are to have it.
                    strategy: if standing.is_some() && enums.0 % 4 != 0 {
                        v1::Strategy::Guided.into()
                    } else {
                        enums.0
                    },
                    bend_ratios: enums.1,
                    convention: enums.2,
                    seed,
                    // A replay names its hand.
                    only_attempt: only_attempt.filter(|_| handedness > 0 && standing.is_none()),
                    receiving_hand: Some(v1::ReceivingHand {
                        rig: String::new(),
                        handedness,
                        hand_scale: None,
                    }),
                    // Both hands have no body and no standing grasp.
                    receiver: receiver.filter(|_| !both_hands),
                    standing: standing.filter(|_| !both_hands),
                    reproducible,
                    friction,
                    plan_key_frames: !both_hands,
                    hands: if both_hands {
                        v1::Hands::Both
                    } else {
                        v1::Hands::One
                    }
                    .into(),
                    other_hands: other_hand.into_iter().collect(),
                    obstacles,
                    ..Default::default()
                }
            },
        )
}

/// Objects from a speck to a beam.
pub(in crate::search) fn objects() -> impl Strategy<Value = StoredObject> {
    prop_oneof![Just(0.002_f32), Just(0.05), Just(9.0)].prop_map(|edge| tetrahedron("any", edge, &[1]))
}

/// A search by one worker for the default budget, without known grips.
pub(in crate::search) fn job(query: FindQuery, object: StoredObject) -> FindJob {
    let budgets = config::Config::default().budgets;
    let arrived = Instant::now();
    FindJob {
        budget: effective_budget(
            query.limits.budget,
            budgets,
            budgets.minimum_reserve,
            arrived,
            None,
        ),
        patience: Duration::ZERO,
        has_deadline: false,
        query,
        derived: unstopped(|stop| object.derived_until(stop)),
        stored: Arc::new(object),
        resized: None,
        seed: 3,
        arrived,
        workers: 1,
        improvement: Duration::from_micros(100),
        known: Default::default(),
        mechanisms: Mechanisms::ALL,
    }
}

pub(in crate::search) fn runs() -> Config {
    Config {
        cases: 1000,
        rng_seed: RngSeed::Fixed(2),
        failure_persistence: None,
        ..Config::default()
    }
}

#[test]
fn answers_every_request_that_passes_validation() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let searched = Cell::new([0; 5]);
    let outcome = TestRunner::new(runs()).run(&(request(), objects()), |(request, object)| {
        let Ok(query) = find_query(request, ("thesis", &RigStore::new(0, None)), |_| true) else {
            return Ok(());
        };
        let kind = match &query.presenting_hand {
            None => 0,
            Some(GiverHand::Jointed(giver)) if giver.field.ends_with("angles") => 1,
            Some(GiverHand::Jointed(_)) => 2,
            Some(GiverHand::Meshed(_)) => 3,
        };
        let mut counts = searched.get();
        counts[kind] += 1;
        let has_standing = query.standing.is_some();
        counts[4] += usize::from(has_standing);
        searched.set(counts);
        let takes_both = query.other_hand.is_some();
        let job = job(query, object);
        match job
            .prepare()
            .and_then(|job| job.run(&pool, &AtomicBool::new(false), &Progress::default()))
        {
            Ok(Answered { response: answer, .. }) => {
                let report = answer.report.as_ref().expect("every answer has a report");
                prop_assert!(report.attempts <= 2);
                prop_assert_eq!(answer.standing.is_some(), has_standing);
                if let Some(standing) = &answer.standing {
                    let is_aborted = standing.status() == v1::StandingStatus::Aborted;
                    prop_assert_eq!(standing.withdrawal.is_some(), is_aborted);
                    prop_assert_eq!(answer.outcome() == v1::Outcome::Aborted, is_aborted);
                    let way = standing
                        .way
                        .iter()
                        .flat_map(|way| [way.distance, way.angle, way.fingertips]);
                    prop_assert!(way.into_iter().all(f32::is_finite));
                    let figures = standing.fall.iter().flat_map(|fall| [fall.figure, fall.bound]);
                    prop_assert!(figures.flatten().all(f32::is_finite), "{:?}", standing.fall);
                }
                prop_assert_eq!(
                    answer.grasp.is_some(),
                    answer.outcome == i32::from(v1::Outcome::Found)
                );
                prop_assert_eq!(answer.other_grasp.is_some(), answer.grasp.is_some() && takes_both);
                for arm in answer.grasp.iter().filter_map(|grasp| grasp.arm) {
                    let elbow = arm.client_elbow.expect("every arm has an elbow");
                    prop_assert!(elbow.x.is_finite() && elbow.y.is_finite() && elbow.z.is_finite());
                }
                for joint in answer.grasp.iter().flat_map(|grasp| &grasp.joints) {
                    let pose = joint.client_from_joint.expect("every joint has a pose");
                    let position = pose.position.expect("every pose has a position");
                    prop_assert!(position.x.is_finite() && position.y.is_finite() && position.z.is_finite());
                }
            }
            Err(error) => prop_assert!(matches!(error, ServiceError::Invalid(_)), "{}", error),
        }
        Ok(())
    });
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    // The test is meaningful only if many requests of every kind pass validation.
    assert!(searched.get().iter().all(|&count| count >= 20), "{searched:?}");
}
