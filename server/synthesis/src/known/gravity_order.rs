//! Grips sorted by score for each direction of gravity.

use glam::Vec3;

use super::{
    entry::{Entry, SLIPS},
    gravity::{DIRECTIONS, nearest_direction},
};

/// The grips for one direction.
#[derive(Clone, Debug, PartialEq)]
struct Order {
    /// By falling score.
    entries: Vec<u16>,
    /// How many of them hold the object: they come first.
    holding: usize,
}

/// The grips by falling score, for each direction.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GravityOrder {
    orders: Vec<Order>,
}

impl GravityOrder {
    pub(super) fn of(entries: &[Entry]) -> Self {
        let order = |direction: usize| {
            let score = |entry: u16| entries[usize::from(entry)].scores[direction];
            let mut order: Vec<u16> = (0..entries.len() as u16).collect();
            // Stable: equal scores keep the order of the entries.
            order.sort_by_key(|&entry| std::cmp::Reverse(score(entry)));
            Order {
                holding: order.partition_point(|&entry| score(entry) != SLIPS),
                entries: order,
            }
        };
        Self {
            orders: (0..DIRECTIONS).map(order).collect(),
        }
    }

    pub(super) fn under(&self, up: Vec3) -> &[u16] {
        self.order(up).map_or(&[], |order| &order.entries)
    }

    /// The grips that hold the object.
    pub(super) fn holding_under(&self, up: Vec3) -> &[u16] {
        self.order(up)
            .map_or(&[], |order| &order.entries[..order.holding])
    }

    fn order(&self, up: Vec3) -> Option<&Order> {
        self.orders.get(nearest_direction(up))
    }

    pub(super) fn bytes(&self) -> usize {
        let entries = self
            .orders
            .iter()
            .map(|order| size_of_val(order.entries.as_slice()));
        entries.sum::<usize>() + size_of_val(self.orders.as_slice())
    }
}
