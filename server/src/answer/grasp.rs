//! Converts grasps and hands to messages.

use glam::Vec3;
use grasp_import::Binding;
use grasp_proto::v1;
use grasp_synthesis::model::{
    grasp::{Contact, Grasp, KeyFrame, Stage},
    hand::{
        Digit, HandPose, Phalanx,
        joints::{HandJoints, JOINT_COUNT, Joint, openxr_from_thesis_frame},
        kinematics::{HandFrames, hand_frames},
        rig::Rig,
    },
    score::{Score, ScoredTerm},
};

use super::{ClientFrame, verdicts::wire_margins};
use crate::{
    convention::Convention,
    rigs::{RigHand, resource_name},
    wire::{wire_digit, wire_handedness, wire_pose},
};

pub(crate) fn wire_grasp(grasp: &Grasp, hand: &RigHand, frame: ClientFrame) -> v1::Grasp {
    let (margins, classification) = (grasp.margins.as_ref(), &grasp.classification);
    // THESIS validity has no torsions.
    let torsions = grasp.torsions.iter().copied().chain(std::iter::repeat(0.0));
    let contacts = grasp.contacts.iter().zip(&grasp.forces).zip(torsions);
    let score_term = |term: ScoredTerm| v1::ScoreTerm {
        name: term.name.to_owned(),
        value: term.value,
        weight: term.weight,
    };
    let key_frame = |key_frame: &KeyFrame| v1::KeyFrame {
        kind: match key_frame.stage {
            Stage::Approach => v1::KeyFrameKind::Approach,
            Stage::PreGrasp => v1::KeyFrameKind::PreGrasp,
            Stage::Close => v1::KeyFrameKind::Close,
        }
        .into(),
        hand: Some(wire_hand(&key_frame.pose, hand, frame)),
    };
    let mut message = v1::Grasp {
        hand: Some(wire_hand(&grasp.pose, hand, frame)),
        contacts: contacts
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
        score_terms: grasp
            .score
            .iter()
            .flat_map(Score::terms)
            .map(score_term)
            .collect(),
        key_frames: grasp.key_frames.iter().flatten().map(key_frame).collect(),
        hangs: grasp.hangs,
        arm: grasp.arm.as_ref().map(|arm| v1::Arm {
            client_shoulder: Some(frame.point(arm.shoulder)),
            client_elbow: Some(frame.point(arm.elbow)),
            wrist_flexion: arm.flexion,
            wrist_deviation: arm.deviation,
        }),
        thesis: Some(v1::ThesisFigures {
            comfort: grasp.comfort,
            wrench_angle: grasp.wrench_angle,
        }),
        packed: Vec::new(),
    };
    if frame.packs {
        message.packed = message.pack();
    }
    message
}

/// A grasp that the client knows, except for where it is now.
pub(super) fn kept_grasp(grasp: &Grasp, hand: &RigHand, frame: ClientFrame) -> v1::Grasp {
    v1::Grasp {
        hand: Some(wire_wrist(&grasp.pose, hand, frame)),
        score: grasp.score.as_ref().map(Score::total),
        ..v1::Grasp::default()
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

pub(super) fn wire_hand(pose: &HandPose, hand: &RigHand, frame: ClientFrame) -> v1::HandPose {
    let rig: &Rig = &hand.hand.rig;
    let convention = frame.convention;
    let joints = HandJoints::of_pose(rig, pose).transformed(frame.client_from_object);
    let joint = |place| wire_joint(&joints, convention.joint_at(place), convention);
    let model = hand.binding.as_deref();
    let model = model.map(|binding| wire_model(binding, hand.scale, &hand_frames(rig, pose), frame));
    v1::HandPose {
        joints: (0..JOINT_COUNT).map(joint).collect(),
        model: model.unwrap_or_default(),
        ..wire_wrist(pose, hand, frame)
    }
    .with_digits(wire_digits(rig, pose))
}

/// A hand with only its wrist's pose.
pub(super) fn wire_wrist(pose: &HandPose, hand: &RigHand, frame: ClientFrame) -> v1::HandPose {
    let rig: &Rig = &hand.hand.rig;
    let convention = frame.convention;
    let object_from_wrist = openxr_from_thesis_frame(pose.frame_from_wrist);
    let client_from_wrist = frame.client_from_object * object_from_wrist;
    v1::HandPose {
        scale: (hand.scale != 1.0).then_some(hand.scale),
        convention: convention.to_wire().into(),
        ..v1::HandPose::new(resource_name(rig), wire_handedness(rig.handedness))
    }
    .with_client_from_wrist(wire_pose(convention.joint_from_openxr(client_from_wrist)))
    .with_object_from_wrist(wire_pose(
        convention.joint_at_object_from_openxr(object_from_wrist),
    ))
}

fn wire_digits(rig: &Rig, pose: &HandPose) -> [Option<v1::DigitAngles>; 5] {
    Digit::ALL.map(|digit| {
        let angles = &pose.digits[digit.index()];
        let all = [
            angles.base_yaw,
            angles.base_pitch,
            angles.second_pitch,
            angles.third_pitch,
        ];
        rig.has(digit).then(|| v1::DigitAngles::new(all))
    })
}

pub(crate) fn wire_joint(hand: &HandJoints, joint: usize, convention: Convention) -> v1::JointPose {
    if !hand.has(joint) {
        return v1::JointPose::default();
    }
    let Joint { pose, radius } = hand.joints[joint];
    v1::JointPose::new(
        wire_pose(convention.joint_from_openxr(pose)),
        convention.length_from_openxr(radius),
    )
}

/// The nodes of a model that make its skin follow the rig: the root, then the others.
fn wire_model(binding: &Binding, scale: f32, frames: &HandFrames, frame: ClientFrame) -> Vec<v1::NodePose> {
    let client_from_root = frame.client_from_object * binding.frame_from_root(frames, scale);
    let root = v1::NodePose {
        node: binding.root().to_owned(),
        pose: Some(wire_pose(frame.convention.object_from_openxr(client_from_root))),
    };
    let others = binding.posed(frames, scale).map(|node| v1::NodePose {
        node: node.name.to_owned(),
        pose: Some(v1::Pose {
            position: node.translation.map(Into::into),
            orientation: Some(node.rotation.into()),
        }),
    });
    std::iter::once(root).chain(others).collect()
}
