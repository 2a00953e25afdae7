//! Open questions of the thesis (6.1), with first figures.

use super::{Claim, Verdict};
use crate::{
    data::{Data, milliseconds},
    plan::Set,
    stats::rank_correlation,
    tables::{comfort_share_by_draw, mean_of_means, touching_digits, valid_with_figures},
    types::SetTypes,
};

pub(super) fn claims(data: &Data<'_>, types: &[SetTypes]) -> Vec<Claim> {
    let Some(strategy) = data.ladder().last() else {
        return Vec::new();
    };
    let set = Set::ladder(strategy);
    [threads(data, set), comfort(data, set), unclassifiable(types)]
        .into_iter()
        .flatten()
        .collect()
}

/// "We would have liked to know our algorithm's execution time on a computer that can run VR applications."
fn threads(data: &Data<'_>, set: Set) -> Option<Claim> {
    let threads = data.more_threads()?;
    let of = |threads| {
        let searches = data.searches_by_holdout(set, threads);
        mean_of_means(&searches.iter().map(|own| milliseconds(own)).collect::<Vec<_>>())
    };
    let (one, more) = (of(1)?, of(threads)?);
    Some(Claim {
        source: "6.1, open question",
        thesis: "how fast is it on a better computer? (not measured)",
        run: format!(
            "set {}: {one:.1} ms on one thread, {more:.1} ms ({:.2} times as fast) on {threads}",
            set.name(),
            one / more
        ),
        verdict: Verdict::Answered,
        why: "",
    })
}

/// "We are interested in seeing whether this evaluation measure would rank a false valid grasp after a true valid
/// grasp."
fn comfort(data: &Data<'_>, set: Set) -> Option<Claim> {
    let by_draw = comfort_share_by_draw(data, set)?;
    let pairs: Vec<_> = valid_with_figures(data, set)
        .map(|(_, details, grasp)| (f64::from(grasp.comfort), touching_digits(details)))
        .collect();
    Some(Claim {
        source: "6.1, open question",
        thesis: "does comfort E rank false valid grasps after true ones? (not measured)",
        run: format!(
            "it can hardly: {:.0} % of the variance of E in set {} is the draw of the force distribution and not the \
             grasp; rank correlation with the number of touching digits {:.2}",
            100.0 * by_draw,
            set.name(),
            rank_correlation(&pairs)?
        ),
        verdict: Verdict::Answered,
        why: "",
    })
}

/// "... we want to know whether the improvements to our algorithm changed the percentage of false valid grasps."
fn unclassifiable(types: &[SetTypes]) -> Option<Claim> {
    let mut ladder = types.iter().filter(|types| types.set.is_ladder());
    let first = ladder.next()?;
    let last = ladder.next_back()?;
    let (before, after) = (first.share(None)?, last.share(None)?);
    // The interval of a difference of two means.
    let margin = first.margin()?.hypot(last.margin()?);
    let shares = format!(
        "{:.1} % in set {}, {:.1} % in set {}",
        100.0 * before,
        first.set.name(),
        100.0 * after,
        last.set.name()
    );
    let change = 100.0 * (after - before);
    let verdict = if change.abs() <= 100.0 * margin {
        "no more than chance would"
    } else if change > 0.0 {
        "yes, there are more"
    } else {
        "yes, there are fewer"
    };
    Some(Claim {
        source: "6.1, open question",
        thesis: "did the improvements change the share of false valid grasps? (not measured)",
        run: format!(
            "{verdict}: of no type of the taxonomy are {shares}, a change by {change:+.1} ± {:.1} points",
            100.0 * margin
        ),
        verdict: Verdict::Answered,
        why: "",
    })
}
