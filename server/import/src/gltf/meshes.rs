//! The triangles of a scene's meshes, where nodes, instances and skins put them.

use std::collections::HashMap;

use glam::{DMat4, DQuat, DVec3};
use gltf::{Accessor, Document, Mesh, Node, Primitive, Semantic, Skin, mesh::Mode};

use super::{
    Buffers, Opened,
    scene::{Extended, InstanceAttributes, Scene, drawn_nodes},
};
use crate::{
    error::ImportError,
    parts::{Aside, FaceNames, listed, quoted},
    raw::{RawMesh, check_counts},
};

/// Extension named as the place of errors.
const EXTENSION: &str = "EXT_mesh_gpu_instancing";

/// Sets of four joints per vertex that are read.
const JOINT_SETS: u32 = 4;

/// Appends all triangles that a scene shows, and those that it would show elsewhere or nearer, marked as such.
pub(super) fn read_into(raw: &mut RawMesh, opened: &Opened<'_>) -> Result<(), ImportError> {
    let (document, buffers) = (&opened.document, &opened.buffers);
    let scene = Scene::of(document);
    let extended = Extended::of(&opened.json)?;
    let drawn = drawn_nodes(&scene, document, &extended, &mut raw.names);
    let nodes: Vec<Node<'_>> = document.nodes().collect();
    // Each name once: scenes may show a part with a long one thousands of times.
    let mut by_name = |name: Option<&str>| {
        let name = name.filter(|name| !name.is_empty());
        name.map(|name| raw.names.intern(name))
    };
    let nodes_by_name: Vec<Option<u32>> = document.nodes().map(|node| by_name(node.name())).collect();
    let meshes_by_name: Vec<Option<u32>> = document.meshes().map(|mesh| by_name(mesh.name())).collect();
    let materials = document.materials();
    let materials_by_name: Vec<Option<u32>> = materials.map(|material| by_name(material.name())).collect();
    let mut skins = HashMap::new();
    let mut is_drawn = vec![false; document.meshes().len()];
    let mut skipped = 0;
    for drawn in drawn {
        let node = &nodes[drawn.node];
        let Some(mesh) = node.mesh() else { continue };
        is_drawn[mesh.index()] = true;
        if let Some(skin) = node.skin()
            && !skins.contains_key(&skin.index())
        {
            let joints = joints_at(&skin, buffers, |node| scene.scene_from_node[node])?;
            skins.insert(skin.index(), joints);
        }
        let joints = node.skin().and_then(|skin| skins.get(&skin.index()));
        let at = extended.instances(drawn.node)?;
        if at.is_some() && joints.is_some() {
            raw.warnings.push(format!(
                "node {} has instances of a mesh with a skin: one is read, where its joints are",
                node.index()
            ));
        }
        // Joints mirror a mesh together, and the node's own place does not count.
        let instances = match (joints, at) {
            (Some(joints), _) => vec![joints.first().copied().unwrap_or(DMat4::IDENTITY)],
            (None, None) => vec![drawn.scene_from_node],
            (None, Some(attributes)) => {
                let at = instances(attributes, document, buffers);
                let at = at.map_err(|error| {
                    ImportError::at(format!("nodes[{}]", node.index()), error.to_string())
                })?;
                at.into_iter().map(|at| drawn.scene_from_node * at).collect()
            }
        };
        for primitive in mesh.primitives() {
            buffers.spend(0)?;
            if !has_triangles(&primitive) {
                skipped += 1;
                continue;
            }
            let place = |error: ImportError| in_primitive(&mesh, &primitive, &error);
            let material = primitive.material().index();
            let is_transparent = material.is_some_and(|material| extended.is_transparent(material));
            let own = [nodes_by_name[drawn.node], meshes_by_name[mesh.index()]];
            let names = raw.names.add(FaceNames {
                parts: own.into_iter().flatten().collect(),
                material: material.and_then(|material| materials_by_name[material]),
                role: drawn.role,
                aside: drawn.aside.or(is_transparent.then_some(Aside::Transparent)),
            });
            let mut positions = positions(&primitive, node, buffers).map_err(place)?;
            if let Some(joints) = joints {
                positions = skinned(&primitive, joints, &positions, buffers).map_err(place)?;
            }
            let shown = ShownPrimitive {
                indices: indices(&primitive, positions.len(), buffers).map_err(place)?,
                positions,
                mode: primitive.mode(),
                is_skinned: joints.is_some(),
                names,
            };
            for &scene_from_mesh in &instances {
                shown.add_to(raw, scene_from_mesh, buffers).map_err(place)?;
            }
        }
    }
    if skipped > 0 {
        let skipped = format!("{skipped} primitives of points or lines were ignored");
        raw.warnings.push(skipped);
    }
    let undrawn = document.meshes().filter(|mesh| !is_drawn[mesh.index()]);
    let undrawn: Vec<Mesh<'_>> = undrawn.collect();
    if !undrawn.is_empty() {
        let names = undrawn.iter().map(|mesh| mesh.name().unwrap_or("without a name"));
        raw.warnings.push(format!(
            "{} meshes that no node of the scene shows were left out: {}",
            undrawn.len(),
            listed(names.collect())
        ));
    }
    Ok(())
}

