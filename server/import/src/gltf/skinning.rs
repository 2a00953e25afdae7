//! Vertices that the joints of a skin move.

use glam::{DMat4, DVec3};
use gltf::{Node, Primitive, Semantic, Skin, mesh::Mode};

use super::{
    Opened,
    accessors::Buffers,
    primitives::{corners, in_primitive, indices, positions, triangle_count},
};
use crate::{error::ImportError, limits::MeshLimits};

/// Sets of four joints per vertex that are read.
const JOINT_SETS: u32 = 4;

/// A primitive as its joints move it.
#[derive(Debug)]
pub(crate) struct SkinnedMesh {
    pub(crate) positions: Vec<DVec3>,
    /// The share of each vertex's weights that chosen joints have.
    pub(crate) shares: Vec<f64>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// The primitives of a node's mesh if it has a skin, moved by joints that are at the nodes' frames and of which some are chosen.
pub(crate) fn skinned_mesh(
    node: &Node<'_>,
    opened: &Opened<'_>,
    limits: MeshLimits,
    frame_of: impl Fn(usize) -> DMat4,
    is_chosen: impl Fn(usize) -> bool,
) -> Result<Vec<SkinnedMesh>, ImportError> {
    let Some((mesh, skin)) = node.mesh().zip(node.skin()) else {
        return Ok(Vec::new());
    };
    let buffers = &opened.buffers;
    let joints = joints_at(&skin, buffers, frame_of)?;
    let is_chosen: Vec<bool> = skin.joints().map(|joint| is_chosen(joint.index())).collect();
    let shown = mesh.primitives().filter(|primitive| {
        matches!(
            primitive.mode(),
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        )
    });
    let read = |primitive: &Primitive<'_>| {
        let bound = positions(primitive, node, buffers, limits)?;
        let mut shares = vec![0.0; bound.len()];
        each_weight(primitive, bound.len(), buffers, |vertex, joint, weight| {
            if is_chosen.get(joint) == Some(&true) {
                shares[vertex] += weight;
            }
            Ok(())
        })?;
        let indices = indices(primitive, bound.len(), buffers, limits)?;
        let triangles = 0..triangle_count(&indices, primitive.mode());
        Ok(SkinnedMesh {
            positions: skinned(primitive, &joints, &bound, buffers)?,
            shares,
            triangles: triangles
                .map(|triangle| corners(&indices, primitive.mode(), triangle))
                .collect(),
        })
    };
    shown
        .map(|primitive| {
            read(&primitive).map_err(|error: ImportError| in_primitive(&mesh, &primitive, &error))
        })
        .collect()
}

/// The transforms of a skin's joints, of which the nodes' frames are given, from where the mesh was bound.
pub(super) fn joints_at(
    skin: &Skin<'_>,
    buffers: &Buffers<'_>,
    frame_of: impl Fn(usize) -> DMat4,
) -> Result<Vec<DMat4>, ImportError> {
    let joints: Vec<DMat4> = skin.joints().map(|joint| frame_of(joint.index())).collect();
    let Some(accessor) = skin.inverse_bind_matrices() else {
        return Ok(joints);
    };
    let inverse = buffers.numbers::<16>(&accessor, joints.len())?;
    let bound = joints.iter().zip(inverse);
    Ok(bound
        .map(|(&joint, inverse)| joint * DMat4::from_cols_array(&inverse))
        .collect())
}

/// Where the vertices of a skinned primitive are: as its joints move them, by their weights.
pub(super) fn skinned(
    primitive: &Primitive<'_>,
    joints: &[DMat4],
    positions: &[DVec3],
    buffers: &Buffers<'_>,
) -> Result<Vec<DVec3>, ImportError> {
    let mut sums = vec![(DVec3::ZERO, 0.0); positions.len()];
    each_weight(primitive, positions.len(), buffers, |vertex, joint, weight| {
        let transform = joints.get(joint).ok_or_else(|| {
            let known = joints.len();
            ImportError::at(
                "attributes",
                format!("joint {joint} does not exist; there are {known}"),
            )
        })?;
        let (sum, total) = &mut sums[vertex];
        *sum += weight * transform.transform_point3(positions[vertex]);
        *total += weight;
        Ok(())
    })?;
    // Vertices without weights stay where they are.
    let moved = sums.into_iter().zip(positions);
    Ok(moved
        .map(|((sum, total), &position)| if total > 0.0 { sum / total } else { position })
        .collect())
}

/// Calls `each` with every vertex, joint of it and weight other than 0.
fn each_weight(
    primitive: &Primitive<'_>,
    vertices: usize,
    buffers: &Buffers<'_>,
    mut each: impl FnMut(usize, usize, f64) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    for set in 0..JOINT_SETS {
        let sets = (
            primitive.get(&Semantic::Joints(set)),
            primitive.get(&Semantic::Weights(set)),
        );
        let (Some(indices), Some(weights)) = sets else {
            break;
        };
        let indices = buffers.numbers::<4>(&indices, vertices)?;
        let weights = buffers.numbers::<4>(&weights, vertices)?;
        for (vertex, (indices, weights)) in indices.into_iter().zip(weights).enumerate() {
            for (index, weight) in indices.into_iter().zip(weights) {
                if weight != 0.0 {
                    each(vertex, index as usize, weight)?;
                }
            }
        }
    }
    Ok(())
}
