//! The nodes of a scene: where they are, which of them have meshes, and which of these are no part of an object.

use glam::{DMat4, DQuat, DVec3};
use gltf::{Document, Node, json::deserialize, scene::Transform};
use serde::Deserialize;
use serde_json::Value;

use crate::{
    error::ImportError,
    part_names::Role,
    parts::{Aside, NameSets},
};

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
    let lower_levels = extended.lower_levels().filter(|&(level, _)| level < count);
    let lower_levels: Vec<(usize, usize)> = lower_levels.collect();
    let mut asides = vec![None; count];
    for &(level, _) in &lower_levels {
        asides[level] = Some(Aside::LowerLevel);
    }
    let mut roles = vec![None; count];
    let nodes: Vec<Node<'_>> = document.nodes().collect();
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
        let named = nodes[node]
            .name()
            .filter(|name| Role::of(name, &mut |_| 0) != Role::Part(0));
        let named = named.map(|name| names.intern(name));
        roles[node] = named.or_else(|| roles[parent?]);
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
    let DMat4 {
        x_axis,
        y_axis,
        z_axis,
        ..
    } = scene_from_node;
    [x_axis, y_axis, z_axis]
        .iter()
        .all(|axis| axis.truncate().length_squared() == 0.0)
}

/// Extensions that do not change the shape, and one that the reader knows; of families, what their names start with.
const HARMLESS: &str = "ADOBE_materials_ AGI_stk_metadata CESIUM_primitive_outline EXT_feature_metadata EXT_instance_features \
    EXT_lights_ EXT_mesh_features EXT_mesh_manifold EXT_structural_metadata EXT_texture_ FB_ngon_encoding \
    KHR_animation_pointer KHR_audio KHR_collision_shapes KHR_implicit_shapes KHR_interactivity KHR_lights_ \
    KHR_materials_ KHR_mesh_quantization KHR_node_hoverability KHR_node_selectability \
    KHR_physics_rigid_bodies KHR_rigid_bodies KHR_techniques_webgl KHR_texture_ KHR_xmp MOZ_ MSFT_packing_ \
    MSFT_texture_dds OMI_ VRM";

/// Extensions that are read here.
const READ: &[&str] = &["EXT_mesh_gpu_instancing", "KHR_node_visibility", "MSFT_lod"];

/// Extensions whose files may have the same mesh uncompressed beside them.
pub(super) const COMPRESSIONS: &[&str] = &[DRACO, "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The compression of primitives; the others are those of buffers.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Whether a file that requires an extension can be read.
pub(super) fn can_be_required(extension: &str) -> bool {
    READ.contains(&extension)
        || HARMLESS
            .split(' ')
            .any(|harmless| extension.starts_with(harmless))
}

/// Whether an extension may change the shape in a way that is not read.
pub(super) fn may_be_missed(extension: &str) -> bool {
    !(can_be_required(extension) || COMPRESSIONS.contains(&extension))
}

/// Why an extension keeps a file from being read.
pub(super) fn refusal(extension: &str) -> ImportError {
    let what = match extension {
        DRACO => "the mesh is compressed by Draco; export it without compression",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "the mesh is compressed by meshopt; export it without compression"
        }
        _ => "is required by the file and not known; export it without",
    };
    ImportError::at(format!("extension {extension:?}"), what)
}

/// The parts of a document that are read here; the others are skipped.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Extended {
    nodes: Vec<ExtendedNode>,
    materials: Vec<Material>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct ExtendedNode {
    extensions: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Material {
    alpha_mode: String,
    pbr_metallic_roughness: Value,
}

/// The accessors of where a node's mesh is drawn, relative to the node.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) struct InstanceAttributes {
    pub(super) translation: Option<usize>,
    pub(super) rotation: Option<usize>,
    pub(super) scale: Option<usize>,
}

impl Extended {
    /// Of a document that has been validated.
    pub(super) fn of(json: &[u8]) -> Result<Self, ImportError> {
        deserialize::from_slice(json)
            .map_err(|error| ImportError::at("the extensions of the glTF document", error.to_string()))
    }

    /// A member of a node's extensions.
    fn member(&self, node: usize, pointer: &str) -> Option<&Value> {
        self.nodes.get(node)?.extensions.pointer(pointer)
    }

    /// Where a node draws its mesh, if not just at the node.
    pub(super) fn instances(&self, node: usize) -> Result<Option<InstanceAttributes>, ImportError> {
        let attributes = self.member(node, "/EXT_mesh_gpu_instancing/attributes");
        let attributes = attributes.map(InstanceAttributes::deserialize).transpose();
        attributes.map_err(|error| ImportError::at("the extensions of the glTF document", error.to_string()))
    }

    /// Whether a node is hidden, and what is below it.
    pub(super) fn hides(&self, node: usize) -> bool {
        let members = [
            "/KHR_node_visibility/visible",
            "/MOZ_hubs_components/visible/visible",
        ];
        members
            .iter()
            .any(|member| self.member(node, member) == Some(&Value::Bool(false)))
    }

    /// Whether a node is a collider.
    pub(super) fn is_collider(&self, node: usize) -> bool {
        self.member(node, "/OMI_collider").is_some()
    }

    /// Nodes that stand in for others at a distance, each with the one whose place it takes.
    pub(super) fn lower_levels(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.nodes.len()).flat_map(|node| {
            let levels = self.member(node, "/MSFT_lod/ids").and_then(Value::as_array);
            let levels = levels.into_iter().flatten().filter_map(Value::as_u64);
            levels.map(move |level| (level as usize, node))
        })
    }

    /// Whether a material lets everything through.
    pub(super) fn is_transparent(&self, material: usize) -> bool {
        self.materials.get(material).is_some_and(|material| {
            let opacity = material.pbr_metallic_roughness.pointer("/baseColorFactor/3");
            let is_clear = opacity
                .and_then(Value::as_f64)
                .is_some_and(|opacity| opacity <= 0.0);
            is_clear && matches!(material.alpha_mode.as_str(), "BLEND" | "MASK")
        })
    }
}
