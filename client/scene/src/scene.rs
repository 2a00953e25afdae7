//! The content of a picture or a GLB file: parts with a colour and a finish.

use glam::Vec3;

/// Smooth normals across edges flatter than this, in radians (40°): rounds tessellated curves, keeps box edges sharp.
pub const DEFAULT_CREASE_ANGLE: f32 = 0.7;

/// Reflective finish of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Finish {
    /// Plastic with a soft highlight.
    #[default]
    Satin,
    /// Brushed metal: colours its reflections.
    Metal,
    /// Skin: reddish light bleeds past the terminator.
    Skin,
    /// Fabric: no highlight, brighter toward the outline.
    Cloth,
    /// A contact or a force: evenly lit, and faintly visible through other parts.
    Marker,
}

/// A smooth or flat shaded triangle mesh.
#[derive(Clone, Debug)]
pub struct Part {
    /// Name of the node in the GLB.
    pub name: String,
    /// Vertex positions in metres, in the scene's frame (+Y up).
    pub positions: Vec<Vec3>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Linear RGBA, each 0 to 1. Alpha is quantised to samples of the anti-aliasing grid.
    pub colour: [f32; 4],
    /// Linear RGB per vertex, overriding `colour`; empty: `colour` everywhere.
    pub vertex_colours: Vec<Vec3>,
    /// Smooth normals across edges flatter than this angle in radians; 0 shades every triangle flat. Vertices at the
    /// same position count as one, which hides seams of the file.
    pub crease_angle: f32,
    /// Finish.
    pub finish: Finish,
    /// The `extras` of the GLB node.
    pub extras: Option<serde_json::Value>,
}

impl Part {
    /// A part of one colour with the default crease angle and finish.
    pub fn new(
        name: impl Into<String>,
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        colour: [f32; 4],
    ) -> Self {
        Self {
            name: name.into(),
            positions,
            triangles,
            colour,
            vertex_colours: Vec::new(),
            crease_angle: DEFAULT_CREASE_ANGLE,
            finish: Finish::default(),
            extras: None,
        }
    }

    /// The same part with another finish.
    #[must_use]
    pub fn with_finish(self, finish: Finish) -> Self {
        Self { finish, ..self }
    }

    /// Linear RGB at a vertex.
    pub(crate) fn vertex_colour(&self, vertex: u32) -> Vec3 {
        let [r, g, b, _] = self.colour;
        self.vertex_colours
            .get(vertex as usize)
            .copied()
            .unwrap_or(Vec3::new(r, g, b))
    }
}

/// Parts shown together.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The parts.
    pub parts: Vec<Part>,
}

impl Scene {
    /// Every vertex of every part.
    pub fn points(&self) -> impl Iterator<Item = Vec3> + Clone + '_ {
        self.parts.iter().flat_map(|part| part.positions.iter().copied())
    }
}

/// Linear RGBA of an opaque sRGB colour, 0 to 255 per channel.
pub fn linear_from_srgb(red: u8, green: u8, blue: u8) -> [f32; 4] {
    // IEC 61966-2-1.
    let channel = |value: u8| {
        let value = f32::from(value) / 255.0;
        if value <= 0.040_45 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        }
    };
    [channel(red), channel(green), channel(blue), 1.0]
}
