//! Weights that half of the objects suggest, checked on the other half.

use std::fmt::Write as _;

use grasp_synthesis::model::score::{TERMS, Term};
use grasp_tests::pairs::{
    pairing::Pair,
    reasons::Reason,
    regression::{Regression, share_right},
};
use serde::Serialize;

use crate::table::empty;

/// What a weight's squared distance from the shipped one costs: small changes are cheap, doublings of the largest are not.
const RIDGE: f64 = 2e-3;

/// Weights that the pairs of some objects suggest.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Suggestion {
    terms: Vec<Suggested>,
    /// Of pairs of the objects that the fit has seen, and of those it has not.
    fits: [Accuracy; 2],
}

/// The weights of a term.
#[derive(Clone, Debug, Serialize)]
struct Suggested {
    term: &'static str,
    shipped: f64,
    /// By objects of even and of odd number.
    fitted: [f64; 2],
}

/// Shares of pairs ranked right: by the shipped weights and by those fitted to objects of one half.
#[derive(Clone, Copy, Debug, Serialize)]
struct Accuracy {
    fitted_to: &'static str,
    pairs: usize,
    pairs_held_out: usize,
    shipped: f64,
    fitted: f64,
    shipped_held_out: f64,
    fitted_held_out: f64,
}

/// The weights that the objects of even numbers suggest, and those that the odd ones do, with the same sum as the shipped.
pub(crate) fn suggest(pairs: &[Pair<'_>]) -> Suggestion {
    let shipped: [f64; TERMS] = Term::ALL.map(|term| f64::from(term.weight()));
    let halves = [0, 1].map(|half| {
        let own: Vec<&Pair<'_>> = pairs
            .iter()
            .filter(|pair| pair.gathered.object % 2 == half)
            .collect();
        own
    });
    let differences = halves
        .each_ref()
        .map(|half| half.iter().map(|pair| pair.differences()).collect::<Vec<_>>());
    let fitted = [0, 1].map(|half| {
        let fit = Regression {
            differences: &differences[half],
            importances: &importances(&halves[half]),
            near: shipped,
            ridge: RIDGE,
        };
        let weights = fit.weights();
        let scale = shipped.iter().sum::<f64>() / weights.iter().sum::<f64>();
        weights.map(|weight| weight * scale)
    });
    let terms = Term::ALL.into_iter().map(|term| Suggested {
        term: term.name(),
        shipped: shipped[term as usize],
        fitted: fitted.map(|weights| weights[term as usize]),
    });
    Suggestion {
        terms: terms.collect(),
        fits: [0, 1].map(|half| {
            let [seen, unseen] = [&differences[half], &differences[1 - half]];
            Accuracy {
                fitted_to: ["even", "odd"][half],
                pairs: seen.len(),
                pairs_held_out: unseen.len(),
                shipped: share_right(&shipped, seen),
                fitted: share_right(&fitted[half], seen),
                shipped_held_out: share_right(&shipped, unseen),
                fitted_held_out: share_right(&fitted[half], unseen),
            }
        }),
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
    let mut table = empty(&["term", "shipped", "fitted to even", "fitted to odd"]);
    for Suggested {
        term,
        shipped,
        fitted: [even, odd],
    } in &suggestion.terms
    {
        table.add_row([
            (*term).to_owned(),
            format!("{shipped:.2}"),
            format!("{even:.2}"),
            format!("{odd:.2}"),
        ]);
    }
    let mut text = format!("{table}\n");
    for fit in suggestion.fits {
        let _ = write!(
            text,
            "\nfitted to {} objects, {} pairs: {:.1} % right instead of {:.1} %; of {} pairs of the others: {:.1} % instead of {:.1} %",
            fit.fitted_to,
            fit.pairs,
            100.0 * fit.fitted,
            100.0 * fit.shipped,
            fit.pairs_held_out,
            100.0 * fit.fitted_held_out,
            100.0 * fit.shipped_held_out,
        );
    }
    text
}
