//! The palm's contacts against the surface it lies on.

use glam::Vec3;
use grasp_synthesis::{
    geometry::{mesh::TriangleMesh, mesh_bvh::MeshBvh},
    model::hand::HandPart,
};

use crate::fixtures::{
    atlases::complete_atlas,
    objects::{OBJECT_NAMES, object},
};

/// A contact's normal may be that of any triangle within this distance, in metres, …
const NEAR: f32 = 5e-4;

/// … or between those of triangles that meet at the contact, up to rounding in metres, …
const MEETING: f32 = 2e-5;

/// … within this many degrees.
const ANGLE: f32 = 15.0;

/// A single triangle, with its first corner and the largest distance of its points from there.
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

/// Normals of the triangles within a distance of a point.
fn normals_near(triangles: &[Triangle], point: Vec3, distance: f32) -> Vec<Vec3> {
    let near = triangles
        .iter()
        .filter(|triangle| triangle.is_near(point, distance));
    near.map(|triangle| triangle.surface.mesh().normal(0)).collect()
}

/// Distance of a unit vector from the cone spanned by some normals, by projecting onto one after the other until
/// nothing changes.
fn distance_from_cone(normals: &[Vec3], direction: Vec3) -> f32 {
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

/// A palm consists of overlapping solids. Where one touches an edge, the axis of another lies to the side, and a normal
/// toward that axis would be none of the edge's.
#[test]
fn palm_contacts_have_normals_of_the_surface() {
    let mut count = 0;
    for name in OBJECT_NAMES {
        let mesh = object(name).surface.mesh();
        let triangles: Vec<Triangle> = (0..mesh.triangles().len())
            .map(|triangle| Triangle::of(mesh, triangle))
            .collect();
        let atlas = complete_atlas(name);
        let contacts = atlas.entries().iter().flat_map(|entry| &entry.contacts);
        for contact in contacts.filter(|contact| contact.part == HandPart::Palm) {
            let is_of_triangle = normals_near(&triangles, contact.position, NEAR)
                .into_iter()
                .any(|normal| normal.dot(contact.normal) > ANGLE.to_radians().cos());
            let meeting = normals_near(&triangles, contact.position, MEETING);
            let is_between = distance_from_cone(&meeting, contact.normal) < ANGLE.to_radians().sin();
            assert!(
                is_of_triangle || is_between,
                "{name}: {contact:?}, normals {meeting:?}"
            );
            count += 1;
        }
    }
    assert!(count > 1000, "{count} contacts of palms");
}
