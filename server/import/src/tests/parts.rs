//! Scenes of several parts: what is the object, and what is left out.

use glam::{DVec3, Vec3};

use crate::{
    Import, ImportError, ImportedMesh, read_mesh_until,
    tests::{LIMITS, Ring, assert_mentioned, floats, glb, message, messages, read, repair::Polygons, volume},
};
use grasp_synthesis::base::stop::Stop;

/// Two meshes of one ring each, "near" with the material "steel" and "far" with "air", and nodes that show them; `more` are other
/// members of the document.
fn scene(nodes: &[&str], more: &str) -> Vec<u8> {
    scene_with(nodes, more, &[0.0], "")
}

/// The same, with accessors of floats behind those of the ring, from 2 on, in a third view.
fn scene_with(nodes: &[&str], more: &str, numbers: &[f64], accessors: &str) -> Vec<u8> {
    let ring = Ring::new();
    let (vertices, indices) = (ring.positions.len(), 3 * ring.triangles.len());
    let lengths = [12 * vertices, 4 * indices, 4 * numbers.len()];
    let buffer = [ring.buffer(), floats(numbers)].concat();
    let view = |place: usize| {
        let (offset, length) = (lengths[..place].iter().sum::<usize>(), lengths[place]);
        format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#)
    };
    let primitive =
        |material: usize| format!(r#"{{"attributes":{{"POSITION":0}},"indices":1,"material":{material}}}"#);
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{}],
        "meshes":[{{"name":"near","primitives":[{}]}},{{"name":"far","primitives":[{}]}}],
        "materials":[{{"name":"steel"}},
          {{"name":"air","alphaMode":"BLEND","pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,0]}}}}],
        "accessors":[
          {{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3","min":[-1,-1,-1],"max":[1,1,1]}},
          {{"bufferView":1,"componentType":5125,"count":{indices},"type":"SCALAR"}}{accessors}],
        "bufferViews":[{},{},{}],"buffers":[{{"byteLength":{}}}]{more}}}"#,
        nodes.join(","),
        primitive(0),
        primitive(1),
        view(0),
        view(1),
        view(2),
        buffer.len()
    );
    glb(&json, &buffer)
}

fn only(bytes: &[u8], parts: &[&str]) -> Result<ImportedMesh, Vec<ImportError>> {
    let parts: Vec<String> = parts.iter().map(|&part| part.to_owned()).collect();
    read_mesh_until(bytes, Import::METRES, &parts, LIMITS, Stop::NEVER)
}

#[track_caller]
fn assert_rings(read: &ImportedMesh, expected: f64) {
    let rings = volume(read) / Ring::volume();
    assert!(
        (rings - expected).abs() < 1e-3,
        "{rings} rings: {:?}",
        read.warnings
    );
}

#[test]
fn instances_are_shown_where_their_attributes_say() {
    let node = |attributes: &str| {
        format!(
            r#"{{"mesh":0,"translation":[0,1,0],"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{{attributes}}}}}}}}}"#
        )
    };
    let accessor = |offset: usize, kind: &str| {
        format!(r#",{{"bufferView":2,"byteOffset":{offset},"componentType":5126,"count":3,"type":"{kind}"}}"#)
    };
    #[rustfmt::skip]
    let floats = [
        0.0, 0.0, 0.0,  0.2, 0.0, 0.0,  0.4, 0.0, 0.0,
        0.0, 0.0, 0.0, 1.0,  0.0, 0.0, 0.707_106_77, 0.707_106_77,  0.0, 0.0, 0.0, 1.0,
        1.0, 1.0, 1.0,  1.0, 1.0, 1.0,  2.0, 2.0, -2.0,
    ];
    let accessors = [accessor(0, "VEC3"), accessor(36, "VEC4"), accessor(84, "VEC3")].concat();
    for required in ["", r#","extensionsRequired":["EXT_mesh_gpu_instancing"]"#] {
        let more = format!(r#","extensionsUsed":["EXT_mesh_gpu_instancing"]{required}"#);
        let read_with = |attributes: &str| {
            let bytes = scene_with(&[&node(attributes)], &more, &floats, &accessors);
            read(&bytes).unwrap()
        };
        let moved = read_with(r#""TRANSLATION":2"#);
        assert_rings(&moved, 3.0);
        assert_mentioned(
            &moved.warnings,
            &["1 meshes that no node of the scene shows", "\"far\""],
        );
        assert_mentioned(&moved.warnings, &["3 parts are disconnected"]);
        let size = moved.mesh.aabb().extents();
        assert!(size.abs_diff_eq(Vec3::new(0.48, 0.02, 0.08), 1e-5), "{size}");
        assert!((moved.mesh.aabb().centre().y - 1.0).abs() < 1e-5);
        // The third is eight times as large and mirrored, and the second stands on its edge.
        let all = read_with(r#""TRANSLATION":2,"ROTATION":3,"SCALE":4,"_ID":2"#);
        assert_rings(&all, 10.0);
        let height = all.mesh.aabb().extents().y;
        assert!((height - 0.08).abs() < 1e-5, "{height}");
    }
    let wrong = |attributes: &str| message(scene_with(&[&node(attributes)], "", &floats, &accessors));
    assert!(wrong(r#""TRANSLATION":9"#).contains("accessors[9], which does not exist"));
    assert!(wrong(r#""TRANSLATION":2,"SCALE":1"#).contains("their numbers must be equal"));
    assert!(wrong(r#""TRANSLATION":3"#).starts_with("nodes[0]: "));
}

#[test]
fn unseen_parts_are_left_out_and_can_be_requested() {
    let hidden = r#","extensions":{"KHR_node_visibility":{"visible":false}}"#;
    let of_hubs = r#","extensions":{"MOZ_hubs_components":{"visible":{"visible":false}}}"#;
    let collider = r#","extensions":{"OMI_collider":{"collider":0}}"#;
    let colliders = r#","name":"Colliders""#;
    // The mesh and more members of a node, and those of one above it.
    for (name, mesh, members, above, why) in [
        ("ghost", 0, hidden, "", "hides"),
        ("ghost", 0, of_hubs, "", "hides"),
        ("ghost", 0, "", hidden, "hides"),
        ("lamp", 1, "", "", "transparent"),
        ("UCX_mug_01", 0, "", "", "for collisions"),
        ("mug_col", 0, "", "", "for collisions"),
        ("hull", 0, "", colliders, "for collisions"),
        ("hull", 0, collider, "", "for collisions"),
        ("mug_LOD1", 0, "", "", "lower levels"),
    ] {
        let apart = format!(r#"{{"translation":[1,0,0],"name":"{name}","mesh":{mesh}{members}}}"#);
        let above = format!(r#"{{"children":[1]{above}}}"#);
        let nodes = [r#"{"name":"mug","mesh":0}"#.to_owned(), apart, above];
        let nodes: Vec<&str> = nodes.iter().map(String::as_str).collect();
        let bytes = scene(&nodes, "");
        let found = read(&bytes).unwrap();
        assert_rings(&found, 1.0);
        assert_eq!((found.triangles_in_file, found.indices_in_file[0]), (2 * 1152, 0));
        assert_mentioned(&found.warnings, &["1152 triangles", why, name]);
        let requested = only(&bytes, &[name]).unwrap();
        assert_rings(&requested, 1.0);
        assert!((requested.mesh.aabb().centre().x - 1.0).abs() < 1e-4, "{name}");
        let counts = (requested.triangles_in_file, requested.indices_in_file[0]);
        assert_eq!(counts, (2 * 1152, 1152));
        assert_rings(&only(&bytes, &["mug", name]).unwrap(), 2.0);
    }
}

#[test]
fn visible_parts_are_all_there() {
    let nodes = [
        r#"{"name":"column","mesh":0,"extensions":{"KHR_node_visibility":{"visible":true}}}"#,
        r#"{"name":"Mug_NoCollision","mesh":0,"translation":[1,0,0]}"#,
        r#"{"name":"table_col","mesh":0,"translation":[2,0,0],"extensions":{"KHR_node_visibility":{}}}"#,
    ];
    let found = read(scene(&nodes, "")).unwrap();
    assert_rings(&found, 3.0);
    assert!(
        !found
            .warnings
            .iter()
            .any(|warning| warning.contains("name parts"))
    );
}

#[test]
fn of_levels_of_detail_the_finest_is_read() {
    // By the extension, in the scene or outside of it, below a node that is moved.
    for (scenes, depth) in [(r#","scenes":[{"nodes":[0]}]"#, 3.0), ("", 0.0)] {
        let nodes = [
            r#"{"children":[1],"translation":[0,0,3]}"#,
            r#"{"name":"fine","mesh":0,"extensions":{"MSFT_lod":{"ids":[2,3]}}}"#,
            r#"{"name":"coarse","mesh":0,"translation":[1,0,0]}"#,
            r#"{"name":"coarsest","children":[4]}"#,
            r#"{"name":"box","mesh":0,"translation":[2,0,0]}"#,
        ];
        let bytes = scene(&nodes, scenes);
        let found = read(&bytes).unwrap();
        assert_rings(&found, 1.0);
        assert_mentioned(
            &found.warnings,
            &["2304 triangles", "lower levels", "coarse", "box"],
        );
        let coarse = only(&bytes, &["coarse"]).unwrap().mesh.aabb().centre();
        assert!(coarse.abs_diff_eq(Vec3::new(1.0, 0.0, depth), 1e-4));
    }
    // By names, of which the lowest number that is there counts.
    for (names, expected) in [
        (["mug_LOD1", "mug_LOD2", "mug_LOD3"], 1.0),
        (["mug", "MUG_LOD1", "lid_LOD1"], 2.0),
        (["mug_LOD0", "lid_LOD0", "lid_LOD1"], 2.0),
        (["mug_LOD2", "lid_LOD1", "spoon"], 3.0),
    ] {
        let nodes = names.map(|name| {
            let place = name.len() + usize::from(name.starts_with('l'));
            format!(r#"{{"name":"{name}","mesh":0,"translation":[{place},0,0]}}"#)
        });
        let nodes: Vec<&str> = nodes.iter().map(String::as_str).collect();
        let found = read(scene(&nodes, ""));
        assert_rings(&found.unwrap(), expected);
    }
}

#[test]
fn a_file_of_nothing_but_helpers_is_an_object_and_one_of_hidden_parts_is_none() {
    let helpers = read(scene(&[r#"{"name":"UCX_mug","mesh":0}"#], "")).unwrap();
    assert_rings(&helpers, 1.0);
    assert_rings(&read(scene(&[r#"{"name":"glass","mesh":1}"#], "")).unwrap(), 1.0);
    let hidden = r#"{"name":"ghost","mesh":0,"extensions":{"KHR_node_visibility":{"visible":false}}}"#;
    let why = message(scene(&[hidden], ""));
    assert!(why.contains("hides") && why.contains("\"ghost\""), "{why}");
}

#[test]
fn names_that_the_file_lacks_are_refused() {
    let bytes = scene(&[r#"{"name":"mug","mesh":0}"#], "");
    let found = only(&bytes, &["mug", "lid"]);
    assert!(
        matches!(found, Err(ref errors) if matches!(errors[0], ImportError::NoSuchPart { place: 1, .. }))
    );
    assert_eq!(
        messages(found),
        [r#"is "lid", but the file has "mug", "near", "steel""#]
    );
    let nameless = messages(only(&Ring::new().stl_binary(), &["lid"]));
    assert_mentioned(&nameless, &["names no parts"]);
}

#[test]
fn extensions_that_may_change_the_shape_are_named() {
    let nodes = [r#"{"name":"mug","mesh":0}"#];
    let used = |extensions: &str| {
        let more = format!(r#","extensionsUsed":[{extensions}]"#);
        read(scene(&nodes, &more)).unwrap()
    };
    let odd = used(r#""ACME_displacement","KHR_materials_sheen","EXT_mesh_primitive_restart""#);
    assert_mentioned(&odd.warnings, &["\"ACME_displacement\"", "not read"]);
    assert_mentioned(&odd.warnings, &["\"EXT_mesh_primitive_restart\"", "not read"]);
    assert!(!odd.warnings.iter().any(|warning| warning.contains("sheen")));
    let plain = used(r#""KHR_lights_punctual","KHR_texture_transform","VRMC_vrm","KHR_node_visibility""#);
    assert_eq!(plain.warnings.len(), 1, "{:?}", plain.warnings);
}

#[test]
fn compressed_meshes_without_another_form_are_named_though_optional() {
    let ring = Ring::new();
    let json = ring.gltf_json("", "");
    let used = |extension: &str| {
        let more = format!(r#""extensionsUsed":["{extension}"],"asset""#);
        json.replace(r#""asset""#, &more)
    };
    let draco = used("KHR_draco_mesh_compression").replacen(r#""bufferView":0,"#, "", 1);
    let why = message(glb(&draco, &ring.buffer()));
    assert!(why.contains("compressed by Draco"), "{why}");
    // The positions are there, so the extension can be ignored.
    let fallback = read(glb(&used("KHR_draco_mesh_compression"), &ring.buffer())).unwrap();
    assert_eq!(fallback.warnings, [""; 0]);
    let empty = used("EXT_meshopt_compression").replace(r#""buffers":["#, r#""buffers":[{"byteLength":4},"#);
    assert!(message(glb(&empty, &ring.buffer())).contains("compressed by meshopt"));
}

#[test]
fn empty_scenes_say_what_they_have_instead() {
    let points = Ring::new().gltf_json("", "");
    let points = points.replace(r#""indices":1"#, r#""indices":1,"mode":0"#);
    let why = message(glb(&points, &Ring::new().buffer()));
    assert!(why.contains("1 primitives of points or lines"), "{why}");
    let nodes = [r#"{"name":"lamp"}"#, r#"{"name":"mug","mesh":0}"#];
    let why = message(scene(&nodes, r#","scenes":[{"nodes":[0]},{"nodes":[1]}]"#));
    assert!(why.contains("2 meshes that no node of the scene shows"), "{why}");
}

#[test]
fn groups_and_objects_of_obj_are_parts() {
    let cube = |at: f64| Polygons::cube(DVec3::X * at, 1.0).obj();
    // The material's name says nothing of the part. In the third, both names hold.
    let [first, second, third] = [0.0, 2.0, 4.0].map(cube);
    let text = format!("o Mug\nusemtl Collider\n{first}o UCX_Mug\n{second}g Mug_LOD1\n{third}");
    let found = read(&text).unwrap();
    assert!((volume(&found) - 1.0).abs() < 1e-6);
    assert_eq!(found.triangles_in_file, 36);
    assert!(found.indices_in_file.iter().copied().eq(0..12));
    let names: Vec<&str> = found.groups.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["Collider", "Mug"]);
    assert_mentioned(&found.warnings, &["UCX_Mug", "for collisions"]);
    let both = only(text.as_bytes(), &["Mug", "UCX_Mug"]).unwrap();
    assert!(both.indices_in_file.into_iter().eq(0..36));
}
