//! The plan of a run: sets of grasps, cell by cell.

use std::ops::Not;

use grasp_assets::holdouts::{BuiltInHoldout, holdouts};
use grasp_synthesis::model::{
    bend_ratios::BendRatioChoice,
    strategy::{Strategy, Validity},
};
use serde::{Deserialize, Serialize};

/// The receiving hand under the thesis' validity.
pub const THESIS_RIG: &str = "thesis";

/// The receiving hand under `PHYSICAL` validity: the server's default.
pub const PHYSICAL_RIG: &str = "adult";

/// Distance between the seeds of two holdouts: one more than the largest number of grasps per cell.
const SEEDS_PER_HOLDOUT: u64 = 1_000_000;

/// Largest number of grasps, and of invalid attempts, per cell: far more than there is time for.
pub const MAX_PER_CELL: u64 = SEEDS_PER_HOLDOUT - 1;

/// Attempts after which a search of a set beyond A to F gives up, as not every holdout leaves a physical grasp. More
/// take up to a minute each; the worst holdout with a grasp takes 6,000 on average.
const MAX_ATTEMPTS: u64 = 1_000_000;

/// A way to synthesize: a grasp set of the thesis, or one beyond them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Set {
    /// How grasps are searched for.
    pub strategy: Strategy,
    /// Which bend ratios a digit tries.
    pub bend_ratios: BendRatioChoice,
    /// Which grasps count as valid. Omitted in records under the thesis' validity.
    #[serde(default, skip_serializing_if = "is_of_thesis")]
    pub validity: Validity,
    /// Whether the grips of the object's complete atlas are tried first. Omitted in records of sets without an atlas.
    #[serde(default, skip_serializing_if = "Not::not")]
    pub atlas: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_of_thesis(validity: &Validity) -> bool {
    *validity == Validity::Thesis
}

impl Set {
    /// Grasp set A to F.
    pub fn ladder(strategy: Strategy) -> Self {
        Self::of_thesis(strategy, strategy.default_bend_ratios())
    }

    /// GUIDED search with the hand and the validity of the thesis.
    pub const GUIDED: Self = Self::of_thesis(Strategy::Guided, BendRatioChoice::OneRandom);

    /// GUIDED search for the server's default grasps, without known grips.
    pub const PHYSICAL: Self = Self {
        validity: Validity::Physical,
        ..Self::GUIDED
    };

    /// [`Self::PHYSICAL`] with the object's complete atlas, as a server answers by default.
    pub const ATLAS: Self = Self {
        atlas: true,
        ..Self::PHYSICAL
    };

    /// All compared sets: A to F, and those beyond.
    pub const ALL: [Self; 9] = [
        Self::of_thesis(Strategy::A, BendRatioChoice::All),
        Self::of_thesis(Strategy::B, BendRatioChoice::All),
        Self::of_thesis(Strategy::C, BendRatioChoice::All),
        Self::of_thesis(Strategy::D, BendRatioChoice::All),
        Self::of_thesis(Strategy::E, BendRatioChoice::OneRandom),
        Self::of_thesis(Strategy::F, BendRatioChoice::OneRandom),
        Self::GUIDED,
        Self::PHYSICAL,
        Self::ATLAS,
    ];

    /// The columns of Figure 5.20 in its order, (a) to (f). Column (a) is set D and column (c) set E: the thesis names
    /// them so.
    pub const BEND_RATIO_COLUMNS: [Self; 6] = [
        Self::of_thesis(Strategy::D, BendRatioChoice::All),
        Self::of_thesis(Strategy::D, BendRatioChoice::AllFingersWithoutLow),
        Self::of_thesis(Strategy::E, BendRatioChoice::OneRandom),
        Self::of_thesis(Strategy::D, BendRatioChoice::OneRandomFingersWithoutLow),
        Self::of_thesis(Strategy::D, BendRatioChoice::OnlyOne),
        Self::of_thesis(Strategy::D, BendRatioChoice::OnlyHigh),
    ];

    const fn of_thesis(strategy: Strategy, bend_ratios: BendRatioChoice) -> Self {
        Self {
            strategy,
            bend_ratios,
            validity: Validity::Thesis,
            atlas: false,
        }
    }

