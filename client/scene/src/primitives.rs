//! Spheres, rods and arrows as parts.

use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec2, Vec3};

use crate::scene::{DEFAULT_CREASE_ANGLE, Part};

/// Sides of round parts: the outline deviates from a circle by 0.2 % of the radius.
const SIDES: u32 = 48;

/// Rings of vertices from pole to pole of a sphere.
const RINGS: u32 = 24;

/// Largest fraction of an arrow's length taken by its head.
const HEAD_SHARE: f32 = 0.45;

/// A sphere.
pub fn sphere(name: &str, centre: Vec3, radius: f32, colour: [f32; 4]) -> Part {
    let profile: Vec<Vec2> = (0..=RINGS)
        .map(|i| arc_point(i as f32 / RINGS as f32 * PI) * radius)
        .collect();
    smooth(lathe(name, centre, Vec3::Y, &profile, colour))
}

/// A capsule: all points within `radius` of a segment.
pub fn capsule(name: &str, start: Vec3, end: Vec3, radius: f32, colour: [f32; 4]) -> Part {
    let length = start.distance(end);
    let profile: Vec<Vec2> = (0..=RINGS + 1)
        .map(|i| {
            let (step, along) = if i <= RINGS / 2 { (i, 0.0) } else { (i - 1, length) };
            arc_point(step as f32 / RINGS as f32 * PI) * radius + Vec2::new(0.0, along)
        })
        .collect();
    let axis = (end - start).normalize_or(Vec3::Y);
    smooth(lathe(name, start, axis, &profile, colour))
}

/// A rod with flat ends between two points, with a radius at each end.
pub fn tapered_cylinder(
    name: &str,
    start: Vec3,
    end: Vec3,
    start_radius: f32,
    end_radius: f32,
    colour: [f32; 4],
) -> Part {
    let length = start.distance(end);
    let profile = [
        Vec2::ZERO,
        Vec2::new(start_radius, 0.0),
        Vec2::new(end_radius, length),
        Vec2::new(0.0, length),
    ];
    lathe(name, start, (end - start).normalize_or(Vec3::Y), &profile, colour)
}

/// An arrow from `tail` to `tip`; `radius` is that of its shaft.
pub fn arrow(name: &str, tail: Vec3, tip: Vec3, radius: f32, colour: [f32; 4]) -> Part {
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
pub fn lathe(name: &str, origin: Vec3, axis: Vec3, profile: &[Vec2], colour: [f32; 4]) -> Part {
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
    Part {
        crease_angle: DEFAULT_CREASE_ANGLE,
        ..Part::new(name, positions, triangles, colour)
    }
}

/// Distance from the axis and height of a unit circle's point, `angle` from its bottom.
fn arc_point(angle: f32) -> Vec2 {
    Vec2::new(angle.sin(), -angle.cos())
}

fn smooth(part: Part) -> Part {
    Part {
        crease_angle: PI,
        ..part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: positive only if the surface is closed and wound outward.
    fn volume(part: &Part) -> f32 {
        part.triangles
            .iter()
            .map(|t| t.map(|v| part.positions[v as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum()
    }

    fn assert_closed(part: &Part) {
        let mut edges: Vec<[u32; 2]> = part
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .collect();
        let count = edges.len();
        edges.sort_unstable();
        edges.dedup();
        assert_eq!(
            edges.len(),
            count,
            "{}: an edge is used twice in one direction",
            part.name
        );
        for &[a, b] in &edges {
            assert!(edges.binary_search(&[b, a]).is_ok(), "{}: open edge", part.name);
        }
    }

    #[test]
    fn volumes_match_the_solids() {
        let (a, b) = (Vec3::new(0.3, -0.1, 0.2), Vec3::new(0.5, 0.3, 0.1));
        let length = a.distance(b);
        let ball = |r: f32| 4.0 / 3.0 * PI * r.powi(3);
        let white = [1.0; 4];
        let head = 0.02_f32 * 5.5;
        let cases = [
            (sphere("sphere", a, 0.1, white), ball(0.1)),
            (
                capsule("capsule", a, b, 0.1, white),
                ball(0.1) + PI * 0.01 * length,
            ),
            (
                tapered_cylinder("cone", a, b, 0.1, 0.05, white),
                PI * length / 3.0 * (0.01 + 0.005 + 0.0025),
            ),
            (
                arrow("arrow", a, b, 0.02, white),
                PI * 0.0004 * (length - head) + PI * 0.048_f32.powi(2) * head / 3.0,
            ),
        ];
        for (part, expected) in cases {
            assert_closed(&part);
            let volume = volume(&part);
            assert!(
                (volume / expected - 1.0).abs() < 0.01,
                "{}: {volume} is not {expected}",
                part.name
            );
        }
    }

    #[test]
    fn capsule_vertices_lie_one_radius_from_the_segment() {
        let (a, b) = (Vec3::new(0.3, -0.1, 0.2), Vec3::new(0.5, 0.3, 0.1));
        for &p in &capsule("capsule", a, b, 0.07, [1.0; 4]).positions {
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            assert!((p.distance(a.lerp(b, t)) - 0.07).abs() < 1e-5);
        }
    }
}
