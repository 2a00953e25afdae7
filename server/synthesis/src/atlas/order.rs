//! The order of the grips by gravity's direction.

use glam::Vec3;

use super::{
    entry::Entry,
    gravity::{DIRECTIONS, nearest},
};

/// For each direction, the grips by falling score.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GravityOrder {
    orders: Vec<Vec<u16>>,
}

impl GravityOrder {
    pub(super) fn of(entries: &[Entry]) -> Self {
        let order = |direction: usize| {
            let mut order: Vec<u16> = (0..entries.len() as u16).collect();
            // Stable, so that equal scores stay in the order of the entries.
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
