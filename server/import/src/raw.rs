//! A mesh as a file has it, before it is split into triangles, welded and checked.

use std::fmt;

use glam::DVec3;

use crate::{
    Import, MAX_COORDINATE_METRES, MeshLimits,
    error::{ImportError, Violations, check_count},
    parts::NameSets,
};

/// Largest distance of the centre of a mesh's box from the file's origin, in metres, at which the file's origin is kept. Beyond,
/// steps of single precision exceed a micrometre, and distances computed from such coordinates lose what fingers can feel.
const KEPT_ORIGIN_METRES: f64 = 10.0;

/// True if a mesh whose box has this centre, in metres from the file's origin, keeps that origin.
pub fn keeps_origin(centre: DVec3) -> bool {
    centre.length() <= KEPT_ORIGIN_METRES
}

/// Checks numbers of vertices and triangles that a file claims.
pub(crate) fn check_counts(vertices: u64, triangles: u64, limits: MeshLimits) -> Result<(), ImportError> {
    check_count("the mesh", "vertices", vertices, limits.vertices)?;
    check_count("the mesh", "triangles", triangles, limits.triangles)
}

/// The error of a coordinate that is too far from the origin.
pub(crate) fn too_far(metres: f64) -> String {
    format!(
        "a coordinate is {metres} m from the origin; it must be at most {MAX_COORDINATE_METRES} m, is the unit right?"
    )
}

/// What every reader returns.
#[derive(Debug, Default)]
pub(crate) struct RawMesh {
    /// The vertices, in the file's units and axes.
    pub(crate) positions: Vec<DVec3>,
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
    pub(crate) fn new(places: Places) -> Self {
        Self {
            places,
            ..Self::default()
        }
    }

    /// Checks that every vertex is finite and near enough to the origin.
    pub(crate) fn check_coordinates(&self, unit_metres: f64) -> Result<(), Violations> {
        let mut violations = Violations::default();
        for (vertex, position) in self.positions.iter().enumerate() {
            let largest = position.abs().max_element() * unit_metres;
            let what = if !position.is_finite() {
                "is not finite".to_owned()
            } else if largest > MAX_COORDINATE_METRES {
                too_far(largest)
            } else {
                continue;
            };
            violations.add(format!("vertex {vertex}"), what);
        }
        violations.into_result()
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

    /// Numbers the vertices in the order of their first use and drops those that no face uses.
    pub(crate) fn keep_used_vertices(&mut self) {
        let positions = std::mem::take(&mut self.positions);
        let mut numbers = vec![u32::MAX; positions.len()];
        for corner in &mut self.corners {
            let number = &mut numbers[*corner as usize];
            if *number == u32::MAX {
                *number = self.positions.len() as u32;
                self.positions.push(positions[*corner as usize]);
            }
            *corner = *number;
        }
    }

    /// Moves a mesh that is far from the file's origin to the centre of its box; returns where its origin is in the file.
    pub(crate) fn recentre(&mut self, import: Import) -> DVec3 {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &corner in &self.corners {
            let position = self.positions[corner as usize];
            low = low.min(position);
            high = high.max(position);
        }
        let centre = low.midpoint(high);
        let moved = import.metres_from_file(centre);
        // Without faces, there is no centre.
        if !moved.is_finite() || keeps_origin(moved) {
            return DVec3::ZERO;
        }
        for position in &mut self.positions {
            *position -= centre;
        }
        let [x, y, z] = centre.to_array();
        self.warnings.push(format!(
            "the mesh is {:.3} m from the file's origin: the object's origin is the centre of the mesh's box, about ({x:.3}, {y:.3}, \
             {z:.3}) in the file",
            moved.length()
        ));
        centre
    }

    /// The error of a mesh without triangles, of which some were dropped.
    pub(crate) fn empty(&self, dropped: usize) -> ImportError {
        ImportError::Empty {
            dropped: self.without_area.count + dropped,
            unknown: self.unknown.count,
        }
    }
}

/// A face of three or more corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RawFace {
    /// Its place in the file, counted as [`RawMesh::places`] says.
    pub(crate) place: usize,
    /// Number of corners, at least 3.
    pub(crate) corners: usize,
    /// Index of its names in [`RawMesh::names`].
    pub(crate) names: usize,
}

