//! Converts grasps and reports to messages in the client's frame and convention.

mod names;
mod standing;
mod verdicts;

use std::time::Duration;

use glam::Vec3;
use grasp_import::Binding;
use grasp_proto::v1;
use grasp_synthesis::{
    base::{pose::Pose, rejection::Rejection, stopwatch::StepTimes},
    known::atlas::Atlas,
    model::{
        grasp::{Contact, Grasp, KeyFrame, Stage},
        hand::{
            Digit, HandPose, Handedness,
            joints::{HandJoints, JOINT_COUNT, Joint, openxr_from_thesis_frame},
            kinematics::{HandFrames, hand_frames},
            rig::Rig,
        },
        receiver::ArmPose,
        score::Score,
    },
    search::{
        GraspSource, NearestMiss, SearchEnd, SearchOutcome, SearchReport,
        limits::{Limit, LimitKind},
        settings::SearchSettings,
        standing::Fall,
    },
};

pub(crate) use self::names::{wire_digit, wire_rejection};
use self::names::{wire_grasp_type, wire_phalanx, wire_strategy, wire_validity};
use self::standing::wire_fall;
pub(crate) use self::standing::{standing_report, wire_way};
pub(crate) use self::verdicts::wire_verdict;
use crate::{convention::Convention, error::ServiceError, rigs::RigHand};

/// The frame and convention in which a client gets its answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClientFrame {
    /// Axes, units and joint order.
    pub convention: Convention,
    /// The object in the client's frame, in `OpenXR` axes.
    pub client_from_object: Pose,
}

/// What a report contains in addition to the search's own report.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Circumstances<'a> {
    /// Wall time of the search.
    pub search_time: Duration,
    /// Effective budget.
    pub budget: Duration,
    /// Name of the preferred grip that was found.
    pub preferred_grip: Option<&'a str>,
    /// Names of the preferred grips that were tried and not answered, and why.
    pub passed_over: &'a [(&'a str, Fall)],
    /// What was repaired in the request.
    pub warnings: &'a [String],
    /// Settings of the search with the hand that might have been chosen instead.
    pub other_settings: Option<&'a SearchSettings>,
}

/// The response to a `FindGrasp` request.
///
/// # Errors
/// [`ServiceError::Cancelled`] if the search was stopped.
pub(crate) fn find_response(
    outcome: &SearchOutcome,
    (hand, other_hand): (&RigHand, Option<&RigHand>),
    frame: ClientFrame,
    settings: &SearchSettings,
    circumstances: Circumstances<'_>,
) -> Result<v1::FindGraspResponse, ServiceError> {
    let wire_outcome = match outcome.end {
        SearchEnd::Found => v1::Outcome::Found,
        SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted => v1::Outcome::BudgetExhausted,
        SearchEnd::Aborted => v1::Outcome::Aborted,
        SearchEnd::Stopped => return Err(ServiceError::Cancelled),
    };
    let other_grasp = || {
        let grasp = outcome.grasp.as_ref()?.other_hand.as_ref()?;
        Some(wire_grasp(grasp, other_hand?, frame))
    };
    Ok(v1::FindGraspResponse {
        outcome: wire_outcome.into(),
        grasp: outcome.grasp.as_ref().map(|grasp| wire_grasp(grasp, hand, frame)),
        report: Some(report(
            &outcome.report,
            &hand.hand.rig,
            frame,
            settings,
            circumstances,
        )),
        other_grasp: other_grasp(),
        standing: None,
    })
}

