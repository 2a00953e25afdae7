//! The nodes of a glTF model as its skins bind them, and the vertices that follow each.

use std::collections::HashMap;

use glam::{DMat4, DVec3};
use gltf::{Document, Semantic};

use crate::{
    error::ImportError,
    gltf::{Buffers, Opened, Scene, in_primitive},
    limits::MeshLimits,
    raw::check_counts,
};

/// Sets of four joints per vertex that are read.
const JOINT_SETS: u32 = 4;

/// A model's nodes, by index.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) names: Vec<String>,
    pub(super) parents: Vec<Option<usize>>,
    /// Where nodes are when nothing has moved.
    pub(super) scene_from_node: Vec<DMat4>,
    /// For each node that moves a skin, the transform from where the mesh is bound.
    node_from_mesh: HashMap<usize, DMat4>,
}

/// A vertex of a skin, where it is bound.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundVertex {
    /// The node that moves it most.
    pub(super) node: usize,
    /// In the frame of the mesh.
    pub(super) position: DVec3,
}

impl Model {
    /// Reads nodes and skins.
    pub(super) fn of(opened: &Opened<'_>, scene: Scene) -> Result<Self, ImportError> {
        let Opened {
            document, buffers, ..
        } = opened;
        let mut node_from_mesh = HashMap::new();
        for skin in document.skins() {
            let Some(accessor) = skin.inverse_bind_matrices() else {
                buffers.spend(skin.joints().len() as u64)?;
                for joint in skin.joints() {
                    node_from_mesh.entry(joint.index()).or_insert(DMat4::IDENTITY);
                }
                continue;
            };
            let inverse = buffers.numbers::<16>(&accessor, skin.joints().len())?;
            for (joint, matrix) in skin.joints().zip(inverse) {
                node_from_mesh
                    .entry(joint.index())
                    .or_insert_with(|| DMat4::from_cols_array(&matrix));
            }
        }
        Ok(Self {
            names: document
                .nodes()
                .map(|node| node.name().unwrap_or_default().to_owned())
                .collect(),
            parents: scene.parents,
            scene_from_node: scene.scene_from_node,
            node_from_mesh,
        })
    }

    /// True if vertices follow the node.
    pub(super) fn moves_skin(&self, node: usize) -> bool {
        self.node_from_mesh.contains_key(&node)
    }

    /// The transform of the mesh's frame to the scene around a node: the node's place in the scene is kept.
    pub(super) fn scene_from_mesh(&self, node: usize) -> DMat4 {
        let bound = self.node_from_mesh.get(&node);
        bound.map_or(DMat4::IDENTITY, |&node_from_mesh| {
            self.scene_from_node[node] * node_from_mesh
        })
    }

    /// Where a node is when the skin is bound, for a skin that is placed by [`Self::scene_from_mesh`]. Nodes that move no
    /// skin follow their parents.
    pub(super) fn bound(&self, node: usize, scene_from_mesh: DMat4) -> DMat4 {
        let mut local = DMat4::IDENTITY;
        let mut at = node;
        loop {
            if let Some(node_from_mesh) = self.node_from_mesh.get(&at) {
                return scene_from_mesh * node_from_mesh.inverse() * local;
            }
            // Parents of a validated scene form no cycle: `Scene` lists each node once.
            let Some(parent) = self.parents[at] else {
                return self.scene_from_node[at] * local;
            };
            local = self.scene_from_node[parent].inverse() * self.scene_from_node[at] * local;
            at = parent;
        }
    }

    /// The nearest of a node and its ancestors that meets a condition.
    pub(super) fn nearest(&self, node: usize, condition: impl Fn(usize) -> bool) -> Option<usize> {
        let mut at = Some(node);
        while let Some(node) = at {
            if condition(node) {
                return Some(node);
            }
            at = self.parents[node];
        }
        None
    }

    /// Number of ancestors of a node.
    pub(super) fn depth(&self, node: usize) -> usize {
        std::iter::successors(self.parents[node], |&node| self.parents[node]).count()
    }
}

/// The vertices that the wanted nodes move, of all meshes that the scene shows.
pub(super) fn vertices(
    document: &Document,
    buffers: &Buffers<'_>,
    shown: &[usize],
    is_wanted: impl Fn(usize) -> bool,
    limits: MeshLimits,
) -> Result<Vec<BoundVertex>, ImportError> {
    let nodes: Vec<_> = document.nodes().collect();
    let mut vertices = Vec::new();
    let mut read = 0_u64;
    for &shown in shown {
        let Some((mesh, skin)) = nodes[shown].mesh().zip(nodes[shown].skin()) else {
            continue;
        };
        let joints: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
        buffers.spend(joints.len() as u64)?;
        for primitive in mesh.primitives() {
            let place = |error: ImportError| in_primitive(&mesh, &primitive, &error);
            buffers.spend(0)?;
            let Some(accessor) = primitive.get(&Semantic::Positions) else {
                continue;
            };
            read += accessor.count() as u64;
            check_counts(read, 0, limits).map_err(place)?;
            let positions = buffers.numbers::<3>(&accessor, accessor.count()).map_err(place)?;
            let mut most = vec![(0.0, 0_usize); positions.len()];
            for set in 0..JOINT_SETS {
                let sets = (
                    primitive.get(&Semantic::Joints(set)),
                    primitive.get(&Semantic::Weights(set)),
                );
                let (Some(indices), Some(weights)) = sets else {
                    break;
                };
                let indices = buffers.numbers::<4>(&indices, most.len()).map_err(place)?;
                let weights = buffers.numbers::<4>(&weights, most.len()).map_err(place)?;
                for (most, (indices, weights)) in most.iter_mut().zip(indices.into_iter().zip(weights)) {
                    for (index, weight) in indices.into_iter().zip(weights) {
                        if weight > most.0 {
                            *most = (weight, index as usize);
                        }
                    }
                }
            }
            let bound = most.into_iter().zip(positions);
            vertices.extend(bound.filter_map(|((weight, index), position)| {
                let node = *joints.get(index)?;
                (weight > 0.0 && is_wanted(node)).then(|| BoundVertex {
                    node,
                    position: DVec3::from_array(position),
                })
            }));
        }
    }
    Ok(vertices)
}
