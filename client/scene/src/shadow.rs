//! Shadows: of the key light on all parts, and a soft one on the ground.

use glam::{Mat3, Vec2, Vec3};

use crate::{
    raster::{self, Coverage, NOTHING, ScreenTriangle},
    scene::Finish,
    shading::{KeyArrival, smoothstep},
    surface::{SurfacePoint, Triangle},
};

/// Texels along each side of the key light's map: about half a millimetre per texel for a handover.
const MAP_SIZE: usize = 1024;

/// Half width of the filter that softens shadow borders, in metres; more is softer but loses thin shadows.
const SOFTNESS: f32 = 2.2e-3;

/// Largest half width of the filter, in texels; bounds the work for small scenes.
const MAX_FILTER_TEXELS: i32 = 4;

/// Bias toward the light in depth comparisons, in metres; hides the map's steps.
const BIAS: f32 = 0.7e-3;

/// Thickness beyond which skin is opaque, in metres.
const MAX_THICKNESS: f32 = 20e-3;

/// The key light's view of the scene.
pub(crate) struct ShadowMap {
    /// Rows are the light's axes: x, y in the map and z to the light.
    light_from_world: Mat3,
    /// Map coordinates of a point: (axes - origin) * scale.
    origin: Vec2,
    texels_per_metre: f32,
    coverage: Coverage,
}

fn axes_along(direction: Vec3) -> Mat3 {
    let x = direction.any_orthonormal_vector();
    Mat3::from_cols(x, direction.cross(x), direction).transpose()
}

/// The triangles that cast shadows, projected along z of `axes` onto a square of `size` texels that fits all of them
/// with a border; also the square's origin and its texels per metre.
fn seen_along(
    triangles: &[Triangle],
    axes: Mat3,
    size: usize,
    border_share: f32,
) -> Option<(Vec2, f32, Vec<ScreenTriangle>)> {
    let casters: Vec<[Vec3; 3]> = triangles
        .iter()
        .filter(|t| t.finish != Finish::Marker && t.alpha > 0.5)
        .map(|t| t.corners.map(|c| axes * c))
        .collect();
    let corners = || casters.iter().flatten().map(|c| c.truncate());
    let low = corners().reduce(Vec2::min)?;
    let high = corners().reduce(Vec2::max)?;
    let extent = (high - low).max_element().max(1e-4) * (1.0 + 2.0 * border_share);
    let origin = (low + high) * 0.5 - extent * 0.5;
    let texels_per_metre = size as f32 / extent;
    let screen = casters
        .iter()
        .map(|corners| ScreenTriangle {
            corners: corners.map(|c| ((c.truncate() - origin) * texels_per_metre).extend(c.z)),
            id: 0,
        })
        .collect();
    Some((origin, texels_per_metre, screen))
}

impl ShadowMap {
    /// The map of a light in a direction; none if nothing casts a shadow.
    pub(crate) fn new(triangles: &[Triangle], to_light: Vec3) -> Option<Self> {
        let light_from_world = axes_along(to_light);
        let (origin, texels_per_metre, screen) = seen_along(triangles, light_from_world, MAP_SIZE, 0.02)?;
        Some(Self {
            light_from_world,
            origin,
            texels_per_metre,
            coverage: raster::rasterise(MAP_SIZE, MAP_SIZE, &screen, |_, _, _| true),
        })
    }

    /// The light that arrives at a point: depth comparisons under a soft square around the point, each texel against the
    /// point's tangent plane, which keeps slanted surfaces from shading themselves.
    pub(crate) fn arrival(&self, point: &SurfacePoint) -> KeyArrival {
        let face = self.light_from_world * point.face;
        let local = self.light_from_world * (point.position + point.face * BIAS);
        let at = (local.truncate() - self.origin) * self.texels_per_metre;
        let depth = local.z + BIAS;
        // The plane's change of depth per texel; bounded, as it is infinite for grazing light.
        let slope = if face.z.abs() > 1e-3 {
            -face.truncate() / (face.z * self.texels_per_metre)
        } else {
            Vec2::ZERO
        };
        let steepest = 2.0 / self.texels_per_metre;
        let slope = slope.clamp(Vec2::splat(-steepest), Vec2::splat(steepest));

        let radius = (SOFTNESS * self.texels_per_metre).clamp(1.0, MAX_FILTER_TEXELS as f32);
        let reach = radius.ceil() as i32;
        let centre = (at - 0.5).round();
        let (mut lit, mut thickness, mut total) = (0.0, 0.0, 0.0);
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let texel = centre + Vec2::new(dx as f32, dy as f32);
                let offset = texel + 0.5 - at;
                // A tent filter: borders fade without steps.
                let tent = (1.0 - offset.abs() / (radius + 0.5)).max(Vec2::ZERO);
                let weight = tent.x * tent.y;
                let expected = depth + slope.dot(offset);
                let hidden_by = (self.depth_at(texel) - expected).max(0.0);
                total += weight;
                if hidden_by == 0.0 {
                    lit += weight;
                }
                thickness += weight * hidden_by.min(MAX_THICKNESS);
            }
        }
        KeyArrival {
            lit: lit / total,
            thickness: thickness / total,
        }
    }

    fn depth_at(&self, texel: Vec2) -> f32 {
        let inside = texel.cmpge(Vec2::ZERO).all() && texel.cmplt(Vec2::splat(MAP_SIZE as f32)).all();
        if inside {
            self.coverage.depths[texel.y as usize * MAP_SIZE + texel.x as usize]
        } else {
            f32::NEG_INFINITY
        }
    }
}

