//! Quantiles, ratios and how sure they are.

use grasp_experiment::stats::mean;
use grasp_synthesis::base::mechanisms::Mechanism;
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{Knowledge, Searched};

/// A mechanism is kept if its absence costs this share at the median, …
pub(super) const MEDIAN_COST: f64 = 0.10;

/// … this share at p99 …
pub(super) const P99_COST: f64 = 0.25;

/// … or this many percentage points of answers in 50 ms, with any class of holdouts.
pub(super) const ANSWERED_COST: f64 = 0.5;

/// Resamples of a bootstrap interval. More make its ends steadier, in proportion to their root.
const RESAMPLES: usize = 400;

/// Seed of the resamples.
const SEED: u64 = 20_180_614;

/// Holdouts that are judged together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// The fifteen built-in ones.
    Fifteen,
    /// Random ones of an object.
    Random(&'static str),
}

impl Class {
    /// Random holdouts of a built-in object.
    pub(super) fn random(object: &str) -> Self {
        let names = ["remote", "scissors", "scalpel"];
        let name = names.into_iter().find(|name| *name == object);
        Self::Random(name.expect("the built-in objects are these"))
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Fifteen => "fifteen",
            Self::Random(object) => object,
        }
    }
}

/// A figure with the ends of its 95 % interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Figure {
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// One variant against all mechanisms on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Against {
    /// Ratio of the medians.
    pub(crate) median: Figure,
    /// The same of wall times.
    pub(crate) wall_median: Figure,
    /// Ratio of the p99.
    pub(crate) p99: Figure,
    /// Percentage points more or fewer answered in 50 ms.
    pub(crate) answered: Figure,
    /// Ratio of the means.
    pub(crate) mean: Figure,
    /// Ratio of mean scores, of holdouts that both answer.
    pub(crate) score: f64,
}

/// A variant's own figures; times in seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Own {
    pub(crate) median: f64,
    pub(crate) p90: f64,
    pub(crate) p99: f64,
    pub(crate) mean: f64,
    pub(crate) wall_median: f64,
    /// Share answered in 50 ms.
    pub(crate) answered: f64,
    pub(crate) score: f64,
}

/// What one class came to.
pub(crate) struct Results {
    pub(crate) knowledge: Knowledge,
    pub(crate) class: Class,
    /// For each variant: what is off, its figures, and its figures against all on.
    pub(crate) variants: Vec<(Option<Mechanism>, Own, Against)>,
    baseline: Vec<Searched>,
}

impl Results {
    /// The first two variants have all mechanisms on.
    pub(super) fn of(
        knowledge: Knowledge,
        class: Class,
        variants: &[Option<Mechanism>],
        searched: &[Vec<Searched>],
    ) -> Self {
        let (first, second) = (&searched[0], &searched[1]);
        let against = |number: usize, searched: &Vec<Searched>| match number {
            0 => against(&[first], first),
            1 => against(&[first], second),
            _ => against(&[first, second], searched),
        };
        let variants = variants
            .iter()
            .zip(searched)
            .enumerate()
            .map(|(number, (off, searched))| (*off, own(searched), against(number, searched)))
            .collect();
        let baseline = searched[..2].concat();
        Self {
            knowledge,
            class,
            variants,
            baseline,
        }
    }

    /// Every search with all mechanisms on.
    pub(super) fn all_on(&self) -> impl Iterator<Item = Searched> {
        self.baseline.iter().copied()
    }

    /// What two runs of the same differ by.
    pub(super) fn noise(&self) -> Against {
        self.variants[1].2
    }

    /// All on, both runs together.
    pub(super) fn baseline(&self) -> Own {
        own(&self.baseline)
    }
}

/// A quantile of numbers that are sorted.
fn sorted_quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + (above - below) * place.fract()
}

fn own(searched: &[Searched]) -> Own {
    let mut times: Vec<f64> = searched.iter().map(|one| one.time.as_secs_f64()).collect();
    times.sort_by(f64::total_cmp);
    let wall_times = searched.iter().map(|one| one.wall_time.as_secs_f64());
    let mut wall_times: Vec<f64> = wall_times.collect();
    wall_times.sort_by(f64::total_cmp);
    let scores: Vec<f64> = searched
        .iter()
        .filter_map(|one| one.score)
        .map(f64::from)
        .collect();
    Own {
        median: sorted_quantile(&times, 0.5),
        p90: sorted_quantile(&times, 0.9),
        p99: sorted_quantile(&times, 0.99),
        mean: mean(&times).unwrap_or(0.0),
        wall_median: sorted_quantile(&wall_times, 0.5),
        answered: searched.iter().filter(|one| one.is_in_time()).count() as f64 / searched.len() as f64,
        score: mean(&scores).unwrap_or(0.0),
    }
}

/// Ratios and differences of a variant to runs with all on; intervals by a bootstrap over the holdouts, which both share.
fn against(all_on: &[&Vec<Searched>], searched: &[Searched]) -> Against {
    let count = searched.len();
    let of = |holdouts: &[usize]| {
        let all: Vec<Searched> = all_on
            .iter()
            .flat_map(|run| holdouts.iter().map(|&holdout| run[holdout]))
            .collect();
        let without: Vec<Searched> = holdouts.iter().map(|&holdout| searched[holdout]).collect();
        let (all, without) = (own(&all), own(&without));
        [
            without.median / all.median,
            without.p99 / all.p99,
            100.0 * (without.answered - all.answered),
            without.mean / all.mean,
            without.wall_median / all.wall_median,
        ]
    };
    let whole: Vec<usize> = (0..count).collect();
    let values = of(&whole);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let resampled: Vec<[f64; 5]> = (0..RESAMPLES)
        .map(|_| {
            let drawn: Vec<usize> = (0..count).map(|_| random.random_range(0..count)).collect();
            of(&drawn)
        })
        .collect();
    let figure = |which: usize| {
        let mut drawn: Vec<f64> = resampled.iter().map(|values| values[which]).collect();
        drawn.sort_by(f64::total_cmp);
        Figure {
            value: values[which],
            low: sorted_quantile(&drawn, 0.025),
            high: sorted_quantile(&drawn, 0.975),
        }
    };
    let both = all_on[0].iter().zip(searched);
    let scores: Vec<(f64, f64)> = both
        .filter_map(|(all, without)| Some((f64::from(all.score?), f64::from(without.score?))))
        .collect();
    let sum = |of: fn(&(f64, f64)) -> f64| scores.iter().map(of).sum::<f64>();
    Against {
        median: figure(0),
        p99: figure(1),
        answered: figure(2),
        mean: figure(3),
        wall_median: figure(4),
        score: sum(|(_, without)| *without) / sum(|(all, _)| *all),
    }
}
