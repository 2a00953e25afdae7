//! Volume, centroid, topology and validation of meshes.

use std::f64::consts::PI;

use grasp_synthesis::geometry::{mesh::MeshError, topology::Topology};

use crate::prelude::*;

#[test]
fn volume_and_centroid_match_closed_forms() {
    let half = Vec3::new(0.05, 0.03, 0.02);
    let offset = Vec3::new(2.0, -3.0, 1.5);
    let turned = moved(&cuboid(half, 3), Random::new(8).rotation(), offset);
    let volume = 8.0 * f64::from(half.element_product());
    assert!((turned.signed_volume() / volume - 1.0).abs() < 1e-4);
    let centroid = turned.volume_centroid().expect("the box has a volume");
    assert!(centroid.distance(offset) < 1e-6, "{centroid}");
    let area = 8.0 * f64::from(half.x * half.y + half.y * half.z + half.z * half.x);
    assert!((turned.area() / area - 1.0).abs() < 1e-5);

    // A mesh inscribed in a torus is smaller by about 2/3 (π/n)² in each direction.
    let torus = torus(0.05, 0.015, 100);
    let volume = 2.0 * PI * PI * 0.05 * 0.015 * 0.015;
    let share = torus.signed_volume() / volume;
    assert!((0.998..1.0).contains(&share), "{share}");

    let inside_out = meshes::inside_out_sphere();
    assert!(inside_out.signed_volume() < 0.0);
    let centroid = inside_out.volume_centroid().expect("it has a volume");
    assert!(centroid.length() < 1e-6, "{centroid}");
}

#[test]
fn centroid_is_weighted_by_volume_not_by_vertices() {
    let mesh = meshes::Parts::default()
        .cuboid(Vec3::ZERO, Vec3::splat(0.02), 20)
        .cuboid(Vec3::X, Vec3::splat(0.04), 1)
        .mesh();
    let centroid = mesh.volume_centroid().expect("it has a volume");
    assert!(centroid.distance(Vec3::X * (8.0 / 9.0)) < 1e-6, "{centroid}");
}

#[test]
fn a_flat_mesh_has_no_centroid_of_volume() {
    let flat = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]).expect("it is sound");
    assert_eq!(flat.volume_centroid(), None);
    assert!(flat.signed_volume().abs() < 1e-12);
}

#[test]
fn topology_distinguishes_closed_from_open_and_counts_parts() {
    let closed = Topology::of(&meshes::overlapping_boxes());
    assert!(closed.is_closed() && closed.is_consistently_wound());
    assert_eq!((closed.components, closed.non_manifold_edges), (2, 0));

    let open = Topology::of(&open_box());
    // Four sides of four cells.
    assert_eq!((open.boundary_edges, open.components), (16, 1));
    assert!(!open.is_closed());

    let soup = Topology::of(&meshes::soup());
    assert_eq!((soup.components, soup.boundary_edges), (300, 900));

    let sphere = sphere(0.04, 8);
    let mut triangles = sphere.triangles().to_vec();
    triangles[100].swap(0, 1);
    let flipped = TriangleMesh::new(sphere.positions().to_vec(), triangles).expect("it is sound");
    let flipped = Topology::of(&flipped);
    assert_eq!(flipped.miswound_edges, 3);
    assert!(flipped.is_closed() && !flipped.is_consistently_wound());

    // Two tetrahedra that share an edge: four triangles at that edge.
    let (x, y) = (Vec3::X, Vec3::Y);
    let positions = vec![Vec3::ZERO, Vec3::Z, x, x + y, -x, -x - y];
    let tetrahedron = |a: u32, b: u32, c: u32, d: u32| [[a, c, b], [a, b, d], [b, c, d], [a, d, c]];
    let triangles = [tetrahedron(0, 1, 2, 3), tetrahedron(0, 1, 4, 5)].concat();
    let pair = TriangleMesh::new(positions, triangles).expect("it is sound");
    let pair = Topology::of(&pair);
    assert_eq!((pair.non_manifold_edges, pair.boundary_edges), (1, 0));
    assert_eq!(pair.components, 1);
}

#[test]
fn rejects_broken_meshes_with_the_reason() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X * 2.0];
    let new = |triangles: &[[u32; 3]]| TriangleMesh::new(positions.clone(), triangles.to_vec());
    assert_eq!(new(&[]), Err(MeshError::Empty));
    assert_eq!(
        new(&[[0, 1, 2], [0, 1, 9]]),
        Err(MeshError::IndexOutOfRange {
            triangle: 1,
            vertex: 9,
            vertices: 4
        })
    );
    assert_eq!(new(&[[0, 1, 3]]), Err(MeshError::Degenerate { triangle: 0 }));
    assert_eq!(new(&[[0, 1, 1]]), Err(MeshError::Degenerate { triangle: 0 }));
    assert_eq!(
        TriangleMesh::new(vec![Vec3::ZERO, Vec3::NAN, Vec3::Y], vec![[0, 1, 2]]),
        Err(MeshError::NotFinite { vertex: 1 })
    );
    let repaired = TriangleMesh::without_degenerates(positions.clone(), &[[0, 1, 3], [0, 1, 2]]);
    assert_eq!(repaired.expect("one triangle remains").triangles(), [[0, 1, 2]]);
    assert_eq!(
        TriangleMesh::without_degenerates(positions, &[[0, 1, 3]]),
        Err(MeshError::Empty)
    );
}

#[test]
fn normals_of_tiny_triangles_point_outward() {
    for scale in [1.0, 1e-4, 1e-8] {
        let turn = Quat::from_rotation_x(0.4);
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| turn * p * scale).to_vec();
        let mesh = TriangleMesh::new(positions, vec![[0, 1, 2]]).expect("it is sound");
        assert!(mesh.normal(0).distance(turn * Vec3::Z) < 1e-6, "{scale}");
    }
}
