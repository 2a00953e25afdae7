//! Scenes as binary glTF 2.0 files.

mod moving;
mod writer;

use std::collections::HashMap;

use glam::Vec3;
use serde_json::{Map, Value, json};

use crate::{
    normals::corner_normals,
    scene::{Finish, Part, Scene},
    skin_look::Binding,
};
pub use moving::to_moving_glb;
pub use writer::GlbWriter;

/// Emission of a marker as a share of its colour: keeps it visible in a viewer's shadows.
const MARKER_EMISSION: f32 = 0.45;

/// A scene as a GLB file: each part with triangles becomes a named node with its own mesh and material, in metres and
/// +Y up. Vertices have the same smooth normals as in pictures.
///
/// # Panics
/// The file exceeds 4 GiB.
pub fn to_glb(scene: &Scene) -> Vec<u8> {
    let mut writer = SceneWriter::default();
    for part in scene.parts.iter().filter(|part| !part.triangles.is_empty()) {
        writer.add_part(part);
    }
    writer.finish()
}

/// The nodes added so far, and what they need.
#[derive(Default)]
struct SceneWriter {
    nodes: Vec<Value>,
    /// The nodes that have no parent.
    roots: Vec<usize>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    skins: Vec<Value>,
    animations: Vec<Value>,
    file: GlbWriter,
}

impl SceneWriter {
    fn add_part(&mut self, part: &Part) -> usize {
        let mut node = json!({"name": part.name, "mesh": self.add_mesh(part, None)});
        if let Some(extras) = &part.extras {
            node["extras"] = extras.clone();
        }
        self.add_root(node)
    }

    fn add_root(&mut self, node: Value) -> usize {
        let index = self.add_node(node);
        self.roots.push(index);
        index
    }

    fn add_node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// A part's mesh, moved by joints if there is a binding.
    fn add_mesh(&mut self, part: &Part, binding: Option<&Binding>) -> usize {
        let vertices = Vertices::of(part);
        let mut attributes = Map::new();
        attributes.insert("POSITION".into(), self.file.positions(&vertices.positions).into());
        attributes.insert("NORMAL".into(), self.file.vectors(&vertices.normals).into());
        if !part.vertex_colours.is_empty() {
            attributes.insert("COLOR_0".into(), self.file.vectors(&vertices.colours).into());
        }
        if let Some(binding) = binding {
            let sources = vertices.sources.iter().map(|&vertex| vertex as usize);
            let (joints, weights): (Vec<_>, Vec<_>) = sources
                .map(|vertex| without_idle_joints(binding.joints[vertex], binding.weights[vertex]))
                .unzip();
            attributes.insert("JOINTS_0".into(), self.file.joints(&joints).into());
            attributes.insert("WEIGHTS_0".into(), self.file.weights(&weights).into());
        }
        let indices = self.file.indices(&vertices.indices);
        self.meshes.push(json!({
            "name": part.name,
            "primitives": [{"attributes": attributes, "indices": indices, "material": self.materials.len()}],
        }));
        self.materials.push(material(part));
        self.meshes.len() - 1
    }

    fn finish(self) -> Vec<u8> {
        let mut document = json!({"asset": {"version": "2.0", "generator": "grasp"}});
        // The specification forbids empty arrays.
        if !self.roots.is_empty() {
            document["scene"] = 0.into();
            document["scenes"] = json!([{"nodes": self.roots}]);
        }
        for (name, values) in [
            ("nodes", self.nodes),
            ("meshes", self.meshes),
            ("materials", self.materials),
            ("skins", self.skins),
            ("animations", self.animations),
        ] {
            if !values.is_empty() {
                document[name] = values.into();
            }
        }
        self.file.finish(document)
    }
}

/// Joints without weight are to be 0 (3.7.3.3 of the specification).
fn without_idle_joints(mut joints: [u8; 4], weights: [f32; 4]) -> ([u8; 4], [f32; 4]) {
    for (joint, weight) in joints.iter_mut().zip(weights) {
        if weight == 0.0 {
            *joint = 0;
        }
    }
    (joints, weights)
}

fn material(part: &Part) -> Value {
    let (metallic, roughness) = match part.finish {
        Finish::Satin => (0.0, 0.45),
        Finish::Metal => (1.0, 0.35),
        Finish::Skin => (0.0, 0.6),
        Finish::Cloth => (0.0, 0.95),
        Finish::Marker => (0.0, 1.0),
    };
    let [r, g, b, alpha] = part.colour;
    // Viewers multiply vertex colours by the base colour.
    let base = if part.vertex_colours.is_empty() {
        [r, g, b, alpha]
    } else {
        [1.0, 1.0, 1.0, alpha]
    };
    let mut material = json!({
        "name": part.name,
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorFactor": base,
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        },
    });
    if alpha < 1.0 {
        material["alphaMode"] = "BLEND".into();
    }
    if part.finish == Finish::Marker {
        material["emissiveFactor"] = json!([r, g, b].map(|c| c * MARKER_EMISSION));
    }
    material
}

/// A part's vertices, split where the triangles around one have different normals.
struct Vertices {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    colours: Vec<Vec3>,
    /// The part's vertex that each one is.
    sources: Vec<u32>,
    indices: Vec<u32>,
}

impl Vertices {
    fn of(part: &Part) -> Self {
        let mut known = HashMap::new();
        let mut vertices = Self {
            positions: Vec::new(),
            normals: Vec::new(),
            colours: Vec::new(),
            sources: Vec::new(),
            indices: Vec::with_capacity(part.triangles.len() * 3),
        };
        for (triangle, normals) in part.triangles.iter().zip(corner_normals(part)) {
            for (&vertex, normal) in triangle.iter().zip(normals) {
                let next = vertices.positions.len() as u32;
                let index = *known
                    .entry((vertex, normal.to_array().map(f32::to_bits)))
                    .or_insert(next);
                if index == next {
                    vertices.positions.push(part.positions[vertex as usize]);
                    vertices.normals.push(normal);
                    vertices.colours.push(part.vertex_colour(vertex));
                    vertices.sources.push(vertex);
                }
                vertices.indices.push(index);
            }
        }
        vertices
    }
}

