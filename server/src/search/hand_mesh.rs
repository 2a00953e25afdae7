//! Hands of which only the mesh is known, around the object.

use std::sync::Arc;

use grasp_import::mesh_of_triangles;
use grasp_synthesis::{base::pose::Pose, model::hand::mesh::HandMesh};

use crate::{error::ServiceError, validate::MeshedHand};

/// Most edges of holes. A wrist has a hundred; whether a point is inside takes time in proportion to them.
const MAX_RIM_EDGES: usize = 2000;

/// Prepares a hand in the object's frame.
///
/// # Errors
/// The mesh is no surface.
pub(super) fn hand_mesh(hand: &MeshedHand, object_from_client: Pose) -> Result<Arc<HandMesh>, ServiceError> {
    let invalid = |wrong: String| ServiceError::invalid(hand.field.as_str(), wrong);
    let positions = hand
        .positions
        .iter()
        .map(|&position| object_from_client.transform_point(position));
    let read = mesh_of_triangles(positions, &hand.triangles).map_err(|errors| {
        let errors: Vec<String> = errors.iter().map(ToString::to_string).collect();
        invalid(errors.join("; "))
    })?;
    let wrist = hand.client_from_wrist.map(|wrist| object_from_client * wrist);
    let mesh = HandMesh::new(read.mesh, wrist);
    let rim = mesh.surface.rim_edges();
    if rim > MAX_RIM_EDGES {
        return Err(invalid(format!(
            "has {rim} edges with a triangle on one side only; it may have {MAX_RIM_EDGES}, around the wrist: it must be \
             one surface, not loose triangles"
        )));
    }
    Ok(Arc::new(mesh))
}
