//! Renders parts to pictures by tracing rays.
//!
//! The light that casts shadows comes from the upper left of the camera, which lights every view well; ceiling and floor add
//! light that only near surfaces block. Every pixel is the mean of a grid of samples; each tries another point of the light
//! and another direction of its surroundings, which softens shadows.

use std::time::Duration;

use glam::{Vec2, Vec3};
use grasp_synthesis::base::pose::Pose;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    ray::{Ray, RayHit},
    triangle::Triangle,
};
use rayon::prelude::*;

use crate::{
    camera::Camera,
    image::Image,
    parts::{Finish, Part, face_normal, smoothstep, srgb_from_linear},
};

/// Samples along each side of a pixel: 4 would be smoother and slower.
const SUPERSAMPLING: u32 = 3;

/// Unit direction of the light in the camera's axes, its linear RGB, and its width as seen from the scene, in radians.
const LIGHT_DIRECTION: Vec3 = Vec3::new(-0.460, 0.628, 0.628);
const LIGHT: Vec3 = Vec3::new(0.88, 0.85, 0.81);
const LIGHT_WIDTH: f32 = 0.15;

/// Light from above and from below, linear RGB: a bright ceiling and a warm floor.
const CEILING: Vec3 = Vec3::new(0.44, 0.46, 0.50);
const FLOOR: Vec3 = Vec3::new(0.25, 0.235, 0.22);

/// Surfaces within this distance block light of the surroundings, in metres: about a finger's width.
const SURROUNDINGS: f32 = 0.024;

/// Rays from a surface start this far above it, in metres, so that rounding does not let it shade itself.
const LIFT: f32 = 0.2e-3;

/// Visibility of markers through other parts, 0 to 1.
const MARKER_GLOW: f32 = 0.38;

/// Linear RGB of the background at its brightest.
const BACKGROUND: Vec3 = Vec3::new(0.88, 0.89, 0.905);

/// Pixels of a picture, each side at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewSize {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
}

impl ViewSize {
    pub(crate) fn aspect(self) -> f32 {
        self.width as f32 / self.height as f32
    }
}

/// Draws a stage. The camera's aspect should be that of the size; `up` is the unit vector to the ceiling. The same stage gives
/// the same bytes for any number of threads.
pub(crate) fn render(
    stage: &Stage,
    camera: &Camera,
    ViewSize { width, height }: ViewSize,
    up: Vec3,
) -> Image {
    let (width, height) = (width as usize, height as usize);
    let samples = samples();
    let size = Vec2::new(width as f32, height as f32);
    let mut pixels = vec![0; width * height * 3];
    pixels.par_chunks_mut(width * 3).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let corner = Vec2::new(x as f32, y as f32);
            let light = samples.iter().map(|sample| {
                let at = (corner + sample.within) / size;
                let ray = camera.ray(at);
                let seen = stage.seen(camera.world_from_camera.position, ray);
                let solid = seen.solid.as_ref();
                let solid = solid.map(|hit| stage.shaded(hit, ray, sample, camera.world_from_camera, up));
                seen.with_marker(ray, solid.unwrap_or_else(|| backdrop(at)))
            });
            let mean = light.sum::<Vec3>() / samples.len() as f32;
            pixel.copy_from_slice(&srgb_from_linear(mean));
        }
    });
    Image {
        width,
        height,
        rgb: pixels,
    }
}

struct Sample {
    /// Its place, from 0 to 1 along each side.
    within: Vec2,
    /// The point of a unit sphere whose direction it tries.
    around: Vec3,
}

fn samples() -> Vec<Sample> {
    const GOLDEN_ANGLE: f32 = 2.399_963;
    let grid = SUPERSAMPLING;
    let count = grid * grid;
    let sample = |index: u32| {
        let cell = Vec2::new((index % grid) as f32, (index / grid) as f32);
        // On a spiral from pole to pole, in another order than the cells.
        let place = (index * 5 % count) as f32;
        let height = 1.0 - (2.0 * place + 1.0) / count as f32;
        let (sin, cos) = (place * GOLDEN_ANGLE).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        Sample {
            within: (cell + 0.5) / grid as f32,
            around: Vec3::new(radius * cos, radius * sin, height),
        }
    };
    (0..count).map(sample).collect()
}

/// A wall that is darker toward the picture's corners and floor.
fn backdrop(at: Vec2) -> Vec3 {
    let from_middle = (at * 2.0 - Vec2::new(1.0, 0.75)).length();
    BACKGROUND * (1.0 - 0.26 * smoothstep(0.2, 2.1, from_middle))
}

