//! The faces of a file, as runs of alike ones, which take little memory: most files have one.

/// A face of three or more corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RawFace {
    /// Its place in the file, counted as [`RawMesh::places`](crate::raw::RawMesh::places) says.
    pub(crate) place: usize,
    /// Number of corners, at least 3.
    pub(crate) corners: usize,
    /// Index of its names in [`RawMesh::names`](crate::raw::RawMesh::names).
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

    fn triangles_per_face(self) -> u32 {
        self.corners - 2
    }

    fn end(self) -> u32 {
        self.first_triangle + self.faces * self.triangles_per_face()
    }
}

/// The faces of a file, in its order.
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

    /// True if there is none.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
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
        let run = self.0.partition_point(|run| run.end() <= triangle);
        let run = self.0[run];
        run.face((triangle - run.first_triangle) / run.triangles_per_face())
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
