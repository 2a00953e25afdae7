//! Finds all grips that collide with a given one at once, as if its hand were the giver's.
//!
//! Instead of comparing hands one by one, the space around the object is divided into cells, each with one bit per grip whose
//! hand fills it. The cells that a hand fills then tell every grip that collides with it.

use glam::{IVec3, Vec3};

use super::entry::Entry;
use crate::{
    model::{hand::rig::Rig, object::GraspObject},
    physical::{grip::GIVER_CLEARANCE, solids::TaperedCapsule},
};

/// Edge of a cell in metres. Smaller cells separate hands better; memory grows with the third power.
const CELL: f32 = 0.0125;

/// Largest number of cells. Larger objects get larger cells, which separate hands less well.
const MAX_CELLS: f32 = 10_000.0;

/// Largest number of lines kept, 64 bytes for 512 grips each: the cells that most hands fill, about 2,600 for
/// 8,192 grips. Fewer tell fewer collisions.
const MAX_LINES: usize = 41_600;

/// Distance from a cell's centre to its corners, as a multiple of its edge.
const HALF_DIAGONAL: f32 = 0.866_026;

/// Radius in metres of a giver's inner phalanges. A larger one makes hands fill more cells.
const MIN_RADIUS: f32 = 0.01;

/// Margin of the grid around the object's bounding box, in metres: more than the thickness of a hand.
const MARGIN: f32 = 0.07;

/// Grips per word.
const WORD: usize = u64::BITS as usize;

/// Grips per block: as many as a cache line has bits.
const BLOCK: usize = 8 * WORD;

/// Cells along x that are tested against a solid at once: more than most solids extend over.
const LANES: usize = 8;

/// One bit per grip of a block.
type Line = [u64; BLOCK / WORD];

/// The row of cells that no hand fills.
const EMPTY: u16 = 0;

/// For each cell around an object, the grips whose hands fill it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Occupancy {
    low: Vec3,
    /// Edge of a cell in metres.
    edge: f32,
    counts: IVec3,
    /// Each cell's row.
    rows: Vec<u16>,
    /// For each block of grips, the bits of every row.
    blocks: Vec<Vec<Line>>,
}

/// Grips whose hands share a cell with a given grip's hand: nearly all that collide with it, and few others.
#[derive(Clone, Debug)]
pub(super) struct Colliding {
    lines: Vec<Line>,
}

impl Colliding {
    /// True if a grip is one of them.
    pub(super) fn contains(&self, entry: usize) -> bool {
        has(&self.lines[entry / BLOCK], entry % BLOCK)
    }
}

/// True if a line has the bit of a grip of its block.
fn has(line: &Line, bit: usize) -> bool {
    line[bit / WORD] >> (bit % WORD) & 1 == 1
}

impl Occupancy {
    /// The cells that the hands of some grips fill.
    pub(super) fn of(object: &GraspObject, rig: &Rig, entries: &[Entry]) -> Self {
        let surface = object.surface.mesh().aabb();
        let low = surface.min - MARGIN;
        let extents = surface.max + MARGIN - low;
        let edge = CELL.max((extents.element_product() / MAX_CELLS).cbrt());
        let counts = (extents / edge).ceil().as_ivec3();
        let mut occupancy = Self {
            low,
            edge,
            counts,
            rows: vec![EMPTY; counts.element_product() as usize],
            // The first row belongs to the cells that no hand fills.
            blocks: vec![vec![Line::default()]; entries.len().div_ceil(BLOCK)],
        };
        for (index, entry) in entries.iter().enumerate() {
            for solid in entry.solids(rig).iter() {
                occupancy.fill(solid, index);
            }
        }
        occupancy.keep_fullest();
        occupancy
    }

    /// Empties the cells that fewest hands fill, if there are more than [`MAX_LINES`] lines.
    fn keep_fullest(&mut self) {
        let count = self.row_count();
        let max_rows = MAX_LINES / self.blocks.len().max(1);
        if count <= max_rows {
            return;
        }
        let filled = |row: &usize| -> u32 {
            let words = self.blocks.iter().flat_map(|rows| rows[*row]);
            words.map(u64::count_ones).sum()
        };
        // The first row stays first; ties keep the order of filling.
        let mut kept: Vec<usize> = (1..count).collect();
        kept.sort_by_cached_key(|row| std::cmp::Reverse(filled(row)));
        kept.truncate(max_rows - 1);
        kept.sort_unstable();
        let mut new_rows = vec![EMPTY; count];
        for (new, &old) in (1..).zip(&kept) {
            new_rows[old] = new;
        }
        for row in &mut self.rows {
            *row = new_rows[usize::from(*row)];
        }
        for rows in &mut self.blocks {
            for (new, &old) in (1..).zip(&kept) {
                rows[new] = rows[old];
            }
            rows.truncate(kept.len() + 1);
            rows.shrink_to_fit();
        }
    }

    fn row_count(&self) -> usize {
        self.blocks.first().map_or(1, Vec::len)
    }

    /// The grips that share a cell with the given one, which is included.
    pub(super) fn colliding_with(&self, entry: usize) -> Colliding {
        let (block, bit) = (entry / BLOCK, entry % BLOCK);
        let rows = self.blocks[block].iter().enumerate();
        let filled = rows.filter(|(_, line)| has(line, bit)).map(|(row, _)| row as u16);
        let filled: Vec<u16> = filled.collect();
        Colliding {
            lines: (0..self.blocks.len())
                .map(|block| self.union(block, &filled))
                .collect(),
        }
    }

    /// The union of some rows for a block.
    fn union(&self, block: usize, rows: &[u16]) -> Line {
        let lines = &self.blocks[block];
        let mut union = Line::default();
        for &row in rows {
            for (word, more) in union.iter_mut().zip(lines[usize::from(row)]) {
                *word |= more;
            }
        }
        union
    }

    /// Sets a grip's bit in the cells that one of its solids fills: those in which a giver's sphere of radius
    /// [`MIN_RADIUS`] is certainly too close, wherever in the cell its centre lies.
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

    /// For a row of cells along x: more than 0 if the centre is within `reach` metres of the solid. These are
    /// differences of squared distances, not depths in metres.
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

    fn set(&mut self, place: IVec3, entry: usize) {
        let Some(cell) = self.cell(place) else { return };
        if self.rows[cell] == EMPTY {
            // Only boxes of kilometres have more cells than row numbers; the remaining cells exclude nothing.
            let Ok(row) = u16::try_from(self.row_count()) else {
                return;
            };
            self.rows[cell] = row;
            for rows in &mut self.blocks {
                rows.push(Line::default());
            }
        }
        let row = usize::from(self.rows[cell]);
        let (block, bit) = (entry / BLOCK, entry % BLOCK);
        self.blocks[block][row][bit / WORD] |= 1 << (bit % WORD);
    }

    /// A point's cell along each axis.
    fn cell_coordinates(&self, point: Vec3) -> IVec3 {
        ((point - self.low) / self.edge).floor().as_ivec3()
    }

    fn cell(&self, place: IVec3) -> Option<usize> {
        let is_inside = place.cmpge(IVec3::ZERO).all() && place.cmplt(self.counts).all();
        is_inside.then(|| ((place.z * self.counts.y + place.y) * self.counts.x + place.x) as usize)
    }
}