    /// True for the sets A to F.
    pub fn is_ladder(self) -> bool {
        Strategy::LADDER.contains(&self.strategy) && self == Self::ladder(self.strategy)
    }

    /// Attempts after which a search gives up; searches of A to F never do.
    pub fn most_attempts(self) -> u64 {
        if self == Self::GUIDED || self.validity == Validity::Physical {
            MAX_ATTEMPTS
        } else {
            u64::MAX
        }
    }

    /// The rig of the receiving hand: the server's default.
    pub fn rig_name(self) -> &'static str {
        match self.validity {
            Validity::Thesis => THESIS_RIG,
            Validity::Physical => PHYSICAL_RIG,
        }
    }

    /// "A" to "F", "Guided", "Physical" or "Atlas", or "D, only 1.0" and so on.
    pub fn name(self) -> String {
        match self {
            Self::PHYSICAL => "Physical".to_owned(),
            Self::ATLAS => "Atlas".to_owned(),
            Self::GUIDED => "Guided".to_owned(),
            _ if self.is_ladder() => format!("{:?}", self.strategy),
            _ => format!("{:?}, {}", self.strategy, choice_name(self.bend_ratios)),
        }
    }
}

/// Short form of Figure 5.20's name of a choice of bend ratios.
pub fn choice_name(choice: BendRatioChoice) -> &'static str {
    match choice {
        BendRatioChoice::All => "all",
        BendRatioChoice::AllFingersWithoutLow => "fingers without 0.7",
        BendRatioChoice::OneRandom => "one random",
        BendRatioChoice::OneRandomFingersWithoutLow => "one random, fingers without 0.7",
        BendRatioChoice::OnlyOne => "only 1.0",
        BendRatioChoice::OnlyHigh => "only 1.42",
    }
}

/// A set on one holdout with a number of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Cell {
    /// The way to synthesize.
    #[serde(flatten)]
    pub set: Set,
    /// Workers that race.
    pub threads: usize,
    /// Index among the built-in holdouts, serialized as the name.
    #[serde(with = "holdout_name")]
    pub holdout: usize,
}

impl Cell {
    /// The holdout.
    pub fn built_in(&self) -> &'static BuiltInHoldout {
        &holdouts()[self.holdout]
    }
}

mod holdout_name {
    use grasp_assets::holdouts::holdouts;
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _, ser::Error as _};

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
    pub(super) fn serialize<S: Serializer>(index: &usize, serializer: S) -> Result<S::Ok, S::Error> {
        match holdouts().get(*index) {
            Some(holdout) => serializer.serialize_str(&holdout.name),
            None => Err(S::Error::custom(format!("there is no holdout {index}"))),
        }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
        let name = String::deserialize(deserializer)?;
        let found = holdouts().iter().position(|holdout| holdout.name == name);
        found.ok_or_else(|| D::Error::custom(format!("there is no holdout {name:?}")))
    }
}

/// The request of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Start of all randomness.
    pub seed: u64,
    /// Valid grasps per cell; the thesis made 25.
    pub valid: u64,
    /// Invalid attempts per set and holdout; the thesis kept 100.
    pub invalid: u64,
    /// The sets, in the order of [`Set::ALL`].
    pub sets: Vec<Set>,
    /// The holdouts, as indices.
    pub holdouts: Vec<usize>,
    /// Whether the columns of Figure 5.20 are included.
    pub bend_ratio_columns: bool,
    /// Numbers of threads to run the sets with; everything but times is taken from the first.
    pub threads: Vec<usize>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            valid: 25,
            invalid: 100,
            sets: Set::ALL.to_vec(),
            holdouts: (0..holdouts().len()).collect(),
            bend_ratio_columns: true,
            threads: vec![1, 2],
        }
    }
}

