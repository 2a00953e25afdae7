//! Spreads grips over cells of similar ones, of which an atlas keeps a few, and over the space around the object, where hands that
//! fill the same cell collide.

use std::{cmp::Reverse, collections::HashMap};

use glam::{IVec3, Vec3};

use super::entry::{Entry, nearest_axis};
use crate::{
    model::{
        grasp::Contact,
        hand::{Digit, HandPart, HandPose, rig::Rig},
        object::GraspObject,
    },
    physical::{grip::GIVER_CLEARANCE, solids::TaperedCapsule},
};

/// Edge of the cells that palms are sorted into, in metres.
const PALM_CELL: f32 = 0.02;

/// Grips per cell. A cell also distinguishes the 24 axis-aligned orientations of a hand, and few fingers from many.
const MAX_PER_CELL: usize = 4;

/// Number of touching fingers from which a hand counts as large: hands with fewer are clear of more givers.
const MANY_FINGERS: usize = 3;

/// The cell of similar grips: the palm's place, the axes along which palm and fingers point, and whether many fingers touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Cell(IVec3, [u8; 2], bool);

impl Cell {
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
            (palm / PALM_CELL).floor().as_ivec3(),
            [facing, nearest_axis(fingers)],
            Digit::ALL[1..].iter().filter(touches).count() >= MANY_FINGERS,
        )
    }
}

/// Outcome of offering a grip.
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
    pub(super) fn admission(&self, cell: Cell, base_score: f32) -> Admission {
        let Some(alike) = self.cells.get(&cell).filter(|alike| alike.len() >= MAX_PER_CELL) else {
            return Admission::Add;
        };
        match alike.iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some(&(entry, lowest)) if base_score > lowest => Admission::Replace(entry),
            _ => Admission::Reject,
        }
    }

    pub(super) fn count_in(&self, cell: Cell) -> usize {
        self.cells.get(&cell).map_or(0, Vec::len)
    }

    pub(super) fn record(&mut self, cell: Cell, index: usize, base_score: f32) {
        let alike = self.cells.entry(cell).or_default();
        match alike.iter_mut().find(|(entry, _)| *entry == index) {
            Some(known) => known.1 = base_score,
            None => alike.push((index, base_score)),
        }
    }
}

/// Edge of a cell in metres. Smaller cells separate hands better; memory grows with the third power.
const CELL: f32 = 0.0125;

/// Largest number of cells. Larger objects get larger cells, which separate hands less well.
const MAX_CELLS: f32 = 10_000.0;

/// Largest number of cells kept per 512 grips, those that most hands fill: about 2,600 for 8,192 grips.
const MAX_LINES: usize = 41_600;
const LINE: usize = 512;

/// Distance from a cell's centre to its corners, as a multiple of its edge.
const HALF_DIAGONAL: f32 = 0.866_026;

/// Radius in metres of a giver's inner phalanges. A larger one makes hands fill more cells.
const MIN_RADIUS: f32 = 0.01;

/// Margin of the grid around the object's bounding box, in metres: more than the thickness of a hand.
const MARGIN: f32 = 0.07;

/// Cells along x that are tested against a solid at once: more than most solids extend over.
const LANES: usize = 8;

/// A cell that no hand fills.
const EMPTY: u16 = u16::MAX;

type Bits = Vec<u64>;

/// For each cell around an object that hands fill, the grips of these.
#[derive(Clone, Debug)]
pub(super) struct Occupancy(Vec<Bits>);

fn has(grips: &Bits, entry: usize) -> bool {
    grips[entry / 64] >> (entry % 64) & 1 == 1
}

impl Occupancy {
    pub(super) fn of(object: &GraspObject, rig: &Rig, entries: &[Entry]) -> Self {
        let surface = object.surface.mesh().aabb();
        let low = surface.min - MARGIN;
        let extents = surface.max + MARGIN - low;
        let edge = CELL.max((extents.element_product() / MAX_CELLS).cbrt());
        let counts = (extents / edge).ceil().as_ivec3();
        let mut grid = Grid {
            low,
            edge,
            counts,
            places: vec![EMPTY; counts.element_product() as usize],
            filled: Vec::new(),
            none: vec![0; entries.len().div_ceil(64)],
        };
        for (index, entry) in entries.iter().enumerate() {
            for solid in entry.solids(rig).iter() {
                grid.fill(solid, index);
            }
        }
        // One line is left for the cells that no hand fills. Ties keep the order of filling.
        let most = MAX_LINES / entries.len().div_ceil(LINE).max(1) - 1;
        let mut filled = grid.filled;
        filled.sort_by_cached_key(|grips| Reverse(grips.iter().map(|word| word.count_ones()).sum::<u32>()));
        filled.truncate(most);
        Self(filled)
    }

