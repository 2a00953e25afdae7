//! Weights that half of the objects suggest, checked on the other half.

use std::fmt::Write as _;

use grasp_synthesis::model::score::{TERMS, Term};
use grasp_tests::pairs::{
    pairing::Pair,
    reasons::Reason,
    regression::{Regression, share_right},
};
use serde::Serialize;

use crate::pairs::table::{empty, percent};

/// What a weight's squared distance from the shipped one costs: small changes are cheap, doublings of the largest are not.
const RIDGE: f64 = 2e-3;

/// Which weights a fit may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Free {
    /// Those of terms about what the reasons are about. No reason judges how firm or natural a grip is.
    Judged,
    /// All.
    All,
}

/// Which objects a fit sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Half {
    /// Those of even numbers.
    Even,
    /// Those of odd numbers.
    Odd,
}

/// Weights that pairs suggest.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Suggestion {
    terms: [&'static str; TERMS],
    shipped: [f64; TERMS],
    fits: Vec<Fit>,
}

/// Weights fitted to the pairs of one half of the objects.
#[derive(Clone, Debug, Serialize)]
struct Fit {
    free: Free,
    half: Half,
    weights: [f64; TERMS],
    /// Of the pairs of this half, and of those of the other, which the fit has not seen.
    seen: Accuracy,
    unseen: Accuracy,
}

/// Shares of pairs ranked right.
#[derive(Clone, Copy, Debug, Serialize)]
struct Accuracy {
    pairs: usize,
    shipped: f64,
    fitted: f64,
}

impl Free {
    /// Whether a fit may change the weight of a term.
    fn includes(self, term: Term) -> bool {
        self == Self::All
            || matches!(
                term,
                Term::EnoughDigits
                    | Term::AwayFromGiver
                    | Term::Stance
                    | Term::FromSideOrAbove
                    | Term::WristLoad
                    | Term::AcrossLongAxis
                    | Term::NearCentre
                    | Term::OnHandle
                    | Term::OffSharp
            )
    }
}

impl Half {
    fn of(pair: &Pair<'_>) -> Self {
        if pair.gathered.object.is_multiple_of(2) {
            Self::Even
        } else {
            Self::Odd
        }
    }
}

/// What each half of the objects suggests, if some or all weights may change.
pub(crate) fn suggest(pairs: &[Pair<'_>]) -> Suggestion {
    let shipped = Term::ALL.map(|term| f64::from(term.weight()));
    let fits = [Free::Judged, Free::All]
        .into_iter()
        .flat_map(|free| [Half::Even, Half::Odd].map(|half| fit(pairs, shipped, free, half)));
    Suggestion {
        terms: Term::ALL.map(Term::name),
        shipped,
        fits: fits.collect(),
    }
}

fn fit(pairs: &[Pair<'_>], shipped: [f64; TERMS], free: Free, half: Half) -> Fit {
    let (seen, unseen): (Vec<&Pair<'_>>, Vec<&Pair<'_>>) =
        pairs.iter().partition(|pair| Half::of(pair) == half);
    let importances = importances(&seen);
    let [seen, unseen] = [seen, unseen].map(|half| {
        let differences = half.iter().map(|pair| pair.differences());
        differences.collect::<Vec<_>>()
    });
    let regression = Regression {
        differences: &seen,
        importances: &importances,
        near: shipped,
        is_free: Term::ALL.map(|term| free.includes(term)),
        ridge: RIDGE,
    };
    let weights = regression.weights();
    let accuracy = |differences: &[[f64; TERMS]]| Accuracy {
        pairs: differences.len(),
        shipped: share_right(&shipped, differences),
        fitted: share_right(&weights, differences),
    };
    Fit {
        free,
        half,
        seen: accuracy(&seen),
        unseen: accuracy(&unseen),
        weights,
    }
}

/// Every reason counts the same, however many pairs it has.
fn importances(pairs: &[&Pair<'_>]) -> Vec<f64> {
    let count = |reason: Reason| pairs.iter().filter(|pair| pair.reason == reason).count();
    let counts = Reason::ALL.map(count);
    pairs
        .iter()
        .map(|pair| 1.0 / counts[pair.reason as usize] as f64)
        .collect()
}

/// The weights as a table, and how well they rank.
pub(crate) fn render(suggestion: &Suggestion) -> String {
    let name = |fit: &Fit| {
        let free = match fit.free {
            Free::Judged => "judged",
            Free::All => "all",
        };
        let half = match fit.half {
            Half::Even => "even",
            Half::Odd => "odd",
        };
        format!("{free}, {half}")
    };
    let header = ["term", "shipped"].map(str::to_owned).into_iter();
    let mut table = empty(header.chain(suggestion.fits.iter().map(name)));
    for (k, term) in suggestion.terms.into_iter().enumerate() {
        let weights = suggestion.fits.iter().map(|fit| fit.weights[k]);
        let weights = [suggestion.shipped[k]].into_iter().chain(weights);
        table.add_row(
            [term.to_owned()]
                .into_iter()
                .chain(weights.map(|weight| format!("{weight:.2}"))),
        );
    }
    let mut text = format!("{table}\n");
    for fit in &suggestion.fits {
        let Fit { seen, unseen, .. } = fit;
        let _ = write!(
            text,
            "\n{}: {} of {} pairs ranked right instead of {}; held out, {} of {} instead of {}",
            name(fit),
            percent(seen.fitted),
            seen.pairs,
            percent(seen.shipped),
            percent(unseen.fitted),
            unseen.pairs,
            percent(unseen.shipped),
        );
    }
    text
}
