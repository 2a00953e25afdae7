//! The directions that gravity is quantized to.

use std::sync::LazyLock;

use glam::Vec3;

/// Number of directions that gravity is quantized to, about 18° apart. More order the grips more exactly, and
/// cost 2 bytes and one balance computation per grip each.
pub const DIRECTIONS: usize = 64;

/// A direction: a point of a Fibonacci lattice on the sphere (R. Swinbank and R. J. Purser, "Fibonacci
/// grids", 2006).
pub fn direction(index: usize) -> Vec3 {
    let golden_angle = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let z = 1.0 - (2 * index + 1) as f32 / DIRECTIONS as f32;
    let (sin, cos) = (golden_angle * index as f32).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

/// All directions, by coordinate. Computing their sines would take as long as trying a grip.
static COORDINATES: LazyLock<[[f32; DIRECTIONS]; 3]> =
    LazyLock::new(|| std::array::from_fn(|axis| std::array::from_fn(|index| direction(index)[axis])));

/// The index of the direction nearest to a unit vector.
pub fn nearest_direction(up: Vec3) -> usize {
    let [xs, ys, zs] = &*COORDINATES;
    let mut cosines = [0.0; DIRECTIONS];
    for i in 0..DIRECTIONS {
        cosines[i] = xs[i] * up.x + ys[i] * up.y + zs[i] * up.z;
    }
    let highest = cosines.iter().fold(f32::MIN, |a, &b| if b > a { b } else { a });
    cosines.iter().position(|&cosine| cosine == highest).unwrap_or(0)
}
