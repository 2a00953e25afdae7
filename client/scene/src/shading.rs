//! Shading: lights, finishes and tone mapping.
//!
//! Lights are fixed relative to the camera, which lights every view well; only the sky depends on the up direction.
//! Light is linear; a white diffuse surface that faces a light of strength 1 has brightness 1.

use glam::Vec3;

use crate::{camera::Camera, scene::Finish, surface::SurfacePoint};

/// A directional light.
#[derive(Clone, Copy, Debug)]
struct Light {
    /// Unit vector to the light.
    direction: Vec3,
    /// Linear RGB strength.
    strength: Vec3,
}

/// All lights of the studio.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Studio {
    key: Light,
    /// Fill from the other side and two rims from behind; they cast no shadow.
    others: [Light; 3],
    /// Unit vector to the ceiling.
    up: Vec3,
}

/// How much of the key light arrives at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KeyArrival {
    /// Fraction not blocked by opaque parts, 0 to 1.
    pub(crate) lit: f32,
    /// Thickness of the matter between the point and the light, in metres.
    pub(crate) thickness: f32,
}

/// Light from above and from below, linear RGB: a bright ceiling and a warm floor.
const CEILING: Vec3 = Vec3::new(0.50, 0.52, 0.56);
const FLOOR: Vec3 = Vec3::new(0.27, 0.25, 0.235);

/// Wrap of light past the terminator on skin, the w of (n·l + w) / (1 + w): red reaches farthest.
const SKIN_WRAP: Vec3 = Vec3::new(0.38, 0.20, 0.14);

/// Mean free path of light in skin, in metres, slightly exaggerated: makes thin parts glow red.
const SKIN_FREE_PATH: Vec3 = Vec3::new(3.0e-3, 1.1e-3, 0.7e-3);

/// Reflective properties of a finish.
struct Response {
    /// Reflectance at normal incidence; for metal a factor on the colour.
    reflectance: f32,
    /// Blinn-Phong exponent: higher is glossier.
    exponent: f32,
    /// Strength of reflections of the studio, 0 to 1.
    mirror: f32,
    /// Reflectance at grazing incidence: rough surfaces stay far below the 1 of a mirror.
    grazing: f32,
}

fn response(finish: Finish) -> Response {
    let (reflectance, exponent, mirror, grazing) = match finish {
        Finish::Satin => (0.045, 48.0, 0.55, 0.6),
        Finish::Metal => (0.9, 60.0, 1.0, 1.0),
        Finish::Skin => (0.028, 18.0, 0.30, 0.3),
        Finish::Cloth | Finish::Marker => (0.0, 1.0, 0.0, 0.0),
    };
    Response {
        reflectance,
        exponent,
        mirror,
        grazing,
    }
}

impl Studio {
    /// The lights around a camera.
    pub(crate) fn new(camera: &Camera, up: Vec3) -> Self {
        let axes = camera.world_from_camera;
        let light = |x: f32, y: f32, z: f32, strength: Vec3| Light {
            direction: axes.transform_vector(Vec3::new(x, y, z)).normalize_or(Vec3::Y),
            strength,
        };
        Self {
            key: light(-0.55, 0.75, 0.75, Vec3::new(1.30, 1.25, 1.17)),
            others: [
                light(0.9, 0.15, 0.6, Vec3::new(0.24, 0.26, 0.30)),
                light(0.75, 0.5, -0.75, Vec3::new(0.42, 0.44, 0.48)),
                light(-0.8, 0.1, -0.7, Vec3::new(0.22, 0.22, 0.24)),
            ],
            up,
        }
    }

    /// Unit vector to the light that casts shadows.
    pub(crate) fn key_direction(&self) -> Vec3 {
        self.key.direction
    }

