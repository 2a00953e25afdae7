//! What extensions say about the shape of a scene: instances, what is not drawn, levels of detail and colliders.

use gltf::json::deserialize;
use serde::{Deserialize, de::IgnoredAny};

use crate::error::ImportError;

/// Extensions that do not change the shape, and one that the reader knows; of families, what their names start with.
const HARMLESS: &[&str] = &[
    "ADOBE_materials_",
    "AGI_stk_metadata",
    "CESIUM_primitive_outline",
    "EXT_feature_metadata",
    "EXT_instance_features",
    "EXT_lights_",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "EXT_texture_",
    "FB_ngon_encoding",
    "KHR_animation_pointer",
    "KHR_audio",
    "KHR_collision_shapes",
    "KHR_implicit_shapes",
    "KHR_interactivity",
    "KHR_lights_",
    "KHR_materials_",
    "KHR_mesh_quantization",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_physics_rigid_bodies",
    "KHR_rigid_bodies",
    "KHR_techniques_webgl",
    "KHR_texture_",
    "KHR_xmp",
    "MOZ_",
    "MSFT_packing_",
    "MSFT_texture_dds",
    "OMI_",
    "VRM",
];

/// Extensions that are read here.
const READ: &[&str] = &["EXT_mesh_gpu_instancing", "KHR_node_visibility", "MSFT_lod"];

/// Extensions whose files may have the same mesh uncompressed beside them.
pub(super) const COMPRESSIONS: &[&str] = &[DRACO, "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The compression of primitives; the others are those of buffers.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Whether a file that requires an extension can be read.
pub(super) fn can_be_required(extension: &str) -> bool {
    READ.contains(&extension) || HARMLESS.iter().any(|harmless| extension.starts_with(harmless))
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
    extensions: NodeExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    visibility: Option<Visibility>,
    #[serde(rename = "MOZ_hubs_components")]
    hubs: Option<Hubs>,
    #[serde(rename = "MSFT_lod")]
    levels: Option<Levels>,
    #[serde(rename = "OMI_collider")]
    collider: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
struct Instancing {
    attributes: InstanceAttributes,
}

/// The accessors of where a node's mesh is drawn, relative to the node.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) struct InstanceAttributes {
    pub(super) translation: Option<usize>,
    pub(super) rotation: Option<usize>,
    pub(super) scale: Option<usize>,
}

#[derive(Debug, Deserialize)]
struct Visibility {
    #[serde(default = "yes")]
    visible: bool,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Hubs {
    visible: Option<Visibility>,
}

#[derive(Debug, Deserialize)]
struct Levels {
    ids: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Material {
    alpha_mode: AlphaMode,
    pbr_metallic_roughness: Colour,
}

#[derive(Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum AlphaMode {
    Blend,
    Mask,
    #[default]
    #[serde(other)]
    Opaque,
}

#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Colour {
    base_color_factor: [f32; 4],
}

impl Default for Colour {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
        }
    }
}

fn yes() -> bool {
    true
}

impl Extended {
    /// Of a document that has been validated.
    pub(super) fn of(json: &[u8]) -> Result<Self, ImportError> {
        deserialize::from_slice(json)
            .map_err(|error| ImportError::at("the extensions of the glTF document", error.to_string()))
    }

    fn node(&self, node: usize) -> Option<&NodeExtensions> {
        self.nodes.get(node).map(|node| &node.extensions)
    }

    /// Where a node draws its mesh, if not just at the node.
    pub(super) fn instances(&self, node: usize) -> Option<InstanceAttributes> {
        Some(self.node(node)?.instancing.as_ref()?.attributes)
    }

    /// Whether a node is hidden, and what is below it.
    pub(super) fn hides(&self, node: usize) -> bool {
        let Some(NodeExtensions { visibility, hubs, .. }) = self.node(node) else {
            return false;
        };
        let of_hubs = hubs.as_ref().and_then(|hubs| hubs.visible.as_ref());
        [visibility.as_ref(), of_hubs]
            .into_iter()
            .flatten()
            .any(|visibility| !visibility.visible)
    }

    /// Whether a node is a collider.
    pub(super) fn is_collider(&self, node: usize) -> bool {
        self.node(node).is_some_and(|node| node.collider.is_some())
    }

    /// Nodes that stand in for others at a distance, each with the one whose place it takes.
    pub(super) fn lower_levels(&self) -> impl Iterator<Item = (usize, usize)> {
        let nodes = self.nodes.iter().enumerate();
        nodes.flat_map(|(node, extended)| {
            let levels = extended.extensions.levels.iter().flat_map(|levels| &levels.ids);
            levels.map(move |&level| (level, node))
        })
    }

    /// Whether a material lets everything through.
    pub(super) fn is_transparent(&self, material: usize) -> bool {
        self.materials.get(material).is_some_and(|material| {
            material.alpha_mode != AlphaMode::Opaque
                && material.pbr_metallic_roughness.base_color_factor[3] <= 0.0
        })
    }
}
