//! Hands of created rigs, with the skin of the model that the rig was created from.

use grasp_client::{Grasp, NodePose};
use grasp_import::{MeshLimits, ModelPose, posed_skin};
use grasp_scene::{
    Part,
    client::{CannotDraw, synthesis_pose},
    linear_from_srgb,
};

/// Limits of a model for a picture: ample for whole characters.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 256 << 20,
    vertices: 3_000_000,
    triangles: 3_000_000,
};

/// The skin of a grasp's hand.
pub(super) fn skin_of_model(model: &[u8], grasp: &Grasp, name: &str) -> Result<Part, CannotDraw> {
    let Some(posed) = &grasp.model else {
        return Err(CannotDraw(format!(
            "rig {:?} was not created from a model, so its hand has no skin",
            grasp.rig
        )));
    };
    let nodes = posed.nodes.iter().map(|node| {
        let NodePose {
            node,
            rotation,
            translation,
        } = node;
        (node.clone(), *rotation, *translation)
    });
    let pose = ModelPose {
        root: posed.root_node.clone(),
        frame_from_root: synthesis_pose(posed.client_from_root),
        scale: posed.scale,
        nodes: nodes.collect(),
    };
    let skin = posed_skin(model, &pose, LIMITS).map_err(|errors| {
        let errors: Vec<String> = errors.iter().map(ToString::to_string).collect();
        CannotDraw(format!("the model cannot be drawn: {}", errors.join("; ")))
    })?;
    Ok(Part::new(
        name,
        skin.positions,
        skin.triangles,
        linear_from_srgb(150, 104, 78),
    ))
}