    /// The linear RGB light from a point to the camera. `openness` is the fraction of the point's surroundings that
    /// nothing close blocks, 0 to 1.
    pub(crate) fn shade(&self, point: &SurfacePoint, key: KeyArrival, openness: f32) -> Vec3 {
        let normal = point.normal;
        if point.finish == Finish::Marker {
            // Nearly flat, with just enough shading to show the shape.
            return point.colour * (0.72 + 0.28 * normal.dot(point.to_camera).max(0.0));
        }
        let Response {
            reflectance,
            exponent,
            mirror,
            grazing,
        } = response(point.finish);
        let metal = point.finish == Finish::Metal;
        let diffuse_colour = if metal { point.colour * 0.15 } else { point.colour };
        let f0 = if metal {
            point.colour * reflectance
        } else {
            Vec3::splat(reflectance)
        };
        let facing = normal.dot(point.to_camera).clamp(0.0, 1.0);

        let arrival = key_colour(point.finish, key);
        // Occlusion also dims direct light, most of which comes from soft boxes.
        let softened = 0.55 + 0.45 * openness;
        let mut diffuse = Vec3::ZERO;
        let mut specular = Vec3::ZERO;
        let lights = std::iter::once((self.key, arrival)).chain(self.others.map(|l| (l, Vec3::ONE)));
        for (light, arrival) in lights {
            let cosine = normal.dot(light.direction);
            let strength = light.strength * arrival * softened;
            diffuse += strength * wrapped(point.finish, cosine);
            if cosine > 0.0 && reflectance > 0.0 {
                let half = (light.direction + point.to_camera).normalize_or(normal);
                // Normalised Blinn-Phong with Schlick's Fresnel term.
                let lobe = (exponent + 8.0) / 8.0 * normal.dot(half).max(0.0).powf(exponent);
                specular += strength * fresnel(f0, grazing, half.dot(point.to_camera)) * lobe * cosine;
            }
        }
        diffuse += self.sky(normal) * occlusion_tint(point.finish, openness);
        let bounce = (normal * (2.0 * facing) - point.to_camera).normalize_or(normal);
        let mirrored = self.mirrored(bounce) * fresnel(f0, grazing, facing) * mirror * (0.2 + 0.8 * openness);
        let sheen = if point.finish == Finish::Cloth {
            point.colour * (0.35 * (1.0 - facing).powi(3) * openness)
        } else {
            Vec3::ZERO
        };
        diffuse_colour * diffuse + specular + mirrored + sheen
    }

    /// Diffuse light of ceiling and floor on a surface.
    fn sky(&self, normal: Vec3) -> Vec3 {
        FLOOR.lerp(CEILING, 0.5 + 0.5 * normal.dot(self.up))
    }

    /// The environment that smooth surfaces reflect: a bright ceiling with soft borders, a dim horizon, a floor.
    fn mirrored(&self, direction: Vec3) -> Vec3 {
        let height = direction.dot(self.up);
        let ceiling = smoothstep(0.15, 0.75, height);
        let key = smoothstep(0.75, 0.95, direction.dot(self.key.direction));
        let floor = smoothstep(0.1, -0.6, height);
        Vec3::splat(0.28)
            + CEILING * (1.3 * ceiling)
            + self.key.strength * (0.9 * key)
            + FLOOR * (0.6 * floor)
    }
}

/// The key light after occlusion: none passes opaque parts, some red passes skin.
fn key_colour(finish: Finish, key: KeyArrival) -> Vec3 {
    if finish == Finish::Skin {
        let through = SKIN_FREE_PATH.map(|path| (-key.thickness / path).exp());
        Vec3::splat(key.lit).max(through)
    } else {
        Vec3::splat(key.lit)
    }
}

/// Lambert's cosine, wrapped around the terminator for skin.
fn wrapped(finish: Finish, cosine: f32) -> Vec3 {
    if finish == Finish::Skin {
        ((Vec3::splat(cosine) + SKIN_WRAP) / (Vec3::ONE + SKIN_WRAP)).max(Vec3::ZERO)
    } else {
        Vec3::splat(cosine.max(0.0))
    }
}