/// Solid parts, and markers, which are visible through them.
pub(crate) struct Stage {
    solids: Tracer,
    markers: Tracer,
}

/// The first solid and the first marker along a ray.
pub(crate) struct Seen {
    pub(crate) solid: Option<Hit>,
    pub(crate) marker: Option<Hit>,
}

impl Stage {
    pub(crate) fn new(parts: &[Part]) -> Self {
        Self {
            solids: Tracer::new(parts, false),
            markers: Tracer::new(parts, true),
        }
    }

    pub(crate) fn seen(&self, eye: Vec3, ray: Vec3) -> Seen {
        Seen {
            solid: self.solids.first_hit(eye, ray),
            marker: self.markers.first_hit(eye, ray),
        }
    }

    /// The light from a point that a ray meets.
    fn shaded(&self, hit: &Hit, ray: Vec3, sample: &Sample, camera: Pose, up: Vec3) -> Vec3 {
        let offset = (sample.within - 0.5) * LIGHT_WIDTH;
        let to_light = LIGHT_DIRECTION + offset.extend(0.0);
        let to_light = camera.transform_vector(to_light).normalize_or(up);
        let start = hit.start + hit.normal * LIFT;
        // Light scatters in skin.
        let (wrap, shine, gloss) = match hit.finish {
            Finish::Satin => (0.0, 0.22, 48.0),
            Finish::Metal => (0.0, 0.8, 40.0),
            Finish::Skin => (0.25, 0.06, 16.0),
            Finish::Cloth | Finish::Marker => (0.0, 0.0, 1.0),
        };
        let mut direct = ((hit.normal.dot(to_light) + wrap) / (1.0 + wrap)).max(0.0);
        if direct > 0.0 && self.solids.is_blocked(start, to_light, f32::INFINITY) {
            direct = 0.0;
        }
        let around = (hit.normal + sample.around * 0.999).normalize_or(hit.normal);
        let is_open = !self.solids.is_blocked(start, around, SURROUNDINGS);
        let sky = FLOOR.lerp(CEILING, 0.5 + 0.5 * hit.normal.dot(up));
        let ambient = if is_open { sky } else { sky * 0.25 };
        // Blinn and Phong.
        let half = (to_light - ray).normalize_or(hit.normal);
        let highlight = shine * direct * hit.normal.dot(half).max(0.0).powf(gloss);
        hit.colour * (LIGHT * direct + ambient) + LIGHT * highlight
    }
}

impl Seen {
    /// The light of a place, with the marker that is before or behind it.
    fn with_marker(&self, ray: Vec3, light: Vec3) -> Vec3 {
        let Some(marker) = &self.marker else {
            return light;
        };
        // Nearly flat, with just enough shading to show the shape.
        let marked = marker.colour * (0.72 - 0.28 * marker.normal.dot(ray).min(0.0));
        let glow = if self.is_marker_hidden() { MARKER_GLOW } else { 1.0 };
        light.lerp(marked, glow)
    }

    pub(crate) fn is_marker_hidden(&self) -> bool {
        let [solid, marker] = [self.solid, self.marker].map(|hit| hit.map(|hit| hit.distance));
        solid.is_some_and(|solid| marker.is_some_and(|marker| solid < marker))
    }
}

/// Triangles in a bounding volume hierarchy.
struct Tracer {
    /// In the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
    looks: Vec<Look>,
    /// `None` if there are no triangles.
    boxes: Option<Bvh2>,
}

#[derive(Clone, Copy)]
struct Look {
    normals: [Vec3; 3],
    colours: [Vec3; 3],
    finish: Finish,
    /// Index of its part.
    part: usize,
}

/// A point of a surface that a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    distance: f32,
    /// Where rays from the surface may start: on its smooth shape, so that flat triangles do not shade each other.
    start: Vec3,
    /// Smooth unit normal, on the side that the ray comes from.
    normal: Vec3,
    /// Linear RGB.
    colour: Vec3,
    finish: Finish,
    /// Index of its part.
    pub(crate) part: usize,
}

