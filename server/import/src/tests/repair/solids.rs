//! Polygons to assemble and to spoil, and OBJ text of them.

use std::fmt::Write as _;

use glam::DVec3;

/// Polygons over vertices of their own; vertices at equal positions are one to the reader.
#[derive(Clone, Default)]
pub(crate) struct Polygons(pub(crate) Vec<Vec<DVec3>>);

impl Polygons {
    /// A cube of an edge around a middle, of six squares wound outward.
    pub(crate) fn cube(middle: DVec3, edge: f64) -> Self {
        let corner = |bits: usize| {
            let side = |axis: usize| if bits >> axis & 1 == 1 { 0.5 } else { -0.5 };
            middle + DVec3::new(side(0), side(1), side(2)) * edge
        };
        let faces = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        Self(faces.map(|face| face.map(corner).to_vec()).to_vec())
    }

    /// The same polygons, wound the other way.
    pub(crate) fn reversed(mut self) -> Self {
        for face in &mut self.0 {
            face.reverse();
        }
        self
    }

    pub(crate) fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// OBJ text: four lines of vertices and one of the face per square.
    pub(crate) fn obj(&self) -> String {
        let mut text = String::new();
        for face in &self.0 {
            for DVec3 { x, y, z } in face {
                writeln!(text, "v {x} {y} {z}").unwrap();
            }
            text += "f";
            for back in (1..=face.len()).rev() {
                write!(text, " -{back}").unwrap();
            }
            text += "\n";
        }
        text
    }
}
