//! Simple shapes that hands know beforehand, for objects that no hand knows yet.
//!
//! What is as long, wide and thick as a box can mostly be held where the box can. So the atlases of some boxes are made
//! once, as those of the built-in objects are, and the grips of their lists are kept: of these, nearly every giver leaves
//! some. A search for an object without an atlas starts from those that fit it ([`super::transferred_grips`]). That primitives tell where
//! to grasp is of A. T. Miller, S. Knoop, H. I. Christensen and P. K. Allen: Automatic Grasp Planning Using Shape
//! Primitives, ICRA 2003; there they have rules, here grips that were tried.

use glam::Vec3;

use super::grips::Grips;
use crate::{geometry::mesh::TriangleMesh, model::object::GraspObject};

/// A box, its longest edges along x and its shortest along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primitive {
    /// Half of its edges, in metres.
    pub half_extents: Vec3,
}

/// What a box weighs, in kilograms: what is held in one hand weighs some tens to hundreds of grams, and grips are tried
/// anew with the object's own weight.
const MASS: f32 = 0.1;

impl Primitive {
    /// All whose grips are known. They are close where thickness decides which fingers get round: from blades and handles
    /// over pens and bars to a phone, and one that is as wide as a mug. What is easy to hold needs none.
    pub const ALL: [Self; 12] = [
        Self::of_millimetres(160, 10, 5),
        Self::of_millimetres(160, 12, 3),
        Self::of_millimetres(160, 20, 6),
        Self::of_millimetres(160, 26, 4),
        Self::of_millimetres(160, 18, 18),
        Self::of_millimetres(160, 32, 14),
        Self::of_millimetres(160, 40, 8),
        Self::of_millimetres(160, 40, 20),
        Self::of_millimetres(150, 70, 8),
        Self::of_millimetres(160, 70, 24),
        Self::of_millimetres(100, 24, 10),
        Self::of_millimetres(120, 76, 76),
    ];

    /// The one with these edges.
    const fn of_millimetres(length: u16, width: u16, thickness: u16) -> Self {
        Self {
            half_extents: Vec3::new(
                length as f32 / 2000.0,
                width as f32 / 2000.0,
                thickness as f32 / 2000.0,
            ),
        }
    }

    /// "box-160x10x5", by its edges in millimetres.
    pub fn name(self) -> String {
        let [length, width, thickness] = (self.half_extents * 2000.0).to_array().map(f32::round);
        format!("box-{length}x{width}x{thickness}")
    }

    /// The box as an object, centred.
    ///
    /// # Panics
    /// Never for those of [`Primitive::ALL`]; if an edge is not a positive number.
    pub fn object(self) -> GraspObject {
        let corner = |k: usize| {
            let side = |axis: usize| if k >> axis & 1 == 0 { -1.0 } else { 1.0 };
            self.half_extents * Vec3::new(side(0), side(1), side(2))
        };
        let faces = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let mesh = TriangleMesh::new((0..8).map(corner).collect(), triangles.collect());
        mesh.ok()
            .and_then(|mesh| GraspObject::new(mesh, MASS, Vec3::ZERO, None, &[]).ok())
            .expect("a box with edges is an object")
    }
}

/// A box with grips of a hand at it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldPrimitive {
    /// The box.
    pub primitive: Primitive,
    /// The grips, in its frame.
    pub grips: Grips,
}
