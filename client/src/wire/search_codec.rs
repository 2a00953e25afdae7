//! Requests for grasps and their answers.

use grasp_proto::v1;

use super::{
    Malformed,
    constraint_codec::constraints_to_wire,
    each, exactly,
    geometry_codec::{
        convention_to_wire, duration_from_wire, duration_to_wire, pose_from_wire, pose_to_wire,
        vector_from_wire, vector_to_wire,
    },
    hand_codec::{
        digit_angles_from_wire, digit_from_wire, handedness_from_wire, joint_from_wire, phalanx_from_wire,
        presenting_hand_to_wire, receiving_hand_to_wire,
    },
    obstacle_codec::obstacle_to_wire,
    receiver_codec::{arm_from_wire, receiver_to_wire, stance_to_wire},
    required,
    rig_codec::model_from_wire,
    standing_codec::{fall_from_wire, report_from_wire as standing_from_wire, standing_to_wire},
};
use crate::{
    grasp_type::GraspType,
    key_frame::{KeyFrame, KeyFrameKind},
    query::{AtlasUse, BendRatios, Choice, Hands, Strategy, Validity},
    report::{
        GraspSource, Limit, LimitKind, NearestMiss, PassedOverGrip, Rejection, RejectionCount, SearchReport,
        Step, StepTime,
    },
    rig::PosedModel,
    score::{Score, ScoreTerm},
    search::{Contact, FindAnswer, FindRequest, Grasp, Outcome, PhysicalMargins},
};

pub(crate) fn find_request_to_wire(request: &FindRequest) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        object: request.object.clone(),
        client_from_object: Some(pose_to_wire(request.client_from_object)),
        presenting_hand: request.presenting_hand.as_ref().map(presenting_hand_to_wire),
        receiving_hand: Some(receiving_hand_to_wire(&request.receiving_hand)),
        up: request.up.map(vector_to_wire),
        budget: request.budget.map(duration_to_wire),
        max_attempts: request.max_attempts,
        strategy: request
            .strategy
            .map_or(v1::Strategy::Unspecified, strategy_to_wire)
            .into(),
        bend_ratios: request
            .bend_ratios
            .map_or(v1::BendRatios::Unspecified, bend_ratios_to_wire)
            .into(),
        validity: request
            .validity
            .map_or(v1::Validity::Unspecified, validity_to_wire)
            .into(),
        seed: request.seed,
        reproducible: request.reproducible,
        only_attempt: request.only_attempt,
        record_step_times: request.record_step_times,
        convention: convention_to_wire(request.convention).into(),
        friction: request.friction,
        constraints: constraints_to_wire(&request.constraints),
        choice: match request.choice {
            None => v1::Choice::Unspecified,
            Some(Choice::FirstValid) => v1::Choice::FirstValid,
            Some(Choice::BestWithinBudget) => v1::Choice::BestWithinBudget,
        }
        .into(),
        atlas: match request.atlas {
            None => v1::AtlasUse::Unspecified,
            Some(AtlasUse::Allowed) => v1::AtlasUse::Allowed,
            Some(AtlasUse::None) => v1::AtlasUse::None,
        }
        .into(),
        plan_key_frames: request.plan_key_frames,
        other_hands: request.other_hands.iter().map(presenting_hand_to_wire).collect(),
        obstacles: request.obstacles.iter().map(obstacle_to_wire).collect(),
        hands: match request.hands {
            None => v1::Hands::Unspecified,
            Some(Hands::One) => v1::Hands::One,
            Some(Hands::Both) => v1::Hands::Both,
        }
        .into(),
        receiver: request.receiver.map(receiver_to_wire),
        receiver_stance: stance_to_wire(request.receiver_stance).into(),
        improvement: request.improvement.map(duration_to_wire),
        object_scale: request.object_scale,
        object_mass_kg: request.object_mass_kg,
        standing: request.standing.as_ref().map(standing_to_wire),
    }
}

fn strategy_to_wire(strategy: Strategy) -> v1::Strategy {
    match strategy {
        Strategy::A => v1::Strategy::A,
        Strategy::B => v1::Strategy::B,
        Strategy::C => v1::Strategy::C,
        Strategy::D => v1::Strategy::D,
        Strategy::E => v1::Strategy::E,
        Strategy::F => v1::Strategy::F,
        Strategy::Guided => v1::Strategy::Guided,
    }
}

