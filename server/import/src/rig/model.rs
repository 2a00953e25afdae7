//! The nodes of a glTF model as its skins bind them, the vertices that follow each, and where poses put these.

use std::collections::HashMap;

use glam::{DMat4, DVec3, Vec3};
use gltf::{Document, Node, Semantic};
use grasp_synthesis::base::{pose::Pose, stop::Stop};

use super::binding::PosedNode;
use crate::{
    MeshLimits,
    error::ImportError,
    gltf::{
        Buffers, Opened, Scene, SkinnedMesh, each_weight, in_primitive, inverse_binds, open, skinned_mesh,
        walk,
    },
    raw::check_counts,
};

/// The least share of a vertex's weights that nodes of the hand must have, for it to be the hand's.
const HAND_SHARE: f64 = 0.5;

/// A model's nodes, by index, and the skins that they move.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) names: Vec<String>,
    pub(super) parents: Vec<Option<usize>>,
    /// Where nodes are when nothing has moved.
    pub(super) scene_from_node: Vec<DMat4>,
    /// For each skin and each node that moves it, the transform from where the mesh is bound.
    node_from_mesh: Vec<HashMap<usize, DMat4>>,
    /// The vertices of all meshes that the scene shows.
    pub(super) vertices: Vec<BoundVertex>,
}

/// A vertex of a skin, where it is bound.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundVertex {
    /// The node that moves it most.
    pub(super) node: usize,
    skin: usize,
    /// In the node's frame.
    pub(super) position: DVec3,
}

impl Model {
    /// Reads nodes, skins and their vertices.
    pub(super) fn of(opened: &Opened<'_>, scene: Scene) -> Result<Self, ImportError> {
        let (document, buffers) = (&opened.document, &opened.buffers);
        let mut node_from_mesh: Vec<HashMap<usize, DMat4>> = Vec::new();
        for skin in document.skins() {
            let joints = skin.joints().map(|joint| joint.index());
            node_from_mesh.push(joints.zip(inverse_binds(&skin, buffers)?).collect());
        }
        let vertices = vertices(document, buffers, &scene.shown, &node_from_mesh)?;
        let names = document
            .nodes()
            .map(|node| node.name().unwrap_or_default().to_owned());
        Ok(Self {
            names: names.collect(),
            parents: scene.parents,
            scene_from_node: scene.scene_from_node,
            node_from_mesh,
            vertices,
        })
    }

    /// True if the node is a joint of a skin, though perhaps of no vertex.
    pub(super) fn is_bound(&self, node: usize) -> bool {
        self.node_from_mesh.iter().any(|skin| skin.contains_key(&node))
    }

    /// How many vertices the node moves most.
    pub(super) fn moved_by(&self, node: usize) -> usize {
        self.vertices.iter().filter(|vertex| vertex.node == node).count()
    }

    /// Where a node is when nothing has moved.
    pub(super) fn place(&self, node: usize) -> DVec3 {
        self.scene_from_node[node].w_axis.truncate()
    }

    /// A node and its ancestors, upward.
    pub(super) fn with_ancestors(&self, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(node), |&node| self.parents[node])
    }

    /// Number of ancestors of a node.
    pub(super) fn depth(&self, node: usize) -> usize {
        self.with_ancestors(node).count() - 1
    }
}

/// Where the nodes of a hand are when its skins are bound, in the scene.
#[derive(Debug)]
pub(super) struct BindPose<'a> {
    model: &'a Model,
    /// For each node that moves a skin, the transform from the frame of the mesh that the hand moves most of.
    node_from_mesh: HashMap<usize, DMat4>,
    scene_from_mesh: DMat4,
}

