//! The triangles of a scene's meshes.

use std::collections::{HashMap, hash_map::Entry};

use glam::{DMat4, DVec3};
use gltf::{Document, Mesh, Node, Primitive, Semantic, mesh::Mode};

use super::{
    Opened,
    accessors::Buffers,
    drawn::drawn_nodes,
    extensions::Extended,
    instances::instances,
    nodes::Scene,
    skinning::{joints_at, skinned},
};
use crate::{
    error::ImportError,
    limits::MeshLimits,
    names::{Aside, FaceNames},
    parts::{listed, quoted},
    raw::{RawMesh, check_counts},
};

/// Appends all triangles that a scene shows, and those that it would show elsewhere or nearer, marked as such.
pub(super) fn read_into(
    raw: &mut RawMesh,
    opened: &Opened<'_>,
    limits: MeshLimits,
) -> Result<(), ImportError> {
    let Opened {
        json,
        document,
        buffers,
    } = opened;
    let scene = Scene::of(document);
    let extended = Extended::of(json)?;
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
        let joints = match node.skin() {
            Some(skin) => match skins.entry(skin.index()) {
                Entry::Occupied(known) => Some(&*known.into_mut()),
                Entry::Vacant(unknown) => {
                    Some(&*unknown.insert(joints_at(&skin, buffers, |node| scene.scene_from_node[node])?))
                }
            },
            None => None,
        };
        let at = extended.instances(drawn.node);
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
                let at = instances(attributes, document, buffers, limits);
                let at = at.map_err(|error| {
                    ImportError::at(format!("nodes[{}]", node.index()), error.to_string())
                })?;
                at.into_iter().map(|at| drawn.scene_from_node * at).collect()
            }
        };
        for primitive in mesh.primitives() {
            buffers.spend(0)?;
            if !matches!(
                primitive.mode(),
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
            ) {
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
            let mut positions = positions(&primitive, node, buffers, limits).map_err(place)?;
            if let Some(joints) = joints {
                positions = skinned(&primitive, joints, &positions, buffers).map_err(place)?;
            }
            let indices = indices(&primitive, positions.len(), buffers, limits).map_err(place)?;
            for &scene_from_mesh in &instances {
                let of_positions = joints.is_none().then_some(scene_from_mesh);
                let first = add_vertices(raw, &positions, of_positions, buffers, limits).map_err(place)?;
                // A mirrored instance shows its other side.
                let is_mirrored = scene_from_mesh.determinant() < 0.0;
                let mode = (primitive.mode(), is_mirrored);
                add_triangles(raw, &indices, mode, (first, names), limits).map_err(place)?;
            }
        }
    }
    if skipped > 0 {
        raw.warnings
            .push(format!("{skipped} primitives of points or lines were ignored"));
    }
    raw.warnings.extend(of_undrawn(document, &is_drawn));
    Ok(())
}

/// A warning of meshes that are not shown.
fn of_undrawn(document: &Document, is_drawn: &[bool]) -> Option<String> {
    let undrawn = document.meshes().filter(|mesh| !is_drawn[mesh.index()]);
    let undrawn: Vec<Mesh<'_>> = undrawn.collect();
    let names = undrawn.iter().map(|mesh| mesh.name().unwrap_or("without a name"));
    (!undrawn.is_empty()).then(|| {
        format!(
            "{} meshes that no node of the scene shows were left out: {}",
            undrawn.len(),
            listed(names.collect())
        )
    })
}

/// Appends the vertices of a primitive where a node shows it; returns the index of the first.
fn add_vertices(
    raw: &mut RawMesh,
    positions: &[DVec3],
    scene_from_mesh: Option<DMat4>,
    buffers: &Buffers<'_>,
    limits: MeshLimits,
) -> Result<u32, ImportError> {
    let first = raw.coordinates.len() / 3;
    check_counts((first + positions.len()) as u64, 0, limits)?;
    buffers.spend(0)?;
    raw.coordinates.reserve(3 * positions.len());
    for &position in positions {
        let placed = scene_from_mesh.map_or(position, |at| at.transform_point3(position));
        raw.add_vertex(placed.to_array());
    }
    Ok(first as u32)
}
/// Appends the triangles of indices in a mode, mirrored or not, whose vertices start at `first`.
fn add_triangles(
    raw: &mut RawMesh,
    indices: &[u32],
    (mode, is_mirrored): (Mode, bool),
    (first, names): (u32, usize),
    limits: MeshLimits,
) -> Result<(), ImportError> {
    let before = raw.faces.triangles();
    let triangles = triangle_count(indices, mode);
    check_counts(0, (before + triangles) as u64, limits)?;
    raw.corners.reserve(3 * triangles);
    for triangle in 0..triangles {
        let [a, b, c] = corners(indices, mode, triangle);
        let corners = if is_mirrored { [a, c, b] } else { [a, b, c] };
        raw.add_triangle(corners.map(|corner| first + corner), before + triangle, names);
    }
    Ok(())
}