/// A primitive that may be shown at several places.
struct ShownPrimitive {
    /// In the mesh's frame or, with a skin, in the scene's.
    positions: Vec<DVec3>,
    indices: Vec<u32>,
    mode: Mode,
    is_skinned: bool,
    names: u32,
}

impl ShownPrimitive {
    /// Appends its vertices and triangles where they are shown.
    fn add_to(
        &self,
        raw: &mut RawMesh,
        scene_from_mesh: DMat4,
        buffers: &Buffers<'_>,
    ) -> Result<(), ImportError> {
        buffers.spend(0)?;
        let triangles = triangles(&self.indices, self.mode);
        let (first, before) = (raw.positions.len(), raw.triangles);
        let vertices = (first + self.positions.len()) as u64;
        check_counts(vertices, (before + triangles.len()) as u64, buffers.limits)?;
        raw.positions.extend(self.positions.iter().map(|&position| {
            if self.is_skinned {
                position
            } else {
                scene_from_mesh.transform_point3(position)
            }
        }));
        raw.corners.reserve(3 * triangles.len());
        // A mirrored instance shows its other side.
        let is_mirrored = scene_from_mesh.determinant() < 0.0;
        for (number, [a, b, c]) in triangles.enumerate() {
            let corners = if is_mirrored { [a, c, b] } else { [a, b, c] };
            let corners = corners.map(|corner| first as u32 + corner);
            raw.add_triangle(corners, before + number, self.names);
        }
        Ok(())
    }
}

/// The positions of a primitive's vertices with morph targets at their default weights, in the mesh's frame.
fn positions(
    primitive: &Primitive<'_>,
    node: &Node<'_>,
    buffers: &Buffers<'_>,
) -> Result<Vec<DVec3>, ImportError> {
    let accessor = primitive
        .get(&Semantic::Positions)
        .ok_or_else(|| ImportError::at("attributes", "has no POSITION"))?;
    check_counts(accessor.count() as u64, 0, buffers.limits)?;
    let mut positions = buffers.read(&accessor, accessor.count(), DVec3::from_array)?;
    let mesh = node.mesh();
    let defaults = mesh.as_ref().and_then(gltf::Mesh::weights);
    let weights = node.weights().or(defaults).unwrap_or_default();
    for (target, &weight) in primitive.morph_targets().zip(weights) {
        buffers.spend(0)?;
        let Some(offsets) = target.positions().filter(|_| weight != 0.0) else {
            continue;
        };
        let offsets = buffers.read(&offsets, positions.len(), DVec3::from_array)?;
        for (position, offset) in positions.iter_mut().zip(offsets) {
            *position += f64::from(weight) * offset;
        }
    }
    Ok(positions)
}

