//! Boxes with known grips, for objects that have no atlas yet.
//!
//! An object of about the same length, width and thickness as a box can mostly be held where the box can. So
//! the atlases of some boxes are grown once, like those of the built-in objects, and their shortlisted grips
//! are kept: nearly every giver leaves some of these free. A search for an object without an atlas starts
//! from those that fit it ([`super::transferred_grips`]). Choosing grasps by shape primitives follows A. T.
//! Miller, S. Knoop, H. I. Christensen and P. K. Allen, "Automatic Grasp Planning Using Shape Primitives",
//! ICRA 2003, with tested grips instead of their rules.

use glam::Vec3;

use super::grips::Grips;
use crate::{geometry::mesh::TriangleMesh, model::object::GraspObject};

/// A box with its longest edges along x and its shortest along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primitive {
    /// Half of its edge lengths, in metres.
    pub half_extents: Vec3,
}

/// Mass of a box, in kilograms: typical of objects held in one hand. Grips are checked again with the
/// object's own mass.
const MASS: f32 = 0.1;

impl Primitive {
    /// All boxes with known grips. They are dense where thickness decides which fingers reach around: from
    /// blades and handles over pens and bars to a phone, and one as wide as a mug. Easy objects need none.
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

    /// A box with these edge lengths.
    const fn of_millimetres(length: u16, width: u16, thickness: u16) -> Self {
        Self {
            half_extents: Vec3::new(
                length as f32 / 2000.0,
                width as f32 / 2000.0,
                thickness as f32 / 2000.0,
            ),
        }
    }

    /// Its edge lengths in millimetres, such as "box-160x10x5".
    pub fn name(self) -> String {
        let [length, width, thickness] = (self.half_extents * 2000.0).to_array().map(f32::round);
        format!("box-{length}x{width}x{thickness}")
    }

    /// The box as an object, centred on the origin.
    ///
    /// # Panics
    /// If an edge is not a positive number; never for those of [`Primitive::ALL`].
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

/// A box with a hand's grips on it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldPrimitive {
    /// The box.
    pub primitive: Primitive,
    /// The grips, in the frame of the box.
    pub grips: Grips,
}