/// The strategy of a report; none for one of a newer server.
fn strategy_from_wire(value: i32) -> Option<Strategy> {
    match v1::Strategy::try_from(value).ok()? {
        v1::Strategy::Unspecified => None,
        v1::Strategy::A => Some(Strategy::A),
        v1::Strategy::B => Some(Strategy::B),
        v1::Strategy::C => Some(Strategy::C),
        v1::Strategy::D => Some(Strategy::D),
        v1::Strategy::E => Some(Strategy::E),
        v1::Strategy::F => Some(Strategy::F),
        v1::Strategy::Guided => Some(Strategy::Guided),
    }
}

fn validity_from_wire(value: i32) -> Option<Validity> {
    match v1::Validity::try_from(value).ok()? {
        v1::Validity::Unspecified => None,
        v1::Validity::Thesis => Some(Validity::Thesis),
        v1::Validity::Physical => Some(Validity::Physical),
    }
}

fn validity_to_wire(validity: Validity) -> v1::Validity {
    match validity {
        Validity::Thesis => v1::Validity::Thesis,
        Validity::Physical => v1::Validity::Physical,
    }
}

fn bend_ratios_to_wire(ratios: BendRatios) -> v1::BendRatios {
    match ratios {
        BendRatios::All => v1::BendRatios::All,
        BendRatios::AllFingersWithoutLow => v1::BendRatios::AllFingersWithoutLow,
        BendRatios::OneRandom => v1::BendRatios::OneRandom,
        BendRatios::OneRandomFingersWithoutLow => v1::BendRatios::OneRandomFingersWithoutLow,
        BendRatios::OnlyOne => v1::BendRatios::OnlyOne,
        BendRatios::OnlyHigh => v1::BendRatios::OnlyHigh,
    }
}

/// None for an origin of a newer server.
pub(super) fn source_from_wire(value: i32) -> Option<GraspSource> {
    match v1::GraspSource::try_from(value).ok()? {
        v1::GraspSource::Unspecified => None,
        v1::GraspSource::Search => Some(GraspSource::Search),
        v1::GraspSource::Atlas => Some(GraspSource::Atlas),
        v1::GraspSource::Preferred => Some(GraspSource::Preferred),
        v1::GraspSource::Standing => Some(GraspSource::Standing),
        v1::GraspSource::Learned => Some(GraspSource::Learned),
    }
}

fn rejection_from_wire(value: i32) -> Rejection {
    match v1::Rejection::try_from(value) {
        Ok(v1::Rejection::NoContacts) => Rejection::NoContacts,
        Ok(v1::Rejection::NoThumb) => Rejection::NoThumb,
        Ok(v1::Rejection::NoThumbEarlyStop) => Rejection::NoThumbEarlyStop,
        Ok(v1::Rejection::NoFingers) => Rejection::NoFingers,
        Ok(v1::Rejection::PalmCollision) => Rejection::PalmCollision,
        Ok(v1::Rejection::FingerCollision) => Rejection::FingerCollision,
        Ok(v1::Rejection::UnwantedContact) => Rejection::UnwantedContact,
        Ok(v1::Rejection::NotImmobilizing) => Rejection::NotImmobilizing,
        Ok(v1::Rejection::UnmetConstraint) => Rejection::UnmetConstraint,
        Ok(v1::Rejection::Unspecified) | Err(_) => Rejection::Unrecognised,
    }
}

fn step_from_wire(value: i32) -> Step {
    match v1::Step::try_from(value) {
        Ok(v1::Step::WristPlacement) => Step::WristPlacement,
        Ok(v1::Step::FingerPosing) => Step::FingerPosing,
        Ok(v1::Step::CollisionValidation) => Step::CollisionValidation,
        Ok(v1::Step::ContactValidation) => Step::ContactValidation,
        Ok(v1::Step::ImmobilityValidation) => Step::ImmobilityValidation,
        Ok(v1::Step::Unspecified) | Err(_) => Step::Unrecognised,
    }
}