impl Settings {
    /// The cells in the order in which they are made.
    ///
    /// Sets are in the ladder's order, so that a holdout's time in one set predicts its time in the next.
    pub fn cells(&self) -> Vec<Cell> {
        let mut runs: Vec<(Set, usize)> = Vec::new();
        for &set in &self.sets {
            runs.extend(self.threads.iter().map(|&threads| (set, threads)));
        }
        if self.bend_ratio_columns {
            runs.extend(Set::BEND_RATIO_COLUMNS.map(|set| (set, 1)));
        }
        let mut cells = Vec::new();
        for (index, &(set, threads)) in runs.iter().enumerate() {
            if runs[..index].contains(&(set, threads)) {
                continue;
            }
            cells.extend(self.holdouts.iter().map(|&holdout| Cell {
                set,
                threads,
                holdout,
            }));
        }
        cells
    }

    /// Number of invalid attempts that a cell keeps: on one thread, in the requested sets without an atlas, as an atlas
    /// does not change attempts.
    pub fn invalid_of(&self, cell: &Cell) -> u64 {
        if self.sets.contains(&cell.set) && !cell.set.atlas && cell.threads == 1 {
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

    /// The seed of a cell's invalid attempts.
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

    #[test]
    fn every_cell_is_made_once() {
        let cells = Settings::default().cells();
        // Nine sets on one and two threads, and four columns of Figure 5.20 that are not among the sets.
        assert_eq!(cells.len(), (9 * 2 + 4) * 15);
        assert_eq!(cells.iter().collect::<HashSet<_>>().len(), cells.len());
    }

    #[test]
    fn bend_ratio_columns_match_the_thesis() {
        let names = Set::BEND_RATIO_COLUMNS.map(Set::name);
        assert_eq!(names[0], "D");
        assert_eq!(names[2], "E");
        assert_eq!(names[4], "D, only 1.0");
        assert_eq!(names.iter().collect::<HashSet<_>>().len(), 6);
    }

    #[test]
    fn the_first_sets_are_the_ladder() {
        let (ladder, beyond) = Set::ALL.split_at(6);
        assert_eq!(ladder, Strategy::LADDER.map(Set::ladder));
        assert!(ladder.iter().all(|set| set.is_ladder()));
        assert!(!beyond.iter().any(|set| set.is_ladder()));
        assert_eq!(Set::GUIDED.bend_ratios, Strategy::Guided.default_bend_ratios());
        let names: Vec<_> = beyond.iter().map(|set| set.name()).collect();
        assert_eq!(names, ["Guided", "Physical", "Atlas"]);
    }

    #[test]
    fn cells_of_earlier_versions_round_trip() {
        let earlier = r#"{"strategy":"B","bend_ratios":"all","threads":1,"holdout":"scissors-hold1"}"#;
        let cell: Cell = serde_json::from_str(earlier).expect("a cell");
        assert_eq!(cell.set, Set::ladder(Strategy::B));
        assert_eq!(serde_json::to_string(&cell).expect("text"), earlier);
        for set in Set::ALL {
            let text = serde_json::to_string(&Cell { set, ..cell }).expect("text");
            assert_eq!(
                serde_json::from_str::<Cell>(&text).expect("a cell").set,
                set,
                "{text}"
            );
        }
    }

    #[test]
    fn searches_of_a_set_have_distinct_seeds() {
        let settings = Settings::default();
        let mut seeds = HashSet::new();
        for cell in settings
            .cells()
            .iter()
            .filter(|cell| cell.set.name() == "B" && cell.threads == 1)
        {
            for number in [0, 1, MAX_PER_CELL - 1] {
                assert!(seeds.insert(settings.seed_of_valid(cell, number)));
            }
            assert!(seeds.insert(settings.seed_of_invalid(cell)));
        }
        assert_eq!(seeds.len(), 4 * 15);
    }

    #[test]
    fn invalid_attempts_are_kept_of_requested_sets_on_one_thread() {
        let settings = Settings {
            sets: vec![Set::ladder(Strategy::F), Set::PHYSICAL, Set::ATLAS],
            ..Settings::default()
        };
        for cell in settings.cells() {
            let is_negative_set = ["F", "Physical"].contains(&cell.set.name().as_str());
            let expected = if is_negative_set && cell.threads == 1 {
                100
            } else {
                0
            };
            assert_eq!(settings.invalid_of(&cell), expected, "{cell:?}");
        }
    }
}
