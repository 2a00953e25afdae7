//! Renders scenes to pictures.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::{
    camera::Camera,
    image::Image,
    occlusion::OcclusionMap,
    raster::{self, Coverage, NOTHING},
    scene::{Finish, Scene},
    shading::{KeyArrival, Studio, develop, smoothstep, srgb_bytes},
    shadow::{GroundShadow, ShadowMap},
    surface::{SurfacePoint, Triangle, project, triangles_of},
};

/// Largest number of samples along a pixel's side: 64 samples per pixel.
const MAX_SUPERSAMPLING: u32 = 8;

/// Visibility of markers through other parts, 0 to 1.
const MARKER_GLOW: f32 = 0.38;

/// Settings of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Pixels per row, at least 1.
    pub width: u32,
    /// Number of rows, at least 1.
    pub height: u32,
    /// Samples along each side of a pixel, 1 to 8 (others are clamped): 3 is smooth, 4 is smoother and slower.
    pub supersampling: u32,
    /// Linear RGB of the background at its brightest.
    pub background: Vec3,
    /// Unit vector opposite to gravity: points to the ceiling, away from the ground.
    pub up: Vec3,
    /// Whether to draw a soft shadow on the ground.
    pub ground_shadow: bool,
    /// Radius of ambient occlusion, in metres: about a finger's width for hands.
    pub occlusion_radius: f32,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            width: 900,
            height: 700,
            supersampling: 3,
            background: Vec3::new(0.88, 0.89, 0.905),
            up: Vec3::Y,
            ground_shadow: true,
            occlusion_radius: 0.024,
        }
    }
}

/// Draws a scene. The camera's aspect should be that of the options.
pub fn render(scene: &Scene, camera: &Camera, options: RenderOptions) -> Image {
    let (width, height) = (options.width.max(1) as usize, options.height.max(1) as usize);
    let grid = options.supersampling.clamp(1, MAX_SUPERSAMPLING) as usize;
    let triangles = triangles_of(scene);
    let frame = Frame {
        camera,
        width,
        height,
        grid,
        triangles: &triangles,
    };
    let solid = frame.coverage(|t| t.finish != Finish::Marker);
    let markers = frame.coverage(|t| t.finish == Finish::Marker);

    // The surface in the middle of every pixel, for ambient occlusion.
    let middle = grid / 2;
    let seen: Vec<Option<SurfacePoint>> = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (x, y) = (pixel % width * grid + middle, pixel / width * grid + middle);
            let id = solid.ids[y * solid.width + x];
            let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            (id != NOTHING).then(|| frame.point(id, at))
        })
        .collect();
    let occlusion = OcclusionMap::new(camera, width, height, &seen, options.occlusion_radius);
    let studio = Studio::new(camera, options.up);
    let lighting = Lighting {
        shadow: ShadowMap::new(&triangles, studio.key_direction()),
        ground: options
            .ground_shadow
            .then(|| GroundShadow::new(&triangles, options.up))
            .flatten(),
        studio,
        occlusion,
        background: options.background,
    };

    let mut pixels = vec![0; width * height * 3];
    pixels.par_chunks_mut(width * 3).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let colour = frame.pixel(x, y, &solid, &markers, &lighting);
            pixel.copy_from_slice(&srgb_bytes(colour));
        }
    });
    Image::from_rgb(width, height, pixels)
}

/// Draws a scene as a PNG, framed from a direction (from the scene to the camera) with the options' up at the top.
pub fn render_png(scene: &Scene, direction: Vec3, options: RenderOptions) -> Vec<u8> {
    let aspect = options.width.max(1) as f32 / options.height.max(1) as f32;
    let camera = Camera::framing(scene, direction, options.up, aspect);
    render(scene, &camera, options).to_png()
}

/// Everything but the triangles that a pixel's colour depends on.
struct Lighting {
    studio: Studio,
    shadow: Option<ShadowMap>,
    ground: Option<GroundShadow>,
    occlusion: OcclusionMap,
    background: Vec3,
}

/// The picture's grid of samples.
struct Frame<'a> {
    camera: &'a Camera,
    width: usize,
    height: usize,
    grid: usize,
    triangles: &'a [Triangle],
}

/// The samples of one pixel that show the same triangle.
#[derive(Clone, Copy)]
struct Patch {
    id: u32,
    count: f32,
    /// Sum of the samples' positions.
    sum: Vec2,
}

