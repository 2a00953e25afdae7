//! Welding of vertices, and which triangles are worth keeping.

use std::collections::HashMap;

use glam::Vec3;

use crate::Import;

/// Scales positions to metres, turns +Y up and merges equal ones; returns them with the new index of each vertex.
pub(crate) fn weld(coordinates: &[f32], import: Import) -> (Vec<Vec3>, Vec<u32>) {
    let mut known = HashMap::new();
    let mut positions = Vec::new();
    let indices = coordinates
        .as_chunks()
        .0
        .iter()
        .map(|&[x, y, z]: &[f32; 3]| {
            // Adding zero turns −0 into 0, so that equal numbers have equal bits.
            let position = import.metres_from_file(Vec3::new(x, y, z)) + Vec3::ZERO;
            *known
                .entry(position.to_array().map(f32::to_bits))
                .or_insert_with(|| {
                    positions.push(position);
                    positions.len() as u32 - 1
                })
        })
        .collect();
    (positions, indices)
}

pub(crate) fn has_repeated_corner([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// The same triangle, starting at its smallest index: equal for equal triangles of equal winding.
pub(crate) fn smallest_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// Whether [`TriangleMesh`](grasp_synthesis::geometry::mesh::TriangleMesh) accepts the triangle.
pub(crate) fn has_area(positions: &[Vec3], triangle: [u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
    (b - a).cross(c - a).length().is_normal()
}
