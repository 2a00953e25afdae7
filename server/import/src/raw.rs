//! A mesh as a file has it, before it is split into triangles, welded and checked.

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

/// Output of every reader.
#[derive(Debug, Default)]
pub(crate) struct RawMesh {
    /// The vertices, in the file's units and axes.
    pub(crate) positions: Vec<DVec3>,
    /// The corners of all faces, as indices of vertices.
    pub(crate) corners: Vec<u32>,
    /// The faces, in the file's order.
    pub(crate) faces: Faces,
    /// Number of triangles of the file after polygons are split.
    pub(crate) triangles: usize,
    /// The names of faces' parts.
    pub(crate) names: NameSets,
    /// Unit in which faces are counted.
    pub(crate) places: Places,
    /// Name in messages of the mesh of a format that its sender may believe to be another; empty for OBJ.
    name: &'static str,
    /// Vertices that no face uses, if the reader knows.
    pub(crate) unused_vertices: usize,
    pub(crate) oddities: Oddities,
    /// Warnings of content read otherwise than may be expected.
    pub(crate) warnings: Vec<String>,
}

impl RawMesh {
    pub(crate) fn new(name: &'static str, places: Places) -> Self {
        Self {
            places,
            name,
            ..Self::default()
        }
    }

    /// Checks that every vertex is finite and near enough to the origin.
    pub(crate) fn check_coordinates(&self, unit_metres: f64) -> Result<(), Violations> {
        let mut violations = Violations::default();
        for (vertex, position) in self.positions.iter().enumerate() {
            let largest = position.abs().max_element() * unit_metres;
            if !position.is_finite() {
                violations.add(format!("vertex {vertex}"), "is not finite");
            } else if largest > MAX_COORDINATE_METRES {
                violations.add(format!("vertex {vertex}"), too_far(largest));
            }
        }
        violations.into_result()
    }

    pub(crate) fn add_triangle(&mut self, corners: [u32; 3], place: usize, names: u32) {
        self.corners.extend(corners);
        self.add_face(3, place, names);
    }

    /// Adds a face whose corners are or will be in [`RawMesh::corners`].
    pub(crate) fn add_face(&mut self, corners: usize, place: usize, names: u32) {
        self.faces.push(RawFace {
            place: place as u32,
            corners: corners as u32,
            names,
            triangle: self.triangles as u32,
        });
        self.triangles += corners - 2;
    }

    /// Keeps some faces and their vertices, which are numbered in the order of their first use.
    pub(crate) fn keep(&mut self, is_kept: impl Fn(RawFace) -> bool) {
        let positions = std::mem::take(&mut self.positions);
        let corners = std::mem::take(&mut self.corners);
        let mut numbers = vec![u32::MAX; positions.len()];
        let mut rest = corners.as_slice();
        for face in std::mem::take(&mut self.faces).iter() {
            let (own, others) = rest.split_at(face.corners as usize);
            rest = others;
            if !is_kept(face) {
                continue;
            }
            self.faces.push(face);
            for &corner in own {
                let number = &mut numbers[corner as usize];
                if *number == u32::MAX {
                    *number = self.positions.len() as u32;
                    self.positions.push(positions[corner as usize]);
                }
                self.corners.push(*number);
            }
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

    /// The error of a mesh without triangles.
    pub(crate) fn empty(&self) -> ImportError {
        let count = |oddity| self.oddities.of(oddity).count;
        let dropped = count(Oddity::FewCorners) + count(Oddity::NoArea);
        if self.name.is_empty() {
            return ImportError::Whole(format!(
                "the mesh has no triangles; {dropped} points, lines and faces without area and {} lines with an unknown \
                 keyword were ignored",
                count(Oddity::UnknownLine)
            ));
        }
        let ignored = (dropped > 0).then(|| format!("{dropped} faces without area were ignored"));
        let mut what = vec!["has no triangles".to_owned()];
        what.extend(ignored.into_iter().chain(self.warnings.iter().cloned()));
        ImportError::at(self.name, what.join("; "))
    }
}

/// A face of three or more corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RawFace {
    /// Its place in the file, counted as [`RawMesh::places`] says.
    pub(crate) place: u32,
    /// Number of corners, at least 3.
    pub(crate) corners: u32,
    /// Index of its names in [`RawMesh::names`].
    pub(crate) names: u32,
    /// Index in the file of its first triangle.
    pub(crate) triangle: u32,
}

impl RawFace {
    /// The face that comes some faces after this one if all are alike.
    fn after(self, faces: u32) -> Self {
        Self {
            place: self.place + faces,
            triangle: self.triangle + faces * (self.corners - 2),
            ..self
        }
    }
}

/// The faces of a file in its order, as the first and the number of alike ones, which take little memory: most files have one run.
#[derive(Debug, Default)]
pub(crate) struct Faces(Vec<(RawFace, u32)>);

impl Faces {
    fn push(&mut self, face: RawFace) {
        match self.0.last_mut() {
            Some((first, count)) if first.after(*count) == face => *count += 1,
            _ => self.0.push((face, 1)),
        }
    }

