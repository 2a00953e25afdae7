//! Meshes far from the origin of their file.

use std::fmt::Write as _;

use crate::{Import, ImportedMesh, UpAxis, read_mesh};
use glam::{DVec3, Vec3};

use crate::tests::repair::{LIMITS, read, solids::Polygons, volume};

/// A tetrahedron of 10 cm at a place, by its corners.
fn corners(place: DVec3) -> [DVec3; 4] {
    [DVec3::ZERO, DVec3::X * 0.1, DVec3::Y * 0.1, DVec3::Z * 0.1].map(|corner| corner + place)
}

const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

fn obj(place: DVec3) -> Vec<u8> {
    let mut text = String::new();
    for DVec3 { x, y, z } in corners(place) {
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    for [a, b, c] in FACES {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
    }
    text.into_bytes()
}

fn stl(place: DVec3) -> Vec<u8> {
    let mut text = "solid far\n".to_owned();
    for face in FACES {
        text += "facet normal 0 0 0\nouter loop\n";
        for DVec3 { x, y, z } in face.map(|corner| corners(place)[corner]) {
            writeln!(text, "vertex {x} {y} {z}").unwrap();
        }
        text += "endloop\nendfacet\n";
    }
    (text + "endsolid far\n").into_bytes()
}

fn ply(place: DVec3) -> Vec<u8> {
    let mut text =
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n\
                    element face 4\nproperty list uchar int vertex_indices\nend_header\n"
            .to_owned();
    for DVec3 { x, y, z } in corners(place) {
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    for [a, b, c] in FACES {
        writeln!(text, "3 {a} {b} {c}").unwrap();
    }
    text.into_bytes()
}

fn gltf(place: DVec3) -> Vec<u8> {
    use base64::Engine as _;
    let mut buffer = Vec::new();
    for corner in corners(DVec3::ZERO) {
        buffer.extend(corner.as_vec3().to_array().into_iter().flat_map(f32::to_le_bytes));
    }
    buffer.extend(
        FACES
            .as_flattened()
            .iter()
            .flat_map(|&corner| (corner as u16).to_le_bytes()),
    );
    let data = base64::prelude::BASE64_STANDARD.encode(&buffer);
    // Single precision holds neither the sum of the two nodes' places nor the tetrahedron there.
    let [x, y, z] = place.to_array();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"translation":[{x},{y},{z}],"children":[1]}},{{"translation":[0.03125,0,0],"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "buffers":[{{"uri":"data:application/octet-stream;base64,{data}","byteLength":72}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":24}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
        {{"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}}]}}"#
    )
    .into_bytes()
}

/// The place in the file of each vertex of a mesh in metres with +Y up.
fn in_file(read: &ImportedMesh) -> Vec<DVec3> {
    let positions = read.mesh.positions().iter();
    positions
        .map(|position| position.as_dvec3() + read.origin_in_file)
        .collect()
}

#[test]
fn every_format_keeps_shape_and_place_a_thousand_kilometres_away() {
    let place = DVec3::new(1e6, -2e6, 3.5e5);
    for (format, write, offset) in [
        ("OBJ", obj as fn(DVec3) -> Vec<u8>, 0.0),
        ("STL", stl, 0.0),
        ("PLY", ply, 0.0),
        ("glTF", gltf, 0.03125),
    ] {
        let found = read_mesh(&write(place), Import::METRES, LIMITS).unwrap();
        assert!(
            (volume(&found) - 1e-3 / 6.0).abs() < 1e-10,
            "{format}: {}",
            volume(&found)
        );
        let expected = corners(place + DVec3::X * offset);
        for vertex in in_file(&found) {
            let nearest = expected
                .map(|corner| corner.distance(vertex))
                .into_iter()
                .fold(f64::MAX, f64::min);
            assert!(nearest < 1e-8, "{format}: {nearest} m");
        }
        let [warning] = &found.warnings[..] else {
            panic!("{format}: {:?}", found.warnings)
        };
        assert!(warning.starts_with("the mesh is 2263"), "{warning}");
    }
}

#[test]
fn origin_is_the_centre_of_the_box_in_the_units_and_axes_of_the_file() {
    let millimetres = Import {
        up_axis: UpAxis::Z,
        ..Import::with_unit(1e-3)
    };
    let far = Polygons::cube(DVec3::new(50_000.0, 0.0, 250.0), 100.0);
    let found = read_mesh(far.obj().as_bytes(), millimetres, LIMITS).unwrap();
    assert_eq!(found.origin_in_file, DVec3::new(50_000.0, 0.0, 250.0));
    for position in found.mesh.positions() {
        assert!((position.abs() - Vec3::splat(0.05)).length() < 1e-7, "{position}");
    }
}

#[test]
fn mesh_near_the_origin_of_its_file_stays_there() {
    for (distance, moved) in [(9.99, 0.0), (10.01, 10.01)] {
        let found = read(&Polygons::cube(DVec3::Z * distance, 0.1).obj());
        assert!((found.origin_in_file - DVec3::Z * moved).length() < 1e-12);
        assert_eq!(found.warnings.len(), usize::from(moved > 0.0));
    }
    // What a mesh does not use does not count.
    let unused = format!("v 5000 0 0\n{}", Polygons::cube(DVec3::ZERO, 0.1).obj());
    assert_eq!(read(&unused).origin_in_file, DVec3::ZERO);
}

#[test]
fn concave_polygon_is_split_exactly_far_away() {
    let outline = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]];
    let face = outline.map(|[x, y]| DVec3::new(1e7 + 0.01 * f64::from(x), 0.01 * f64::from(y), 0.0));
    let found = read(&Polygons(vec![face.to_vec()]).obj());
    assert!((found.mesh.area() - 7e-4).abs() < 1e-9, "{}", found.mesh.area());
}