    /// Marks the grips that share a cell with the given one, itself included: nearly all that collide with it, and few others.
    pub(super) fn colliding_with(&self, entry: usize) -> impl Fn(usize) -> bool + use<> {
        let mut union = Bits::new();
        for cell in self.0.iter().filter(|cell| has(cell, entry)) {
            union.resize(cell.len(), 0);
            for (word, more) in union.iter_mut().zip(cell) {
                *word |= more;
            }
        }
        move |other| !union.is_empty() && has(&union, other)
    }
}

struct Grid {
    low: Vec3,
    /// Edge of a cell in metres.
    edge: f32,
    counts: IVec3,
    places: Vec<u16>,
    filled: Vec<Bits>,
    none: Bits,
}

impl Grid {
    /// Sets a grip's bit in the cells that one of its solids fills: those in which a giver's sphere of radius [`MIN_RADIUS`] is
    /// certainly too close, wherever in the cell its centre lies.
    fn fill(&mut self, solid: &TaperedCapsule, entry: usize) {
        let reach = MIN_RADIUS + GIVER_CLEARANCE - HALF_DIAGONAL * self.edge;
        let thickest = solid.start_radius.max(solid.end_radius) + reach.max(0.0);
        let first = self
            .cell_coordinates(solid.start.min(solid.end) - thickest)
            .max(IVec3::ZERO);
        let last = self
            .cell_coordinates(solid.start.max(solid.end) + thickest)
            .min(self.counts - 1);
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in (first.x..=last.x).step_by(LANES) {
                    let squared_margins = self.squared_margins(solid, reach, IVec3::new(x, y, z));
                    for (x, margin) in (x..=last.x).zip(squared_margins) {
                        if margin > 0.0 {
                            self.set(IVec3::new(x, y, z), entry);
                        }
                    }
                }
            }
        }
    }

    /// For a row of cells along x: more than 0 if the centre is within `reach` metres of the solid.
    #[inline]
    fn squared_margins(&self, solid: &TaperedCapsule, reach: f32, first: IVec3) -> [f32; LANES] {
        let middle = self.low + (first.as_vec3() + 0.5) * self.edge;
        let axis = solid.end - solid.start;
        let inverse_square = axis.length_squared().max(f32::MIN_POSITIVE).recip();
        let rise = solid.end_radius - solid.start_radius;
        let offset = middle - solid.start;
        let mut squared_margins = [0.0; LANES];
        for (lane, margin) in squared_margins.iter_mut().enumerate() {
            let x = offset.x + lane as f32 * self.edge;
            let t = (x * axis.x + offset.y * axis.y + offset.z * axis.z) * inverse_square;
            let t = t.clamp(0.0, 1.0);
            let (x, y, z) = (x - axis.x * t, offset.y - axis.y * t, offset.z - axis.z * t);
            // The sphere around the foot of the perpendicular is part of the solid.
            let within = (solid.start_radius + rise * t + reach).max(0.0);
            *margin = within * within - (x * x + y * y + z * z);
        }
        squared_margins
    }

    fn set(&mut self, cell: IVec3, entry: usize) {
        let cell = ((cell.z * self.counts.y + cell.y) * self.counts.x + cell.x) as usize;
        if self.places[cell] == EMPTY {
            // Only boxes of kilometres have more cells than that; the remaining cells tell nothing.
            let Some(place) = u16::try_from(self.filled.len())
                .ok()
                .filter(|&place| place != EMPTY)
            else {
                return;
            };
            self.places[cell] = place;
            self.filled.push(self.none.clone());
        }
        self.filled[usize::from(self.places[cell])][entry / 64] |= 1 << (entry % 64);
    }

    fn cell_coordinates(&self, point: Vec3) -> IVec3 {
        ((point - self.low) / self.edge).floor().as_ivec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the sphere at the nearest of many points along the axis.
    #[test]
    fn margins_are_those_of_the_sphere_nearest_along_the_axis() {
        let grid = Grid {
            low: Vec3::new(-0.1, -0.05, 0.02),
            edge: 0.01,
            counts: IVec3::splat(20),
            places: Vec::new(),
            filled: Vec::new(),
            none: Bits::new(),
        };
        let solid = TaperedCapsule::new(Vec3::ZERO, Vec3::new(0.05, 0.03, 0.1), 0.012, 0.006);
        for first in [IVec3::ZERO, IVec3::new(8, 3, 5), IVec3::new(4, 17, 12)] {
            let margins = grid.squared_margins(&solid, 0.004, first);
            for (lane, margin) in margins.into_iter().enumerate() {
                let cell = first.as_vec3() + Vec3::X * lane as f32;
                let centre = grid.low + (cell + 0.5) * grid.edge;
                let shares = (0..=4000).map(|share| share as f32 / 4000.0);
                let distance = |share: f32| solid.at(share).distance(centre);
                let nearest = shares.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
                let share = nearest.expect("there are some");
                let expected = (solid.radius_at(share) + 0.004).powi(2) - distance(share).powi(2);
                assert!(
                    (margin - expected).abs() < 1e-6,
                    "{centre}: {margin}, not {expected}"
                );
            }
        }
    }
}
