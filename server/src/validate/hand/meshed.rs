//! Checks a hand given as a mesh.

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;

use super::GiverHand;
use crate::{
    convention::Convention,
    validate::{FARTHEST, Field, pose},
};

/// Largest numbers of vertices and of triangles, of all hands of a request together: twice those of a hand in a game. Some queries
/// of the search may look at every triangle of a hostile mesh.
const MAXIMUM: usize = 6000;

/// A hand of which the surface is known, in the client's frame and `OpenXR` axes.
#[derive(Clone, Debug)]
pub(crate) struct MeshedHand {
    /// The vertices, in metres.
    pub positions: Vec<Vec3>,
    /// The vertices of each triangle, all of which exist.
    pub triangles: Vec<[u32; 3]>,
    /// The wrist's joint frame, if it is known.
    pub client_from_wrist: Option<Pose>,
    /// The field that gave the mesh, for errors of the surface as a whole.
    pub field: String,
}

/// The hand in the client's frame; `None` if it is wrong.
pub(super) fn meshed_hand(
    field: Field<'_>,
    mesh: &v1::HandMesh,
    convention: Convention,
) -> Option<MeshedHand> {
    let before = field.violations().len();
    let coordinates_field = field.child("client_coordinates");
    let coordinates = threes(coordinates_field, &mesh.client_coordinates);
    let triangles_field = field.child("triangles");
    let triangles = threes(triangles_field, &mesh.triangles);
    let farthest = FARTHEST / convention.metres_per_unit();
    let is_near = |position: &[f32; 3]| position.iter().all(|number| number.abs() <= farthest);
    let wrong = || {
        coordinates
            .iter()
            .enumerate()
            .filter(|(_, position)| !is_near(position))
    };
    if let Some((vertex, position)) = wrong().next() {
        coordinates_field.add(format_args!(
                "has {} vertices that are not finite or more than {farthest} from 0 (1 km); the first is vertex {vertex}, {}",
                wrong().count(),
                Vec3::from_array(*position)
            ));
    }
    let is_known = |corners: &[u32; 3]| {
        corners
            .iter()
            .all(|&corner| (corner as usize) < coordinates.len())
    };
    let wrong = || {
        triangles
            .iter()
            .enumerate()
            .filter(|(_, corners)| !is_known(corners))
    };
    if let Some((triangle, [a, b, c])) = wrong().next() {
        triangles_field.add(format_args!(
                "has {} triangles with a vertex that does not exist; the first is triangle {triangle}, ({a}, {b}, {c}), and \
                 there are {} vertices, counted from 0",
                wrong().count(),
                coordinates.len()
            ));
    }
    let client_from_wrist = mesh.client_from_wrist.map(|sent| {
        let sent = pose(field.child("client_from_wrist"), Some(sent), convention);
        convention.joint_to_openxr(sent)
    });
    (field.violations().len() == before).then(|| MeshedHand {
        positions: coordinates
            .iter()
            .map(|&position| convention.point_to_openxr(Vec3::from_array(position)))
            .collect(),
        triangles: triangles.to_vec(),
        client_from_wrist,
        field: field.to_string(),
    })
}

/// Checks how large all hands of a request are together.
pub(in crate::validate) fn check_meshes_together<'h>(
    field: Field<'_>,
    hands: impl Iterator<Item = &'h GiverHand>,
) {
    let sizes = hands.filter_map(|hand| match hand {
        GiverHand::Jointed(_) => None,
        GiverHand::Meshed(hand) => Some((hand.positions.len(), hand.triangles.len())),
    });
    let (vertices, triangles) = sizes.fold((0, 0), |(a, b), (c, d)| (a + c, b + d));
    if vertices.max(triangles) > MAXIMUM {
        field.add(format_args!(
                "and holdout.presenting_hand have meshes of {vertices} vertices and {triangles} triangles in all; they may have {MAXIMUM} of each"
            ));
    }
}

/// A list as groups of three; empty if it is too long, which is a violation, as are an empty list and a rest.
fn threes<'a, T>(field: Field<'_>, list: &'a [T]) -> &'a [[T; 3]] {
    let (threes, rest) = list.as_chunks::<3>();
    if list.is_empty() || !rest.is_empty() || threes.len() > MAXIMUM {
        field.add(format_args!(
            "has {} numbers; it must have 3 to {}, a multiple of 3",
            list.len(),
            3 * MAXIMUM
        ));
        return &[];
    }
    threes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::{Violations, testing::read_at};

    /// A tetrahedron of the convention's unit.
    fn tetrahedron() -> v1::HandMesh {
        v1::HandMesh {
            client_coordinates: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            triangles: vec![0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2],
            client_from_wrist: None,
        }
    }

    fn violations_of(mesh: &v1::HandMesh) -> Vec<(String, String)> {
        let violations = Violations::default();
        let field = violations.field("presenting_hand");
        let read = meshed_hand(field, mesh, Convention::OpenXr);
        assert_eq!(read.is_none(), !violations.is_empty());
        let listed = violations.into_listed().into_iter();
        listed
            .map(|violation| (violation.field, violation.description))
            .collect()
    }

    #[test]
    fn converts_vertices_and_wrist_from_the_convention() {
        let mesh = v1::HandMesh {
            client_from_wrist: Some(v1::Pose::default()),
            ..tetrahedron()
        };
        let (read, _) = read_at("hand", |field| meshed_hand(field, &mesh, Convention::Unreal));
        let read = read.expect("it is sound");
        let expected: Vec<Vec3> = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z]
            .map(|position| Convention::Unreal.point_to_openxr(position))
            .into();
        assert_eq!(read.positions, expected);
        assert!((read.positions[1].length() - 0.01).abs() < 1e-6);
        assert!(read.client_from_wrist.is_some());
    }

    #[test]
    fn reports_everything_that_is_wrong_at_once() {
        let mut mesh = tetrahedron();
        mesh.client_coordinates[4] = f32::NAN;
        mesh.triangles[2] = 4;
        mesh.client_from_wrist = Some(v1::Pose {
            orientation: Some(v1::Quaternion::default()),
            ..Default::default()
        });
        let [coordinates, triangles, wrist] = &violations_of(&mesh)[..] else {
            panic!("three fields are wrong");
        };
        assert_eq!(coordinates.0, "presenting_hand.client_coordinates");
        assert!(coordinates.1.contains("vertex 1"), "{coordinates:?}");
        assert!(triangles.1.contains("triangle 0, (0, 2, 4)"), "{triangles:?}");
        assert_eq!(wrist.0, "presenting_hand.client_from_wrist.orientation");
    }

    #[test]
    fn rejects_lists_that_are_empty_broken_or_too_long() {
        for (coordinates, triangles) in [(0, 12), (12, 0), (11, 12), (12, 13), (3 * MAXIMUM + 3, 12)] {
            let mesh = v1::HandMesh {
                client_coordinates: vec![0.0; coordinates],
                triangles: vec![0; triangles],
                client_from_wrist: None,
            };
            let violations = violations_of(&mesh);
            assert!(
                violations
                    .iter()
                    .any(|(_, description)| description.contains("multiple of 3")),
                "{violations:?}"
            );
        }
    }
}
