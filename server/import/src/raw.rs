//! A mesh as a file has it, before it is split into triangles, welded and checked.

use std::fmt;

use crate::{
    error::{ImportError, Violations},
    limits::{MAX_COORDINATE_METRES, MeshLimits},
    names::NameSets,
    runs::{Faces, RawFace},
};
use glam::DVec3;

/// Checks numbers of vertices and triangles that a file claims.
///
/// # Errors
/// [`ImportError::TooMany`].
pub(crate) fn check_counts(vertices: u64, triangles: u64, limits: MeshLimits) -> Result<(), ImportError> {
    for (what, found, limit) in [
        ("vertices", vertices, limits.vertices),
        ("triangles", triangles, limits.triangles),
    ] {
        if found > limit as u64 {
            return Err(ImportError::TooMany { what, found, limit });
        }
    }
    Ok(())
}

/// What every reader returns.
#[derive(Debug, Default)]
pub(crate) struct RawMesh {
    /// x, y and z of each vertex, in the file's units and axes.
    pub(crate) coordinates: Vec<f64>,
    /// The corners of all faces, as indices of vertices.
    pub(crate) corners: Vec<u32>,
    /// The faces, in the file's order.
    pub(crate) faces: Faces,
    /// The names of faces' parts.
    pub(crate) names: NameSets,
    /// What faces are counted by.
    pub(crate) places: Places,
    /// Vertices that no face uses, if the reader knows.
    pub(crate) unused_vertices: usize,
    /// Points, lines, and faces with fewer than three corners.
    pub(crate) without_area: Occurrences,
    /// Lines that start with an unknown keyword.
    pub(crate) unknown: Occurrences,
    /// What was read otherwise than may be expected.
    pub(crate) warnings: Vec<String>,
}

impl RawMesh {
    /// The vertices.
    pub(crate) fn positions(&self) -> impl Iterator<Item = DVec3> {
        let positions = self.coordinates.as_chunks::<3>().0;
        positions.iter().copied().map(DVec3::from_array)
    }

    /// Checks that every vertex is finite and near enough to the origin.
    pub(crate) fn check_coordinates(&self, unit_metres: f64) -> Result<(), Vec<ImportError>> {
        let mut violations = Violations::default();
        for (vertex, position) in self.positions().enumerate() {
            let largest = position.abs().max_element() * unit_metres;
            if !position.is_finite() {
                violations.push(ImportError::at(format!("vertex {vertex}"), "is not finite"));
            } else if largest > MAX_COORDINATE_METRES {
                violations.push(ImportError::at(
                    format!("vertex {vertex}"),
                    format!(
                        "a coordinate is {largest} m from the origin; it must be at most {MAX_COORDINATE_METRES} m, is the \
                         unit right?"
                    ),
                ));
            }
        }
        violations.into_result()
    }

    /// Adds a vertex.
    pub(crate) fn add_vertex(&mut self, position: [f64; 3]) {
        self.coordinates.extend(position);
    }

    /// Adds a triangle.
    pub(crate) fn add_triangle(&mut self, corners: [u32; 3], place: usize, names: usize) {
        self.corners.extend(corners);
        self.faces.push(RawFace {
            place,
            corners: 3,
            names,
        });
    }
}

/// How the places of faces are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Places {
    /// By lines, from 1.
    #[default]
    Lines,
    /// By faces, from 0.
    Faces,
    /// By triangles, from 0.
    Triangles,
}

/// A place in a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place(pub(crate) Places, pub(crate) usize);

impl Place {
    /// The face that is there.
    pub(crate) fn face(self) -> String {
        match self.0 {
            Places::Lines => format!("the face {self}"),
            Places::Faces | Places::Triangles => self.to_string(),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(places, number) = self;
        match places {
            Places::Lines => write!(f, "on line {number}"),
            Places::Faces => write!(f, "face {number}"),
            Places::Triangles => write!(f, "triangle {number}"),
        }
    }
}

/// How often something occurred, and where first.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Occurrences {
    pub(crate) count: usize,
    pub(crate) first: usize,
}

impl Occurrences {
    pub(crate) fn note(&mut self, place: usize) {
        if self.count == 0 {
            self.first = place;
        }
        self.count += 1;
    }

    /// Notes a place that may be before those noted already.
    pub(crate) fn note_least(&mut self, place: usize) {
        self.first = if self.count == 0 {
            place
        } else {
            self.first.min(place)
        };
        self.count += 1;
    }
}