#[cfg(test)]
mod tests {
    use gltf::Semantic;

    use super::*;
    use crate::{primitives, scene::linear_from_srgb};

    fn sample() -> Scene {
        let red = linear_from_srgb(200, 30, 20);
        let mut ball = primitives::sphere("ball", Vec3::new(0.1, 0.2, 0.3), 0.05, red);
        ball.extras = Some(json!({"force_n": 2.5}));
        let mut rod =
            primitives::tapered_cylinder("rod", Vec3::ZERO, Vec3::Y, 0.1, 0.1, [0.2, 0.3, 0.4, 0.5]);
        rod.vertex_colours = rod.positions.iter().map(|p| p.abs().min(Vec3::ONE)).collect();
        let empty = Part::new("empty", vec![Vec3::ZERO], Vec::new(), red);
        Scene {
            parts: vec![ball, empty, rod],
        }
    }

    /// Parses and validates the file with the gltf crate.
    fn parse(bytes: &[u8]) -> (gltf::Document, Vec<u8>) {
        let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(bytes).expect("a valid file");
        (document, blob.unwrap_or_default())
    }

    #[test]
    fn preserves_triangles_normals_and_bounds() {
        let scene = sample();
        let (document, blob) = parse(&to_glb(&scene));
        let nodes: Vec<_> = document.default_scene().expect("a scene").nodes().collect();
        let parts: Vec<_> = scene.parts.iter().filter(|p| !p.triangles.is_empty()).collect();
        assert_eq!(nodes.len(), parts.len());
        for (node, part) in nodes.iter().zip(parts) {
            assert_eq!(node.name(), Some(part.name.as_str()));
            let mesh = node.mesh().expect("a mesh");
            let primitive = mesh.primitives().next().expect("a primitive");
            let reader = primitive.reader(|_| Some(&blob));
            let positions: Vec<Vec3> = reader
                .read_positions()
                .expect("positions")
                .map(Vec3::from)
                .collect();
            let normals: Vec<Vec3> = reader.read_normals().expect("normals").map(Vec3::from).collect();
            let indices: Vec<u32> = reader.read_indices().expect("indices").into_u32().collect();
            let corners: Vec<Vec3> = part
                .triangles
                .iter()
                .flatten()
                .map(|&v| part.positions[v as usize])
                .collect();
            let read: Vec<Vec3> = indices.iter().map(|&i| positions[i as usize]).collect();
            assert_eq!(read, corners);
            assert_eq!(normals.len(), positions.len());
            assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
            for (triangle, face) in indices.chunks(3).zip(corners.chunks(3)) {
                let face = (face[1] - face[0]).cross(face[2] - face[0]);
                assert!(triangle.iter().all(|&i| normals[i as usize].dot(face) > 0.0));
            }
            let bounds = primitive.bounding_box();
            assert_eq!(
                Vec3::from(bounds.min),
                corners.iter().copied().fold(Vec3::INFINITY, Vec3::min)
            );
            assert_eq!(
                Vec3::from(bounds.max),
                corners.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max)
            );
        }
    }

    #[test]
    fn preserves_colours_blending_and_extras() {
        let scene = sample();
        let bytes = to_glb(&scene);
        let (document, blob) = parse(&bytes);
        let material = |i: usize| document.materials().nth(i).expect("a material");
        assert_eq!(
            material(0).pbr_metallic_roughness().base_color_factor(),
            scene.parts[0].colour
        );
        assert_eq!(material(0).alpha_mode(), gltf::material::AlphaMode::Opaque);
        assert_eq!(
            material(1).pbr_metallic_roughness().base_color_factor(),
            [1.0, 1.0, 1.0, 0.5]
        );
        assert_eq!(material(1).alpha_mode(), gltf::material::AlphaMode::Blend);

        let rod = document
            .meshes()
            .nth(1)
            .expect("the rod")
            .primitives()
            .next()
            .expect("one");
        assert!(rod.get(&Semantic::Colors(0)).is_some());
        let reader = rod.reader(|_| Some(&blob));
        let colours = reader.read_colors(0).expect("colours").into_rgb_f32();
        for (colour, position) in colours.zip(reader.read_positions().expect("positions")) {
            assert_eq!(Vec3::from(colour), Vec3::from(position).abs().min(Vec3::ONE));
        }

        let json_length = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
        let root: Value = serde_json::from_slice(&bytes[20..20 + json_length]).expect("JSON");
        assert_eq!(root["nodes"][0]["extras"], json!({"force_n": 2.5}));
    }

    #[test]
    fn shares_smooth_vertices_and_splits_sharp_ones() {
        let ball = primitives::sphere("ball", Vec3::ZERO, 1.0, [1.0; 4]);
        assert_eq!(Vertices::of(&ball).positions.len(), ball.positions.len());
        let flat = Part {
            crease_angle: 0.0,
            ..ball.clone()
        };
        let split = Vertices::of(&flat).positions.len();
        assert!(split > ball.positions.len() * 2 && split <= ball.triangles.len() * 3);
    }

    #[test]
    fn empty_scene_is_a_valid_file() {
        let (document, blob) = parse(&to_glb(&Scene::default()));
        assert_eq!(document.nodes().count(), 0);
        assert!(blob.is_empty());
    }
}
