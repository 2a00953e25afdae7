//! Hands of created rigs, with the skin of the model that the rig was created from.

use grasp_client::v1;
use grasp_import::{MeshLimits, ModelPose, PosedNode, posed_skin};
use grasp_scene::{
    Part,
    client::{CannotDraw, synthesis_pose},
    linear_from_srgb,
};

use crate::format::joined;

/// Limits of a model for a picture: ample for whole characters.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 256 << 20,
    vertices: 3_000_000,
    triangles: 3_000_000,
};

/// The skin of a hand.
pub(super) fn skin_of_model(model: &[u8], hand: &v1::HandPose, name: &str) -> Result<Part, CannotDraw> {
    let Some((root, nodes)) = hand.model.split_first() else {
        return Err(CannotDraw(format!(
            "rig {:?} was not created from a model, so its hand has no skin",
            hand.rig
        )));
    };
    let nodes = nodes.iter().map(|v1::NodePose { node, pose }| {
        let pose = pose.unwrap_or_default();
        PosedNode {
            name: node,
            rotation: pose.orientation(),
            translation: pose.position.map(Into::into),
        }
    });
    let pose = ModelPose {
        root: &root.node,
        frame_from_root: synthesis_pose(root.pose),
        scale: hand.size(),
        nodes: nodes.collect(),
    };
    let skin = posed_skin(model, &pose, LIMITS)
        .map_err(|errors| CannotDraw(format!("the model cannot be drawn: {}", joined("; ", errors))))?;
    Ok(Part::new(
        name,
        skin.positions,
        skin.triangles,
        linear_from_srgb(150, 104, 78),
    ))
}
