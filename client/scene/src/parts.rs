//! The content of a picture or a GLB file: triangle meshes with a colour and a finish.

use std::{
    collections::HashMap,
    f32::consts::{FRAC_PI_2, PI, TAU},
};

use glam::{Quat, Vec2, Vec3};
use grasp_assets::objects::object;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{mesh::TriangleMesh, tapered_capsule::TaperedCapsule},
};

/// Edges flatter than this are smoothed, in radians (40°): rounds tessellated curves, keeps the edges of boxes sharp.
const CREASE_ANGLE: f32 = 0.7;

/// Sides of round parts: the outline deviates from a circle by 0.2 % of the radius.
const SIDES: u32 = 48;

/// Rings of vertices from pole to equator of a sphere.
const RINGS: u32 = 12;

/// Largest fraction of an arrow's length taken by its head.
const HEAD_SHARE: f32 = 0.45;

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
    /// Vertex positions in metres, +Y up.
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

    /// An object in its own frame, named `object`. Triangles that must not be touched are red.
    pub fn object(mesh: &TriangleMesh, forbidden: &[u32], colour: Vec3, finish: Finish) -> Self {
        let mut part = Self::new(
            "object",
            mesh.positions().to_vec(),
            mesh.triangles().to_vec(),
            colour,
        );
        part.finish = finish;
        if !forbidden.is_empty() {
            // Separate vertices give the colour of forbidden triangles a sharp border.
            part.vertex_colours = vec![colour; part.positions.len()];
            let mut copies = HashMap::new();
            for &triangle in forbidden {
                let Some(corners) = part.triangles.get_mut(triangle as usize) else {
                    continue;
                };
                for vertex in corners {
                    *vertex = *copies.entry(*vertex).or_insert_with(|| {
                        part.positions.push(part.positions[*vertex as usize]);
                        part.vertex_colours.push(linear_from_srgb(176, 52, 48));
                        part.positions.len() as u32 - 1
                    });
                }
            }
        }
        part
    }

    /// A built-in object, by its name with or without the collection; `None` if it is not built in.
    pub fn built_in_object(name: &str) -> Option<Self> {
        let built_in = object(name.strip_prefix("objects/").unwrap_or(name))?;
        let mesh = built_in.object.surface.mesh();
        let (colour, finish) = match built_in.name {
            "remote" => (linear_from_srgb(70, 74, 82), Finish::Satin),
            _ => (linear_from_srgb(198, 203, 210), Finish::Metal),
        };
        let mut forbidden: Vec<u32> = (0..mesh.triangles().len() as u32).collect();
        forbidden.retain(|&triangle| built_in.object.is_forbidden(triangle));
        Some(Self::object(mesh, &forbidden, colour, finish))
    }

    /// The same part at another size, which is rounded to hundredths like sizes of objects on the server.
    #[must_use]
    pub fn scaled(mut self, scale: f32) -> Self {
        let scale = (100.0 * scale).round() / 100.0;
        for position in &mut self.positions {
            *position *= scale;
        }
        self
    }

    pub(crate) fn moved(mut self, pose: Pose) -> Self {
        for position in &mut self.positions {
            *position = pose.transform_point(*position);
        }
        self
    }

    pub(crate) fn with_finish(self, finish: Finish) -> Self {
        Self { finish, ..self }
    }

    /// Linear RGB at a vertex.
    pub(crate) fn vertex_colour(&self, vertex: u32) -> Vec3 {
        let own = self.vertex_colours.get(vertex as usize);
        own.copied().unwrap_or(self.colour)
    }

    pub(crate) fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|vertex| self.positions[vertex as usize])
    }

    /// The unit normals at the corners of every triangle: the mean of the normals of the triangles at the corner's position that
    /// are smoothed with it, weighted by their angle there (Thürmer and Wüthrich 1998), which makes them independent of the
    /// tessellation.
    pub(crate) fn corner_normals(&self) -> Vec<[Vec3; 3]> {
        let triangles = self.triangles.iter();
        let faces: Vec<Vec3> = triangles
            .map(|&triangle| face_normal(self.corners(triangle)))
            .collect();
        // Adding zero makes -0 and 0 equal in bits.
        let place = |vertex: u32| {
            let position = self.positions[vertex as usize] + Vec3::ZERO;
            position.to_array().map(f32::to_bits)
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

pub(crate) fn sphere(name: &str, centre: Vec3, radius: f32, colour: Vec3) -> Part {
    let profile: Vec<Vec2> = arc(0.0, PI).map(|point| point * radius).collect();
    Part {
        is_smooth: true,
        ..lathe(name, centre, Vec3::Y, &profile, colour)
    }
}

/// A tapered capsule, neither of whose spheres contains the other.
pub(crate) fn capsule(name: &str, solid: &TaperedCapsule, colour: Vec3) -> Part {
    let length = solid.length();
    let narrowing = (solid.start_radius - solid.end_radius) / length;
    let touching = FRAC_PI_2 + narrowing.clamp(-1.0, 1.0).asin();
    let first = arc(0.0, touching).map(|point| point * solid.start_radius);
    let second = arc(touching, PI).map(|point| point * solid.end_radius + Vec2::new(0.0, length));
    let profile: Vec<Vec2> = first.chain(second).collect();
    let axis = (solid.end - solid.start).normalize_or(Vec3::Y);
    Part {
        is_smooth: true,
        ..lathe(name, solid.start, axis, &profile, colour)
    }
}

/// An arrow from `tail` to `tip`; `radius` is that of its shaft.
pub(crate) fn arrow(name: &str, tail: Vec3, tip: Vec3, radius: f32, colour: Vec3) -> Part {
    let length = tail.distance(tip);
    let head = (radius * 5.5).min(length * HEAD_SHARE);
    let profile = [
        Vec2::ZERO,
        Vec2::new(radius, 0.0),
        Vec2::new(radius, length - head),
        Vec2::new(radius * 2.4, length - head),
        Vec2::new(0.0, length),
    ];
    lathe(name, tail, (tip - tail).normalize_or(Vec3::Y), &profile, colour)
}

/// A closed surface of revolution: `profile` gives distance from the axis (x) and place along it (y) in metres, from
/// the bottom up, and starts and ends on the axis.
pub(crate) fn lathe(name: &str, origin: Vec3, axis: Vec3, profile: &[Vec2], colour: Vec3) -> Part {
    let turn = Quat::from_rotation_arc(Vec3::Y, axis);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    // A ring on the axis is one vertex.
    let mut rings: Vec<(u32, bool)> = Vec::with_capacity(profile.len());
    for (i, point) in profile.iter().enumerate() {
        let is_pole = i == 0 || i + 1 == profile.len();
        rings.push((positions.len() as u32, is_pole));
        let sides = if is_pole { 1 } else { SIDES };
        positions.extend((0..sides).map(|side| {
            let (sin, cos) = (side as f32 / SIDES as f32 * TAU).sin_cos();
            let radius = if is_pole { 0.0 } else { point.x };
            origin + turn * Vec3::new(radius * sin, point.y, radius * cos)
        }));
    }
    for pair in rings.windows(2) {
        let [(low, low_pole), (high, high_pole)] = [pair[0], pair[1]];
        for side in 0..SIDES {
            let next = (side + 1) % SIDES;
            if !low_pole {
                let top = if high_pole { high } else { high + side };
                triangles.push([low + side, low + next, top]);
            }
            if !high_pole {
                let bottom = if low_pole { low } else { low + next };
                triangles.push([high + side, bottom, high + next]);
            }
        }
    }
    Part::new(name, positions, triangles, colour)
}

/// Points of a unit circle around the origin, between two angles from its bottom: distance from the axis, and height.
fn arc(from: f32, to: f32) -> impl Iterator<Item = Vec2> {
    let steps = (2.0 * RINGS as f32 * (to - from) / PI).ceil().max(1.0) as u32;
    (0..=steps).map(move |step| {
        let (sin, cos) = (from + (to - from) * step as f32 / steps as f32).sin_cos();
        Vec2::new(sin, -cos)
    })
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
            let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ZERO, Vec3::X, third];
            Part::new("fold", positions, vec![[0, 1, 2], [4, 3, 5]], Vec3::ONE)
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
            assert!(normals[0][0].distance(normals[1][1]) < 1e-6);
            assert!(normals[0][0].z < 0.99 && normals[0][0].y < -0.1);
            assert_eq!(normals[0][2], Vec3::Z);
        }
    }

    #[test]
    fn volumes_match_the_solids_and_capsules_are_their_surface() {
        let (a, b) = (Vec3::new(0.3, -0.1, 0.2), Vec3::new(0.5, 0.3, 0.1));
        let ball = 4.0 / 3.0 * PI * 1e-3;
        let head = 0.02_f32 * 5.5;
        let shaft = PI * 0.0004 * (a.distance(b) - head);
        let solid = TaperedCapsule::new(a, b, 0.1, 0.1);
        let cylinder = PI * 0.01 * a.distance(b);
        let tip = PI * 0.048_f32.powi(2) * head / 3.0;
        for (part, expected) in [
            (sphere("sphere", a, 0.1, Vec3::ONE), ball),
            (capsule("capsule", &solid, Vec3::ONE), ball + cylinder),
            (arrow("arrow", a, b, 0.02, Vec3::ONE), shaft + tip),
        ] {
            // By the divergence theorem: positive only if the surface is closed and wound outward.
            let corners = part.triangles.iter().map(|&triangle| part.corners(triangle));
            let volume: f32 = corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
            assert!((volume / expected - 1.0).abs() < 0.01, "{}: {volume}", part.name);
        }
        for [start, end] in [[0.07, 0.03], [0.03, 0.07], [0.05, 0.05]] {
            let solid = TaperedCapsule::new(a, b, start, end);
            for &p in &capsule("capsule", &solid, Vec3::ONE).positions {
                let off = solid.signed_distance(p);
                assert!(off.abs() < 1e-5, "{p} is {off} m off");
            }
        }
    }
}