/// The indices of a primitive; those of a primitive without are its vertices in turn.
fn indices(
    primitive: &Primitive<'_>,
    vertices: usize,
    buffers: &Buffers<'_>,
) -> Result<Vec<u32>, ImportError> {
    let Some(accessor) = primitive.indices() else {
        return Ok((0..vertices as u32).collect());
    };
    check_counts(0, accessor.count() as u64 / 3, buffers.limits)?;
    // Anything but a whole number in range becomes the largest, which no vertex has.
    let index_of = |[number]: [f64; 1]| if number >= 0.0 { number as u32 } else { u32::MAX };
    let indices = buffers.read(&accessor, accessor.count(), index_of)?;
    match indices.iter().find(|&&index| index as usize >= vertices) {
        Some(index) => {
            let what = format!("vertex {index} does not exist; there are {vertices}, counted from 0");
            Err(ImportError::at("indices", what))
        }
        None => Ok(indices),
    }
}

/// Whether a primitive is a list, strip or fan of triangles.
fn has_triangles(primitive: &Primitive<'_>) -> bool {
    use Mode::{TriangleFan, TriangleStrip, Triangles};
    matches!(primitive.mode(), Triangles | TriangleStrip | TriangleFan)
}

/// The triangles of a list, strip or fan of indices.
fn triangles(indices: &[u32], mode: Mode) -> impl ExactSizeIterator<Item = [u32; 3]> {
    let count = match mode {
        Mode::TriangleStrip | Mode::TriangleFan => indices.len().saturating_sub(2),
        _ => indices.len() / 3,
    };
    (0..count).map(move |triangle| match mode {
        Mode::TriangleStrip if triangle % 2 == 1 => [1, 0, 2].map(|corner| indices[triangle + corner]),
        Mode::TriangleStrip => [0, 1, 2].map(|corner| indices[triangle + corner]),
        Mode::TriangleFan => [indices[0], indices[triangle + 1], indices[triangle + 2]],
        _ => [0, 1, 2].map(|corner| indices[3 * triangle + corner]),
    })
}

/// An error in a primitive of a mesh, with its place.
pub(crate) fn in_primitive(mesh: &Mesh<'_>, primitive: &Primitive<'_>, error: &ImportError) -> ImportError {
    let mesh = mesh.name().map_or_else(|| mesh.index().to_string(), quoted);
    let place = format!("mesh {mesh}, primitive {}", primitive.index());
    ImportError::at(place, error.to_string())
}

/// Where a mesh is drawn, relative to its node.
fn instances(
    attributes: InstanceAttributes,
    document: &Document,
    buffers: &Buffers<'_>,
) -> Result<Vec<DMat4>, ImportError> {
    let accessor = |index: usize| {
        let what = || format!("refers to accessors[{index}], which does not exist");
        document
            .accessors()
            .nth(index)
            .ok_or_else(|| ImportError::at(EXTENSION, what()))
    };
    let translation = attributes.translation.map(accessor).transpose()?;
    let rotation = attributes.rotation.map(accessor).transpose()?;
    let scale = attributes.scale.map(accessor).transpose()?;
    let all = [&translation, &rotation, &scale].into_iter().flatten();
    let mut counts = all.map(Accessor::count);
    let Some(count) = counts.next() else {
        // Other attributes move nothing.
        return Ok(vec![DMat4::IDENTITY]);
    };
    if let Some(other) = counts.find(|&other| other != count) {
        let what = format!("has attributes of {count} and of {other} instances; their numbers must be equal");
        return Err(ImportError::at(EXTENSION, what));
    }
    // Each instance of a mesh has a triangle at least.
    check_counts(0, count as u64, buffers.limits)?;
    let vectors = |accessor: &Option<Accessor<'_>>, default: DVec3| match accessor {
        Some(accessor) => buffers.read(accessor, count, DVec3::from_array),
        None => Ok(vec![default; count]),
    };
    let translations = vectors(&translation, DVec3::ZERO)?;
    let scales = vectors(&scale, DVec3::ONE)?;
    let rotations = match &rotation {
        Some(accessor) => buffers.read(accessor, count, DQuat::from_array)?,
        None => vec![DQuat::IDENTITY; count],
    };
    let at = scales.into_iter().zip(rotations).zip(translations);
    let at = at.map(|((scale, rotation), translation)| {
        DMat4::from_scale_rotation_translation(scale, rotation.normalize(), translation)
    });
    Ok(at.collect())
}

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
    frame_of: impl Fn(usize) -> DMat4,
    is_chosen: impl Fn(usize) -> bool,
) -> Result<Vec<SkinnedMesh>, ImportError> {
    let Some((mesh, skin)) = node.mesh().zip(node.skin()) else {
        return Ok(Vec::new());
    };
    let buffers = &opened.buffers;
    let joints = joints_at(&skin, buffers, frame_of)?;
    let is_chosen: Vec<bool> = skin.joints().map(|joint| is_chosen(joint.index())).collect();
    let read = |primitive: &Primitive<'_>| {
        let bound = positions(primitive, node, buffers)?;
        let mut shares = vec![0.0; bound.len()];
        each_weight(primitive, bound.len(), buffers, |vertex, joint, weight| {
            if is_chosen.get(joint) == Some(&true) {
                shares[vertex] += weight;
            }
            Ok(())
        })?;
        let indices = indices(primitive, bound.len(), buffers)?;
        Ok(SkinnedMesh {
            positions: skinned(primitive, &joints, &bound, buffers)?,
            shares,
            triangles: triangles(&indices, primitive.mode()).collect(),
        })
    };
    mesh.primitives()
        .filter(has_triangles)
        .map(|primitive| read(&primitive).map_err(|error| in_primitive(&mesh, &primitive, &error)))
        .collect()
}

