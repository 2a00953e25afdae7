//! glTF, as JSON and as GLB.

use base64::{Engine as _, prelude::BASE64_STANDARD};

use crate::tests::{LIMITS, Ring, assert_mentioned, corners, floats, glb, message, messages, read, volume};

const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
const POSITIONS: &str =
    r#"{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}"#;

/// A scene with a strip of four vertices.
struct Strip<'a> {
    /// Members of the mesh.
    mesh: &'a str,
    /// More members of the primitive.
    primitive: &'a str,
    accessors: &'a str,
    /// Offset and length of each view, and more members of them.
    views: &'a [(usize, usize)],
    stride: &'a str,
    buffer: Vec<u8>,
}

impl Default for Strip<'_> {
    fn default() -> Self {
        Self {
            mesh: "",
            primitive: r#""mode":5"#,
            accessors: POSITIONS,
            views: &[(0, 48)],
            stride: "",
            buffer: floats(CORNERS.as_flattened()),
        }
    }
}

impl Strip<'_> {
    fn glb(&self) -> Vec<u8> {
        let stride = self.stride;
        let views = self.views.iter().map(|(offset, length)| {
            format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}{stride}}}"#)
        });
        let views: Vec<String> = views.collect();
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],
            "meshes":[{{{}"primitives":[{{"attributes":{{"POSITION":0}},{}}}]}}],
            "accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}}"#,
            self.mesh,
            self.primitive,
            self.accessors,
            views.join(","),
            self.buffer.len()
        );
        glb(&json, &self.buffer)
    }

    /// The area of the mesh in the plane z = 0, signed by its winding.
    fn signed_area(&self) -> f32 {
        let triangles = corners(&read(self.glb()).unwrap()).into_iter();
        triangles.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).z).sum()
    }
}

#[test]
fn nodes_place_scale_and_turn_meshes() {
    let ring = Ring::new();
    let place = r#","scale":[2,2,2],"rotation":[0.70710677,0,0,0.70710677],"translation":[1,0,0]"#;
    let scaled = read(ring.glb(place)).unwrap();
    assert!((volume(&scaled) / (8.0 * Ring::volume()) - 1.0).abs() < 1e-5);
    let thickness = |axis: usize| {
        let along = scaled.mesh.positions().iter().map(|position| position[axis]);
        along.clone().fold(f32::MIN, f32::max) - along.fold(f32::MAX, f32::min)
    };
    // The ring's axis was +Y, and is +Z.
    assert!((thickness(2) - 0.04).abs() < 1e-5 && (thickness(1) - 0.16).abs() < 1e-5);
    let names: Vec<&str> = scaled.groups.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["ring", "steel", "torus"]);
}

