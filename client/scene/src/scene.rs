//! The content of a picture or a GLB file: parts with a colour and a finish.

use std::collections::HashMap;

use glam::Vec3;

/// Edges flatter than this are smoothed, in radians (40°): rounds tessellated curves, keeps the edges of boxes sharp.
const CREASE_ANGLE: f32 = 0.7;

/// Reflective finish of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Finish {
    /// Plastic with a soft highlight.
    #[default]
    Satin,
    /// Brushed metal: a strong highlight.
    Metal,
    /// Skin: light reaches a little past the terminator.
    Skin,
    /// Fabric: no highlight.
    Cloth,
    /// A contact or a force: evenly lit, and faintly visible through other parts.
    Marker,
}

/// A triangle mesh.
#[derive(Clone, Debug)]
pub struct Part {
    /// Name of the node in the GLB.
    pub name: String,
    /// Vertex positions in metres, in the scene's frame (+Y up).
    pub positions: Vec<Vec3>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Linear RGB, each 0 to 1.
    pub colour: Vec3,
    /// Linear RGB per vertex, overriding `colour`; empty: `colour` everywhere.
    pub vertex_colours: Vec<Vec3>,
    /// Whether all edges are smoothed, or only flat ones. Vertices at the same position count as one, which hides seams.
    pub is_smooth: bool,
    /// Finish.
    pub finish: Finish,
    /// The `extras` of the GLB node.
    pub extras: Option<serde_json::Value>,
}

impl Part {
    /// A part of one colour with sharp edges and the default finish.
    pub fn new(
        name: impl Into<String>,
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        colour: Vec3,
    ) -> Self {
        Self {
            name: name.into(),
            positions,
            triangles,
            colour,
            vertex_colours: Vec::new(),
            is_smooth: false,
            finish: Finish::default(),
            extras: None,
        }
    }

    /// The same part with another finish.
    #[must_use]
    pub(crate) fn with_finish(self, finish: Finish) -> Self {
        Self { finish, ..self }
    }

    /// Linear RGB at a vertex.
    pub(crate) fn vertex_colour(&self, vertex: u32) -> Vec3 {
        self.vertex_colours
            .get(vertex as usize)
            .copied()
            .unwrap_or(self.colour)
    }

    pub(crate) fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|vertex| self.positions[vertex as usize])
    }

    /// The unit normals at the corners of every triangle: the mean of the normals of the triangles at the corner's position that
    /// are smoothed with it, weighted by their angle there (Thürmer and Wüthrich 1998), which makes them independent of the
    /// tessellation.
    pub(crate) fn corner_normals(&self) -> Vec<[Vec3; 3]> {
        let faces: Vec<Vec3> = self
            .triangles
            .iter()
            .map(|&triangle| face_normal(self.corners(triangle)))
            .collect();
        // Adding zero makes -0 and 0 equal in bits.
        let place = |vertex: u32| {
            (self.positions[vertex as usize] + Vec3::ZERO)
                .to_array()
                .map(f32::to_bits)
        };
        let mut around: HashMap<[u32; 3], Vec<(usize, f32)>> = HashMap::with_capacity(self.positions.len());
        for (index, &triangle) in self.triangles.iter().enumerate() {
            let corners = self.corners(triangle);
            for (corner, vertex) in triangle.into_iter().enumerate() {
                let angle = corner_angle(corners, corner);
                around.entry(place(vertex)).or_default().push((index, angle));
            }
        }
        let min_cosine = if self.is_smooth { -2.0 } else { CREASE_ANGLE.cos() };
        let smoothed = |vertex: u32, face: Vec3| {
            let all = around[&place(vertex)].iter();
            let near = all.filter(|(other, _)| faces[*other].dot(face) >= min_cosine);
            let sum: Vec3 = near.map(|&(other, angle)| faces[other] * angle).sum();
            sum.normalize_or(face)
        };
        let with_faces = self.triangles.iter().zip(&faces);
        with_faces
            .map(|(triangle, &face)| triangle.map(|vertex| smoothed(vertex, face)))
            .collect()
    }
}

/// Parts shown together.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The parts.
    pub parts: Vec<Part>,
}

/// The outward unit normal of a triangle; +Y for one without area.
pub(crate) fn face_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    // Scaled first: the product of two tiny edges would underflow.
    let scale = (b - a).abs().max((c - a).abs()).max_element();
    let scale = if scale > 0.0 { scale } else { 1.0 };
    ((b - a) / scale).cross((c - a) / scale).normalize_or(Vec3::Y)
}

/// The angle of a triangle at one of its corners, in radians; 0 where an edge has no length.
fn corner_angle(corners: [Vec3; 3], corner: usize) -> f32 {
    let [one, other] =
        [1, 2].map(|next| (corners[(corner + next) % 3] - corners[corner]).normalize_or_zero());
    if one == Vec3::ZERO || other == Vec3::ZERO {
        return 0.0;
    }
    one.dot(other).clamp(-1.0, 1.0).acos()
}

/// Linear RGB of an sRGB colour, 0 to 255 per channel (IEC 61966-2-1).
pub fn linear_from_srgb(red: u8, green: u8, blue: u8) -> Vec3 {
    Vec3::from([red, green, blue].map(|value| {
        let value = f32::from(value) / 255.0;
        if value <= 0.040_45 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        }
    }))
}

/// sRGB bytes of linear light; light beyond 1 is white.
pub(crate) fn srgb_from_linear(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(|value| {
        let value = value.clamp(0.0, 1.0);
        let encoded = if value <= 0.003_130_8 {
            value * 12.92
        } else {
            1.055 * value.powf(1.0 / 2.4) - 0.055
        };
        (encoded * 255.0 + 0.5) as u8
    })
}

/// 0 below `from`, 1 beyond `to`, smooth between.
pub(crate) fn smoothstep(from: f32, to: f32, value: f32) -> f32 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trips_every_byte() {
        for value in 0..=255 {
            assert_eq!(srgb_from_linear(linear_from_srgb(value, 0, 9)), [value, 0, 9]);
        }
    }

    #[test]
    fn creases_split_and_smooth_edges_join() {
        // Two triangles that meet at an edge along the x axis; the second has separate vertices.
        let fold = |angle: f32| {
            let (sin, cos) = angle.sin_cos();
            let third = Vec3::new(0.0, -cos, -sin);
            Part::new(
                "fold",
                vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ZERO, Vec3::X, third],
                vec![[0, 1, 2], [4, 3, 5]],
                Vec3::ONE,
            )
        };
        let sharp = fold(CREASE_ANGLE * 1.1);
        let normals = sharp.corner_normals();
        assert_eq!(normals[0], [Vec3::Z; 3]);
        let face = face_normal(sharp.corners([4, 3, 5]));
        assert!(normals[1].iter().all(|normal| normal.distance(face) < 1e-6));
        let smoothed = Part {
            is_smooth: true,
            ..sharp
        };
        for smooth in [fold(CREASE_ANGLE * 0.9), smoothed] {
            let normals = smooth.corner_normals();
            assert!(
                normals[0][0].distance(normals[1][1]) < 1e-6,
                "one place has one normal"
            );
            assert!(normals[0][0].z < 0.99 && normals[0][0].y < -0.1);
            assert_eq!(normals[0][2], Vec3::Z);
        }
    }
}