/// Consecutive faces with as many corners and the same names, at consecutive places.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// The place of the first face.
    place: u32,
    corners: u32,
    names: u32,
    faces: u32,
    /// Triangles of all faces before.
    first_triangle: u32,
}

impl Run {
    fn face(self, number: u32) -> RawFace {
        RawFace {
            place: (self.place + number) as usize,
            corners: self.corners as usize,
            names: self.names as usize,
        }
    }

    fn end(self) -> u32 {
        self.first_triangle + self.faces * (self.corners - 2)
    }
}

/// The faces of a file in its order, as runs of alike ones, which take little memory: most files have one.
#[derive(Debug, Default)]
pub(crate) struct Faces(Vec<Run>);

impl Faces {
    /// Adds a face.
    pub(crate) fn push(&mut self, face: RawFace) {
        let last = self.0.last_mut();
        if let Some(run) = last.filter(|run| run.face(run.faces) == face) {
            run.faces += 1;
            return;
        }
        self.0.push(Run {
            place: face.place as u32,
            corners: face.corners as u32,
            names: face.names as u32,
            faces: 1,
            first_triangle: self.triangles() as u32,
        });
    }

    /// Number of triangles after polygons are split.
    pub(crate) fn triangles(&self) -> usize {
        self.0.last().map_or(0, |run| run.end() as usize)
    }

    /// True if no face has more than three corners.
    pub(crate) fn are_triangles(&self) -> bool {
        self.0.iter().all(|run| run.corners == 3)
    }

    /// The faces in the file's order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = RawFace> {
        let runs = self.0.iter();
        runs.flat_map(|&run| (0..run.faces).map(move |number| run.face(number)))
    }

    /// The face of each triangle in turn.
    pub(crate) fn by_triangle(&self) -> impl Iterator<Item = RawFace> {
        self.iter()
            .flat_map(|face| std::iter::repeat_n(face, face.corners - 2))
    }

    /// The face of a triangle, which must exist.
    pub(crate) fn of_triangle(&self, triangle: usize) -> RawFace {
        let triangle = triangle as u32;
        let run = self.0[self.0.partition_point(|run| run.end() <= triangle)];
        run.face((triangle - run.first_triangle) / (run.corners - 2))
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
    /// Notes a place, which may be before those noted already.
    pub(crate) fn note(&mut self, place: usize) {
        self.first = if self.count == 0 {
            place
        } else {
            self.first.min(place)
        };
        self.count += 1;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn runs_are_the_faces_that_were_added(
            steps in prop::collection::vec((1_usize..3, 3_usize..6, 0_usize..2), 0..40),
        ) {
            let mut place = 0;
            let added: Vec<RawFace> = steps
                .into_iter()
                .map(|(step, corners, names)| {
                    place += step;
                    RawFace { place, corners, names }
                })
                .collect();
            let mut faces = Faces::default();
            for &face in &added {
                faces.push(face);
            }
            let by_triangle: Vec<RawFace> = added
                .iter()
                .flat_map(|face| vec![*face; face.corners - 2])
                .collect();
            prop_assert_eq!(faces.iter().collect::<Vec<_>>(), added);
            prop_assert_eq!(faces.triangles(), by_triangle.len());
            prop_assert_eq!(faces.by_triangle().collect::<Vec<_>>(), by_triangle.clone());
            for (triangle, face) in by_triangle.iter().enumerate() {
                prop_assert_eq!(faces.of_triangle(triangle), *face);
            }
        }
    }
}
