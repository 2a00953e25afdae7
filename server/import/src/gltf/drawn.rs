//! Which nodes of a scene have meshes, where, and which of them are no part of an object.

use glam::DMat4;
use gltf::Document;

use super::{
    extensions::Extended,
    nodes::{Scene, walk},
};
use crate::{
    names::{Aside, NameSets},
    part_names::Role,
};

/// A node with a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct DrawnNode {
    pub(super) node: usize,
    pub(super) scene_from_node: DMat4,
    /// Why it is no part of the object, if the node or one above it says so.
    pub(super) aside: Option<Aside>,
    /// The nearest name, of the node or one above it, that says what the node is for.
    pub(super) role: Option<u32>,
}

/// The nodes with meshes that a scene shows, then the lower levels of detail that it does not show.
pub(super) fn drawn_nodes(
    scene: &Scene,
    document: &Document,
    extended: &Extended,
    names: &mut NameSets,
) -> Vec<DrawnNode> {
    let count = document.nodes().len();
    let lower_levels: Vec<(usize, usize)> = extended
        .lower_levels()
        .filter(|&(level, _)| level < count)
        .collect();
    let mut asides = vec![None; count];
    for &(level, _) in &lower_levels {
        asides[level] = Some(Aside::LowerLevel);
    }
    let mut roles = vec![None; count];
    let nodes: Vec<gltf::Node<'_>> = document.nodes().collect();
    let mut is_met = vec![false; count];
    let mut drawn = Vec::new();
    let mut meet = |node: usize, scene_from_root: DMat4| {
        if std::mem::replace(&mut is_met[node], true) {
            return;
        }
        let scene_from_node = scene_from_root * scene.scene_from_node[node];
        let parent = scene.parents[node];
        asides[node] = parent.and_then(|parent| asides[parent]).or_else(|| {
            let is_placed_by_joints = nodes[node].skin().is_some();
            if extended.hides(node) || (!is_placed_by_joints && has_no_size(scene_from_node)) {
                Some(Aside::Invisible)
            } else if extended.is_collider(node) {
                Some(Aside::Helper)
            } else {
                asides[node]
            }
        });
        let named = nodes[node].name().filter(|name| Role::of(name) != Role::Part);
        roles[node] = named
            .map(|name| names.intern(name))
            .or_else(|| parent.and_then(|parent| roles[parent]));
        if nodes[node].mesh().is_some() {
            drawn.push(DrawnNode {
                node,
                scene_from_node,
                aside: asides[node],
                role: roles[node],
            });
        }
    };
    for &node in &scene.shown {
        meet(node, DMat4::IDENTITY);
    }
    // Levels that are not in the scene take the place of their owners.
    let mut scene_from_root = vec![DMat4::IDENTITY; count];
    let levels: Vec<usize> = lower_levels.iter().map(|&(level, _)| level).collect();
    for (level, owner) in lower_levels {
        let is_apart = scene.parents[level].is_none();
        let above = scene.parents.get(owner).copied().flatten().filter(|_| is_apart);
        scene_from_root[level] = above.map_or(DMat4::IDENTITY, |parent| scene.scene_from_node[parent]);
    }
    for (node, parent) in walk(&nodes, &levels) {
        if let Some(parent) = parent {
            scene_from_root[node] = scene_from_root[parent];
        }
        meet(node, scene_from_root[node]);
    }
    drawn
}

/// Whether a node shrinks everything to a point: programs without visibility hide parts in this way.
fn has_no_size(scene_from_node: DMat4) -> bool {
    [
        scene_from_node.x_axis,
        scene_from_node.y_axis,
        scene_from_node.z_axis,
    ]
    .into_iter()
    .all(|axis| axis.truncate().length_squared() == 0.0)
}