/// A vector, in the same frame and unit.
pub(crate) fn vector(v: Vec3) -> v1::Vector3 {
    v1::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

/// An atlas' stamp; empty for an empty atlas.
pub(crate) fn atlas_stamp(atlas: &Atlas) -> String {
    if atlas.entries().is_empty() {
        String::new()
    } else {
        wire_stamp(atlas.stamp())
    }
}

fn wire_stamp(stamp: u64) -> String {
    format!("{stamp:016x}")
}

/// A pose, in the same frame and unit.
pub(crate) fn wire_pose(pose: Pose) -> v1::Pose {
    let [x, y, z, w] = pose.orientation.to_array();
    v1::Pose {
        position: Some(vector(pose.position)),
        orientation: Some(v1::Quaternion { x, y, z, w }),
    }
}

/// The fields that grasps and key frames share.
struct WireHand {
    client_from_wrist: v1::Pose,
    digits: Vec<v1::DigitAngles>,
    joints: Vec<v1::JointPose>,
    model: Option<v1::PosedModel>,
}

impl WireHand {
    fn new(pose: &HandPose, hand: &RigHand, frame: ClientFrame) -> Self {
        let rig: &Rig = &hand.hand.rig;
        let ClientFrame {
            convention,
            client_from_object,
        } = frame;
        let client_from_wrist = client_from_object * openxr_from_thesis_frame(pose.frame_from_wrist);
        let joints = HandJoints::of_pose(rig, pose).transformed(client_from_object);
        Self {
            client_from_wrist: wire_pose(convention.joint_from_openxr(client_from_wrist)),
            digits: wire_digits(rig, pose),
            joints: (0..JOINT_COUNT)
                .map(|place| wire_joint(&joints, convention.joint_at(place), convention))
                .collect(),
            model: hand
                .binding
                .as_deref()
                .map(|binding| wire_model(binding, hand.scale, &hand_frames(rig, pose), frame)),
        }
    }
}

/// The joint angles of five digits, thumb first; empty for one that the rig does not have.
fn wire_digits(rig: &Rig, pose: &HandPose) -> Vec<v1::DigitAngles> {
    let digits = Digit::ALL.into_iter().zip(&pose.digits);
    let angles = digits.map(|(digit, angles)| {
        if !rig.has(digit) {
            return v1::DigitAngles::default();
        }
        v1::DigitAngles {
            base_yaw: angles.base_yaw,
            base_pitch: angles.base_pitch,
            second_pitch: angles.second_pitch,
            third_pitch: Some(angles.third_pitch),
        }
    });
    angles.collect()
}

/// A joint of a hand, empty if it is of a missing finger.
pub(crate) fn wire_joint(hand: &HandJoints, joint: usize, convention: Convention) -> v1::JointPose {
    if !hand.has(joint) {
        return v1::JointPose::default();
    }
    let Joint { pose, radius } = hand.joints[joint];
    v1::JointPose {
        client_from_joint: Some(wire_pose(convention.joint_from_openxr(pose))),
        radius: convention.length_from_openxr(radius),
    }
}

/// The nodes of a model that make its skin follow the rig.
fn wire_model(binding: &Binding, scale: f32, frames: &HandFrames, frame: ClientFrame) -> v1::PosedModel {
    let client_from_root = frame.client_from_object * binding.frame_from_root(frames, scale);
    v1::PosedModel {
        root_node: binding.root().to_owned(),
        client_from_root: Some(wire_pose(frame.convention.object_from_openxr(client_from_root))),
        scale,
        nodes: binding
            .posed(frames, scale)
            .map(|node| v1::NodePose {
                node: node.name.to_owned(),
                rotation: wire_pose(Pose::from_orientation(node.rotation)).orientation,
                translation: node.translation.map(vector),
            })
            .collect(),
    }
}

/// A grasp as a message.
pub(crate) fn wire_grasp(grasp: &Grasp, rig_hand: &RigHand, frame: ClientFrame) -> v1::Grasp {
    let hand = WireHand::new(&grasp.pose, rig_hand, frame);
    let rig: &Rig = &rig_hand.hand.rig;
    let object_from_wrist = openxr_from_thesis_frame(grasp.pose.frame_from_wrist);
    v1::Grasp {
        rig: rig.name.clone(),
        handedness: wire_handedness(rig.handedness).into(),
        client_from_wrist: Some(hand.client_from_wrist),
        object_from_wrist: Some(wire_pose(
            frame.convention.joint_at_object_from_openxr(object_from_wrist),
        )),
        digits: hand.digits,
        joints: hand.joints,
        contacts: grasp
            .contacts
            .iter()
            .zip(&grasp.forces)
            // THESIS validity has no torsions.
            .zip(grasp.torsions.iter().copied().chain(std::iter::repeat(0.0)))
            .map(|((contact, &force), torsion)| wire_contact(contact, force, torsion, frame))
            .collect(),
        comfort: grasp.comfort,
        wrench_angle: grasp.wrench_angle,
        margins: grasp.margins.map(|margins| v1::PhysicalMargins {
            residual: margins.residual,
            epsilon: margins.epsilon,
            penetration: margins.penetration,
            giver_clearance: margins.giver_clearance,
            obstacle_clearance: margins.obstacle_clearance,
        }),
        r#type: grasp
            .classification
            .grasp_type
            .map_or(v1::GraspType::Unspecified, wire_grasp_type)
            .into(),
        type_confidence: grasp.classification.confidence,
        score: grasp.score.as_ref().map(wire_score),
        key_frames: grasp
            .key_frames
            .iter()
            .flatten()
            .map(|key_frame| wire_key_frame(key_frame, rig_hand, frame))
            .collect(),
        hangs: grasp.hangs,
        arm: grasp.arm.as_ref().map(|arm| wire_arm(arm, frame)),
        model: hand.model,
    }
}

fn wire_arm(arm: &ArmPose, frame: ClientFrame) -> v1::Arm {
    let point = |p| {
        let in_client = frame.client_from_object.transform_point(p);
        Some(vector(frame.convention.point_from_openxr(in_client)))
    };
    v1::Arm {
        client_shoulder: point(arm.shoulder),
        client_elbow: point(arm.elbow),
        wrist_flexion: arm.flexion,
        wrist_deviation: arm.deviation,
        assumed: arm.is_assumed,
    }
}

fn wire_score(score: &Score) -> v1::Score {
    v1::Score {
        total: score.total(),
        terms: score
            .terms()
            .map(|term| v1::ScoreTerm {
                name: term.name.to_owned(),
                value: term.value,
                weight: term.weight,
            })
            .collect(),
    }
}

fn wire_key_frame(key_frame: &KeyFrame, rig_hand: &RigHand, frame: ClientFrame) -> v1::KeyFrame {
    let hand = WireHand::new(&key_frame.pose, rig_hand, frame);
    v1::KeyFrame {
        kind: match key_frame.stage {
            Stage::Approach => v1::KeyFrameKind::Approach,
            Stage::PreGrasp => v1::KeyFrameKind::PreGrasp,
            Stage::Close => v1::KeyFrameKind::Close,
        }
        .into(),
        client_from_wrist: Some(hand.client_from_wrist),
        digits: hand.digits,
        joints: hand.joints,
        model: hand.model,
    }
}

fn wire_contact(contact: &Contact, force: Vec3, torsion: f32, frame: ClientFrame) -> v1::Contact {
    let ClientFrame {
        convention,
        client_from_object,
    } = frame;
    let point = |p| Some(vector(convention.point_from_openxr(p)));
    let direction = |d| Some(vector(convention.direction_from_openxr(d)));
    let object_direction = |d| Some(vector(convention.direction_at_object_from_openxr(d)));
    v1::Contact {
        client_position: point(client_from_object.transform_point(contact.position)),
        client_normal: direction(client_from_object.transform_vector(contact.normal)),
        object_position: Some(vector(convention.point_at_object_from_openxr(contact.position))),
        object_normal: object_direction(contact.normal),
        digit: contact
            .part
            .digit()
            .map_or(v1::Digit::Unspecified, wire_digit)
            .into(),
        phalanx: contact
            .part
            .phalanx()
            .map_or(v1::Phalanx::Unspecified, wire_phalanx)
            .into(),
        triangle: contact.triangle,
        client_force: direction(client_from_object.transform_vector(force)),
        object_force: object_direction(force),
        torsion,
    }
}

fn report(
    report: &SearchReport,
    rig: &Rig,
    frame: ClientFrame,
    settings: &SearchSettings,
    circumstances: Circumstances<'_>,
) -> v1::SearchReport {
    v1::SearchReport {
        attempts: report.attempts,
        pruned_placements: report.pruned_placements,
        rejections: Rejection::ALL
            .into_iter()
            .zip(report.rejections)
            .filter(|&(_, count)| count > 0)
            .map(|(rejection, count)| v1::RejectionCount {
                rejection: wire_rejection(rejection).into(),
                count,
            })
            .collect(),
        step_times: report.step_times.as_ref().map(step_times).unwrap_or_default(),
        seed: settings.run.seed,
        attempt: report.attempt,
        search_time: Some(wire_duration(circumstances.search_time)),
        budget: Some(wire_duration(circumstances.budget)),
        workers: u32::try_from(settings.run.workers).unwrap_or(u32::MAX),
        nearest_miss: report
            .nearest_miss
            .as_ref()
            .map(|miss| nearest_miss(miss, rig, frame)),
        strategy: wire_strategy(settings.query.strategy).into(),
        validity: wire_validity(settings.query.validity).into(),
        candidates: report.candidates,
        source: report
            .source
            .map_or(v1::GraspSource::Unspecified, wire_source)
            .into(),
        atlas_entries: u32::try_from(report.known_grips).unwrap_or(u32::MAX),
        atlas_stamp: stamp_of_atlas(settings),
        warnings: circumstances.warnings.to_vec(),
        limits: report.limits.iter().map(wire_limit).collect(),
        preferred_grip: circumstances.preferred_grip.unwrap_or_default().to_owned(),
        other_atlas_stamp: circumstances
            .other_settings
            .map(stamp_of_atlas)
            .unwrap_or_default(),
        passed_over: circumstances
            .passed_over
            .iter()
            .map(|(name, fall)| v1::PassedOverGrip {
                name: (*name).to_owned(),
                fall: Some(wire_fall(fall)),
            })
            .collect(),
        learned_stamp: stamp_of_learned(settings),
        other_learned_stamp: circumstances
            .other_settings
            .map(stamp_of_learned)
            .unwrap_or_default(),
    }
}

/// The stamp of the atlas that a search uses; empty without one.
fn stamp_of_atlas(settings: &SearchSettings) -> String {
    let atlas = settings.known.seeds.atlas();
    atlas.map(|atlas| atlas_stamp(atlas)).unwrap_or_default()
}

/// The stamp of the learned grips that it uses; empty without any.
fn stamp_of_learned(settings: &SearchSettings) -> String {
    let learned = settings.learned();
    learned
        .map(|learned| wire_stamp(learned.stamp()))
        .unwrap_or_default()
}

/// Where a grasp came from.
pub(crate) fn wire_source(source: GraspSource) -> v1::GraspSource {
    match source {
        GraspSource::Attempt(_) => v1::GraspSource::Search,
        GraspSource::Atlas(_) => v1::GraspSource::Atlas,
        GraspSource::Learned(_) => v1::GraspSource::Learned,
        GraspSource::Standing => v1::GraspSource::Standing,
        GraspSource::Preferred(_) => v1::GraspSource::Preferred,
    }
}

fn wire_limit(limit: &Limit) -> v1::Limit {
    v1::Limit {
        kind: match limit.kind {
            LimitKind::Mass => v1::LimitKind::Mass,
            LimitKind::Torque => v1::LimitKind::Torque,
            LimitKind::Width => v1::LimitKind::Width,
            LimitKind::Forbidden => v1::LimitKind::Forbidden,
            LimitKind::Giver => v1::LimitKind::Giver,
            LimitKind::Reach => v1::LimitKind::Reach,
            LimitKind::Obstacle => v1::LimitKind::Obstacle,
        }
        .into(),
        value: limit.value,
        bound: limit.bound,
        description: limit.to_string(),
    }
}

fn step_times(times: &StepTimes) -> Vec<v1::StepTime> {
    [
        (v1::Step::WristPlacement, times.wrist_placement),
        (v1::Step::FingerPosing, times.finger_posing),
        (v1::Step::CollisionValidation, times.collision_validation),
        (v1::Step::ContactValidation, times.contact_validation),
        (v1::Step::ImmobilityValidation, times.immobility_validation),
    ]
    .into_iter()
    .map(|(step, time)| v1::StepTime {
        step: step.into(),
        time: Some(wire_duration(time)),
    })
    .collect()
}

fn nearest_miss(miss: &NearestMiss, rig: &Rig, frame: ClientFrame) -> v1::NearestMiss {
    let HandPose { frame_from_wrist, .. } = miss.pose;
    let client_from_wrist = frame.client_from_object * openxr_from_thesis_frame(frame_from_wrist);
    v1::NearestMiss {
        rejection: wire_rejection(miss.rejection).into(),
        attempt: miss.attempt,
        wrench_angle: miss.wrench_angle,
        client_from_wrist: Some(wire_pose(frame.convention.joint_from_openxr(client_from_wrist))),
        handedness: wire_handedness(rig.handedness).into(),
    }
}

/// A duration. Saturates at the 292 billion years that the message can hold.
pub(crate) fn wire_duration(duration: Duration) -> prost_types::Duration {
    prost_types::Duration {
        seconds: i64::try_from(duration.as_secs()).unwrap_or(i64::MAX),
        nanos: i32::try_from(duration.subsec_nanos()).unwrap_or(i32::MAX),
    }
}

pub(crate) fn wire_handedness(handedness: Handedness) -> v1::Handedness {
    match handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    }
}