pub(crate) fn find_answer_from_wire(answer: v1::FindGraspResponse) -> Result<FindAnswer, Malformed> {
    let grasp = answer
        .grasp
        .map(grasp_from_wire)
        .transpose()
        .map_err(|malformed| malformed.within("grasp"))?;
    let other_grasp = answer
        .other_grasp
        .map(grasp_from_wire)
        .transpose()
        .map_err(|malformed| malformed.within("other_grasp"))?;
    if grasp.is_none() && other_grasp.is_some() {
        return Err(Malformed::new("other_grasp", "is present without grasp"));
    }
    let (outcome, grasp) = match (v1::Outcome::try_from(answer.outcome), grasp) {
        (Ok(v1::Outcome::Found), Some(grasp)) => (Outcome::Found, Some(grasp)),
        (Ok(v1::Outcome::Found), None) => return Err(Malformed::missing("grasp")),
        (Ok(v1::Outcome::BudgetExhausted), None) => (Outcome::BudgetExhausted, None),
        (Ok(v1::Outcome::Aborted), None) => (Outcome::Aborted, None),
        (Ok(v1::Outcome::BudgetExhausted | v1::Outcome::Aborted), Some(_)) => {
            return Err(Malformed::new("grasp", "is present although none was found"));
        }
        (Ok(v1::Outcome::Unspecified) | Err(_), _) => {
            return Err(Malformed::unknown_value("outcome", answer.outcome));
        }
    };
    let report = report_from_wire(required("report", answer.report)?)
        .map_err(|malformed| malformed.within("report"))?;
    let standing = answer
        .standing
        .map(standing_from_wire)
        .transpose()
        .map_err(|malformed| malformed.within("standing"))?;
    Ok(FindAnswer {
        outcome,
        grasp,
        other_grasp,
        report,
        standing,
    })
}

