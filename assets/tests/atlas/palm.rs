//! The palm's contacts against the surface that it lies on.

use glam::Vec3;
use grasp_assets::atlases;
use grasp_synthesis::{
    geometry::{mesh::TriangleMesh, mesh_bvh::MeshBvh},
    known::codec::decode,
    model::hand::{HandPart, Handedness},
};

use crate::support::{adult, object};

/// A contact's normal may be that of any triangle so near, in metres, …
const NEAR: f32 = 5e-4;

/// … or between those of triangles that meet where it is, which are as near as rounding leaves them, …
const MEETING: f32 = 2e-5;

/// … to so many degrees.
const ANGLE: f32 = 15.0;

/// A triangle by itself, with its first corner and how far its points are from there at most.
struct Triangle {
    surface: MeshBvh,
    corner: Vec3,
    reach: f32,
}

impl Triangle {
    fn of(mesh: &TriangleMesh, triangle: usize) -> Self {
        let corners = mesh.corners(triangle);
        let alone = TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2]]).expect("a triangle of a mesh");
        Self {
            surface: MeshBvh::build_quick(alone),
            corner: corners[0],
            reach: corners[0]
                .distance(corners[1])
                .max(corners[0].distance(corners[2])),
        }
    }

    fn is_near(&self, point: Vec3, distance: f32) -> bool {
        self.corner.distance(point) <= self.reach + distance
            && self.surface.closest_point_within(point, distance).is_some()
    }
}

/// Normals of the triangles that are at most so far from a point.
fn normals_near(triangles: &[Triangle], point: Vec3, distance: f32) -> Vec<Vec3> {
    let near = triangles
        .iter()
        .filter(|triangle| triangle.is_near(point, distance));
    near.map(|triangle| triangle.surface.mesh().normal(0)).collect()
}

/// What a unit vector is off the nearest sum of some normals with weights that are not negative: projected on one after the
/// other until nothing changes.
fn off_between(normals: &[Vec3], direction: Vec3) -> f32 {
    let mut weights = vec![0.0_f32; normals.len()];
    let mut rest = direction;
    for _ in 0..200 {
        for (weight, normal) in weights.iter_mut().zip(normals) {
            let better = (*weight + rest.dot(*normal)).max(0.0);
            rest -= *normal * (better - *weight);
            *weight = better;
        }
    }
    rest.length()
}

/// A palm is made of solids that overlap. Where one of them touches an edge, the bone of another is off aside, and a normal
/// toward that would be none that the edge has.
#[test]
fn palms_press_along_normals_of_the_surface() {
    let rig = adult(Handedness::Right);
    let mut count = 0;
    for name in ["remote", "scalpel", "scissors"] {
        let object = object(name);
        let mesh = object.surface.mesh();
        let triangles: Vec<Triangle> = (0..mesh.triangles().len())
            .map(|triangle| Triangle::of(mesh, triangle))
            .collect();
        let bytes = atlases::atlas(name, rig).expect("it is shipped");
        let grown = decode(bytes, object, rig).expect("it is up to date");
        let contacts = grown.atlas.entries().iter().flat_map(|entry| &entry.contacts);
        for contact in contacts.filter(|contact| contact.part == HandPart::Palm) {
            let is_of_one = normals_near(&triangles, contact.position, NEAR)
                .into_iter()
                .any(|normal| normal.dot(contact.normal) > ANGLE.to_radians().cos());
            let meeting = normals_near(&triangles, contact.position, MEETING);
            let is_between = off_between(&meeting, contact.normal) < ANGLE.to_radians().sin();
            assert!(is_of_one || is_between, "{name}: {contact:?} beside {meeting:?}");
            count += 1;
        }
    }
    assert!(count > 1000, "{count} contacts of palms");
}
