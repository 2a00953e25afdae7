//! Rays into a scene: the surface that each one meets first.

use std::time::Duration;

use glam::Vec3;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    ray::{Ray, RayHit},
    triangle::Triangle,
};

use crate::scene::{Finish, Part, Scene, face_normal};

/// Surfaces that rays can meet, in a hierarchy of boxes.
pub(crate) struct Tracer {
    /// In the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
    looks: Vec<Look>,
    /// `None` if there are no triangles.
    boxes: Option<Bvh2>,
}

/// How a triangle looks.
#[derive(Clone, Copy)]
struct Look {
    /// Smooth unit normals at its corners.
    normals: [Vec3; 3],
    /// Linear RGB at its corners.
    colours: [Vec3; 3],
    finish: Finish,
    /// Index of its part.
    part: usize,
}

/// A point of a surface that a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub(crate) distance: f32,
    /// Where rays from the surface may start: on its smooth shape, so that flat triangles do not shade each other.
    pub(crate) start: Vec3,
    /// Smooth unit normal, on the side that the ray comes from.
    pub(crate) normal: Vec3,
    /// Linear RGB.
    pub(crate) colour: Vec3,
    pub(crate) finish: Finish,
    /// Index of the part in the scene.
    pub(crate) part: usize,
}

impl Tracer {
    /// The parts of a scene that are wanted.
    pub(crate) fn new(scene: &Scene, is_wanted: impl Fn(&Part) -> bool) -> Self {
        let (mut triangles, mut looks) = (Vec::new(), Vec::new());
        for (index, part) in scene.parts.iter().enumerate().filter(|(_, part)| is_wanted(part)) {
            for (&triangle, normals) in part.triangles.iter().zip(part.corner_normals()) {
                let [v0, v1, v2] = part.corners(triangle).map(Into::into);
                triangles.push(Triangle { v0, v1, v2 });
                looks.push(Look {
                    normals,
                    colours: triangle.map(|vertex| part.vertex_colour(vertex)),
                    finish: part.finish,
                    part: index,
                });
            }
        }
        if triangles.is_empty() {
            return Self {
                triangles,
                looks,
                boxes: None,
            };
        }
        // Reinsertion would take minutes for thousands of triangles in one place.
        let params = BvhBuildParams {
            reinsertion_batch_ratio: 0.0,
            ..BvhBuildParams::fast_build()
        };
        let boxes = build_bvh2_from_tris(&triangles, params, &mut Duration::default());
        let order = || boxes.primitive_indices.iter().map(|&index| index as usize);
        Self {
            triangles: order().map(|index| triangles[index]).collect(),
            looks: order().map(|index| looks[index]).collect(),
            boxes: Some(boxes),
        }
    }

    /// The first surface that a ray of unit direction meets.
    pub(crate) fn first_hit(&self, start: Vec3, direction: Vec3) -> Option<Hit> {
        let ray = Ray::new_inf(start.into(), direction.into());
        let mut hit = RayHit::none();
        let boxes = self.boxes.as_ref()?;
        if !boxes.ray_traverse(ray, &mut hit, |ray, index| self.triangles[index].intersect(ray)) {
            return None;
        }
        let look = &self.looks[hit.primitive_id as usize];
        let Triangle { v0, v1, v2 } = self.triangles[hit.primitive_id as usize];
        let position = start + direction * hit.t;
        let corners = [v0, v1, v2].map(Vec3::from);
        let face = face_normal(corners);
        let shares = shares_at(corners, position);
        let mix = |[a, b, c]: [Vec3; 3]| a * shares.x + b * shares.y + c * shares.z;
        let side = if face.dot(direction) > 0.0 { -1.0 } else { 1.0 };
        // Onto the corners' tangent planes, where these are above (Hanika 2021).
        let raised = [0, 1, 2].map(|corner| {
            let normal = look.normals[corner] * side;
            position - normal * (position - corners[corner]).dot(normal).min(0.0)
        });
        Some(Hit {
            distance: hit.t,
            start: mix(raised),
            normal: mix(look.normals).normalize_or(face) * side,
            colour: mix(look.colours),
            finish: look.finish,
            part: look.part,
        })
    }

    /// Whether a ray meets anything within `reach` metres.
    pub(crate) fn is_blocked(&self, start: Vec3, direction: Vec3, reach: f32) -> bool {
        let ray = Ray::new(start.into(), direction.into(), 0.0, reach);
        self.boxes.as_ref().is_some_and(|boxes| {
            !boxes.ray_traverse_miss(ray, |ray, index| self.triangles[index].intersect(ray))
        })
    }
}

/// The barycentric coordinates of a point of a triangle.
fn shares_at([a, b, c]: [Vec3; 3], point: Vec3) -> Vec3 {
    let normal = (b - a).cross(c - a);
    let share = |from: Vec3, to: Vec3| normal.dot((to - from).cross(point - from));
    let shares = Vec3::new(share(b, c), share(c, a), share(a, b));
    let sum = shares.element_sum();
    if sum > 0.0 { shares / sum } else { Vec3::X }
}
