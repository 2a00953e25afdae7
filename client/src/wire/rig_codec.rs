//! Rigs and posed models.

use glam::Quat;
use grasp_proto::v1;

use super::{
    Malformed, each, exactly,
    geometry_codec::{pose_from_wire, vector_from_wire},
    hand_codec::{
        digit_from_wire, hand_joints_to_wire, handedness_from_wire, handedness_to_wire, joint_from_wire,
    },
    required,
};
use crate::{
    hand::Handedness,
    rig::{AngleRange, DigitLimits, NewRig, NodePose, PosedModel, Rig, RigHand, RigNode, RigSource},
};

/// The rigs of a page, and the token of the next one.
pub(crate) type RigPage = (Vec<Rig>, Option<String>);

pub(crate) fn new_rig_to_wire(rig: &NewRig) -> v1::CreateRigRequest {
    let limits = rig.limits.iter().flatten();
    v1::CreateRigRequest {
        rig_id: rig.id.clone(),
        source: Some(match &rig.source {
            RigSource::Model(bytes) => v1::create_rig_request::Source::Model(bytes.clone()),
            RigSource::Joints(hands) => v1::create_rig_request::Source::Joints(v1::JointsAtRest {
                hands: hands.iter().map(hand_joints_to_wire).collect(),
            }),
        }),
        joint_map: rig
            .joint_map
            .iter()
            .map(|mapped| v1::RigNode {
                node: mapped.node.clone(),
                joint: mapped.joint.clone(),
                handedness: optional_side(mapped.handedness),
            })
            .collect(),
        limits: limits.copied().map(limits_to_wire).collect(),
        handedness: optional_side(rig.handedness),
        other_model: rig.other_model.clone().unwrap_or_default(),
        width_scale: rig.width_scale.unwrap_or_default(),
        radii: rig.radii.clone(),
    }
}

fn optional_side(side: Option<Handedness>) -> i32 {
    side.map_or(v1::Handedness::Unspecified, handedness_to_wire)
        .into()
}

fn limits_to_wire(limits: DigitLimits) -> v1::DigitLimits {
    let range = |AngleRange { min, max }| Some(v1::AngleRange { min, max });
    v1::DigitLimits {
        base_yaw: range(limits.base_yaw),
        base_pitch: range(limits.base_pitch),
        second_pitch: range(limits.second_pitch),
        third_pitch: range(limits.third_pitch),
    }
}

pub(crate) fn rig_from_wire(rig: Option<v1::Rig>) -> Result<Rig, Malformed> {
    rig_fields_from_wire(required("rig", rig)?).map_err(|malformed| malformed.within("rig"))
}

pub(crate) fn rig_page_from_wire(page: v1::ListRigsResponse) -> Result<RigPage, Malformed> {
    let rigs = each("rigs", page.rigs, rig_fields_from_wire)?;
    Ok((rigs, Some(page.next_page_token).filter(|token| !token.is_empty())))
}

fn rig_fields_from_wire(rig: v1::Rig) -> Result<Rig, Malformed> {
    Ok(Rig {
        name: rig.name,
        built_in: rig.built_in,
        hands: exactly("hands", each("hands", rig.hands, hand_from_wire)?)?,
        warnings: rig.warnings,
    })
}

fn hand_from_wire(hand: v1::RigHand) -> Result<RigHand, Malformed> {
    let joints = hand.stretched_joints.into_iter().map(joint_from_wire);
    Ok(RigHand {
        handedness: handedness_from_wire("handedness", hand.handedness)?,
        stretched_joints: exactly("stretched_joints", joints.collect())?,
        digits: hand
            .digits
            .into_iter()
            .map(|digit| {
                digit_from_wire("digits", digit)?.ok_or_else(|| Malformed::unknown_value("digits", digit))
            })
            .collect::<Result<_, _>>()?,
        limits: exactly("limits", each("limits", hand.limits, limits_from_wire)?)?,
        mirrored: hand.mirrored,
        root_node: hand.root_node,
        nodes: each("nodes", hand.nodes, |node| {
            Ok(RigNode {
                handedness: Some(handedness_from_wire("handedness", node.handedness)?),
                node: node.node,
                joint: node.joint,
            })
        })?,
    })
}

fn limits_from_wire(limits: v1::DigitLimits) -> Result<Option<DigitLimits>, Malformed> {
    if limits == v1::DigitLimits::default() {
        return Ok(None);
    }
    let range = |field, range| {
        let v1::AngleRange { min, max } = required(field, range)?;
        Ok(AngleRange { min, max })
    };
    Ok(Some(DigitLimits {
        base_yaw: range("base_yaw", limits.base_yaw)?,
        base_pitch: range("base_pitch", limits.base_pitch)?,
        second_pitch: range("second_pitch", limits.second_pitch)?,
        third_pitch: range("third_pitch", limits.third_pitch)?,
    }))
}

pub(super) fn model_from_wire(model: v1::PosedModel) -> Result<PosedModel, Malformed> {
    Ok(PosedModel {
        root_node: model.root_node,
        client_from_root: pose_from_wire(model.client_from_root),
        scale: model.scale,
        nodes: each("nodes", model.nodes, |node| {
            let rotation = required("rotation", node.rotation)?;
            Ok(NodePose {
                node: node.node,
                rotation: Quat::from_xyzw(rotation.x, rotation.y, rotation.z, rotation.w),
                translation: node.translation.map(vector_from_wire),
            })
        })?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_posed_node_needs_a_rotation() {
        let model = v1::PosedModel {
            nodes: vec![v1::NodePose::default()],
            ..Default::default()
        };
        let malformed = model_from_wire(model).unwrap_err();
        assert_eq!(malformed, Malformed::missing("rotation").within("nodes[0]"));
    }
}
