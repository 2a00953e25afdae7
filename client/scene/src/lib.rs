//! Pictures (PNG) and scenes (GLB) of hands holding objects.
//!
//! To come; the interface is fixed: a [`Scene`] of coloured meshes and arrows is rendered to a PNG or written as GLB.

use glam::Vec3;

/// A smooth or flat shaded triangle mesh of one colour.
#[derive(Clone, Debug)]
pub struct Part {
    /// Name of the node in the GLB.
    pub name: String,
    /// Vertex positions in metres, in the scene's frame (+Y up).
    pub positions: Vec<Vec3>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Linear RGBA, each 0 to 1.
    pub colour: [f32; 4],
    /// Smooth normals across edges flatter than this angle in radians; 0 shades every triangle flat.
    pub crease_angle: f32,
}

/// Parts that are seen together.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// What is in it.
    pub parts: Vec<Part>,
}