/// The transforms of a skin's joints, of which the nodes' frames are given, from where the mesh was bound.
fn joints_at(
    skin: &Skin<'_>,
    buffers: &Buffers<'_>,
    frame_of: impl Fn(usize) -> DMat4,
) -> Result<Vec<DMat4>, ImportError> {
    let bound = skin.joints().zip(inverse_binds(skin, buffers)?);
    let joints = bound.map(|(joint, inverse_bind)| frame_of(joint.index()) * inverse_bind);
    Ok(joints.collect())
}

/// The transforms of a skin's joints from the frame of the mesh, where it was bound.
pub(crate) fn inverse_binds(skin: &Skin<'_>, buffers: &Buffers<'_>) -> Result<Vec<DMat4>, ImportError> {
    let joints = skin.joints().len();
    if let Some(accessor) = skin.inverse_bind_matrices() {
        return buffers.read(&accessor, joints, |matrix| DMat4::from_cols_array(&matrix));
    }
    buffers.spend(joints as u64)?;
    Ok(vec![DMat4::IDENTITY; joints])
}

/// Where the vertices of a skinned primitive are: as its joints move them, by their weights.
fn skinned(
    primitive: &Primitive<'_>,
    joints: &[DMat4],
    positions: &[DVec3],
    buffers: &Buffers<'_>,
) -> Result<Vec<DVec3>, ImportError> {
    let mut sums = vec![(DVec3::ZERO, 0.0); positions.len()];
    each_weight(primitive, positions.len(), buffers, |vertex, joint, weight| {
        let what = || format!("joint {joint} does not exist; there are {}", joints.len());
        let transform = joints
            .get(joint)
            .ok_or_else(|| ImportError::at("attributes", what()))?;
        let (sum, total) = &mut sums[vertex];
        *sum += weight * transform.transform_point3(positions[vertex]);
        *total += weight;
        Ok(())
    })?;
    // Vertices without weights stay where they are.
    let moved = sums.into_iter().zip(positions);
    let moved = moved.map(|((sum, total), &position)| if total > 0.0 { sum / total } else { position });
    Ok(moved.collect())
}

/// Calls `each` with every vertex, joint of it (by its place in the skin) and weight other than 0.
pub(crate) fn each_weight(
    primitive: &Primitive<'_>,
    vertices: usize,
    buffers: &Buffers<'_>,
    mut each: impl FnMut(usize, usize, f64) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    for set in 0..JOINT_SETS {
        let joints = primitive.get(&Semantic::Joints(set));
        let Some((indices, weights)) = joints.zip(primitive.get(&Semantic::Weights(set))) else {
            break;
        };
        let indices = buffers.read::<4, _>(&indices, vertices, |joints| joints)?;
        let weights = buffers.read::<4, _>(&weights, vertices, |weights| weights)?;
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