impl Tracer {
    /// The markers among some parts, or the others.
    fn new(parts: &[Part], are_markers: bool) -> Self {
        let is_wanted = |part: &Part| (part.finish == Finish::Marker) == are_markers;
        let (mut triangles, mut looks) = (Vec::new(), Vec::new());
        for (index, part) in parts.iter().enumerate().filter(|(_, part)| is_wanted(part)) {
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
    fn first_hit(&self, start: Vec3, direction: Vec3) -> Option<Hit> {
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
    fn is_blocked(&self, start: Vec3, direction: Vec3, reach: f32) -> bool {
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

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use crate::parts::sphere;

    const RED: Vec3 = Vec3::new(0.6, 0.02, 0.02);
    const BLUE: Vec3 = Vec3::new(0.02, 0.02, 0.6);
    const SIZE: ViewSize = ViewSize {
        width: 120,
        height: 90,
    };

    /// A camera at `place` that looks at the origin.
    fn looking_from(place: Vec3) -> Camera {
        let mut camera = Camera::framing([Vec3::ZERO], place, Vec3::NEG_Z, 4.0 / 3.0);
        camera.world_from_camera.position = place;
        camera
    }

    fn drawn(parts: impl IntoIterator<Item = Part>, camera: &Camera) -> Image {
        let parts: Vec<Part> = parts.into_iter().collect();
        render(&Stage::new(&parts), camera, SIZE, Vec3::Y)
    }

    fn middle(image: &Image) -> [i32; 3] {
        pixel(image, 60, 45)
    }

    fn pixel(image: &Image, x: usize, y: usize) -> [i32; 3] {
        let start = (y * image.width + x) * 3;
        [0, 1, 2].map(|channel| i32::from(image.rgb[start + channel]))
    }

    #[test]
    fn sphere_covers_the_area_of_its_outline() {
        let (radius, distance) = (0.1, 0.7);
        let camera = looking_from(Vec3::Z * distance);
        let image = drawn([sphere("ball", Vec3::ZERO, radius, RED)], &camera);
        let covered = image.rgb.chunks(3).filter(|pixel| pixel[1] < 150).count();
        // The tangent cone of a ball meets the plane at distance 1 in a circle of radius r / sqrt(d² - r²).
        let outline = PI * radius * radius / (distance * distance - radius * radius);
        let share = outline / (4.0 * camera.tangents.x * camera.tangents.y);
        let measured = covered as f32 / (120.0 * 90.0);
        assert!((measured / share - 1.0).abs() < 0.02, "{measured} is not {share}");
    }

    #[test]
    fn nearer_parts_hide_farther_ones_but_markers_are_faintly_visible() {
        let front = sphere("front", Vec3::Z * 0.1, 0.05, RED);
        let back = sphere("back", Vec3::Z * -0.1, 0.05, BLUE);
        let [r, _, b] = middle(&drawn(
            [back.clone(), front.clone()],
            &looking_from(Vec3::Z * 0.7),
        ));
        assert!(r > 2 * b, "red {r} is in front of blue {b}");
        let [r, _, b] = middle(&drawn([back, front], &looking_from(Vec3::Z * -0.7)));
        assert!(b > 2 * r, "blue {b} is in front of red {r}");
        let camera = looking_from(Vec3::Z * 0.5);
        let ball = sphere("ball", Vec3::ZERO, 0.05, BLUE);
        let mark = |z: f32| sphere("mark", Vec3::Z * z, 0.01, RED).with_finish(Finish::Marker);
        let red_with = |parts: Vec<Part>| middle(&drawn(parts, &camera))[0];
        let none = red_with(vec![ball.clone()]);
        let hidden = red_with(vec![ball.clone(), mark(0.0)]);
        let shown = red_with(vec![ball, mark(0.06)]);
        assert!(
            hidden > none + 10 && shown > hidden + 30,
            "{none} < {hidden} < {shown}"
        );
    }

    #[test]
    fn parts_cast_shadows() {
        // A ball above a slab, seen from above; the light comes from the picture's upper left.
        let corners = [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)].map(|(x, z)| Vec3::new(x, 0.0, z));
        let triangles = vec![[0, 2, 1], [0, 3, 2]];
        let slab = Part::new("slab", corners.to_vec(), triangles, Vec3::splat(0.4));
        let ball = sphere("ball", Vec3::Y * 0.03, 0.03, RED);
        let camera = looking_from(Vec3::Y * 0.6);
        let (alone, with_ball) = (drawn([slab.clone()], &camera), drawn([slab, ball], &camera));
        // Pixels per metre at the slab's distance.
        let scale = 45.0 / (0.6 * camera.tangents.y);
        let brightness = |image: &Image, x: f32, z: f32| {
            pixel(image, (60.0 + scale * x) as usize, (45.0 + scale * z) as usize)[1]
        };
        // Right of and below the ball, away from the light; then far from it, toward the light.
        let change = |x, z| brightness(&with_ball, x, z) - brightness(&alone, x, z);
        assert!(change(0.035, 0.045) < -40);
        let change = change(-0.08, -0.09);
        assert!(change.abs() <= 3, "open ground changed by {change}");
    }
}
