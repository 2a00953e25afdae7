//! Quantiles and ratios, with confidence intervals.

use grasp_experiment::stats::mean;
use grasp_synthesis::base::mechanisms::Mechanism;
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{Knowledge, SearchSample};

/// A mechanism is kept if its absence costs this share at the median, …
pub(super) const MEDIAN_COST: f64 = 0.10;

/// … this share at p99 …
pub(super) const P99_COST: f64 = 0.25;

/// … or this many percentage points of answers in 50 ms, with any class of holdouts.
pub(super) const ANSWERED_COST: f64 = 0.5;

/// Resamples per bootstrap interval. The ends of intervals become steadier with its square root.
const RESAMPLES: usize = 400;

/// Seed of the resamples.
const SEED: u64 = 20_180_614;

/// Holdouts that are summarised together.
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

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Figure {
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// One variant compared with all mechanisms on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Comparison {
    /// Ratio of the medians.
    pub(crate) median: Figure,
    /// Ratio of the median wall times.
    pub(crate) wall_median: Figure,
    /// Ratio of the p99.
    pub(crate) p99: Figure,
    /// Difference of the share answered within 50 ms, in percentage points.
    pub(crate) answered: Figure,
    /// Ratio of the means.
    pub(crate) mean: Figure,
    /// Ratio of mean scores over holdouts that both answer.
    pub(crate) score: f64,
}

/// Statistics of one variant; times in seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VariantStats {
    pub(crate) median: f64,
    pub(crate) p90: f64,
    pub(crate) p99: f64,
    pub(crate) mean: f64,
    pub(crate) wall_median: f64,
    /// Share answered within 50 ms.
    pub(crate) answered: f64,
    pub(crate) score: f64,
}

/// The results of one class.
pub(crate) struct Results {
    pub(crate) knowledge: Knowledge,
    pub(crate) class: Class,
    /// Per variant: the mechanism switched off, its statistics, and the comparison with all on.
    pub(crate) variants: Vec<(Option<Mechanism>, VariantStats, Comparison)>,
    baseline: Vec<SearchSample>,
}

impl Results {
    /// Summarises samples per variant; the first two variants have all mechanisms on.
    pub(super) fn of(
        knowledge: Knowledge,
        class: Class,
        variants: &[Option<Mechanism>],
        searched: &[Vec<SearchSample>],
    ) -> Self {
        let (first, second) = (&searched[0], &searched[1]);
        let comparison = |number: usize, searched: &Vec<SearchSample>| match number {
            0 => compare(&[first], first),
            1 => compare(&[first], second),
            _ => compare(&[first, second], searched),
        };
        let variants = variants
            .iter()
            .zip(searched)
            .enumerate()
            .map(|(number, (off, searched))| (*off, stats(searched), comparison(number, searched)))
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
    pub(super) fn all_on(&self) -> impl Iterator<Item = SearchSample> {
        self.baseline.iter().copied()
    }

    /// Comparison of the two identical runs.
    pub(super) fn noise(&self) -> Comparison {
        self.variants[1].2
    }

    /// Statistics with all mechanisms on, over both runs.
    pub(super) fn baseline(&self) -> VariantStats {
        stats(&self.baseline)
    }
}

/// A quantile of sorted numbers.
fn sorted_quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + (above - below) * place.fract()
}

fn stats(searched: &[SearchSample]) -> VariantStats {
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
    VariantStats {
        median: sorted_quantile(&times, 0.5),
        p90: sorted_quantile(&times, 0.9),
        p99: sorted_quantile(&times, 0.99),
        mean: mean(&times).unwrap_or(0.0),
        wall_median: sorted_quantile(&wall_times, 0.5),
        answered: searched.iter().filter(|one| one.is_in_time()).count() as f64 / searched.len() as f64,
        score: mean(&scores).unwrap_or(0.0),
    }
}

/// Compares a variant with runs with all mechanisms on. Intervals are bootstrapped over the holdouts that both share.
fn compare(all_on: &[&Vec<SearchSample>], searched: &[SearchSample]) -> Comparison {
    let count = searched.len();
    let of = |holdouts: &[usize]| {
        let all: Vec<SearchSample> = all_on
            .iter()
            .flat_map(|run| holdouts.iter().map(|&holdout| run[holdout]))
            .collect();
        let without: Vec<SearchSample> = holdouts.iter().map(|&holdout| searched[holdout]).collect();
        let (all, without) = (stats(&all), stats(&without));
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
    Comparison {
        median: figure(0),
        p99: figure(1),
        answered: figure(2),
        mean: figure(3),
        wall_median: figure(4),
        score: sum(|(_, without)| *without) / sum(|(all, _)| *all),
    }
}
