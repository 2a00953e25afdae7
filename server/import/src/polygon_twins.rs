//! Polygons that occur more than once: their triangles only match if they are split in the same way.

use crate::{raw::RawMesh, runs::RawFace};

/// A polygon of more than three corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Polygon {
    /// Equal for equal corners in any order.
    hash: u64,
    corners: usize,
    /// Where its corners begin among those of all faces, and its triangles among all triangles.
    first_corner: usize,
    first_triangle: usize,
}

/// Gives polygons that repeat an earlier one, from any corner and in either winding, the triangles of that one.
/// `welded` has the vertex of each of the file's, and `triangles` those of all faces, welded.
pub(crate) fn split_alike(raw: &RawMesh, welded: &[u32], triangles: &mut [[u32; 3]]) {
    let mut polygons = Vec::new();
    let (mut first_corner, mut first_triangle) = (0, 0);
    for RawFace { corners, .. } in raw.faces.iter() {
        if corners > 3 {
            let vertices = raw.corners[first_corner..first_corner + corners].iter();
            let hash = vertices.fold(0_u64, |sum, &vertex| {
                sum.wrapping_add(scattered(welded[vertex as usize]))
            });
            polygons.push(Polygon {
                hash,
                corners,
                first_corner,
                first_triangle,
            });
        }
        first_corner += corners;
        first_triangle += corners - 2;
    }
    polygons.sort_unstable();
    let cycle = |polygon: &Polygon| {
        let corners = &raw.corners[polygon.first_corner..][..polygon.corners];
        corners.iter().map(|&vertex| welded[vertex as usize])
    };
    for alike in polygons.chunk_by(|a, b| (a.hash, a.corners) == (b.hash, b.corners)) {
        let Some((first, others)) = alike.split_first() else {
            continue;
        };
        for other in others {
            let Some(start) = cycle(first)
                .next()
                .and_then(|start| cycle(other).position(|corner| corner == start))
            else {
                continue;
            };
            let from_start = cycle(other).cycle().skip(start).take(other.corners);
            let backward = cycle(other)
                .rev()
                .cycle()
                .skip(other.corners - 1 - start)
                .take(other.corners);
            let is_same = cycle(first).eq(from_start);
            if is_same || cycle(first).eq(backward) {
                for offset in 0..first.corners - 2 {
                    let [a, b, c] = triangles[first.first_triangle + offset];
                    triangles[other.first_triangle + offset] = if is_same { [a, b, c] } else { [a, c, b] };
                }
            }
        }
    }
}

/// A number whose bits all depend on a vertex: the finaliser of `SplitMix64`.
fn scattered(vertex: u32) -> u64 {
    let number = u64::from(vertex) + 0x9e37_79b9_7f4a_7c15;
    let number = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let number = (number ^ (number >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    number ^ (number >> 31)
}