#[test]
fn mirrored_nodes_show_their_other_side() {
    // The ring is the same in a mirror.
    let mirrored = read(Ring::new().glb(r#","scale":[-1,1,1]"#)).unwrap();
    assert!((volume(&mirrored) / Ring::volume() - 1.0).abs() < 1e-5);
    assert_eq!(mirrored.warnings, [""; 0]);
}

#[test]
fn buffers_may_be_data_urls_but_no_files() {
    let ring = Ring::new();
    let encoded = BASE64_STANDARD.encode(ring.buffer());
    let uri = format!(r#","uri":"data:application/octet-stream;base64,{encoded}""#);
    let inside = read(ring.gltf_json("", &uri)).unwrap();
    assert!((volume(&inside) / Ring::volume() - 1.0).abs() < 1e-5);
    let outside = message(ring.gltf_json("", r#","uri":"ring.bin""#));
    assert_eq!(
        outside,
        "buffers[0]: is in another file; embed the buffers, or send a GLB"
    );
}

#[test]
fn strips_and_fans_are_wound_alike() {
    assert_eq!(Strip::default().signed_area(), 1.0);
    let [a, b, c, d] = CORNERS;
    let fan = Strip {
        primitive: r#""mode":6"#,
        buffer: floats([a, b, d, c].as_flattened()),
        ..Strip::default()
    };
    assert_eq!(fan.signed_area(), 1.0);
}

#[test]
fn integers_stand_for_fractions_or_for_themselves() {
    for (normalized, side) in [(true, 1.0), (false, 255.0)] {
        let accessor = format!(
            r#"{{"bufferView":0,"componentType":5121,"count":4,"type":"VEC3","normalized":{normalized},"min":[0,0,0],"max":[255,255,0]}}"#
        );
        // Each vertex is padded to four bytes.
        let padded = CORNERS
            .iter()
            .flat_map(|&[x, y, z]| [x * 255.0, y * 255.0, z, 9.0]);
        let strip = Strip {
            accessors: &accessor,
            views: &[(0, 16)],
            stride: r#","byteStride":4"#,
            buffer: padded.map(|number| number as u8).collect(),
            ..Strip::default()
        };
        assert_eq!(strip.signed_area(), side * side);
    }
}

#[test]
fn sparse_accessors_replace_single_vertices() {
    let mut buffer = floats(CORNERS.as_flattened());
    // The last corner moves from (1, 1) to (2, 2).
    buffer.extend([3, 0, 0, 0]);
    buffer.extend(floats(&[2.0, 2.0, 0.0]));
    let accessor = POSITIONS.replace(
        r#""min""#,
        r#""sparse":{"count":1,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":2}},"min""#,
    );
    let strip = Strip {
        accessors: &accessor,
        views: &[(0, 48), (48, 1), (52, 12)],
        buffer,
        ..Strip::default()
    };
    assert_eq!(strip.signed_area(), 2.0);
}

#[test]
fn morph_targets_count_by_their_default_weights() {
    // At full weight, the square is twice as wide.
    let wider = CORNERS.map(|[x, _, _]| [x, 0.0, 0.0]);
    let accessors = format!("{POSITIONS},{}", POSITIONS.replace("View\":0", "View\":1"));
    for (weights, area) in [("[1]", 2.0), ("[0.5]", 1.5), ("[0]", 1.0)] {
        let strip = Strip {
            mesh: &format!(r#""weights":{weights},"#),
            primitive: r#""mode":5,"targets":[{"POSITION":1}]"#,
            accessors: &accessors,
            views: &[(0, 48), (48, 48)],
            buffer: [floats(CORNERS.as_flattened()), floats(wider.as_flattened())].concat(),
            ..Strip::default()
        };
        assert_eq!(strip.signed_area(), area, "{weights}");
    }
}

#[test]
fn skins_are_at_rest_as_their_joints_are() {
    let mut buffer = floats(CORNERS.as_flattened());
    buffer.extend([0, 1, 0, 0].repeat(4));
    // All of the first joint for the lower corners, half and half for the upper ones.
    for shares in [[1.0, 0.0], [1.0, 0.0], [0.5, 0.5], [0.5, 0.5]] {
        buffer.extend(floats(&[shares[0], shares[1], 0.0, 0.0]));
    }
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],
        "nodes":[{{"mesh":0,"skin":0,"translation":[9,9,9]}},{{"children":[2]}},{{"translation":[0,2,0]}}],
        "skins":[{{"joints":[1,2]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2}},"mode":5}}]}}],
        "accessors":[{POSITIONS},{{"bufferView":1,"componentType":5121,"count":4,"type":"VEC4"}},
        {{"bufferView":2,"componentType":5126,"count":4,"type":"VEC4"}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":16}},
        {{"buffer":0,"byteOffset":64,"byteLength":64}}],"buffers":[{{"byteLength":128}}]}}"#
    );
    // The upper corners rise by half of two metres; the node's own place does not count.
    let found = read(glb(&json, &buffer)).unwrap();
    assert_eq!((found.mesh.area(), found.mesh.aabb().extents().y), (2.0, 2.0));
}