pub(super) fn grasp_from_wire(grasp: v1::Grasp) -> Result<Grasp, Malformed> {
    Ok(Grasp {
        handedness: handedness_from_wire("handedness", grasp.handedness)?,
        rig: grasp.rig,
        client_from_wrist: pose_from_wire(grasp.client_from_wrist),
        object_from_wrist: pose_from_wire(grasp.object_from_wrist),
        digits: exactly("digits", grasp.digits)?.map(digit_angles_from_wire),
        joints: exactly("joints", grasp.joints)?.map(joint_from_wire),
        contacts: each("contacts", grasp.contacts, contact_from_wire)?,
        comfort: grasp.comfort,
        wrench_angle: grasp.wrench_angle,
        margins: grasp.margins.map(|margins| PhysicalMargins {
            residual: margins.residual,
            epsilon: margins.epsilon,
            penetration: margins.penetration,
            giver_clearance: margins.giver_clearance,
            obstacle_clearance: margins.obstacle_clearance,
        }),
        grasp_type: grasp_type_from_wire(grasp.r#type),
        type_confidence: grasp.type_confidence,
        score: grasp.score.map(score_from_wire),
        key_frames: each("key_frames", grasp.key_frames, key_frame_from_wire)?,
        hangs: grasp.hangs,
        arm: grasp
            .arm
            .map(arm_from_wire)
            .transpose()
            .map_err(|malformed| malformed.within("arm"))?,
        model: optional_model(grasp.model)?,
    })
}

fn optional_model(model: Option<v1::PosedModel>) -> Result<Option<PosedModel>, Malformed> {
    model
        .map(model_from_wire)
        .transpose()
        .map_err(|malformed| malformed.within("model"))
}

fn score_from_wire(score: v1::Score) -> Score {
    Score {
        total: score.total,
        terms: score
            .terms
            .into_iter()
            .map(|term| ScoreTerm {
                name: term.name,
                value: term.value,
                weight: term.weight,
            })
            .collect(),
    }
}

fn key_frame_from_wire(frame: v1::KeyFrame) -> Result<KeyFrame, Malformed> {
    Ok(KeyFrame {
        kind: match v1::KeyFrameKind::try_from(frame.kind) {
            Ok(v1::KeyFrameKind::Approach) => KeyFrameKind::Approach,
            Ok(v1::KeyFrameKind::PreGrasp) => KeyFrameKind::PreGrasp,
            Ok(v1::KeyFrameKind::Close) => KeyFrameKind::Close,
            Ok(v1::KeyFrameKind::Unspecified) | Err(_) => KeyFrameKind::Unrecognised,
        },
        client_from_wrist: pose_from_wire(frame.client_from_wrist),
        digits: exactly("digits", frame.digits)?.map(digit_angles_from_wire),
        joints: exactly("joints", frame.joints)?.map(joint_from_wire),
        model: optional_model(frame.model)?,
    })
}

/// The type of a grasp; a newer server may use one that is not known here.
fn grasp_type_from_wire(value: i32) -> Option<GraspType> {
    GraspType::ALL
        .into_iter()
        .find(|&grasp_type| grasp_type as i32 == value)
}

fn contact_from_wire(contact: v1::Contact) -> Result<Contact, Malformed> {
    let vector = |field: &str, value: Option<v1::Vector3>| required(field, value).map(vector_from_wire);
    Ok(Contact {
        client_position: vector("client_position", contact.client_position)?,
        client_normal: vector("client_normal", contact.client_normal)?,
        object_position: vector("object_position", contact.object_position)?,
        object_normal: vector("object_normal", contact.object_normal)?,
        digit: digit_from_wire("digit", contact.digit)?,
        phalanx: phalanx_from_wire("phalanx", contact.phalanx)?,
        triangle: contact.triangle,
        client_force: vector("client_force", contact.client_force)?,
        object_force: vector("object_force", contact.object_force)?,
        torsion: contact.torsion,
    })
}

/// A stamp; none if it is empty.
fn stamp(stamp: String) -> Option<String> {
    Some(stamp).filter(|stamp| !stamp.is_empty())
}

pub(super) fn report_from_wire(report: v1::SearchReport) -> Result<SearchReport, Malformed> {
    let duration = |field: &str, value: Option<prost_types::Duration>| {
        required(field, value).and_then(|value| duration_from_wire(field, value))
    };
    Ok(SearchReport {
        attempts: report.attempts,
        pruned_placements: report.pruned_placements,
        rejections: report
            .rejections
            .into_iter()
            .map(|count| RejectionCount {
                rejection: rejection_from_wire(count.rejection),
                count: count.count,
            })
            .collect(),
        step_times: each("step_times", report.step_times, |step_time| {
            Ok(StepTime {
                step: step_from_wire(step_time.step),
                time: duration("time", step_time.time)?,
            })
        })?,
        seed: report.seed,
        attempt: report.attempt,
        search_time: duration("search_time", report.search_time)?,
        budget: duration("budget", report.budget)?,
        workers: report.workers,
        nearest_miss: report.nearest_miss.map(|miss| NearestMiss {
            rejection: rejection_from_wire(miss.rejection),
            attempt: miss.attempt,
            wrench_angle: miss.wrench_angle,
            client_from_wrist: pose_from_wire(miss.client_from_wrist),
            handedness: handedness_from_wire("handedness", miss.handedness).ok(),
        }),
        strategy: strategy_from_wire(report.strategy),
        validity: validity_from_wire(report.validity),
        candidates: report.candidates,
        source: source_from_wire(report.source),
        atlas_entries: report.atlas_entries,
        atlas_stamp: stamp(report.atlas_stamp),
        other_atlas_stamp: stamp(report.other_atlas_stamp),
        learned_stamp: stamp(report.learned_stamp),
        other_learned_stamp: stamp(report.other_learned_stamp),
        preferred_grip: Some(report.preferred_grip).filter(|name| !name.is_empty()),
        passed_over: report
            .passed_over
            .into_iter()
            .map(|grip| PassedOverGrip {
                name: grip.name,
                fall: fall_from_wire(grip.fall.unwrap_or_default()),
            })
            .collect(),
        limits: report.limits.into_iter().map(limit_from_wire).collect(),
        warnings: report.warnings,
    })
}

fn limit_from_wire(limit: v1::Limit) -> Limit {
    Limit {
        kind: match v1::LimitKind::try_from(limit.kind) {
            Ok(v1::LimitKind::Mass) => LimitKind::Mass,
            Ok(v1::LimitKind::Torque) => LimitKind::Torque,
            Ok(v1::LimitKind::Width) => LimitKind::Width,
            Ok(v1::LimitKind::Forbidden) => LimitKind::Forbidden,
            Ok(v1::LimitKind::Giver) => LimitKind::Giver,
            Ok(v1::LimitKind::Reach) => LimitKind::Reach,
            Ok(v1::LimitKind::Obstacle) => LimitKind::Obstacle,
            Ok(v1::LimitKind::Unspecified) | Err(_) => LimitKind::Unrecognised,
        },
        value: limit.value,
        bound: limit.bound,
        description: limit.description,
    }
}

#[cfg(test)]
#[path = "search_codec_tests.rs"]
mod tests;
