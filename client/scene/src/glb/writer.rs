//! The GLB container: binary buffer, accessors and chunks (Khronos glTF 2.0 specification, 3.6 and 4.4).

use glam::{Mat4, Quat, Vec3};
use serde_json::{Value, json};

/// `glTF` in little-endian.
const MAGIC: u32 = 0x4654_6C67;
const VERSION: u32 = 2;
/// Chunk types, 4.4.3.2 and 4.4.3.3 of the specification.
const JSON_CHUNK: u32 = 0x4E4F_534A;
const BIN_CHUNK: u32 = 0x004E_4942;

/// Component types and buffer targets of the specification.
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Builds a GLB file: every method that takes data appends it to the buffer and returns the index of its accessor;
/// [`GlbWriter::finish`] adds the rest of the document.
#[derive(Debug, Default)]
pub struct GlbWriter {
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl GlbWriter {
    /// Vertex positions, with the bounds that the specification requires.
    pub fn positions(&mut self, positions: &[Vec3]) -> usize {
        let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let index = self.vectors(positions);
        self.accessors[index]["min"] = json!(low.to_array());
        self.accessors[index]["max"] = json!(high.to_array());
        index
    }

    /// Vertex normals or colours.
    pub fn vectors(&mut self, vectors: &[Vec3]) -> usize {
        let bytes = vectors.iter().flat_map(Vec3::to_array).flat_map(f32::to_le_bytes);
        self.add(bytes, vectors.len(), FLOAT, "VEC3", Some(ARRAY_BUFFER))
    }

    /// The joints that move each vertex.
    pub fn joints(&mut self, joints: &[[u8; 4]]) -> usize {
        let bytes = joints.iter().flatten().copied();
        self.add(bytes, joints.len(), UNSIGNED_BYTE, "VEC4", Some(ARRAY_BUFFER))
    }

    /// The weights of those joints.
    pub fn weights(&mut self, weights: &[[f32; 4]]) -> usize {
        let bytes = weights.iter().flatten().copied().flat_map(f32::to_le_bytes);
        self.add(bytes, weights.len(), FLOAT, "VEC4", Some(ARRAY_BUFFER))
    }

    /// Corners of triangles in a mesh of up to 65535 vertices.
    pub fn short_indices(&mut self, indices: &[u16]) -> usize {
        let bytes = indices.iter().flat_map(|index| index.to_le_bytes());
        let target = Some(ELEMENT_ARRAY_BUFFER);
        self.add(bytes, indices.len(), UNSIGNED_SHORT, "SCALAR", target)
    }

    /// Corners of triangles.
    pub fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes = indices.iter().flat_map(|index| index.to_le_bytes());
        let target = Some(ELEMENT_ARRAY_BUFFER);
        self.add(bytes, indices.len(), UNSIGNED_INT, "SCALAR", target)
    }

    /// Inverse bind matrices of a skin.
    pub fn matrices(&mut self, matrices: &[Mat4]) -> usize {
        let bytes = matrices
            .iter()
            .flat_map(Mat4::to_cols_array)
            .flat_map(f32::to_le_bytes);
        self.add(bytes, matrices.len(), FLOAT, "MAT4", None)
    }

    /// Times of an animation in seconds, rising, with the bounds that the specification requires.
    pub fn times(&mut self, times: &[f32]) -> usize {
        let bytes = times.iter().flat_map(|time| time.to_le_bytes());
        let index = self.add(bytes, times.len(), FLOAT, "SCALAR", None);
        self.accessors[index]["min"] = json!(times.first().as_slice());
        self.accessors[index]["max"] = json!(times.last().as_slice());
        index
    }

    /// Translations or scales at the times of an animation.
    pub fn vector_keys(&mut self, vectors: &[Vec3]) -> usize {
        let bytes = vectors.iter().flat_map(Vec3::to_array).flat_map(f32::to_le_bytes);
        self.add(bytes, vectors.len(), FLOAT, "VEC3", None)
    }

    /// Rotations at the times of an animation: unit quaternions.
    pub fn rotation_keys(&mut self, rotations: &[Quat]) -> usize {
        let bytes = rotations
            .iter()
            .flat_map(Quat::to_array)
            .flat_map(f32::to_le_bytes);
        self.add(bytes, rotations.len(), FLOAT, "VEC4", None)
    }

    fn add(
        &mut self,
        bytes: impl Iterator<Item = u8>,
        count: usize,
        component_type: u32,
        element_type: &str,
        target: Option<u32>,
    ) -> usize {
        let start = self.buffer.len();
        self.buffer.extend(bytes);
        let mut view = json!({
            "buffer": 0, "byteOffset": start, "byteLength": self.buffer.len() - start,
        });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        // The next view must be aligned to the size of its components, 4 bytes at most.
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        self.accessors.push(json!({
            "bufferView": self.views.len(), "componentType": component_type, "count": count, "type": element_type,
        }));
        self.views.push(view);
        self.accessors.len() - 1
    }

    /// The file: `document` with accessors, buffer views and buffer added, and the binary chunk.
    ///
    /// # Panics
    /// The file exceeds 4 GiB.
    pub fn finish(self, mut document: Value) -> Vec<u8> {
        // The specification forbids empty arrays.
        if !self.accessors.is_empty() {
            document["accessors"] = self.accessors.into();
            document["bufferViews"] = self.views.into();
            document["buffers"] = json!([{ "byteLength": self.buffer.len() }]);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut chunks = vec![(JSON_CHUNK, text)];
        if !self.buffer.is_empty() {
            chunks.push((BIN_CHUNK, self.buffer));
        }
        let total = 12 + chunks.iter().map(|(_, data)| 8 + data.len()).sum::<usize>();
        let length = |bytes: usize| u32::try_from(bytes).expect("a GLB file is smaller than 4 GiB");
        let mut file = Vec::with_capacity(total);
        for word in [MAGIC, VERSION, length(total)] {
            file.extend(word.to_le_bytes());
        }
        for (kind, data) in chunks {
            file.extend(length(data.len()).to_le_bytes());
            file.extend(kind.to_le_bytes());
            file.extend(data);
        }
        file
    }
}
