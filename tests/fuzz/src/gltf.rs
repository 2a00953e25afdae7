//! glTF files in a form that a fuzzer can change: text, a zero byte, and the binary chunk, without lengths.

use std::borrow::Cow;

use gltf::binary::{Glb, Header};
use grasp_import::MeshLimits;

/// Bounds of meshes. Files may show a mesh any number of times, and leave out numbers that are all zero, up to these bounds;
/// those of a server would allow them some ten megabytes.
pub const GLTF_LIMITS: MeshLimits = MeshLimits {
    bytes: 64 << 20,
    vertices: 3000,
    triangles: 1000,
};

/// Words of documents, besides those of seeds.
pub const GLTF_WORDS: &str = r#""sparse": "indices": "values": "normalized":true "byteStride":16 "extensionsRequired": "extensionsUsed":
    "EXT_mesh_gpu_instancing": "attributes": "TRANSLATION": "ROTATION": "SCALE": "MSFT_lod": "ids": "KHR_mesh_quantization"
    "targets": "weights": "matrix": "scale": "rotation": "translation": "skin": "skins": "joints": "inverseBindMatrices":
    "JOINTS_0": "WEIGHTS_0": "JOINTS_1": "WEIGHTS_1": "mode":5 "componentType":5121 "componentType":5123 "type":"VEC4" "type":"MAT4"
    "visible":false "KHR_node_visibility": "alphaMode":"BLEND" "collision" "lod1" null true {} [] 1e39 -1 4294967295 0.5
    data:application/octet-stream;base64,"#;

/// The file of an input. Those that start as files do are files already.
pub fn file(input: &[u8]) -> Cow<'_, [u8]> {
    if input.starts_with(b"glTF") || input.starts_with(b"[") {
        return input.into();
    }
    let Some(end) = input.iter().position(|&byte| byte == 0) else {
        return input.into();
    };
    let glb = Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            length: 0,
        },
        json: input[..end].into(),
        bin: Some(input[end + 1..].into()),
    };
    glb.to_vec().expect("writing to memory cannot fail").into()
}

/// The input of a file in GLB.
pub fn parts(file: &[u8]) -> Vec<u8> {
    let glb = Glb::from_slice(file).expect("the file is sound");
    [&*glb.json, &[0], &*glb.bin.unwrap_or_default()].concat()
}