impl<'a> BindPose<'a> {
    /// The bind pose of a hand, whose wrist is where the scene has it; `is_of_hand` tells the nodes whose vertices are the hand's.
    pub(super) fn new(
        model: &'a Model,
        joints: &[Option<usize>],
        wrist: usize,
        is_of_hand: impl Fn(usize) -> bool,
    ) -> Self {
        let mut counts = vec![0_usize; model.node_from_mesh.len()];
        for vertex in model.vertices.iter().filter(|vertex| is_of_hand(vertex.node)) {
            counts[vertex.skin] += 1;
        }
        let mut skins: Vec<usize> = (0..counts.len()).collect();
        let joints_in = |skin: usize| {
            let known = |node: &&usize| model.node_from_mesh[skin].contains_key(node);
            joints.iter().flatten().filter(known).count()
        };
        skins.sort_by_cached_key(|&skin| std::cmp::Reverse((counts[skin], joints_in(skin))));
        let mut node_from_mesh: HashMap<usize, DMat4> = HashMap::new();
        for skin in skins {
            let skin = &model.node_from_mesh[skin];
            // Skins may be bound in different frames: a joint of both says how they are placed.
            let shared = joints.iter().flatten().find_map(|node| {
                let known = node_from_mesh.get(node)?;
                Some(skin.get(node)?.inverse() * *known)
            });
            let Some(mesh_from_first) = shared.or(node_from_mesh.is_empty().then_some(DMat4::IDENTITY))
            else {
                continue;
            };
            for (&node, &matrix) in skin {
                node_from_mesh.entry(node).or_insert(matrix * mesh_from_first);
            }
        }
        // A wrist without vertices is where the first bone of the hand puts it.
        let mut nodes = std::iter::once(wrist).chain(joints.iter().flatten().copied());
        let anchor = nodes.find_map(|node| Some((node, node_from_mesh.get(&node)?)));
        let scene_from_mesh = anchor.map_or(DMat4::IDENTITY, |(node, &node_from_mesh)| {
            model.scene_from_node[node] * node_from_mesh
        });
        Self {
            model,
            node_from_mesh,
            scene_from_mesh,
        }
    }

    /// The transform of a node. Nodes that move no skin follow their parents.
    pub(super) fn scene_from_node(&self, node: usize) -> DMat4 {
        let model = self.model;
        let mut local = DMat4::IDENTITY;
        let mut at = node;
        loop {
            if let Some(node_from_mesh) = self.node_from_mesh.get(&at) {
                return self.scene_from_mesh * node_from_mesh.inverse() * local;
            }
            // Parents of a validated scene form no cycle: `Scene` lists each node once.
            let Some(parent) = model.parents[at] else {
                return model.scene_from_node[at] * local;
            };
            local = model.scene_from_node[parent].inverse() * model.scene_from_node[at] * local;
            at = parent;
        }
    }
}

/// The vertices of all meshes that the scene shows, each in the frame of the node that moves it most, as its own skin binds it.
fn vertices(
    document: &Document,
    buffers: &Buffers<'_>,
    shown: &[usize],
    node_from_mesh: &[HashMap<usize, DMat4>],
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
            check_counts(read, 0, buffers.limits).map_err(place)?;
            let positions = buffers
                .read(&accessor, accessor.count(), DVec3::from_array)
                .map_err(place)?;
            let mut most = vec![(0.0, 0_usize); positions.len()];
            each_weight(&primitive, positions.len(), buffers, |vertex, joint, weight| {
                if weight > most[vertex].0 {
                    most[vertex] = (weight, joint);
                }
                Ok(())
            })
            .map_err(place)?;
            let bound = most.into_iter().zip(positions);
            vertices.extend(bound.filter_map(|((weight, index), position)| {
                let node = *joints.get(index)?;
                let bound = node_from_mesh.get(skin.index())?.get(&node)?;
                (weight > 0.0).then(|| BoundVertex {
                    node,
                    skin: skin.index(),
                    position: bound.transform_point3(position),
                })
            }));
        }
    }
    Ok(vertices)
}

/// Where the nodes of a model are.
#[derive(Clone, Debug)]
pub struct ModelPose<'a> {
    /// The root node of the hand.
    pub root: &'a str,
    /// Its frame.
    pub frame_from_root: Pose,
    /// The factor by which its scale in the file is multiplied.
    pub scale: f32,
    /// Nodes below it.
    pub nodes: Vec<PosedNode<'a>>,
}

