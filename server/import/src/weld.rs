//! Welding of vertices, and which triangles are worth keeping.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::Import;

/// Vertices welded between two checks whether to stop.
const VERTICES_PER_CHECK: usize = 4096;

/// Scales positions to metres, turns +Y up, rounds to single precision and merges equal ones; returns them with the new index of
/// each vertex.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn weld(
    positions: impl Iterator<Item = DVec3>,
    import: Import,
    stop: Stop<'_>,
) -> Result<(Vec<Vec3>, Vec<u32>), Stopped> {
    let mut known = HashMap::new();
    let mut welded = Vec::new();
    let indices = positions
        .enumerate()
        .map(|(number, position)| {
            stop.check_every(VERTICES_PER_CHECK, number)?;
            // Adding zero turns −0 into 0, so that equal numbers have equal bits.
            let position = import.metres_from_file(position).as_vec3() + Vec3::ZERO;
            Ok(*known
                .entry(position.to_array().map(f32::to_bits))
                .or_insert_with(|| {
                    welded.push(position);
                    welded.len() as u32 - 1
                }))
        })
        .collect::<Result<_, Stopped>>()?;
    Ok((welded, indices))
}

pub(crate) fn has_repeated_corner([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// Whether [`TriangleMesh`](grasp_synthesis::geometry::mesh::TriangleMesh) accepts the triangle.
pub(crate) fn has_area(positions: &[Vec3], triangle: [u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
    (b - a).cross(c - a).length().is_normal()
}
