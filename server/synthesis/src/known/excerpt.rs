//! The few grips of a growth that a complete atlas keeps: those that together serve sampled givers best under all directions
//! of gravity.
//!
//! The objective is that of the shortlists, summed over the directions, and so is the greedy selection. Once nothing serves
//! a sampled giver better, the same is done with the grips that are left: other givers leave other grips free.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, binary_heap::PeekMut},
};

use super::{
    entry::Entry,
    gravity::DIRECTIONS,
    occupancy::Occupancy,
    shortlist::{Chunks, ClearOf, Row, Served, clear_of_sampled_givers, gain, least_served, serve, values},
};

/// How givers are served under one direction of gravity.
struct Direction {
    values: Vec<Row>,
    /// What counts as not served.
    least: Served,
    served: Served,
}

/// Grips with the givers that are clear of each.
struct Candidates {
    chunks: Chunks,
    clear_of: Vec<ClearOf>,
    directions: Vec<Direction>,
}

impl Candidates {
    fn gain_of(&self, entry: u16) -> u32 {
        let clear_of = &self.clear_of[usize::from(entry)];
        let gains = self.directions.iter().map(|direction| {
            let row = &direction.values[usize::from(entry)];
            gain(row, &self.chunks, clear_of, &direction.served)
        });
        gains.sum()
    }

    fn serve_with(&mut self, entry: u16) {
        let clear_of = &self.clear_of[usize::from(entry)];
        for direction in &mut self.directions {
            let row = &direction.values[usize::from(entry)];
            serve(&mut direction.served, row, &self.chunks, clear_of);
        }
    }

    /// Moves grips from `left` to `chosen` until there are `count` or no other serves a giver better.
    fn choose(&mut self, count: usize, left: &mut Vec<u16>, chosen: &mut Vec<u16>) {
        for direction in &mut self.directions {
            direction.served = direction.least;
        }
        let mut gains: BinaryHeap<(u32, Reverse<u16>)> = left
            .iter()
            .map(|&entry| (self.gain_of(entry), Reverse(entry)))
            .filter(|&(gain, _)| gain > 0)
            .collect();
        let before = chosen.len();
        while chosen.len() < count {
            let Some(mut top) = gains.peek_mut() else { break };
            let (bound, Reverse(entry)) = *top;
            // Gains never grow, so only the top has to be up to date.
            let gain = self.gain_of(entry);
            if gain == bound {
                PeekMut::pop(top);
                self.serve_with(entry);
                chosen.push(entry);
            } else if gain > 0 {
                top.0 = gain;
            } else {
                PeekMut::pop(top);
            }
        }
        let new = &chosen[before..];
        left.retain(|entry| !new.contains(entry));
    }

    /// Chooses as long as others serve a giver at all.
    fn fill(&mut self, count: usize, left: &mut Vec<u16>, chosen: &mut Vec<u16>) {
        while chosen.len() < count {
            let before = chosen.len();
            self.choose(count, left, chosen);
            if chosen.len() == before {
                break;
            }
        }
    }
}

/// Grips of which some are kept in any case.
pub(super) struct Wanted {
    /// Their indices, ascending.
    pub(super) places: Vec<u16>,
    /// How many of them are kept, if there are as many.
    pub(super) count: usize,
}

/// Up to `count` of the grips, whose hands fill the cells of `occupancy`, as ascending indices.
pub(super) fn excerpt(
    entries: &[Entry],
    occupancy: &Occupancy,
    count: usize,
    mut wanted: Wanted,
) -> Vec<usize> {
    let mut left: Vec<u16> = (0..entries.len()).map(|entry| entry as u16).collect();
    let mut chosen = Vec::new();
    if left.len() <= count {
        chosen = left;
    } else {
        let (clear_of, chunks) = clear_of_sampled_givers(entries, occupancy);
        let directions = (0..DIRECTIONS).map(|up| {
            let values = values(entries, up);
            let least = least_served(&values, &chunks, &clear_of);
            Direction {
                values,
                least,
                served: least,
            }
        });
        let mut candidates = Candidates {
            directions: directions.collect(),
            chunks,
            clear_of,
        };
        candidates.fill(wanted.count, &mut wanted.places, &mut chosen);
        left.retain(|entry| !chosen.contains(entry));
        candidates.fill(count, &mut left, &mut chosen);
    }
    chosen.sort_unstable();
    chosen.into_iter().map(usize::from).collect()
}
