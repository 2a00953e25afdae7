//! The GLB files: skeletons that other programs understand, and how broken files are rejected.

use glam::{Mat4, Quat, Vec3};
use grasp_assets::hands::{HandError, read_skin};
use grasp_synthesis::model::hand::joints::JOINT_NAMES;

use super::{all, file_of};

/// The transform from a node to the scene.
fn global(document: &gltf::Document, node: usize) -> Mat4 {
    let parent = document
        .nodes()
        .find(|candidate| candidate.children().any(|child| child.index() == node));
    let found = document.nodes().nth(node).expect("the node is there");
    let (translation, rotation, scale) = found.transform().decomposed();
    let local = Mat4::from_scale_rotation_translation(
        Vec3::from(scale),
        Quat::from_array(rotation),
        Vec3::from(translation),
    );
    parent.map_or(Mat4::IDENTITY, |parent| global(document, parent.index())) * local
}

#[test]
fn skeletons_have_the_webxr_joints_in_their_bind_pose() {
    for hand in all() {
        let file = gltf::Gltf::from_slice(file_of(hand)).expect("it is a GLB file");
        let skin = file.skins().next().expect("it has a skin");
        let names: Vec<_> = skin
            .joints()
            .map(|joint| joint.name().unwrap_or("").to_owned())
            .collect();
        assert_eq!(names, JOINT_NAMES[1..], "WebXR's 25 joints in their order");
        let inverse_binds: Vec<Mat4> = skin
            .reader(|_| file.blob.as_deref())
            .read_inverse_bind_matrices()
            .expect("it has inverse bind matrices")
            .map(|m| Mat4::from_cols_array_2d(&m))
            .collect();
        for (joint, inverse_bind) in skin.joints().zip(inverse_binds) {
            let product = global(&file.document, joint.index()) * inverse_bind;
            assert!(
                product.abs_diff_eq(Mat4::IDENTITY, 1e-5),
                "the node is not in the bind pose: {:?}",
                joint.name()
            );
        }
    }
}

#[test]
fn vertex_normals_point_out_of_the_skin() {
    for hand in all() {
        let file = gltf::Gltf::from_slice(file_of(hand)).expect("it is a GLB file");
        let primitive = file
            .meshes()
            .flat_map(|mesh| mesh.primitives().collect::<Vec<_>>())
            .next()
            .expect("it has a mesh");
        let reader = primitive.reader(|_| file.blob.as_deref());
        let positions: Vec<Vec3> = reader
            .read_positions()
            .expect("positions")
            .map(Vec3::from)
            .collect();
        let normals: Vec<Vec3> = reader.read_normals().expect("normals").map(Vec3::from).collect();
        let corners: Vec<u32> = reader.read_indices().expect("indices").into_u32().collect();
        for triangle in corners.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|i| positions[triangle[i] as usize]);
            let face = (b - a).cross(c - a).normalize_or_zero();
            for &v in triangle {
                let normal = normals[v as usize];
                assert!((normal.length() - 1.0).abs() < 1e-4);
                assert!(
                    normal.dot(face) > 0.0,
                    "the normal of vertex {v} at {a} leaves its triangle"
                );
            }
        }
    }
}

#[test]
fn broken_files_are_rejected() {
    let hand = all().next().expect("there are hands");
    assert!(matches!(read_skin(b"glTF", &hand.rig), Err(HandError::Gltf(_))));
    let file = file_of(hand);
    let half = &file[..file.len() / 2];
    assert!(read_skin(half, &hand.rig).is_err());
    // With one letter of its name changed, a joint is reported missing by name.
    let mut renamed = file.to_vec();
    let at = renamed
        .windows(10)
        .position(|window| window == b"thumb-tip\"")
        .expect("the joint is there");
    renamed[at] = b'T';
    assert!(matches!(
        read_skin(&renamed, &hand.rig),
        Err(HandError::MissingJoint("thumb-tip"))
    ));
}
