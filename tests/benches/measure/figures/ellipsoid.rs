//! New meshes that no server has seen before.

use std::{
    f32::consts::{PI, TAU},
    fmt::Write as _,
};

use glam::Vec3;

/// Half axes in metres: the size of a computer mouse, half of which a giver leaves free.
const HALF_AXES: Vec3 = Vec3::new(0.026, 0.018, 0.06);

/// Rings of vertices between the poles, and vertices per ring: 1,984 triangles.
const RINGS: usize = 31;
const RING: usize = 32;

/// Height of the bumps, as a share of the radius.
const BUMPS: f32 = 0.04;

/// A closed bumpy ellipsoid of some 2,000 triangles as OBJ text in metres. There are four shapes, by `number` modulo 4.
pub(crate) fn ellipsoid(number: u8) -> String {
    let waves = f32::from(number % 4) + 3.0;
    let point = |polar: f32, around: f32| {
        let direction = Vec3::new(
            polar.sin() * around.cos(),
            polar.sin() * around.sin(),
            polar.cos(),
        );
        let bump = 1.0 + BUMPS * (waves * polar).sin() * (4.0 * around).sin();
        direction * HALF_AXES * bump
    };
    let mut obj = String::new();
    let mut vertex = |point: Vec3| {
        // Writing to a string cannot fail.
        let _ = writeln!(obj, "v {} {} {}", point.x, point.y, point.z);
    };
    vertex(point(0.0, 0.0));
    for ring in 1..=RINGS {
        for place in 0..RING {
            let polar = PI * ring as f32 / (RINGS + 1) as f32;
            vertex(point(polar, TAU * place as f32 / RING as f32));
        }
    }
    vertex(point(PI, 0.0));
    let at = |ring: usize, place: usize| 2 + ring * RING + place % RING;
    let (first, last) = (1, 2 + RINGS * RING);
    for place in 0..RING {
        let (here, next) = (at(0, place), at(0, place + 1));
        let _ = writeln!(obj, "f {first} {here} {next}");
        for ring in 1..RINGS {
            let (above, above_next) = (at(ring - 1, place), at(ring - 1, place + 1));
            let (here, next) = (at(ring, place), at(ring, place + 1));
            let _ = writeln!(obj, "f {above} {here} {next}\nf {above} {next} {above_next}");
        }
        let (here, next) = (at(RINGS - 1, place), at(RINGS - 1, place + 1));
        let _ = writeln!(obj, "f {here} {last} {next}");
    }
    obj
}