/// Texels along each side of the ground's shadow, which is blurred anyway.
const GROUND_SIZE: usize = 256;

/// Border around the blurred shadow, as a fraction of the scene's width.
const GROUND_BORDER: f32 = 0.45;

/// Passes of the box blur; three are close to a Gaussian.
const BLUR_PASSES: usize = 3;

/// Half width of the box blur in texels.
const BLUR_RADIUS: usize = 9;

/// Darkest shade of the ground, 0 to 1.
const GROUND_DARKNESS: f32 = 0.42;

/// A soft shadow straight below the scene, on a plane under its lowest point.
pub(crate) struct GroundShadow {
    axes: Mat3,
    /// Height of the plane along up.
    height: f32,
    origin: Vec2,
    texels_per_metre: f32,
    /// 0 to 1.
    darkness: Vec<f32>,
}

impl GroundShadow {
    /// The shadow of all parts that cast one; none without such parts.
    pub(crate) fn new(triangles: &[Triangle], up: Vec3) -> Option<Self> {
        let axes = axes_along(up);
        let (origin, texels_per_metre, screen) = seen_along(triangles, axes, GROUND_SIZE, GROUND_BORDER)?;
        let depths = screen.iter().flat_map(|t| t.corners.map(|c| c.z));
        let (low, high) = depths.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), z| {
            (low.min(z), high.max(z))
        });
        let coverage = raster::rasterise(GROUND_SIZE, GROUND_SIZE, &screen, |_, _, _| true);
        let mut darkness: Vec<f32> = coverage
            .ids
            .iter()
            .zip(&coverage.depths)
            .map(|(&id, &depth)| {
                if id == NOTHING {
                    0.0
                } else {
                    // Higher parts shade less.
                    GROUND_DARKNESS * (1.0 - 0.6 * (depth - low) / (high - low).max(1e-6))
                }
            })
            .collect();
        for _ in 0..BLUR_PASSES {
            blur_rows(&mut darkness);
            transpose(&mut darkness);
            blur_rows(&mut darkness);
            transpose(&mut darkness);
        }
        Some(Self {
            axes,
            height: low - 0.06 * GROUND_SIZE as f32 / texels_per_metre / (1.0 + 2.0 * GROUND_BORDER),
            origin,
            texels_per_metre,
            darkness,
        })
    }

    /// How much a ray into the background is darkened, 0 to 1.
    pub(crate) fn darkness(&self, camera: Vec3, ray: Vec3) -> f32 {
        let (from, along) = (self.axes * camera, self.axes * ray);
        // Only the ground's upper side exists; toward the horizon the shadow fades.
        let fade = smoothstep(0.02, 0.25, -along.z / along.length().max(1e-9));
        if fade == 0.0 || from.z <= self.height {
            return 0.0;
        }
        let on_ground = from + along * ((self.height - from.z) / along.z);
        let at = (on_ground.truncate() - self.origin) * self.texels_per_metre - 0.5;
        let corner = at.floor();
        let share = at - corner;
        let texel = |dx: f32, dy: f32| {
            let (x, y) = (corner.x + dx, corner.y + dy);
            let end = GROUND_SIZE as f32;
            if x < 0.0 || y < 0.0 || x >= end || y >= end {
                0.0
            } else {
                self.darkness[y as usize * GROUND_SIZE + x as usize]
            }
        };
        let top = texel(0.0, 0.0) * (1.0 - share.x) + texel(1.0, 0.0) * share.x;
        let bottom = texel(0.0, 1.0) * (1.0 - share.x) + texel(1.0, 1.0) * share.x;
        fade * (top * (1.0 - share.y) + bottom * share.y)
    }
}

fn blur_rows(values: &mut [f32]) {
    let mut blurred = [0.0; GROUND_SIZE];
    for row in values.chunks_mut(GROUND_SIZE) {
        for (x, value) in blurred.iter_mut().enumerate() {
            let window = &row[x.saturating_sub(BLUR_RADIUS)..(x + BLUR_RADIUS + 1).min(GROUND_SIZE)];
            *value = window.iter().sum::<f32>() / (2 * BLUR_RADIUS + 1) as f32;
        }
        row.copy_from_slice(&blurred);
    }
}

fn transpose(values: &mut [f32]) {
    for y in 0..GROUND_SIZE {
        for x in 0..y {
            values.swap(y * GROUND_SIZE + x, x * GROUND_SIZE + y);
        }
    }
}