/// The positions of a primitive's vertices with morph targets at their default weights, in the mesh's frame.
pub(super) fn positions(
    primitive: &Primitive<'_>,
    node: &Node<'_>,
    buffers: &Buffers<'_>,
    limits: MeshLimits,
) -> Result<Vec<DVec3>, ImportError> {
    let accessor = primitive
        .get(&Semantic::Positions)
        .ok_or_else(|| ImportError::at("attributes", "has no POSITION"))?;
    check_counts(accessor.count() as u64, 0, limits)?;
    let mut positions = buffers.converted(&accessor, accessor.count(), DVec3::from_array)?;
    let mesh = node.mesh();
    let defaults = mesh.as_ref().and_then(gltf::Mesh::weights);
    let weights = node.weights().or(defaults).unwrap_or_default();
    for (target, &weight) in primitive.morph_targets().zip(weights) {
        buffers.spend(0)?;
        let Some(offsets) = target.positions().filter(|_| weight != 0.0) else {
            continue;
        };
        let offsets = buffers.numbers(&offsets, positions.len())?;
        for (position, offset) in positions.iter_mut().zip(offsets) {
            *position += f64::from(weight) * DVec3::from_array(offset);
        }
    }
    Ok(positions)
}

/// The indices of a primitive; those of a primitive without are its vertices in turn.
pub(super) fn indices(
    primitive: &Primitive<'_>,
    vertices: usize,
    buffers: &Buffers<'_>,
    limits: MeshLimits,
) -> Result<Vec<u32>, ImportError> {
    let Some(accessor) = primitive.indices() else {
        return Ok((0..vertices as u32).collect());
    };
    check_counts(0, accessor.count() as u64 / 3, limits)?;
    // What is no whole number in range becomes the largest, which no vertex has.
    let index_of = |[number]: [f64; 1]| if number >= 0.0 { number as u32 } else { u32::MAX };
    let indices = buffers.converted(&accessor, accessor.count(), index_of)?;
    match indices.iter().find(|&&index| index as usize >= vertices) {
        Some(index) => Err(ImportError::at(
            "indices",
            format!("vertex {index} does not exist; there are {vertices}, counted from 0"),
        )),
        None => Ok(indices),
    }
}

/// Number of triangles of a list, strip or fan of indices.
pub(super) fn triangle_count(indices: &[u32], mode: Mode) -> usize {
    match mode {
        Mode::TriangleStrip | Mode::TriangleFan => indices.len().saturating_sub(2),
        _ => indices.len() / 3,
    }
}

/// The corners of a triangle of a list, strip or fan of indices.
pub(super) fn corners(indices: &[u32], mode: Mode, triangle: usize) -> [u32; 3] {
    match mode {
        Mode::TriangleStrip => {
            let [a, b, c] = [0, 1, 2].map(|corner| indices[triangle + corner]);
            if triangle.is_multiple_of(2) {
                [a, b, c]
            } else {
                [b, a, c]
            }
        }
        Mode::TriangleFan => [indices[0], indices[triangle + 1], indices[triangle + 2]],
        _ => [0, 1, 2].map(|corner| indices[3 * triangle + corner]),
    }
}

/// An error in a primitive of a mesh, with its place.
pub(crate) fn in_primitive(mesh: &Mesh<'_>, primitive: &Primitive<'_>, error: &ImportError) -> ImportError {
    ImportError::at(
        format!("mesh {}, primitive {}", mesh_name(mesh), primitive.index()),
        error.to_string(),
    )
}

/// A mesh's name, or its index.
fn mesh_name(mesh: &Mesh<'_>) -> String {
    mesh.name().map_or_else(|| mesh.index().to_string(), quoted)
}