/// The skin of a hand, in the frame of its pose.
#[derive(Clone, Debug, Default)]
pub struct PosedSkin {
    /// The vertices.
    pub positions: Vec<Vec3>,
    /// Their indices, three by three.
    pub triangles: Vec<[u32; 3]>,
}

/// The skin that nodes of a hand move.
///
/// # Errors
/// The file is no glTF with such a node and a skin; see [`ImportError`].
pub fn posed_skin(
    bytes: &[u8],
    pose: &ModelPose<'_>,
    limits: MeshLimits,
) -> Result<PosedSkin, Vec<ImportError>> {
    let opened = open(bytes, limits, Stop::NEVER)?;
    let scene = Scene::of(&opened.document);
    let nodes: Vec<Node<'_>> = opened.document.nodes().collect();
    let named = nodes.iter().find(|node| node.name() == Some(pose.root));
    let root = named.map(Node::index).ok_or_else(|| {
        let place = format!("node {:?}", pose.root);
        ImportError::at(place, "is not in the model: is it the one of this rig?")
    })?;
    let frame_from_node = frames(&scene, &nodes, root, pose);
    let frame_from_scene = frame_from_node[&root] * scene.scene_from_node[root].inverse();
    // The rest follows the hand as a whole.
    let frame_of = |node: usize| {
        let own = frame_from_node.get(&node).copied();
        own.unwrap_or_else(|| frame_from_scene * scene.scene_from_node[node])
    };
    let is_of_hand = |node: usize| frame_from_node.contains_key(&node);
    let mut skin = PosedSkin::default();
    for &shown in &scene.shown {
        for mesh in skinned_mesh(&nodes[shown], &opened, frame_of, is_of_hand)? {
            skin.add(&mesh);
        }
    }
    if skin.triangles.is_empty() {
        return Err(ImportError::at("the model", "has no skin that follows the hand").into());
    }
    Ok(skin)
}

/// The frames of a hand's nodes.
fn frames(scene: &Scene, nodes: &[Node<'_>], root: usize, pose: &ModelPose<'_>) -> HashMap<usize, DMat4> {
    let (scale, _, _) = scene.scene_from_node[root].to_scale_rotation_translation();
    let frame_from_root = DMat4::from_scale_rotation_translation(
        scale * f64::from(pose.scale),
        pose.frame_from_root.orientation.as_dquat(),
        pose.frame_from_root.position.as_dvec3(),
    );
    let mut frames = HashMap::from([(root, frame_from_root)]);
    for (node, parent) in walk(nodes, &[root]) {
        let Some(parent) = parent else { continue };
        let local = scene.scene_from_node[parent].inverse() * scene.scene_from_node[node];
        let (scale, mut rotation, mut translation) = local.to_scale_rotation_translation();
        let name = nodes[node].name();
        if let Some(moved) = pose.nodes.iter().find(|moved| Some(moved.name) == name) {
            rotation = moved.rotation.as_dquat();
            translation = moved.translation.map_or(translation, Vec3::as_dvec3);
        }
        let local = DMat4::from_scale_rotation_translation(scale, rotation, translation);
        frames.insert(node, frames[&parent] * local);
    }
    frames
}

impl PosedSkin {
    /// Adds the triangles of a mesh whose corners are all the hand's.
    fn add(&mut self, mesh: &SkinnedMesh) {
        let mut indices = vec![None; mesh.positions.len()];
        for &corners in &mesh.triangles {
            let corners = corners.map(|corner| corner as usize);
            if corners.iter().any(|&corner| mesh.shares[corner] < HAND_SHARE) {
                continue;
            }
            self.triangles.push(corners.map(|corner| {
                *indices[corner].get_or_insert_with(|| {
                    self.positions.push(mesh.positions[corner].as_vec3());
                    self.positions.len() as u32 - 1
                })
            }));
        }
    }
}
