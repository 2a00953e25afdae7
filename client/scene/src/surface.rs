//! A scene's triangles as the renderer wants them, and where a ray meets one.

use glam::{Vec2, Vec3};

use crate::{
    camera::{Camera, NEAR},
    normals::{corner_normals, face_normal},
    raster::ScreenTriangle,
    scene::{Finish, Scene},
};

/// A triangle with what its corners carry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// In the world, in metres.
    pub(crate) corners: [Vec3; 3],
    /// Smooth unit normals.
    pub(crate) normals: [Vec3; 3],
    /// Linear RGB.
    pub(crate) colours: [Vec3; 3],
    /// 0 to 1.
    pub(crate) alpha: f32,
    /// How it takes the light.
    pub(crate) finish: Finish,
    /// Index of its part.
    pub(crate) part: u32,
}

/// A point of a surface as seen by the camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    /// In the world, in metres.
    pub(crate) position: Vec3,
    /// Smooth unit normal, on the camera's side.
    pub(crate) normal: Vec3,
    /// The triangle's own unit normal, on the camera's side.
    pub(crate) face: Vec3,
    /// Unit vector to the camera.
    pub(crate) to_camera: Vec3,
    /// Linear RGB.
    pub(crate) colour: Vec3,
    /// How it takes the light.
    pub(crate) finish: Finish,
}

/// All triangles of a scene, part by part.
pub(crate) fn triangles_of(scene: &Scene) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for (index, part) in scene.parts.iter().enumerate() {
        let normals = corner_normals(part);
        triangles.extend(
            part.triangles
                .iter()
                .zip(normals)
                .map(|(triangle, normals)| Triangle {
                    corners: triangle.map(|v| part.positions[v as usize]),
                    normals,
                    colours: triangle.map(|v| part.vertex_colour(v)),
                    alpha: part.colour[3],
                    finish: part.finish,
                    part: index as u32,
                }),
        );
    }
    triangles
}

impl Triangle {
    /// What a ray from the camera meets. The ray is taken to hit the triangle: places outside are moved to its rim.
    pub(crate) fn seen_from(&self, camera: Vec3, ray: Vec3) -> SurfacePoint {
        let [a, b, c] = self.corners;
        // Möller and Trumbore 1997.
        let (e1, e2) = (b - a, c - a);
        let p = ray.cross(e2);
        let determinant = e1.dot(p);
        let s = camera - a;
        let (v, w) = if determinant.abs() > f32::MIN_POSITIVE {
            (s.dot(p) / determinant, ray.dot(s.cross(e1)) / determinant)
        } else {
            (1.0 / 3.0, 1.0 / 3.0)
        };
        let (v, w) = (v.clamp(0.0, 1.0), w.clamp(0.0, 1.0));
        let excess = (v + w).max(1.0);
        let (v, w) = (v / excess, w / excess);
        let mix = |[a, b, c]: [Vec3; 3]| a * (1.0 - v - w) + b * v + c * w;

        let position = mix(self.corners);
        let to_camera = (camera - position).normalize_or(Vec3::Z);
        let face = face_normal(self.corners);
        let side = if face.dot(to_camera) < 0.0 { -1.0 } else { 1.0 };
        SurfacePoint {
            position,
            normal: mix(self.normals).normalize_or(face) * side,
            face: face * side,
            to_camera,
            colour: mix(self.colours),
            finish: self.finish,
        }
    }
}

/// The triangles on a screen of `width` × `height` samples, cut off at the camera; ids are their indices.
pub(crate) fn project(
    triangles: &[Triangle],
    camera: &Camera,
    width: usize,
    height: usize,
    wanted: impl Fn(&Triangle) -> bool,
) -> Vec<ScreenTriangle> {
    let camera_from_world = camera.world_from_camera.inverse().to_affine();
    let size = Vec2::new(width as f32, height as f32);
    let to_screen = |local: Vec3| {
        let at = camera.project_local(local);
        (at.truncate() * size).extend(at.z.recip())
    };
    let mut projected = Vec::with_capacity(triangles.len());
    for (id, triangle) in triangles.iter().enumerate() {
        if !wanted(triangle) {
            continue;
        }
        let local = triangle.corners.map(|c| camera_from_world.transform_point3(c));
        let (polygon, count) = clipped_near(local);
        for last in 2..count {
            projected.push(ScreenTriangle {
                corners: [polygon[0], polygon[last - 1], polygon[last]].map(to_screen),
                id: id as u32,
            });
        }
    }
    projected
}

/// The part of a triangle in front of the camera (Sutherland and Hodgman 1974): its corners and how many there are.
fn clipped_near(corners: [Vec3; 3]) -> ([Vec3; 4], usize) {
    let mut polygon = [Vec3::ZERO; 4];
    let mut count = 0;
    let mut push = |corner: Vec3| {
        polygon[count] = corner;
        count += 1;
    };
    for i in 0..3 {
        let (from, to) = (corners[i], corners[(i + 1) % 3]);
        let (inside, next_inside) = (from.z <= -NEAR, to.z <= -NEAR);
        if inside {
            push(from);
        }
        if inside != next_inside {
            push(from.lerp(to, (-NEAR - from.z) / (to.z - from.z)));
        }
    }
    (polygon, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipping_keeps_what_is_in_front() {
        let behind = Vec3::new(0.0, 1.0, 1.0);
        let front = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 0.0, -1.0)];
        let (polygon, count) = clipped_near([front[0], front[1], behind]);
        assert_eq!(count, 4);
        assert!(polygon.iter().all(|p| p.z <= -NEAR * 0.999));
        assert_eq!(clipped_near([behind; 3]).1, 0);
        assert_eq!(clipped_near([front[0], front[1], Vec3::new(0.0, 1.0, -2.0)]).1, 3);
        assert_eq!(clipped_near([front[0], behind, behind + Vec3::X]).1, 3);
    }
}
