//! Spheres, capsules and arrows as parts.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Quat, Vec2, Vec3};
use grasp_synthesis::geometry::tapered_capsule::TaperedCapsule;

use crate::scene::Part;

/// Sides of round parts: the outline deviates from a circle by 0.2 % of the radius.
const SIDES: u32 = 48;

/// Rings of vertices from pole to equator of a sphere.
const RINGS: u32 = 12;

/// Largest fraction of an arrow's length taken by its head.
const HEAD_SHARE: f32 = 0.45;

/// A sphere.
pub(crate) fn sphere(name: &str, centre: Vec3, radius: f32, colour: Vec3) -> Part {
    let profile: Vec<Vec2> = arc(0.0, PI).map(|point| point * radius).collect();
    smooth(lathe(name, centre, Vec3::Y, &profile, colour))
}

/// A tapered capsule, neither of whose spheres contains the other.
pub(crate) fn capsule(name: &str, solid: &TaperedCapsule, colour: Vec3) -> Part {
    let length = solid.length();
    let narrowing = (solid.start_radius - solid.end_radius) / length;
    let touching = FRAC_PI_2 + narrowing.clamp(-1.0, 1.0).asin();
    let first = arc(0.0, touching).map(|point| point * solid.start_radius);
    let second = arc(touching, PI).map(|point| point * solid.end_radius + Vec2::new(0.0, length));
    let profile: Vec<Vec2> = first.chain(second).collect();
    let axis = (solid.end - solid.start).normalize_or(Vec3::Y);
    smooth(lathe(name, solid.start, axis, &profile, colour))
}

/// An arrow from `tail` to `tip`; `radius` is that of its shaft.
pub(crate) fn arrow(name: &str, tail: Vec3, tip: Vec3, radius: f32, colour: Vec3) -> Part {
    let length = tail.distance(tip);
    let head = (radius * 5.5).min(length * HEAD_SHARE);
    let profile = [
        Vec2::ZERO,
        Vec2::new(radius, 0.0),
        Vec2::new(radius, length - head),
        Vec2::new(radius * 2.4, length - head),
        Vec2::new(0.0, length),
    ];
    lathe(name, tail, (tip - tail).normalize_or(Vec3::Y), &profile, colour)
}

/// A closed surface of revolution: `profile` gives distance from the axis (x) and place along it (y) in metres, from
/// the bottom up, and starts and ends on the axis.
pub(crate) fn lathe(name: &str, origin: Vec3, axis: Vec3, profile: &[Vec2], colour: Vec3) -> Part {
    let turn = Quat::from_rotation_arc(Vec3::Y, axis);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    // A ring on the axis is one vertex.
    let mut rings: Vec<(u32, bool)> = Vec::with_capacity(profile.len());
    for (i, point) in profile.iter().enumerate() {
        let is_pole = i == 0 || i + 1 == profile.len();
        rings.push((positions.len() as u32, is_pole));
        let sides = if is_pole { 1 } else { SIDES };
        positions.extend((0..sides).map(|side| {
            let (sin, cos) = (side as f32 / SIDES as f32 * TAU).sin_cos();
            let radius = if is_pole { 0.0 } else { point.x };
            origin + turn * Vec3::new(radius * sin, point.y, radius * cos)
        }));
    }
    for pair in rings.windows(2) {
        let [(low, low_pole), (high, high_pole)] = [pair[0], pair[1]];
        for side in 0..SIDES {
            let next = (side + 1) % SIDES;
            if !low_pole {
                let top = if high_pole { high } else { high + side };
                triangles.push([low + side, low + next, top]);
            }
            if !high_pole {
                let bottom = if low_pole { low } else { low + next };
                triangles.push([high + side, bottom, high + next]);
            }
        }
    }
    Part::new(name, positions, triangles, colour)
}

/// Points of a unit circle around the origin, between two angles from its bottom: distance from the axis, and height.
fn arc(from: f32, to: f32) -> impl Iterator<Item = Vec2> {
    let steps = (2.0 * RINGS as f32 * (to - from) / PI).ceil().max(1.0) as u32;
    (0..=steps).map(move |step| {
        let (sin, cos) = (from + (to - from) * step as f32 / steps as f32).sin_cos();
        Vec2::new(sin, -cos)
    })
}

fn smooth(part: Part) -> Part {
    Part {
        is_smooth: true,
        ..part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: positive only if the surface is closed and wound outward.
    fn volume(part: &Part) -> f32 {
        let triangles = part.triangles.iter();
        let volumes = triangles.map(|&triangle| {
            let [a, b, c] = part.corners(triangle);
            a.dot(b.cross(c)) / 6.0
        });
        volumes.sum()
    }

    #[test]
    fn volumes_match_the_solids() {
        let (a, b) = (Vec3::new(0.3, -0.1, 0.2), Vec3::new(0.5, 0.3, 0.1));
        let length = a.distance(b);
        let ball = |r: f32| 4.0 / 3.0 * PI * r.powi(3);
        let head = 0.02_f32 * 5.5;
        let cases = [
            (sphere("sphere", a, 0.1, Vec3::ONE), ball(0.1)),
            (
                capsule("capsule", &TaperedCapsule::new(a, b, 0.1, 0.1), Vec3::ONE),
                ball(0.1) + PI * 0.01 * length,
            ),
            (
                arrow("arrow", a, b, 0.02, Vec3::ONE),
                PI * 0.0004 * (length - head) + PI * 0.048_f32.powi(2) * head / 3.0,
            ),
        ];
        for (part, expected) in cases {
            let volume = volume(&part);
            assert!(
                (volume / expected - 1.0).abs() < 0.01,
                "{}: {volume} is not {expected}",
                part.name
            );
        }
    }

    #[test]
    fn capsules_are_the_surface_of_the_tapered_solid() {
        let (a, b) = (Vec3::new(0.3, -0.1, 0.2), Vec3::new(0.5, 0.3, 0.1));
        for [start, end] in [[0.07, 0.03], [0.03, 0.07], [0.05, 0.05]] {
            let solid = TaperedCapsule::new(a, b, start, end);
            for &p in &capsule("capsule", &solid, Vec3::ONE).positions {
                let off = solid.signed_distance(p);
                assert!(off.abs() < 1e-5, "{p} is {off} m off");
            }
        }
    }
}
