//! Which grips of an atlas are certainly in a giver's way, found for all of them at once.
//!
//! Most known grips meet the giver's hand. Instead of comparing hands one by one, space around the object is cut into
//! cells, and each cell knows, a bit a grip, which hands fill it. The balls that a giver's hand is made of then look up
//! their cells, and what these say together is out of the question.
//!
//! The bits lie far apart in memory, and most searches end with one of the first grips. So they are kept for a line of the
//! cache's grips at a time, and looked at when one of those is asked for.

use std::sync::OnceLock;

use glam::{IVec3, Vec3};

use super::entry::Entry;
use crate::{
    model::{hand::rig::Rig, object::GraspObject},
    physical::{
        grip::GIVER_CLEARANCE,
        solids::{PreparedHand, TaperedCapsule},
    },
};

/// Edge of a cell in metres. Smaller ones tell more hands apart and take memory by the third power.
const CELL: f32 = 0.0125;

/// Cells at most: those around large objects are larger, and tell fewer hands apart.
const MOST_CELLS: f32 = 10_000.0;

/// Lines of cells that are kept at most, each 64 bytes for 512 grips: those of the cells that most hands fill, 2,600 cells of
/// 8,192 grips. Fewer exclude fewer hands; with 3,500 cells instead of 2,800, look-ups took as long.
const MOST_LINES: usize = 41_600;

/// From a cell's middle to its corners, as a multiple of its edge.
const HALF_DIAGONAL: f32 = 0.866_026;

/// The smallest radius in metres of a giver's balls that are looked up: inner phalanges, palm and forearm. A larger one
/// counts more cells as filled and looks up fewer balls.
const LEAST_RADIUS: f32 = 0.01;

/// Solids of a giver that are looked up, those first that most hands meet. Of a hundred grips of the remote that meet a giver,
/// 16 exclude 39, 20 exclude 40 and 24 exclude 41; all of them take twice as long as 16.
const SOLIDS: usize = 24;

/// How far around the object's box space is cut into cells, in metres: a hand's thickness and more.
const MARGIN: f32 = 0.07;

/// Distance between the balls of one of the giver's solids, in metres: half a cell's edge, so that hardly a cell on the way is
/// left out. A larger one leaves out more, a smaller one looks up the same cells again.
const SPACING: f32 = 0.006;

/// Room for the rows that are looked up for a giver. Where there are more, it grows.
const USUAL_ROWS: usize = 128;

/// Grips that share a word.
const WORD: usize = u64::BITS as usize;

/// Grips whose bits are looked at together: those that a line of the cache has room for.
const BLOCK: usize = 8 * WORD;

/// Cells side by side of which it is found out at once whether a solid fills them: more than most solids reach over.
const LANES: usize = 8;

/// A bit for each grip of a block.
type Line = [u64; BLOCK / WORD];

/// The row of cells that nothing fills.
const EMPTY: u16 = 0;

/// For each cell around an object, the grips whose hands fill it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Occupancy {
    low: Vec3,
    /// Edge of a cell in metres.
    edge: f32,
    counts: IVec3,
    /// The row of each cell.
    rows: Vec<u16>,
    /// For each block of grips, what each row says of them.
    blocks: Vec<Vec<Line>>,
}

/// Grips that a giver is certainly met by.
#[derive(Clone, Debug)]
pub struct Excluded<'a> {
    occupancy: &'a Occupancy,
    /// The rows of the cells that the giver fills.
    filled: Vec<u16>,
    /// What they say together of each block, once it was asked for.
    blocks: Vec<OnceLock<Line>>,
}

impl Excluded<'_> {
    /// True if a grip is out of the question.
    pub fn contains(&self, entry: u16) -> bool {
        let (block, bit) = (usize::from(entry) / BLOCK, usize::from(entry) % BLOCK);
        let Some(line) = self.blocks.get(block) else {
            return false;
        };
        let line = line.get_or_init(|| self.occupancy.together(block, &self.filled));
        has(line, bit)
    }
}

/// Grips whose hands share a cell with another one: nearly all that meet it, and few others.
#[derive(Clone, Debug)]
pub(super) struct Met {
    lines: Vec<Line>,
}

impl Met {
    /// True if a grip is one of them.
    pub(super) fn contains(&self, entry: usize) -> bool {
        has(&self.lines[entry / BLOCK], entry % BLOCK)
    }
}

/// True if a grip of a block is one of those that a line says.
fn has(line: &Line, bit: usize) -> bool {
    line[bit / WORD] >> (bit % WORD) & 1 == 1
}

