//! Files, read by another implementation.

use super::*;
use crate::{primitives, scene::linear_from_srgb};

fn sample() -> Scene {
    let red = linear_from_srgb(200, 30, 20);
    let mut ball = primitives::sphere("ball", Vec3::new(0.1, 0.2, 0.3), 0.05, red);
    ball.extras = Some(json!({"force_n": 2.5}));
    let mut arrow = primitives::arrow("arrow", Vec3::ZERO, Vec3::Y, 0.1, red);
    arrow.vertex_colours = arrow.positions.iter().map(|p| p.abs().min(Vec3::ONE)).collect();
    let empty = Part::new("empty", vec![Vec3::ZERO], Vec::new(), red);
    Scene {
        parts: vec![ball, empty, arrow],
    }
}

#[test]
fn preserves_parts() {
    let scene = sample();
    let bytes = to_glb(&scene);
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(&bytes).expect("a valid file");
    let nodes: Vec<_> = document.default_scene().expect("a scene").nodes().collect();
    let parts: Vec<_> = scene.parts.iter().filter(|p| !p.triangles.is_empty()).collect();
    assert_eq!(nodes.len(), parts.len());
    for (node, part) in nodes.iter().zip(parts) {
        assert_eq!(node.name(), Some(part.name.as_str()));
        let mesh = node.mesh().expect("a mesh");
        let primitive = mesh.primitives().next().expect("a primitive");
        let reader = primitive.reader(|_| blob.as_deref());
        let read = reader.read_positions().expect("positions").map(Vec3::from);
        let positions: Vec<Vec3> = read.collect();
        let normals: Vec<Vec3> = reader.read_normals().expect("normals").map(Vec3::from).collect();
        let indices: Vec<u32> = reader.read_indices().expect("indices").into_u32().collect();
        let corners: Vec<Vec3> = part
            .triangles
            .iter()
            .flat_map(|&triangle| part.corners(triangle))
            .collect();
        let read: Vec<Vec3> = indices.iter().map(|&i| positions[i as usize]).collect();
        assert_eq!(read, corners);
        assert_eq!(normals.len(), positions.len());
        assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
        for (triangle, face) in indices.chunks(3).zip(corners.chunks(3)) {
            let face = (face[1] - face[0]).cross(face[2] - face[0]);
            assert!(triangle.iter().all(|&i| normals[i as usize].dot(face) > 0.0));
        }
        let (low, high) = (
            corners.iter().copied().reduce(Vec3::min),
            corners.iter().copied().reduce(Vec3::max),
        );
        let bounds = primitive.bounding_box();
        assert_eq!((Some(bounds.min.into()), Some(bounds.max.into())), (low, high));

        let base = primitive.material().pbr_metallic_roughness().base_color_factor();
        match reader.read_colors(0) {
            None => assert_eq!(base, part.colour.extend(1.0).to_array()),
            Some(colours) => {
                assert_eq!(base, [1.0; 4]);
                for (colour, position) in colours.into_rgb_f32().zip(&positions) {
                    assert_eq!(Vec3::from(colour), position.abs().min(Vec3::ONE));
                }
            }
        }
    }
    let json_length = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    let root: Value = serde_json::from_slice(&bytes[20..20 + json_length]).expect("JSON");
    assert_eq!(root["nodes"][0]["extras"], json!({"force_n": 2.5}));
}

#[test]
fn shares_smooth_vertices_and_splits_sharp_ones() {
    let ball = primitives::sphere("ball", Vec3::ZERO, 1.0, Vec3::ONE);
    assert_eq!(Vertices::of(&ball).sources.len(), ball.positions.len());
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from);
    let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let tetrahedron = Part::new("sharp", corners.to_vec(), triangles, Vec3::ONE);
    assert_eq!(Vertices::of(&tetrahedron).sources.len(), 12);
}

#[test]
fn empty_scene_is_a_valid_file() {
    let file = gltf::Gltf::from_slice(&to_glb(&Scene::default())).expect("a valid file");
    assert_eq!((file.document.nodes().count(), file.blob), (0, None));
}
