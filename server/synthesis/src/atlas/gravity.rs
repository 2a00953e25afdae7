//! The order of the grips by gravity's direction.

use std::sync::LazyLock;

use glam::Vec3;

use super::entry::Entry;

/// Directions that gravity is sorted into: some 18° apart. More order the grips more exactly and take 2 bytes a grip
/// each, and the time of balancing every grip against one more.
pub const DIRECTIONS: usize = 64;

/// For each direction, the grips by falling score.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GravityOrder {
    orders: Vec<Vec<u16>>,
}

/// The directions: a Fibonacci lattice on the sphere (R. Swinbank and R. J. Purser, "Fibonacci grids", 2006).
pub fn direction(index: usize) -> Vec3 {
    let golden_angle = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let z = 1.0 - (2 * index + 1) as f32 / DIRECTIONS as f32;
    let (sin, cos) = (golden_angle * index as f32).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

/// All of them: a look-up asks for them, and their sines take as long as trying a grip.
static ALL: LazyLock<[Vec3; DIRECTIONS]> = LazyLock::new(|| std::array::from_fn(direction));

/// The nearest direction to a unit vector.
pub fn nearest(up: Vec3) -> usize {
    let of = |index: usize| ALL[index].dot(up);
    (0..DIRECTIONS)
        .max_by(|&a, &b| of(a).total_cmp(&of(b)))
        .unwrap_or(0)
}

impl GravityOrder {
    pub(super) fn of(entries: &[Entry]) -> Self {
        let order = |direction: usize| {
            let mut order: Vec<u16> = (0..entries.len() as u16).collect();
            // Stable, so that equal scores stay in the order of discovery.
            order.sort_by_key(|&entry| std::cmp::Reverse(entries[usize::from(entry)].scores[direction]));
            order
        };
        Self {
            orders: (0..DIRECTIONS).map(order).collect(),
        }
    }

    pub(super) fn under(&self, up: Vec3) -> &[u16] {
        self.orders.get(nearest(up)).map_or(&[], Vec::as_slice)
    }

    pub(super) fn bytes(&self) -> usize {
        self.orders
            .iter()
            .map(|order| size_of_val(order.as_slice()))
            .sum()
    }
}