    /// True if no face has more than three corners.
    pub(crate) fn are_triangles(&self) -> bool {
        self.0.iter().all(|(face, _)| face.corners == 3)
    }

    /// The faces in the file's order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = RawFace> {
        let runs = self.0.iter();
        runs.flat_map(|&(first, count)| (0..count).map(move |number| first.after(number)))
    }

    /// The face of each triangle, with the index of that triangle.
    pub(crate) fn by_triangle(&self) -> impl Iterator<Item = RawFace> {
        self.iter().flat_map(|face| {
            let triangles = face.triangle..face.triangle + face.corners - 2;
            triangles.map(move |triangle| RawFace { triangle, ..face })
        })
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

impl Places {
    /// A place in words.
    pub(crate) fn named(self, place: usize) -> String {
        match self {
            Self::Lines => format!("on line {place}"),
            Self::Faces => format!("face {place}"),
            Self::Triangles => format!("triangle {place}"),
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

/// Possible oddities of a file and its mesh, in the order of their warnings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Oddity {
    UnknownLine,
    FewCorners,
    NoArea,
    Overlapping,
    Repeated,
    TwoSided,
    /// One of two sides, of which neither is needed to close the surface.
    Undecided,
    Disagreeing,
    InsideOut,
    OpenEdge,
    InconsistentEdge,
    CrowdedEdge,
}

/// All oddities in words.
pub(crate) const ODDITIES: [(Oddity, &str); 12] = [
    (
        Oddity::UnknownLine,
        "lines start with an unknown keyword and were ignored",
    ),
    (
        Oddity::FewCorners,
        "points, lines and faces with fewer than three corners were dropped",
    ),
    (Oddity::NoArea, "triangles without area were dropped"),
    (
        Oddity::Overlapping,
        "polygons intersect themselves; their fans of triangles overlap",
    ),
    (
        Oddity::Repeated,
        "triangles that repeat an earlier one were dropped",
    ),
    (
        Oddity::TwoSided,
        "triangles that repeat an earlier one with the opposite winding were dropped: of faces with two sides, one was kept",
    ),
    (
        Oddity::Undecided,
        "triangles that repeat an earlier one with the opposite winding were kept: the rest of the surface is closed without either",
    ),
    (
        Oddity::Disagreeing,
        "triangles faced the opposite way of the rest of their part and were turned",
    ),
    (
        Oddity::InsideOut,
        "triangles of parts that were inside out were turned",
    ),
    (
        Oddity::OpenEdge,
        "edges are open: the surface has holes and its volume is an estimate",
    ),
    (
        Oddity::InconsistentEdge,
        "edges join triangles that face opposite ways: the winding is inconsistent",
    ),
    (Oddity::CrowdedEdge, "edges join more than two triangles"),
];

/// How often each oddity occurred, and where first: up to [`Oddity::FewCorners`] at a place of the file, then at a triangle's index.
#[derive(Debug, Default)]
pub(crate) struct Oddities([Occurrences; ODDITIES.len()]);

impl Oddities {
    pub(crate) fn note(&mut self, oddity: Oddity, place: usize) {
        self.0[oddity as usize].note(place);
    }

    pub(crate) fn of(&self, oddity: Oddity) -> Occurrences {
        self.0[oddity as usize]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn runs_are_the_faces_that_were_added(
            steps in prop::collection::vec((1_u32..3, 3_u32..6, 0_u32..2), 0..40),
        ) {
            let (mut raw, mut added) = (RawMesh::default(), Vec::new());
            let (mut place, mut triangle) = (0, 0);
            for (step, corners, names) in steps {
                place += step;
                raw.add_face(corners as usize, place as usize, names);
                added.push(RawFace { place, corners, names, triangle });
                triangle += corners - 2;
            }
            prop_assert_eq!(raw.faces.iter().collect::<Vec<_>>(), added.clone());
            let of_triangles = added.iter().flat_map(|face| vec![face.place; face.corners as usize - 2]).zip(0..);
            let found = raw.faces.by_triangle().map(|face| (face.place, face.triangle));
            prop_assert!(found.eq(of_triangles));
        }
    }
}
