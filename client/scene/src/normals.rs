//! Smooth vertex normals that respect creases.

use std::collections::HashMap;

use glam::Vec3;

use crate::scene::Part;

/// The unit normals at the corners of every triangle of a part: the mean of the normals of all triangles at the corner's
/// position that are tilted by no more than the crease angle, weighted by their angle there (Thürmer and Wüthrich 1998),
/// which makes them independent of the tessellation.
pub(crate) fn corner_normals(part: &Part) -> Vec<[Vec3; 3]> {
    let places = welded(&part.positions);
    let corners_of = |triangle: &[u32; 3]| triangle.map(|v| part.positions[v as usize]);
    let faces: Vec<Vec3> = part
        .triangles
        .iter()
        .map(|triangle| face_normal(corners_of(triangle)))
        .collect();
    if part.crease_angle <= 0.0 {
        return faces.iter().map(|&normal| [normal; 3]).collect();
    }

    // The corners at each position, as one list with offsets.
    let mut offsets = vec![0_usize; places.count + 1];
    for vertex in part.triangles.iter().flatten() {
        offsets[places.of_vertex[*vertex as usize] + 1] += 1;
    }
    for i in 0..places.count {
        offsets[i + 1] += offsets[i];
    }
    let mut next = offsets.clone();
    let mut around = vec![(0_usize, 0.0_f32); part.triangles.len() * 3];
    for (index, triangle) in part.triangles.iter().enumerate() {
        let corners = corners_of(triangle);
        for (corner, &vertex) in triangle.iter().enumerate() {
            let slot = &mut next[places.of_vertex[vertex as usize]];
            around[*slot] = (index, corner_angle(corners, corner));
            *slot += 1;
        }
    }

    let cosine = part.crease_angle.cos();
    part.triangles
        .iter()
        .zip(&faces)
        .map(|(triangle, &face)| {
            triangle.map(|vertex| {
                let place = places.of_vertex[vertex as usize];
                around[offsets[place]..offsets[place + 1]]
                    .iter()
                    .filter(|(other, _)| faces[*other].dot(face) >= cosine)
                    .map(|&(other, angle)| faces[other] * angle)
                    .sum::<Vec3>()
                    .normalize_or(face)
            })
        })
        .collect()
}

/// The outward unit normal of a triangle; +Y for one without area.
pub(crate) fn face_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    // Scaled first: the product of two tiny edges would underflow.
    let scale = (b - a).abs().max_element().max((c - a).abs().max_element());
    if scale > 0.0 {
        ((b - a) / scale).cross((c - a) / scale).normalize_or(Vec3::Y)
    } else {
        Vec3::Y
    }
}

/// The angle of a triangle at one of its corners, in radians; 0 where an edge has no length.
fn corner_angle(corners: [Vec3; 3], corner: usize) -> f32 {
    let at = corners[corner];
    let one = (corners[(corner + 1) % 3] - at).normalize_or_zero();
    let other = (corners[(corner + 2) % 3] - at).normalize_or_zero();
    if one == Vec3::ZERO || other == Vec3::ZERO {
        return 0.0;
    }
    one.dot(other).clamp(-1.0, 1.0).acos()
}

/// Vertices at the same position.
struct Places {
    of_vertex: Vec<usize>,
    count: usize,
}

fn welded(positions: &[Vec3]) -> Places {
    let mut known = HashMap::with_capacity(positions.len());
    let of_vertex = positions
        .iter()
        .map(|position| {
            let next = known.len();
            // Adding zero makes -0 and 0 equal in bits.
            let key = (*position + Vec3::ZERO).to_array().map(f32::to_bits);
            *known.entry(key).or_insert(next)
        })
        .collect();
    Places {
        of_vertex,
        count: known.len(),
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;
    use crate::primitives;

    #[test]
    fn sphere_has_radial_normals() {
        let part = primitives::sphere("ball", Vec3::new(0.1, 0.2, 0.3), 0.05, [1.0; 4]);
        for (triangle, normals) in part.triangles.iter().zip(corner_normals(&part)) {
            for (&vertex, normal) in triangle.iter().zip(normals) {
                assert!((normal.length() - 1.0).abs() < 1e-5);
                let exact = (part.positions[vertex as usize] - Vec3::new(0.1, 0.2, 0.3)) / 0.05;
                assert!(normal.dot(exact) > 0.999, "{normal} is not {exact}");
            }
        }
    }

    #[test]
    fn creases_split_and_smooth_edges_join() {
        // Two triangles that meet at a right angle along the x axis; the second has separate vertices.
        let mut part = Part::new(
            "fold",
            vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ZERO, Vec3::X, Vec3::NEG_Z],
            vec![[0, 1, 2], [4, 3, 5]],
            [1.0; 4],
        );
        part.crease_angle = FRAC_PI_2 * 0.9;
        let sharp = corner_normals(&part);
        assert_eq!(sharp[0], [Vec3::Z; 3]);
        assert!(sharp[1].iter().all(|n| n.distance(Vec3::NEG_Y) < 1e-6));

        part.crease_angle = FRAC_PI_2 * 1.1;
        let smooth = corner_normals(&part);
        assert!(
            smooth[0][0].distance(smooth[1][1]) < 1e-6,
            "welded places share normals"
        );
        assert!(smooth[0][0].distance(Vec3::new(0.0, -0.5_f32.sqrt(), 0.5_f32.sqrt())) < 1e-5);
        assert_eq!(smooth[0][2], Vec3::Z);

        part.crease_angle = 0.0;
        assert_eq!(corner_normals(&part)[0], [Vec3::Z; 3]);
    }
}