/// Ambient light left in a corner; between skin and skin it turns red instead of grey.
fn occlusion_tint(finish: Finish, openness: f32) -> Vec3 {
    if finish == Finish::Skin {
        Vec3::new(openness.powf(0.8), openness.powf(1.1), openness.powf(1.25))
    } else {
        Vec3::splat(openness)
    }
}

/// Schlick's approximation between the reflectances at normal and at grazing incidence.
fn fresnel(f0: Vec3, grazing: f32, cosine: f32) -> Vec3 {
    f0 + (Vec3::splat(grazing) - f0).max(Vec3::ZERO) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// 0 below `from`, 1 beyond `to`, smooth between (`from` may be the larger one).
pub(crate) fn smoothstep(from: f32, to: f32, value: f32) -> f32 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Exposure, a factor on light. More is brighter and makes white objects vanish in the background.
const EXPOSURE: f32 = 0.88;

/// Light up to here is kept; brighter light is compressed.
const COMPRESSION_START: f32 = 0.62;

/// How fast compressed colours fade to white.
const FADE_TO_WHITE: f32 = 0.25;

/// Tone mapping: linear light to linear display light between 0 and 1. Dark and middle colours are kept; bright ones
/// roll off to white without a change of hue (the shoulder of the Khronos PBR Neutral tone mapper of 2024, starting
/// earlier, and without its toe, which turns skin orange).
pub(crate) fn develop(light: Vec3) -> Vec3 {
    let colour = light.max(Vec3::ZERO) * EXPOSURE;
    let peak = colour.max_element();
    if peak < COMPRESSION_START {
        return colour;
    }
    let room = 1.0 - COMPRESSION_START;
    let new_peak = 1.0 - room * room / (peak + room - COMPRESSION_START);
    let whiteness = 1.0 - 1.0 / (FADE_TO_WHITE * (peak - new_peak) + 1.0);
    (colour * (new_peak / peak)).lerp(Vec3::splat(new_peak), whiteness)
}

/// Display light as sRGB bytes (IEC 61966-2-1).
pub(crate) fn srgb_bytes(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(|value| {
        let value = value.clamp(0.0, 1.0);
        let encoded = if value <= 0.003_130_8 {
            value * 12.92
        } else {
            1.055 * value.powf(1.0 / 2.4) - 0.055
        };
        (encoded * 255.0 + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::linear_from_srgb;

    #[test]
    fn srgb_round_trips_every_byte() {
        for value in 0..=255 {
            let [r, ..] = linear_from_srgb(value, 0, 0);
            assert_eq!(srgb_bytes(Vec3::new(r, 0.0, 0.0))[0], value);
        }
    }

    #[test]
    fn film_is_monotonic_and_stays_in_range() {
        let mut last = -1.0;
        for step in 0..2000 {
            let light = step as f32 * 0.005;
            let grey = develop(Vec3::splat(light));
            assert!(grey.max_element() <= 1.0 && grey.min_element() >= 0.0);
            assert!(grey.x >= last, "{light} is darker than less light");
            last = grey.x;
        }
    }

    #[test]
    fn shadow_darkens_and_corners_darken() {
        let camera = Camera::framing_points([Vec3::ZERO, Vec3::ONE], Vec3::Z, Vec3::Y, 1.0);
        let studio = Studio::new(&camera, Vec3::Y);
        for finish in [Finish::Satin, Finish::Metal, Finish::Skin, Finish::Cloth] {
            let point = SurfacePoint {
                position: Vec3::ZERO,
                normal: studio.key_direction(),
                face: studio.key_direction(),
                to_camera: Vec3::Z,
                colour: Vec3::splat(0.5),
                finish,
            };
            let lit = KeyArrival {
                lit: 1.0,
                thickness: 0.0,
            };
            let dark = KeyArrival {
                lit: 0.0,
                thickness: 1.0,
            };
            let open = studio.shade(&point, lit, 1.0);
            assert!(open.cmpgt(studio.shade(&point, dark, 1.0)).all(), "{finish:?}");
            assert!(open.cmpgt(studio.shade(&point, lit, 0.2)).all(), "{finish:?}");
        }
    }
}
