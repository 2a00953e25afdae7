//! Limits how many similar grips an atlas keeps, in favour of the best.

use std::collections::HashMap;

use glam::{IVec3, Vec3};

use super::entry::Entry;
use crate::model::{
    grasp::Contact,
    hand::{Digit, HandPart, HandPose, rig::Rig},
    score::grip_total,
};

/// Edge of the cells that palms are sorted into, in metres.
const CELL: f32 = 0.02;

/// Grips per cell. A cell also distinguishes the 24 axis-aligned orientations of a hand, and few fingers from
/// many. Fewer leave atlases of thin objects unfilled; more leave less choice next to givers.
const MAX_PER_CELL: usize = 4;

/// Number of touching fingers from which a hand counts as large: hands with fewer are clear of more givers.
const MANY_FINGERS: usize = 3;

/// What similar grips have in common: the palm's place, the axes that palm and fingers point along, and
/// whether many fingers touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Cell(IVec3, [u8; 2], bool);

impl Cell {
    /// The cell of a hand that touches an object.
    pub(super) fn of(rig: &Rig, pose: &HandPose, contacts: &[Contact]) -> Self {
        let wrist = pose.frame_from_wrist;
        let palm = wrist.transform_point(rig.palm);
        let mut fingers = wrist.transform_vector(Vec3::Y);
        let facing = nearest_axis(wrist.transform_vector(Vec3::Z));
        fingers[usize::from(facing / 2)] = 0.0;
        let touches = |finger: &&Digit| {
            let is_of_finger = |part: HandPart| part.digit() == Some(**finger);
            contacts.iter().any(|contact| is_of_finger(contact.part))
        };
        Self(
            (palm / CELL).floor().as_ivec3(),
            [facing, nearest_axis(fingers)],
            Digit::ALL[1..].iter().filter(touches).count() >= MANY_FINGERS,
        )
    }
}

/// What happens to a new grip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Admission {
    /// Its cell is full of grips that are as good or better.
    Reject,
    /// It is added.
    Add,
    /// It replaces this entry, which is worse.
    Replace(usize),
}

/// The entries of each cell with their base scores.
#[derive(Clone, Debug, Default)]
pub(super) struct Spread {
    cells: HashMap<Cell, Vec<(usize, f32)>>,
}

impl Spread {
    /// What happens to a new grip of this cell and score.
    pub(super) fn admission(&self, cell: Cell, base_score: f32) -> Admission {
        let Some(alike) = self.cells.get(&cell).filter(|alike| alike.len() >= MAX_PER_CELL) else {
            return Admission::Add;
        };
        match alike.iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some(&(entry, lowest)) if base_score > lowest => Admission::Replace(entry),
            _ => Admission::Reject,
        }
    }

    /// The number of grips in a cell.
    pub(super) fn count_in(&self, cell: Cell) -> usize {
        self.cells.get(&cell).map_or(0, Vec::len)
    }

    /// Records the grip at an index of the entries.
    pub(super) fn record(&mut self, cell: Cell, index: usize, base_score: f32) {
        let alike = self.cells.entry(cell).or_default();
        match alike.iter_mut().find(|(entry, _)| *entry == index) {
            Some(known) => known.1 = base_score,
            None => alike.push((index, base_score)),
        }
    }
}

/// The part of an entry's score that depends on neither gravity nor giver.
pub(super) fn base_score(entry: &Entry) -> f32 {
    grip_total(&entry.grip_values)
}

/// The axis nearest to a direction: 0 to 5 for x, -x, y, -y, z, -z.
fn nearest_axis(direction: Vec3) -> u8 {
    let axis = direction.abs().max_position();
    2 * axis as u8 + u8::from(direction[axis] < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(x: i32) -> Cell {
        Cell(IVec3::new(x, 0, 0), [0, 2], false)
    }

    #[test]
    fn full_cell_replaces_only_its_worst_grip() {
        let mut spread = Spread::default();
        let scores = [0.5, 0.2, 0.7].into_iter().chain(std::iter::repeat(0.9));
        for (index, base_score) in scores.take(MAX_PER_CELL).enumerate() {
            assert_eq!(spread.admission(cell(0), base_score), Admission::Add);
            spread.record(cell(0), index, base_score);
        }
        assert_eq!(spread.admission(cell(0), 0.1), Admission::Reject);
        assert_eq!(
            spread.admission(cell(0), 0.2),
            Admission::Reject,
            "as good is not better"
        );
        assert_eq!(spread.admission(cell(0), 0.3), Admission::Replace(1));
        assert_eq!(
            spread.admission(cell(1), 0.1),
            Admission::Add,
            "the next cell is empty"
        );
        spread.record(cell(0), 1, 0.6);
        assert_eq!(spread.admission(cell(0), 0.55), Admission::Replace(0));
        // A required grip is recorded beyond the limit, and may be replaced later.
        spread.record(cell(0), MAX_PER_CELL, 0.05);
        assert_eq!(spread.admission(cell(0), 0.1), Admission::Replace(MAX_PER_CELL));
    }
}