impl Occupancy {
    /// What the hands of some grips fill.
    pub(super) fn of(object: &GraspObject, rig: &Rig, entries: &[Entry]) -> Self {
        let surface = object.surface.mesh().aabb();
        let low = surface.min - MARGIN;
        let extents = surface.max + MARGIN - low;
        let edge = CELL.max((extents.element_product() / MOST_CELLS).cbrt());
        let counts = (extents / edge).ceil().as_ivec3();
        let mut occupancy = Self {
            low,
            edge,
            counts,
            rows: vec![EMPTY; counts.element_product() as usize],
            // The first row is the one of cells that nothing fills.
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

    /// Empties the cells that fewest hands fill, if all have more than [`MOST_LINES`].
    fn keep_fullest(&mut self) {
        let count = self.row_count();
        let most = MOST_LINES / self.blocks.len().max(1);
        if count <= most {
            return;
        }
        let filled = |row: &usize| -> u32 {
            let words = self.blocks.iter().flat_map(|rows| rows[*row]);
            words.map(u64::count_ones).sum()
        };
        // The first row stays where it is; of equally full ones, those that were filled first stay.
        let mut kept: Vec<usize> = (1..count).collect();
        kept.sort_by_cached_key(|row| std::cmp::Reverse(filled(row)));
        kept.truncate(most - 1);
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

    /// The grips whose hands a giver's certainly comes too near to.
    pub(super) fn excluded_by(&self, giver: &PreparedHand) -> Excluded<'_> {
        // Solids of a hand overlap, so that half of the balls lie in a cell that was looked up before.
        let mut is_done = vec![false; self.row_count()];
        let mut filled = Vec::with_capacity(USUAL_ROWS);
        for solid in giver.iter().take(SOLIDS) {
            let steps = (solid.length() / SPACING) as u32 + 1;
            let of_step = (steps as f32).recip();
            let (from, way) = (self.in_cells(solid.start), (solid.end - solid.start) / self.edge);
            for step in 0..=steps {
                let along = step as f32 * of_step;
                if solid.radius_at(along) < LEAST_RADIUS {
                    continue;
                }
                let Some(cell) = self.cell(rounded_down(from + way * along)) else {
                    continue;
                };
                let row = self.rows[cell];
                if row != EMPTY && !std::mem::replace(&mut is_done[usize::from(row)], true) {
                    filled.push(row);
                }
            }
        }
        Excluded {
            occupancy: self,
            filled,
            blocks: vec![OnceLock::new(); self.blocks.len()],
        }
    }

    /// The grips that fill a cell together with one of them, and that one.
    pub(super) fn met_by(&self, entry: usize) -> Met {
        let (block, bit) = (entry / BLOCK, entry % BLOCK);
        let rows = self.blocks[block].iter().enumerate();
        let filled = rows.filter(|(_, line)| has(line, bit)).map(|(row, _)| row as u16);
        let filled: Vec<u16> = filled.collect();
        Met {
            lines: (0..self.blocks.len())
                .map(|block| self.together(block, &filled))
                .collect(),
        }
    }

    /// What some rows say together of a block.
    fn together(&self, block: usize, rows: &[u16]) -> Line {
        let lines = &self.blocks[block];
        let mut together = Line::default();
        for &row in rows {
            for (word, more) in together.iter_mut().zip(lines[usize::from(row)]) {
                *word |= more;
            }
        }
        together
    }

    /// Bytes that it takes in memory.
    pub(super) fn bytes(&self) -> usize {
        let blocks = self.blocks.iter().map(|rows| size_of_val(rows.as_slice()));
        size_of_val(self.rows.as_slice()) + blocks.sum::<usize>()
    }

    /// Notes that a hand's solid fills cells: every ball of a giver that has its middle there comes too near.
    fn fill(&mut self, solid: &TaperedCapsule, entry: usize) {
        let reach = LEAST_RADIUS + GIVER_CLEARANCE - HALF_DIAGONAL * self.edge;
        let thickest = solid.start_radius.max(solid.end_radius) + reach.max(0.0);
        let first = self
            .place_of(solid.start.min(solid.end) - thickest)
            .max(IVec3::ZERO);
        let last = self
            .place_of(solid.start.max(solid.end) + thickest)
            .min(self.counts - 1);
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in (first.x..=last.x).step_by(LANES) {
                    let insides = self.insides(solid, reach, IVec3::new(x, y, z));
                    for (x, inside) in (x..=last.x).zip(insides) {
                        if inside > 0.0 {
                            self.set(IVec3::new(x, y, z), entry);
                        }
                    }
                }
            }
        }
    }

    /// For a cell and those beside it along x: more than 0 if its middle is less than `reach` metres off a solid.
    #[inline]
    fn insides(&self, solid: &TaperedCapsule, reach: f32, first: IVec3) -> [f32; LANES] {
        let middle = self.low + (first.as_vec3() + 0.5) * self.edge;
        let axis = solid.end - solid.start;
        let inverse_square = axis.length_squared().max(f32::MIN_POSITIVE).recip();
        let rise = solid.end_radius - solid.start_radius;
        let way = middle - solid.start;
        let mut insides = [0.0; LANES];
        for (lane, inside) in insides.iter_mut().enumerate() {
            let x = way.x + lane as f32 * self.edge;
            let t = (x * axis.x + way.y * axis.y + way.z * axis.z) * inverse_square;
            let t = t.clamp(0.0, 1.0);
            let (x, y, z) = (x - axis.x * t, way.y - axis.y * t, way.z - axis.z * t);
            // The ball around the foot is one of those that the solid is made of.
            let within = (solid.start_radius + rise * t + reach).max(0.0);
            *inside = within * within - (x * x + y * y + z * z);
        }
        insides
    }

    fn set(&mut self, place: IVec3, entry: usize) {
        let Some(cell) = self.cell(place) else { return };
        if self.rows[cell] == EMPTY {
            // Only boxes of kilometres have more cells than can be told apart: what is left out excludes nothing.
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

    /// Which cell along each axis a point is in; before the first, -1.
    fn place_of(&self, point: Vec3) -> IVec3 {
        rounded_down(self.in_cells(point))
    }

    /// A point in edges of a cell from the first one's corner.
    fn in_cells(&self, point: Vec3) -> Vec3 {
        (point - self.low) / self.edge
    }

    fn cell(&self, place: IVec3) -> Option<usize> {
        let is_inside = place.cmpge(IVec3::ZERO).all() && place.cmplt(self.counts).all();
        is_inside.then(|| ((place.z * self.counts.y + place.y) * self.counts.x + place.x) as usize)
    }
}

/// The next whole numbers below, but -1 for all that are less. Conversion takes an instruction where rounding takes a call on
/// many processors.
fn rounded_down(place: Vec3) -> IVec3 {
    (place.max(Vec3::NEG_ONE) + 1.0).as_ivec3() - 1
}
