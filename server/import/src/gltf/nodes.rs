//! Where nodes are: the transforms of a document's nodes, and those that its scene shows.

use glam::{DMat4, DQuat, DVec3};
use gltf::{Document, Node, scene::Transform};

/// The nodes of a scene.
#[derive(Debug)]
#[expect(clippy::struct_field_names, reason = "transforms are named a_from_b")]
pub(crate) struct Scene {
    /// The transform of each node, by index; of nodes in a cycle, their own.
    pub(crate) scene_from_node: Vec<DMat4>,
    /// The parent of each node, by index.
    pub(crate) parents: Vec<Option<usize>>,
    /// The nodes that the scene shows, each once, parents first.
    pub(crate) shown: Vec<usize>,
}

impl Scene {
    /// The default scene of a validated document, or its first one; all nodes if it has none.
    pub(crate) fn of(document: &Document) -> Self {
        let nodes: Vec<Node<'_>> = document.nodes().collect();
        let mut is_child = vec![false; nodes.len()];
        for child in nodes.iter().flat_map(Node::children) {
            is_child[child.index()] = true;
        }
        let roots: Vec<usize> = (0..nodes.len()).filter(|&node| !is_child[node]).collect();
        let mut scene_from_node: Vec<DMat4> = nodes.iter().map(local).collect();
        let mut parents = vec![None; nodes.len()];
        // Joints may be outside the scene.
        for (node, parent) in walk(&nodes, &roots) {
            parents[node] = parent;
            if let Some(parent) = parent {
                scene_from_node[node] = scene_from_node[parent] * scene_from_node[node];
            }
        }
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let start = scene.map_or(roots, |scene| scene.nodes().map(|node| node.index()).collect());
        Self {
            shown: walk(&nodes, &start).into_iter().map(|(node, _)| node).collect(),
            parents,
            scene_from_node,
        }
    }
}

/// The nodes below some others, each once and after its parent, with the parent.
pub(crate) fn walk(nodes: &[Node<'_>], start: &[usize]) -> Vec<(usize, Option<usize>)> {
    let mut is_met = vec![false; nodes.len()];
    let mut order: Vec<(usize, Option<usize>)> = Vec::new();
    let mut meet = |order: &mut Vec<_>, node: usize, parent| {
        if !std::mem::replace(&mut is_met[node], true) {
            order.push((node, parent));
        }
    };
    for &node in start {
        meet(&mut order, node, None);
    }
    let mut next = 0;
    while let Some(&(node, _)) = order.get(next) {
        for child in nodes[node].children() {
            meet(&mut order, child.index(), Some(node));
        }
        next += 1;
    }
    order
}

/// The transform of a node in its parent.
fn local(node: &Node<'_>) -> DMat4 {
    match node.transform() {
        Transform::Matrix { matrix } => {
            DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from)))
        }
        Transform::Decomposed {
            translation,
            rotation,
            scale,
        } => DMat4::from_scale_rotation_translation(
            DVec3::from_array(scale.map(f64::from)),
            DQuat::from_array(rotation.map(f64::from)).normalize(),
            DVec3::from_array(translation.map(f64::from)),
        ),
    }
}
