//! How the grips of an atlas are spread over an object: only so many may be alike, and the better ones stay.

use std::collections::HashMap;

use glam::{IVec3, Vec3};

use super::entry::Entry;
use crate::model::{
    grasp::Contact,
    hand::{Digit, HandPart, HandPose, rig::Rig},
    score::Score,
};

/// Edge in metres of the cells that palms are sorted into, and …
const CELL: f32 = 0.02;

/// … how many grips a cell may hold for each of the 24 ways that a hand can lie along axes, few fingers and many apart. With
/// fewer, an atlas of a thin object is not filled by as many proposals as there are; more are alike, and leave less to
/// givers who are in the way of all of them.
const MOST_IN_CELL: usize = 4;

/// Fingers from which a hand takes much room: two keep clear of givers that more do not.
const MANY_FINGERS: usize = 3;

/// Grips that are alike: where the palm is, which way it faces and which way its fingers go, and whether many of them
/// touch.
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

/// What becomes of a grip that is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Room {
    /// There are enough like it that are as good.
    Crowded,
    /// It is added.
    Free,
    /// It takes the place of this entry, which is worse.
    InsteadOf(usize),
}

/// Which entries are alike, with what they are worth.
#[derive(Clone, Debug, Default)]
pub(super) struct Spread {
    cells: HashMap<Cell, Vec<(usize, f32)>>,
}

impl Spread {
    /// What becomes of a grip of a cell that is worth so much.
    pub(super) fn room(&self, cell: Cell, worth: f32) -> Room {
        let Some(alike) = self.cells.get(&cell).filter(|alike| alike.len() >= MOST_IN_CELL) else {
            return Room::Free;
        };
        match alike.iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some(&(entry, least)) if worth > least => Room::InsteadOf(entry),
            _ => Room::Crowded,
        }
    }

    /// How many grips of a cell are known.
    pub(super) fn alike(&self, cell: Cell) -> usize {
        self.cells.get(&cell).map_or(0, Vec::len)
    }

    /// Notes the grip that is at an index of the entries from now on.
    pub(super) fn note(&mut self, cell: Cell, index: usize, worth: f32) {
        let alike = self.cells.entry(cell).or_default();
        match alike.iter_mut().find(|(entry, _)| *entry == index) {
            Some(known) => known.1 = worth,
            None => alike.push((index, worth)),
        }
    }
}

/// What an entry is worth beside others like it: the part of its score that neither gravity nor giver change.
pub(super) fn worth(entry: &Entry) -> f32 {
    Score {
        values: entry.grip_values,
    }
    .grip_total()
}

/// The axis that a direction is nearest to, from 0 to 5: x, -x, y, -y, z, -z.
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
    fn a_cell_keeps_the_best_that_it_has_room_for() {
        let mut spread = Spread::default();
        let worths = [0.5, 0.2, 0.7].into_iter().chain(std::iter::repeat(0.9));
        for (index, worth) in worths.take(MOST_IN_CELL).enumerate() {
            assert_eq!(spread.room(cell(0), worth), Room::Free);
            spread.note(cell(0), index, worth);
        }
        assert_eq!(spread.room(cell(0), 0.1), Room::Crowded);
        assert_eq!(spread.room(cell(0), 0.2), Room::Crowded, "as good is not better");
        assert_eq!(spread.room(cell(0), 0.3), Room::InsteadOf(1));
        assert_eq!(spread.room(cell(1), 0.1), Room::Free, "the next cell is empty");
        spread.note(cell(0), 1, 0.6);
        assert_eq!(spread.room(cell(0), 0.55), Room::InsteadOf(0));
        // One that was needed is noted beyond the room, and may give way later.
        spread.note(cell(0), MOST_IN_CELL, 0.05);
        assert_eq!(spread.room(cell(0), 0.1), Room::InsteadOf(MOST_IN_CELL));
    }
}