#[test]
fn unreadable_content_is_named() {
    let ring = Ring::new();
    let json = ring.gltf_json("", "");
    let required = |extension: &str| {
        format!(r#""extensionsUsed":["{extension}"],"extensionsRequired":["{extension}"],"asset""#)
    };
    let [draco, meshopt, secret] = [
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "ACME_secret",
    ]
    .map(required);
    for (from, to, expected) in [
        (r#""asset""#, draco.as_str(), "compressed by Draco"),
        (r#""asset""#, meshopt.as_str(), "compressed by meshopt"),
        (
            r#""asset""#,
            secret.as_str(),
            "extension \"ACME_secret\": is required",
        ),
        ("576", "577", "reach beyond its buffer"),
        ("576", "4294967295", "4294967295 vertices; at most 300000"),
        ("576", "9", "indices: vertex"),
        (
            r#""indices":1"#,
            r#""indices":7"#,
            "refers to something that does not exist",
        ),
        (
            r#"Offset":0"#,
            r#"Offset":18446744073709551610"#,
            "reach beyond its buffer",
        ),
        (r#""POSITION":0"#, r#""NORMAL":0"#, "is missing"),
    ] {
        let changed = glb(&json.replace(from, to), &ring.buffer());
        assert_mentioned(&messages(read(changed)), &[expected]);
    }
    for (bytes, expected) in [
        (glb(&json, &[0; 8]), "claims 20736 bytes and has 8"),
        (ring.glb("")[..500].to_vec(), "it is cut off or damaged"),
        (b"glTF\x02\0\0\0\x05\0\0\0".to_vec(), "claims 5 bytes"),
        (b"glTF\x01\0\0\0\x14\0\0\0".to_vec(), "has version 1"),
    ] {
        assert_mentioned(&messages(read(bytes)), &[expected]);
    }
    assert!(message(r#"{"asset":{"version":"2.0"}}"#).contains("no triangles"));
}

#[test]
fn nodes_in_a_circle_end() {
    let json = Ring::new().gltf_json(r#","children":[0]"#, "");
    let found = read(glb(&json, &Ring::new().buffer())).unwrap();
    assert!((volume(&found) / Ring::volume() - 1.0).abs() < 1e-5);
}

#[test]
fn scenes_that_repeat_themselves_end() {
    // Thousands of nodes show a mesh of thousands of primitives, by name and of points.
    let many = |count: usize, part: &str| vec![part; count].join(",");
    let scene = |primitive: &str, name: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{}],"meshes":[{{"name":"{name}","primitives":[{}]}}],
            "accessors":[{{"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[0,0,0],
            "sparse":{{"count":1,"indices":{{"bufferView":0,"componentType":5121}},"values":{{"bufferView":0}}}}}}],
            "bufferViews":[{{"buffer":0,"byteLength":64}}],"buffers":[{{"byteLength":64}}]}}"#,
            many(20_000, r#"{"mesh":0}"#),
            many(20_000, primitive)
        )
    };
    let points = scene(r#"{"attributes":{"POSITION":0},"mode":0}"#, "points");
    assert!(message(glb(&points, &[0; 64])).contains("too often"));
    let named = scene(r#"{"attributes":{"POSITION":0}}"#, &"n".repeat(1 << 20));
    assert!(message(glb(&named, &[0; 64])).contains("at most 300000"));
    let joints = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0,"skin":0}],"skins":[{"joints":[0],"inverseBindMatrices":1}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"accessors":[
        {"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[0,0,0],
         "sparse":{"count":1,"indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0}}},
        {"componentType":5126,"count":4294967296,"type":"MAT4",
         "sparse":{"count":1,"indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0}}}],
        "bufferViews":[{"buffer":0,"byteLength":64}],"buffers":[{"byteLength":64}]}"#;
    assert!(message(glb(joints, &[0; 64])).contains("has no triangles"));
    // Each takes a hundred times its two bytes.
    let nodes = many(200_000, "{}");
    let nodes = format!(r#"{{"asset":{{"version":"2.0"}},"nodes":[{nodes}]}}"#);
    assert!(message(&nodes).contains("200002 JSON objects; at most 65536"));
}

#[test]
fn every_triangle_may_have_vertices_of_its_own() {
    let corners: Vec<[f64; 3]> = Ring::new().corners().flatten().collect();
    let buffer = floats(corners.as_flattened());
    let scene = Strip {
        primitive: r#""mode":4"#,
        accessors: &POSITIONS.replace(r#""count":4"#, r#""count":3456"#),
        views: &[(0, buffer.len())],
        buffer,
        ..Strip::default()
    };
    let limits = crate::MeshLimits {
        vertices: 576,
        triangles: 1152,
        ..LIMITS
    };
    let found = crate::read_mesh(&scene.glb(), crate::Import::METRES, limits).unwrap();
    assert!((volume(&found) / Ring::volume() - 1.0).abs() < 1e-5);
}

#[test]
fn positions_in_an_absent_accessor_are_refused_by_the_mesh() {
    let json = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":5}}]}]}"#;
    assert_mentioned(
        &[message(json.as_bytes())],
        &["meshes[0]", "accessor 5; there are 0 accessors"],
    );
}
