//! A scene's triangles in the renderer's form, and their intersection with rays.

use glam::{Vec2, Vec3};

use crate::{
    camera::{Camera, NEAR},
    normals::{corner_normals, face_normal},
    raster::ScreenTriangle,
    scene::{Finish, Scene},
};

/// Pieces along each edge of a curved triangle: 3 make outlines of hands of 5000 triangles smooth.
const PIECES: u32 = 3;

/// Curvature of curved triangles, from 0 (flat) to 1; 3/4 as the method's authors recommend.
const CURVATURE: f32 = 0.75;

/// A triangle with attributes of its corners.
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
    /// Finish.
    pub(crate) finish: Finish,
    /// Index of its part.
    pub(crate) part: u32,
}

/// A surface point seen by the camera.
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
    /// Finish.
    pub(crate) finish: Finish,
}

/// All triangles of a scene, part by part, unchanged: for the choice of views.
pub(crate) fn flat_triangles_of(scene: &Scene) -> Vec<Triangle> {
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

/// All triangles of a scene, part by part, with skin curved: for pictures.
pub(crate) fn triangles_of(scene: &Scene) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for triangle in flat_triangles_of(scene) {
        if triangle.finish == Finish::Skin {
            triangle.split_curved(&mut triangles);
        } else {
            triangles.push(triangle);
        }
    }
    triangles
}

/// A point of a triangle bent toward the tangent planes at its corners (Phong tessellation, Boubekeur and Alexa 2008),
/// given by its barycentric coordinates. Along an edge it depends only on the edge's ends: neighbours stay joined.
pub(crate) fn curved_point(corners: [Vec3; 3], normals: [Vec3; 3], shares: Vec3) -> Vec3 {
    let flat = mix(corners, shares);
    let onto_plane = |i: usize| flat - normals[i] * (flat - corners[i]).dot(normals[i]);
    flat.lerp(
        mix([onto_plane(0), onto_plane(1), onto_plane(2)], shares),
        CURVATURE,
    )
}

fn mix([a, b, c]: [Vec3; 3], shares: Vec3) -> Vec3 {
    a * shares.x + b * shares.y + c * shares.z
}

impl Triangle {
    /// Adds the triangle's pieces, bent toward its normals.
    fn split_curved(&self, pieces: &mut Vec<Self>) {
        let corner = |i: u32, j: u32| {
            let shares = Vec3::new((PIECES - i - j) as f32, i as f32, j as f32) / PIECES as f32;
            (
                curved_point(self.corners, self.normals, shares),
                mix(self.normals, shares).normalize_or(self.normals[0]),
                mix(self.colours, shares),
            )
        };
        let mut push = |places: [(u32, u32); 3]| {
            let [a, b, c] = places.map(|(i, j)| corner(i, j));
            pieces.push(Self {
                corners: [a.0, b.0, c.0],
                normals: [a.1, b.1, c.1],
                colours: [a.2, b.2, c.2],
                ..*self
            });
        };
        for i in 0..PIECES {
            for j in 0..PIECES - i {
                push([(i, j), (i + 1, j), (i, j + 1)]);
                if i + j + 1 < PIECES {
                    push([(i + 1, j), (i + 1, j + 1), (i, j + 1)]);
                }
            }
        }
    }

    /// The point where a ray from the camera meets the triangle; misses are moved to its border.
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
        let shares = Vec3::new(1.0 - v - w, v, w);

        let position = mix(self.corners, shares);
        let to_camera = (camera - position).normalize_or(Vec3::Z);
        let face = face_normal(self.corners);
        let side = if face.dot(to_camera) < 0.0 { -1.0 } else { 1.0 };
        SurfacePoint {
            position,
            normal: mix(self.normals, shares).normalize_or(face) * side,
            face: face * side,
            to_camera,
            colour: mix(self.colours, shares),
            finish: self.finish,
        }
    }
}

/// The triangles on a screen of `width` × `height` samples, clipped at the camera; ids are their indices.
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

/// The part of a triangle in front of the camera (Sutherland and Hodgman 1974): its corners and their number.
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
    use crate::scene::Part;

    #[test]
    fn curved_skin_is_closed_and_closer_to_the_true_shape() {
        // A ball of 6 × 4 faces: its flat triangles reach deep below the ball's surface.
        let mut coarse = Part::new("ball", Vec::new(), Vec::new(), [1.0; 4]).with_finish(Finish::Skin);
        coarse.crease_angle = std::f32::consts::PI;
        for ring in 1..4_u16 {
            for side in 0..6_u16 {
                let (sin, cos) = (f32::from(side) * std::f32::consts::FRAC_PI_3).sin_cos();
                let (radius, y) = (f32::from(ring) * std::f32::consts::FRAC_PI_4).sin_cos();
                coarse.positions.push(Vec3::new(radius * cos, y, radius * sin));
            }
        }
        coarse.positions.extend([Vec3::Y, Vec3::NEG_Y]);
        for side in 0..6 {
            let next = (side + 1) % 6;
            coarse
                .triangles
                .extend([[18, next, side], [19, 12 + side, 12 + next]]);
            for ring in [0, 6] {
                let (a, b, c, d) = (ring + side, ring + next, ring + 6 + side, ring + 6 + next);
                coarse.triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
        let scene = Scene { parts: vec![coarse] };
        let (flat, curved) = (flat_triangles_of(&scene), triangles_of(&scene));
        assert_eq!(curved.len(), flat.len() * 9);
        let volume = |triangles: &[Triangle]| {
            let six: f32 = triangles
                .iter()
                .map(|t| t.corners[0].dot(t.corners[1].cross(t.corners[2])))
                .sum();
            six / 6.0
        };
        let ball = 4.0 / 3.0 * std::f32::consts::PI;
        let (flat, curved_volume) = (volume(&flat), volume(&curved));
        assert!(
            flat > 0.0 && (curved_volume - ball).abs() < 0.4 * (flat - ball).abs(),
            "{flat} {curved_volume}"
        );
        // Closed: the vector areas of a closed surface sum to zero.
        let areas = curved
            .iter()
            .map(|t| (t.corners[1] - t.corners[0]).cross(t.corners[2] - t.corners[0]));
        assert!(areas.sum::<Vec3>().length() < 1e-4);
    }

    #[test]
    fn clipping_keeps_the_part_in_front() {
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
