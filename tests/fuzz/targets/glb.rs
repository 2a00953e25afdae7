//! Meshes as glTF, in text and GLB.

#![no_main]

use base64::{Engine as _, prelude::BASE64_STANDARD};
use grasp_characters::ring::Ring;
use grasp_fuzz::{
    GLTF_LIMITS, GLTF_WORDS, LONGEST, Target, bounded_as_all, dense, dense_within, file, fuzz, grid, parts,
    words,
};
use grasp_import::{Import, read_mesh};
use grasp_server::fuzzing::MESH_LIMITS;

/// A tetrahedron with instances, a sparse accessor, a morph target, a strip and a node that is hidden.
const ODD: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1,2]}],
"extensionsUsed":["EXT_mesh_gpu_instancing","KHR_node_visibility"],
"nodes":[{"mesh":0,"scale":[1,2,1],"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":0}}}},
{"mesh":0,"matrix":[0.1,0,0,0,0,0.1,0,0,0,0,0.1,0,1,0,0,1]},{"mesh":0,"extensions":{"KHR_node_visibility":{"visible":false}}}],
"meshes":[{"weights":[0.5],"primitives":[{"mode":5,"attributes":{"POSITION":0},"targets":[{"POSITION":1}],"indices":2}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
{"componentType":5126,"count":4,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":1,"componentType":5121},
"values":{"bufferView":0}}},{"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":6}],"buffers":[{"byteLength":54}]}"#;

fn odd() -> Vec<u8> {
    let positions: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let positions = positions.iter().flat_map(|number| number.to_le_bytes());
    let numbers = [0].into_iter().chain(positions).chain([0, 1, 2, 3, 0, 1]);
    ODD.bytes().chain(numbers).collect()
}

fuzz!(Target {
    read: |input| {
        let limits = if input.len() > LONGEST {
            MESH_LIMITS
        } else {
            GLTF_LIMITS
        };
        let _ = read_mesh(&file(input), Import::METRES, limits);
    },
    seeds: || {
        let ring = Ring::at([0.0; 3], 3);
        let data = BASE64_STANDARD.encode(ring.buffer());
        let text = ring.gltf_json("", &format!(r#","uri":"data:;base64,{data}""#));
        vec![parts(&ring.glb("")), ring.glb(""), text.into_bytes(), odd()]
    },
    dense: || {
        let mut dense = bounded_as_all([
            grid().glb(""),
            dense(r#"{"asset":{"version":"2.0"},"extras":[0"#, b",0"),
            dense(r#"{"asset":{"version":"2.0"},"extensions":{"a":[0"#, b",0"),
            dense(r#"{"asset":{"version":"2.0"},"a":"#, b"["),
        ]);
        let start = r#"{"asset":{"version":"2.0"},"#;
        let text = |more: &str, part: &[u8], most| dense_within(&format!("{start}{more}"), part, most);
        dense.push((165, text(r#""nodes":[{}"#, b",{}", 65_000)));
        dense.push((9, text(r#""extensionsUsed":[""#, br#"","a"#, usize::MAX)));
        dense.push((6, text(r#""scenes":[{"nodes":[0"#, b",0", usize::MAX)));
        dense
    },
    longest: LONGEST,
    words: || words(GLTF_WORDS),
});
