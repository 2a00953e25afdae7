//! The plan of a run: sets of grasps, cell by cell.

use grasp_assets::holdouts::{BuiltInHoldout, holdouts};
use grasp_synthesis::model::strategy::{
    BendRatioChoice::{
        self, All, AllFingersWithoutLow, OneRandom, OneRandomFingersWithoutLow, OnlyHigh, OnlyOne,
    },
    Strategy,
};

/// Distance between the seeds of two holdouts: one more than the largest number of grasps per cell.
const SEEDS_PER_HOLDOUT: u64 = 1_000_000;

/// Largest number of grasps, and of failed attempts, per cell: far more than there is time for.
pub const MAX_PER_CELL: u64 = SEEDS_PER_HOLDOUT - 1;

/// A way to synthesize: a grasp set of the thesis, or guided search for the same grasps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Set {
    /// Name in the files: as `grasp find` spells the strategy, for a column of Figure 5.20 with its bend ratios.
    pub name: &'static str,
    /// Whether it is a column of Figure 5.20 and no grasp set: valid grasps on one thread alone. Column (a) is set D,
    /// column (c) set E.
    pub is_column: bool,
    /// How grasps are searched for.
    pub strategy: Strategy,
    /// Which bend ratios a digit tries.
    pub bend_ratios: BendRatioChoice,
}

/// All sets, in the order in which they are made: the ladder's, so that a holdout's time in one set predicts its time
/// in the next.
pub const SETS: [Set; 11] = [
    set("A", Strategy::A, All),
    set("B", Strategy::B, All),
    set("C", Strategy::C, All),
    set("D", Strategy::D, All),
    set("E", Strategy::E, OneRandom),
    set("F", Strategy::F, OneRandom),
    column("D/all-fingers-without-low", AllFingersWithoutLow),
    column("D/one-random-fingers-without-low", OneRandomFingersWithoutLow),
    column("D/only-one", OnlyOne),
    column("D/only-high", OnlyHigh),
    set("GUIDED", Strategy::Guided, OneRandom),
];

const fn set(name: &'static str, strategy: Strategy, bend_ratios: BendRatioChoice) -> Set {
    Set {
        name,
        is_column: false,
        strategy,
        bend_ratios,
    }
}

const fn column(name: &'static str, bend_ratios: BendRatioChoice) -> Set {
    Set {
        is_column: true,
        ..set(name, Strategy::D, bend_ratios)
    }
}

/// A set on one holdout with a number of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// The way to synthesize.
    pub set: Set,
    /// Workers that race.
    pub threads: usize,
    /// Index among the built-in holdouts.
    pub holdout: usize,
}

impl Cell {
    /// The holdout.
    pub fn built_in(&self) -> &'static BuiltInHoldout {
        &holdouts()[self.holdout]
    }
}

/// The settings of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Start of all randomness.
    pub seed: u64,
    /// Valid grasps per cell; the thesis made 25.
    pub valid: u64,
    /// Failed attempts per set and holdout; the thesis kept 100.
    pub invalid: u64,
    /// The sets, in the order of [`SETS`].
    pub sets: Vec<Set>,
    /// The holdouts, as indices among the built-in ones.
    pub holdouts: Vec<usize>,
    /// Searches are timed on one thread, and again on this many; all other columns are from one thread.
    pub threads: usize,
}

impl Settings {
    /// The cells in the order in which they are made.
    pub fn cells(&self) -> Vec<Cell> {
        let mut cells = Vec::new();
        for &set in &self.sets {
            let is_raced = self.threads > 1 && !set.is_column;
            for threads in [Some(1), is_raced.then_some(self.threads)].into_iter().flatten() {
                cells.extend(self.holdouts.iter().map(|&holdout| Cell {
                    set,
                    threads,
                    holdout,
                }));
            }
        }
        cells
    }

    /// Number of failed attempts that a cell keeps.
    pub fn invalid_of(&self, cell: &Cell) -> u64 {
        if cell.threads == 1 && !cell.set.is_column {
            self.invalid
        } else {
            0
        }
    }

    /// The seed of a cell's grasp. It is the same in all sets, so two sets differ in how they synthesize and not in
    /// luck.
    pub fn seed_of_valid(&self, cell: &Cell, number: u64) -> u64 {
        debug_assert!(number < MAX_PER_CELL, "grasp {number} of a cell");
        self.seed_of_holdout(cell).wrapping_add(number)
    }

    /// The seed of a cell's failed attempts.
    pub fn seed_of_invalid(&self, cell: &Cell) -> u64 {
        self.seed_of_holdout(cell).wrapping_add(SEEDS_PER_HOLDOUT - 1)
    }

    fn seed_of_holdout(&self, cell: &Cell) -> u64 {
        self.seed
            .wrapping_add(SEEDS_PER_HOLDOUT.wrapping_mul(cell.holdout as u64))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    fn whole() -> Settings {
        Settings {
            seed: 1,
            valid: 25,
            invalid: 100,
            sets: SETS.to_vec(),
            holdouts: (0..holdouts().len()).collect(),
            threads: 2,
        }
    }

    #[test]
    fn searches_of_a_set_have_distinct_seeds_which_other_sets_share() {
        let settings = whole();
        let of_set = |name| {
            let cells = settings.cells();
            let own = cells
                .iter()
                .filter(|cell| cell.set.name == name && cell.threads == 1);
            let seeds = own.flat_map(|cell| {
                let valid = [0, 1, MAX_PER_CELL - 1].map(|number| settings.seed_of_valid(cell, number));
                valid.into_iter().chain([settings.seed_of_invalid(cell)])
            });
            seeds.collect::<HashSet<_>>()
        };
        assert_eq!(of_set("B").len(), 4 * 15);
        assert_eq!(of_set("B"), of_set("D/only-one"));
    }

    #[test]
    fn columns_of_figure_5_20_are_valid_grasps_on_one_thread() {
        let settings = whole();
        let cells = settings.cells();
        assert_eq!(cells.len(), (7 * 2 + 4) * 15);
        for cell in cells {
            let is_column = cell.set.name.contains('/');
            assert!(!is_column || cell.threads == 1, "{cell:?}");
            let is_examined = !is_column && cell.threads == 1;
            assert_eq!(settings.invalid_of(&cell) == 100, is_examined, "{cell:?}");
        }
    }

    #[test]
    fn sets_without_bend_ratios_in_their_name_have_those_of_their_strategy() {
        for set in SETS.iter().filter(|set| !set.is_column) {
            assert_eq!(
                set.bend_ratios,
                set.strategy.default_bend_ratios(),
                "{}",
                set.name
            );
        }
    }
}
