//! The holdout of a checked request, in the object's frame.

use std::sync::Arc;

use grasp_import::mesh_of_triangles;
use grasp_synthesis::{
    base::pose::Pose,
    model::{
        holdout::{HandMesh, HandShape, Holdout, PresentingHand, Stance},
        object::GraspObject,
        strategy::Validity,
    },
};

use crate::{
    error::ServiceError,
    validate::{FindQuery, GiverHand, MeshedHand},
};

/// Most edges of holes. A wrist has a hundred; whether a point is inside takes time in proportion to them.
const MAX_RIM_EDGES: usize = 2000;

/// Poses the giver's hand and places everything else around the object. The receiver's arm is that of one hand, from a
/// `stance` in the client's frame.
///
/// # Errors
/// The giver's joints fold its skin, or a hand's mesh is no surface.
pub(super) fn holdout(
    query: &FindQuery,
    object: &Arc<GraspObject>,
    stance: Stance,
) -> Result<Holdout, ServiceError> {
    let object_from_client = query.client_from_object.inverse();
    let presenting_hand = match &query.presenting_hand {
        None => None,
        Some(GiverHand::Meshed(giver)) => {
            Some(PresentingHand::of_mesh(hand_mesh(giver, object_from_client)?))
        }
        Some(GiverHand::Jointed(giver)) if query.validity == Validity::Physical => Some(
            PresentingHand::of_joints(giver.joints.transformed(object_from_client)),
        ),
        Some(GiverHand::Jointed(giver)) => Some(
            PresentingHand::in_frame(&giver.skin, &giver.joints, object_from_client)
                .map_err(|error| ServiceError::invalid(giver.field, error.to_string()))?,
        ),
    };
    let shape = |hand: &GiverHand| match hand {
        GiverHand::Jointed(hand) => Ok(HandShape::Joints(Box::new(
            hand.joints.transformed(object_from_client),
        ))),
        GiverHand::Meshed(hand) => hand_mesh(hand, object_from_client).map(HandShape::Mesh),
    };
    let other_hands: Result<Vec<HandShape>, ServiceError> = query.other_hands.iter().map(shape).collect();
    let obstacles = query.obstacles.iter();
    Ok(Holdout {
        object: Arc::clone(object),
        presenting_hand,
        other_hands: other_hands?,
        obstacles: obstacles
            .map(|obstacle| obstacle.transformed(object_from_client))
            .collect(),
        stance: stance.transformed(object_from_client),
        up: object_from_client.transform_vector(query.up),
    })
}

/// Prepares a hand of which only the mesh is known, in the object's frame.
///
/// # Errors
/// The mesh is no surface.
fn hand_mesh(hand: &MeshedHand, object_from_client: Pose) -> Result<Arc<HandMesh>, ServiceError> {
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
