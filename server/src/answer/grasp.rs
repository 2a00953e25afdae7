//! Converts grasps to messages.

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::model::{
    grasp::{Contact, Grasp, KeyFrame, Stage},
    hand::Phalanx,
    holdout::ArmPose,
    score::Score,
};

use super::{
    ClientFrame,
    hand::{wire_hand, wire_wrist},
    verdicts::wire_margins,
};
use crate::{convention::Convention, rigs::RigHand, wire::wire_digit};

/// A grasp as a message.
pub(crate) fn wire_grasp(grasp: &Grasp, hand: &RigHand, frame: ClientFrame) -> v1::Grasp {
    let (margins, classification) = (grasp.margins.as_ref(), &grasp.classification);
    v1::Grasp {
        hand: Some(wire_hand(&grasp.pose, hand, frame)),
        contacts: grasp
            .contacts
            .iter()
            .zip(&grasp.forces)
            // THESIS validity has no torsions.
            .zip(grasp.torsions.iter().copied().chain(std::iter::repeat(0.0)))
            .map(|((contact, &force), torsion)| wire_contact(contact, force, torsion, frame.convention))
            .collect(),
        // The contract uses the taxonomy's numbers.
        r#type: classification
            .grasp_type
            .map_or(0, |one| one.number().cast_signed()),
        type_confidence: classification.confidence,
        margins: margins
            .map(|margins| wire_margins(margins, frame.convention))
            .unwrap_or_default(),
        score: grasp.score.as_ref().map(Score::total),
        score_terms: grasp.score.as_ref().map(score_terms).unwrap_or_default(),
        key_frames: grasp
            .key_frames
            .iter()
            .flatten()
            .map(|key_frame| wire_key_frame(key_frame, hand, frame))
            .collect(),
        hangs: grasp.hangs,
        arm: grasp.arm.as_ref().map(|arm| wire_arm(arm, frame)),
        thesis: Some(v1::ThesisFigures {
            comfort: grasp.comfort,
            wrench_angle: grasp.wrench_angle,
        }),
    }
}

/// A grasp that the client knows, except for where it is now.
pub(super) fn kept_grasp(grasp: &Grasp, hand: &RigHand, frame: ClientFrame) -> v1::Grasp {
    v1::Grasp {
        hand: Some(wire_wrist(&grasp.pose, hand, frame)),
        score: grasp.score.as_ref().map(Score::total),
        ..v1::Grasp::default()
    }
}

fn wire_arm(arm: &ArmPose, frame: ClientFrame) -> v1::Arm {
    v1::Arm {
        client_shoulder: Some(frame.point(arm.shoulder)),
        client_elbow: Some(frame.point(arm.elbow)),
        wrist_flexion: arm.flexion,
        wrist_deviation: arm.deviation,
    }
}

fn score_terms(score: &Score) -> Vec<v1::ScoreTerm> {
    let terms = score.terms().map(|term| v1::ScoreTerm {
        name: term.name.to_owned(),
        value: term.value,
        weight: term.weight,
    });
    terms.collect()
}

fn wire_key_frame(key_frame: &KeyFrame, hand: &RigHand, frame: ClientFrame) -> v1::KeyFrame {
    v1::KeyFrame {
        kind: match key_frame.stage {
            Stage::Approach => v1::KeyFrameKind::Approach,
            Stage::PreGrasp => v1::KeyFrameKind::PreGrasp,
            Stage::Close => v1::KeyFrameKind::Close,
        }
        .into(),
        hand: Some(wire_hand(&key_frame.pose, hand, frame)),
    }
}

fn wire_contact(contact: &Contact, force: Vec3, torsion: f32, convention: Convention) -> v1::Contact {
    let direction = |d| Some(convention.direction_at_object_from_openxr(d).into());
    let digit = contact.part.digit();
    let phalanx = contact.part.phalanx().map(Phalanx::index);
    v1::Contact {
        position: Some(convention.point_at_object_from_openxr(contact.position).into()),
        normal: direction(contact.normal),
        digit: digit.map_or(v1::Digit::Unspecified, wire_digit).into(),
        phalanx: phalanx.map_or(0, |index| index as u32 + 1),
        triangle: contact.triangle,
        force: direction(force),
        torsion,
    }
}