impl Frame<'_> {
    fn coverage(&self, wanted: impl Fn(&Triangle) -> bool) -> Coverage {
        let (width, height) = (self.width * self.grid, self.height * self.grid);
        let screen = project(self.triangles, self.camera, width, height, wanted);
        let admits = |id: u32, x: usize, y: usize| {
            let triangle = &self.triangles[id as usize];
            triangle.alpha >= 1.0 || self.shows(triangle, x % self.grid, y % self.grid)
        };
        raster::rasterise(width, height, &screen, admits)
    }

    /// Whether a transparent triangle is drawn at a sample of its pixel. Each part takes a fraction of the samples given by
    /// its alpha, and starts at a different sample: transparent parts do not hide each other.
    fn shows(&self, triangle: &Triangle, x: usize, y: usize) -> bool {
        let count = self.grid * self.grid;
        // A stride coprime to the number of samples spreads them over the pixel.
        let stride = if count.is_multiple_of(5) { 7 } else { 5 };
        let rank = ((y * self.grid + x) * stride + triangle.part as usize) % count;
        (rank as f32) + 0.5 < triangle.alpha * count as f32
    }

    fn ray(&self, sample: Vec2) -> Vec3 {
        let size = Vec2::new((self.width * self.grid) as f32, (self.height * self.grid) as f32);
        self.camera.ray(sample / size)
    }

    fn point(&self, id: u32, sample: Vec2) -> SurfacePoint {
        let eye = self.camera.world_from_camera.position;
        self.triangles[id as usize].seen_from(eye, self.ray(sample))
    }

    /// The display colour of a pixel: each triangle in it is shaded once, in the middle of its samples.
    fn pixel(&self, x: usize, y: usize, solid: &Coverage, markers: &Coverage, light: &Lighting) -> Vec3 {
        let samples = (self.grid * self.grid) as f32;
        let mut colour = Vec3::ZERO;
        self.for_each_patch(
            x,
            y,
            |sample| solid.ids[sample],
            |patch| {
                let place = patch.sum / patch.count;
                let shaded = if patch.id == NOTHING {
                    self.backdrop(place, light)
                } else {
                    let point = self.point(patch.id, place);
                    let eye = self.camera.world_from_camera;
                    let depth = -eye.inverse().transform_point(point.position).z;
                    let openness = light.occlusion.openness(x, y, depth);
                    let key = light.shadow.as_ref().map_or(
                        KeyArrival {
                            lit: 1.0,
                            thickness: 0.0,
                        },
                        |map| map.arrival(&point),
                    );
                    develop(light.studio.shade(&point, key, openness))
                };
                colour += shaded * (patch.count / samples);
            },
        );

        if self.sees_nothing(x, y, markers) {
            return colour;
        }
        // Markers on top: opaque in front, a faint glow where hidden.
        let mut covered = 0.0;
        let mut marked = Vec3::ZERO;
        let lit = KeyArrival {
            lit: 1.0,
            thickness: 0.0,
        };
        for hidden in [false, true] {
            let id_at = |sample: usize| {
                let is_hidden = markers.depths[sample] < solid.depths[sample];
                if is_hidden == hidden {
                    markers.ids[sample]
                } else {
                    NOTHING
                }
            };
            self.for_each_patch(x, y, id_at, |patch| {
                if patch.id != NOTHING {
                    let point = self.point(patch.id, patch.sum / patch.count);
                    let strength = if hidden { MARKER_GLOW } else { 1.0 } * patch.count / samples;
                    marked += develop(light.studio.shade(&point, lit, 1.0)) * strength;
                    covered += strength;
                }
            });
        }
        colour * (1.0 - covered) + marked
    }

    fn sees_nothing(&self, x: usize, y: usize, coverage: &Coverage) -> bool {
        (y * self.grid..(y + 1) * self.grid).all(|row| {
            let start = row * coverage.width + x * self.grid;
            coverage.ids[start..start + self.grid]
                .iter()
                .all(|&id| id == NOTHING)
        })
    }

    /// Calls `visit` for every different id among a pixel's samples, in the order of their first sample.
    fn for_each_patch(&self, x: usize, y: usize, id_at: impl Fn(usize) -> u32, mut visit: impl FnMut(Patch)) {
        const MOST: usize = (MAX_SUPERSAMPLING * MAX_SUPERSAMPLING) as usize;
        let mut patches = [Patch {
            id: NOTHING,
            count: 0.0,
            sum: Vec2::ZERO,
        }; MOST];
        let mut used = 0;
        let row_length = self.width * self.grid;
        for row in y * self.grid..(y + 1) * self.grid {
            for column in x * self.grid..(x + 1) * self.grid {
                let id = id_at(row * row_length + column);
                let known = patches[..used].iter().position(|patch| patch.id == id);
                let slot = known.unwrap_or(used);
                if slot == used {
                    patches[slot].id = id;
                    used += 1;
                }
                patches[slot].count += 1.0;
                patches[slot].sum += Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
            }
        }
        patches[..used].iter().copied().for_each(&mut visit);
    }

    /// The background: a lit wall that darkens toward the picture's corners and floor, with the ground's shadow.
    fn backdrop(&self, sample: Vec2, light: &Lighting) -> Vec3 {
        let size = Vec2::new((self.width * self.grid) as f32, (self.height * self.grid) as f32);
        let at = sample / size * 2.0 - 1.0;
        let glow = 1.0 - smoothstep(0.2, 2.1, (at - Vec2::new(0.0, -0.25)).length());
        let wall = light.background * (0.74 + 0.26 * glow);
        let ground = light.ground.as_ref().map_or(0.0, |ground| {
            ground.darkness(self.camera.world_from_camera.position, self.ray(sample))
        });
        wall * (1.0 - ground)
    }
}

#[cfg(test)]
mod tests;
